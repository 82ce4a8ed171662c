"""Source of an estimator's step: an FMU or a map, opened and closed again."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.estimators.fmu_step import SENSORS, TEMPERATURE, FmuStep
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE, OTHER_LOAD_OUTPUTS, PARAMETERS, Step, StepResult
from strainfmu.cosim.estimators.zeros_file import load_zeros
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import ALTITUDE, MACH_NUMBER
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros, zeros_of_map
from strainfmu.estimator.map.inverse_map import InverseMap, groups_of_outputs, load_inverse_map
from strainfmu.estimator.other_loads import SIGMA, output_units
from strainfmu.estimator.settings import default_settings
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.interface.input_names import OTHER_AIR_DATA, given_flow, given_thrust, other_air_data
from strainfmu.interface.other_load_variables import other_load_values
from strainfmu.interface.parameter_variables import (
    OUTSIDE_PREFIX,
    STD_PREFIX,
    parameter_names,
    parameter_std_names,
)
from strainfmu.interface.parameter_variables import PREFIX as PARAMETER_PREFIX
from strainfmu.interface.sensor_variables import THRUST, reading_units, sensor_names, temperature_names

LOAD_OUTPUTS = (*LOADS, *(f"{SIGMA}{name}" for name in LOADS))
"""Outputs of the five loads and of their standard deviations."""

NAVIGATION = (MACH_NUMBER, ALTITUDE)
"""Navigation that the bus has in addition to q_inf: for health alone, or for the nonlinear estimator."""


@dataclass(frozen=True)
class ReadyStep:
    """A step, and the names of its gauges in the order of its strains."""

    step: Step
    gauge_names: tuple[str, ...]


def is_fmu(source: Path) -> bool:
    """Return whether the file of an estimator is an FMU; else it is an inverse map.

    Raises
    ------
    InputError
        It is neither, by its name.
    """
    ending = source.suffix.lower()
    if ending not in (".fmu", ".h5", ".hdf5"):
        raise InputError(f"{source}: expected an estimator FMU (X.fmu) or an inverse map (map.h5)")
    return ending == ".fmu"


@contextmanager
def open_step(source: Path, zeros: Path | None = None, *, with_loads: bool = False) -> Iterator[ReadyStep]:
    """Load an estimator FMU or an inverse map, with the ``zeros`` of its gauges (zeros.toml); free it at the end.

    ``with_loads`` asks for :data:`LOAD_OUTPUTS` among the other outputs.

    Raises
    ------
    InputError
        The file is missing, damaged, or neither.
    StrainfmuError
        The FMU cannot be loaded on this machine.
    """
    if is_fmu(source):
        inputs = (*NAVIGATION, *OTHER_AIR_DATA, TEMPERATURE, SENSORS, PARAMETERS)
        loads = LOAD_OUTPUTS if with_loads else ()
        with FmuStep(source, inputs, (ENVELOPE_SCORE, OTHER_LOAD_OUTPUTS, *loads)) as fmu:
            if zeros is not None:
                fmu.set_zeros(load_zeros(zeros, fmu.gauge_names))
            yield ReadyStep(fmu, fmu.gauge_names)
        return
    inverse_map = load_inverse_map(source)
    names = tuple(inverse_map.gauge_names[: inverse_map.n_strain_gauges])
    known = None if zeros is None else load_zeros(zeros, names)
    yield ReadyStep(MapStep(inverse_map, known, with_loads=with_loads), names)


class MapStep:
    """An estimator or a map as the step of a bridge; a nonlinear one starts from the state before."""

    def __init__(
        self, source: InverseMap | Estimator, zeros: GaugeZeros | None = None, *, with_loads: bool = False
    ) -> None:
        self._with_loads = with_loads
        self._estimator = source if isinstance(source, Estimator) else Estimator(source, zeros=zeros)
        self._map = inverse_map = self._estimator.inverse_map
        self.needs_pressure = inverse_map.manifold is None
        self.sensor_names = inverse_map.thermal.sensor_names
        self._temperatures = temperature_names(inverse_map.thermal)
        self.reading_units = reading_units(inverse_map)
        self._sensors = sensor_names(inverse_map)
        self._parameters = parameter_names(inverse_map)
        self._stds = parameter_std_names(inverse_map)
        self._flow = other_air_data(is_nonlinear=not self.needs_pressure, has_masses=inverse_map.has_masses)
        of_flow = (*NAVIGATION, *self._flow, *self._temperatures)
        self.other_inputs = (*of_flow, *self._parameters, *self._stds, *self.reading_units)
        self.noise_std = inverse_map.noise_std[: inverse_map.n_strain_gauges]
        self.sensor_range = default_settings(inverse_map).sensor_range
        self.load_groups = groups_of_outputs(inverse_map)
        self._others = tuple(output_units(self.load_groups))

    def set_zeros(self, zeros: GaugeZeros | None) -> None:
        """Take ``zeros`` off the strains from the next step on, which goes on from the state of the last."""
        known = zeros_of_map(self._map) if zeros is None else zeros
        self._estimator = self._estimator.with_zeros(known)

    def __call__(
        self,
        strain: FloatArray,
        dynamic_pressure: float,
        step_size: float,
        *,
        mach_number: float = nan,
        altitude: float = nan,
        **inputs: float,
    ) -> StepResult:
        """Do one step; its result does not depend on ``step_size``.

        ``inputs`` are temperatures [K], p_inf and standard deviations of navigation, flow parameters and their
        standard deviations, readings of auxiliary sensors and thrust [N] by name of the FMU's input; one that is
        not given is not known, but thrust, which is 0 then.
        """
        warm = None
        if self._temperatures and inputs:
            warm = np.array([inputs.get(name, nan) for name in self._temperatures])
        of_flow: dict[str, Any] = {MACH_NUMBER: mach_number, ALTITUDE: altitude, TEMPERATURE: warm}
        of_flow |= given_flow({name: inputs[name] for name in self._flow if name in inputs})
        names = [name.removeprefix(PARAMETER_PREFIX) for name in self._parameters]
        if names:
            of_flow["parameters"] = {name: inputs.get(PARAMETER_PREFIX + name, nan) for name in names}
        if self._stds:
            of_flow["parameters_std"] = given_flow({name: inputs.get(STD_PREFIX + name, nan) for name in names})
        if self._sensors:
            strain = np.append(strain, [inputs.get(name, nan) for name in self._sensors])
        if THRUST in self.reading_units:
            of_flow |= given_thrust(inputs)
        estimate = self._estimator.track(strain, dynamic_pressure, **of_flow)
        outputs = {ENVELOPE_SCORE: estimate.envelope_score}
        outputs |= {
            OUTSIDE_PREFIX + n: score for n, score in zip(names, estimate.parameter_score.tolist(), strict=False)
        }
        if self._with_loads:
            outputs |= zip(LOAD_OUTPUTS, [*estimate.loads.tolist(), *estimate.loads_std.tolist()], strict=True)
        if self._others:
            outputs |= zip(self._others, other_load_values(estimate), strict=True)
        return StepResult(
            coefficients=estimate.coefficients,
            coefficients_std=estimate.coefficients_std,
            health=int(estimate.health),
            chi_square=estimate.chi_square,
            other_outputs=outputs,
        )
