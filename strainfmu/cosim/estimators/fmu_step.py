"""The FMU as the step of the bridge: strains and dynamic pressure in; coefficients and health out, by name."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.estimators.description import (
    FIRST_NUMBER,
    OUTPUTS,
    STRAIN,
    TEMPERATURES,
    VALID,
    estimator_inputs,
    estimator_outputs,
    load_groups,
    noise_std_of,
    numbered,
    reading_units,
    sensor_range_of,
    stated_names,
    zero_offset_of,
)
from strainfmu.cosim.estimators.exchange import FmuExchange
from strainfmu.cosim.estimators.step import OTHER_LOAD_OUTPUTS, PARAMETERS, StepRefused, StepResult
from strainfmu.cosim.systems.instance import Instance, read_description, safe_temporary_parent, unzip
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MEASURED_ANGLES, STATIC_PRESSURE, STD
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.other_loads import output_units
from strainfmu.estimator.signal_names import TEMPERATURE as TEMPERATURE
from strainfmu.interface.contents import stated_contents
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX, STD_PREFIX
from strainfmu.interface.parameter_variables import PREFIX as PARAMETER_PREFIX
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.zero_variables import zero_names

SENSORS = "sensor"
"""Name that stands for readings of auxiliary sensors, and for thrust, among the other inputs that are asked for;
:data:`TEMPERATURE` does for the temperatures of all sensors. Without it an FMU with such inputs is refused."""

_STOP_TIME = 1e9
"""End of the experiment [s]: the bridge runs until it is stopped, and FMI 2.0 has no word for that."""


class FmuStep:
    """A loaded estimator FMU; call it for a step, close it at the end (or use it as a context).

    A gauge that is not valid is given as NaN, and as ``valid[i]`` = 0 where the FMU has such inputs. After the
    first fmi2Error the FMU is instantiated once more; the second ends the run, as fmi2Fatal does.

    Attributes
    ----------
    other_inputs, other_outputs : names, of those that were asked for, that the FMU has.
    sensor_names : of the temperature sensors in order, if :data:`TEMPERATURE` was asked for; their inputs are
        ``temperature[k]`` [K].
    reading_units : unit of auxiliary sensors and thrust by name of the input.
    load_groups : groups of the loads behind the five among the outputs, if :data:`OTHER_LOAD_OUTPUTS` was asked
        for; none where it was not.
    takes_mask : it need not look for gauges that are not valid.
    needs_pressure : whether there are no coefficients where q_inf is not known: of a linear estimator.
    strain_nominal : (n_d,) nominal values of the strains [m/m], the largest that are expected; 1 without.
    pressure_nominal : nominal value of q_inf [Pa].
    sensor_range : largest |strain| of a working gauge [m/m], at the start.
    noise_std : (n_d,) standard deviations of the gauges' noise [m/m] in the FMU's map, None if it states none.
    zero_offset : (n_d,) zeros that are subtracted [m/m]: the map's, until others are given.
    exchange, inputs, outputs : the step of compiled code, and the numbers that it moves.
    places, first_mask : where an input lies among them, by name, and the mask, which may be none.

    Raises
    ------
    InputError
        The FMU is missing, damaged, or no estimator.
    StrainfmuError
        It cannot be loaded on this machine.
    """

    takes_mask = True

    def __init__(self, path: Path, other_inputs: Sequence[str] = (), other_outputs: Sequence[str] = ()) -> None:
        self.path = path
        self._description = read_description(path)
        inputs = estimator_inputs(path, self._description)
        strains = numbered(inputs, STRAIN)
        contents = stated_contents(path)
        self.gauge_names = stated_names(strains, contents.gauges)
        self.n_gauges = len(strains)
        self.reading_units = reading_units(inputs)
        if self.reading_units and SENSORS not in other_inputs:
            sensor = next(iter(self.reading_units))
            raise InputError(f"{path}: expected an FMU of strain gauges alone, got one with the input '{sensor}'")
        count = sum(name.startswith(SENSOR_PREFIX) for name in self.reading_units)
        valid = numbered(inputs, VALID)
        valid = valid[: len(valid) - count]  # those of sensors stay true: one of NaN, as at the start, is left out
        if valid and len(valid) != self.n_gauges:
            raise InputError(f"{path}: expected {self.n_gauges} inputs valid[i], got {len(valid)}")
        pressure = next(v for v in inputs if v.name == DYNAMIC_PRESSURE)
        by_name = {variable.name: variable for variable in inputs}
        self.needs_pressure = STATIC_PRESSURE not in by_name  # an input of nonlinear estimators
        sensors = numbered(inputs, TEMPERATURES) if TEMPERATURE in other_inputs else []
        self.sensor_names = stated_names(sensors, contents.temperature_sensors)
        of_parameters = [name for name in by_name if name.startswith(PARAMETER_PREFIX)]
        parameters = of_parameters if PARAMETERS in other_inputs else []
        stds = [name.replace(PARAMETER_PREFIX, STD_PREFIX, 1) for name in parameters]
        named = (*(variable.name for variable in sensors), *parameters, *stds)
        asked = (*other_inputs, *named, *self.reading_units)
        self.other_inputs = tuple(name for name in asked if name in by_name)
        # Reals side by side, so that they are exchanged as they lie.
        of_flow = sorted((by_name[name] for name in self.other_inputs), key=lambda v: v.type != "Real")
        self._set = (*strains, pressure, *of_flow, *valid)
        self.places = {v.name: self.n_gauges + index for index, v in enumerate((pressure, *of_flow))}
        # Of angles without one; an FMU leaves them out.
        self._angle_stds = [
            self.places[f"{name}{STD}"] for name in MEASURED_ANGLES if f"{name}{STD}" in self.places
        ]
        self.first_mask = self.n_gauges + 1 + len(of_flow)
        wanted = [name for name in other_outputs if name != OTHER_LOAD_OUTPUTS]
        wanted += [name.replace(PARAMETER_PREFIX, OUTSIDE_PREFIX, 1) for name in parameters]
        self.load_groups = load_groups(self._description, contents) if OTHER_LOAD_OUTPUTS in other_outputs else ()
        wanted += output_units(self.load_groups)
        self._get = estimator_outputs(path, self._description, dict.fromkeys(wanted))
        self.other_outputs = tuple(variable.name for variable in self._get[len(OUTPUTS) - 1 : -1])
        self.strain_nominal = np.array([float(variable.nominal or 1.0) for variable in strains])
        self.pressure_nominal = float(pressure.nominal or 1.0)
        self.sensor_range = sensor_range_of(self._description)
        self.noise_std = noise_std_of(contents, self.n_gauges)
        self.zero_offset = zero_offset_of(contents, self.n_gauges)
        self._retried = False
        self.inputs = np.zeros(len(self._set))
        self._strain_inputs = self.inputs[: self.n_gauges]
        # The same numbers, of which one is set in half the time.
        self._numbers: Any = self.inputs.data
        for variable in of_flow:
            start = np.nan if variable.name.startswith(SENSOR_PREFIX) else float(variable.start or 0.0)
            self.inputs[self.places[variable.name]] = start
        self._zeros: tuple[list[Any], FloatArray] = [], np.zeros(0)
        self.outputs = np.zeros(len(self._get))
        self._python_path = list(sys.path)
        self._stack = ExitStack()
        try:
            self._folder = self._unzipped()
            self._open()
        except BaseException:
            self._stack.close()
            raise

    def _unzipped(self) -> Path:
        """Return the folder of the FMU's files, which goes when the step is closed."""
        made = tempfile.TemporaryDirectory(
            prefix="strainfmu_", dir=safe_temporary_parent(), ignore_cleanup_errors=True
        )
        folder = Path(self._stack.enter_context(made))
        unzip(self.path, folder)
        return folder

    def __enter__(self) -> FmuStep:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __call__(
        self,
        strain: FloatArray,
        dynamic_pressure: float,
        step_size: float,
        mask: bytes | None = None,
        /,
        **inputs: float,
    ) -> StepResult:
        """Do one step.

        Parameters
        ----------
        strain : (n_d,) strains [m/m], NaN where not valid.
        dynamic_pressure : q_inf [Pa], NaN if not known.
        step_size : [s].
        mask : bytes of (n_d,) bool, the gauges whose strains are finite; None to look for them.
        inputs : values of ``other_inputs``, in SI units; one that is not given stays as it is.

        Raises
        ------
        StepRefused
            This step failed; the FMU can go on.
        StrainfmuError
            It cannot.
        """
        numbers, place = self._numbers, self.places
        self._strain_inputs[:] = strain
        numbers[self.n_gauges] = dynamic_pressure
        for name, value in inputs.items():
            numbers[place[name]] = value
        if self.first_mask < len(self.inputs):
            self.inputs[self.first_mask :] = np.isfinite(strain) if mask is None else np.frombuffer(mask, bool)
        try:
            self._step(step_size)
        except StrainfmuError as error:
            raise self._after(error) from error
        values = self.outputs.copy()
        chi_square, *more, health = values.tolist()[FIRST_NUMBER:]
        outputs = dict(zip(self.other_outputs, more, strict=True))
        return StepResult(values[:5], values[5:FIRST_NUMBER], int(health), chi_square, outputs)

    def set_zeros(self, zeros: GaugeZeros) -> None:
        """Let the FMU take ``zeros`` off its strains, from the next step on.

        Raises
        ------
        InputError
            The FMU has no inputs for zeros.
        StrainfmuError
            It refuses them.
        """
        self.require_zero_inputs()
        by_name = {variable.name: variable for variable in self._description.modelVariables}
        self.zero_offset = zeros.value
        names = zero_names(self.n_gauges)
        values = np.concatenate([zeros.value, zeros.std, [zeros.common_std]])
        self._zeros = [by_name[name] for name in names], values
        self._give_zeros()

    def require_zero_inputs(self) -> None:
        """Raise InputError where the FMU has no inputs for zeros."""
        listed = {variable.name for variable in self._description.modelVariables}
        if not listed.issuperset(zero_names(self.n_gauges)):
            raise InputError(f"{self.path}: FMU without zero inputs: export it with --zero-inputs")

    def _give_zeros(self) -> None:
        variables, values = self._zeros
        for block in self._instance.block("Set", variables, range(len(variables)), values):
            if block.buffer.base is not values:
                block.buffer[:] = values[block.columns]
            block.call()

    def close(self) -> None:
        """Free the instance and its files, and take back what PythonFMU did to Python's search path."""
        self._instance.close()
        self._stack.close()
        sys.path[:] = self._python_path

    def _open(self) -> None:
        """Instantiate and initialize."""
        self._instance = Instance("bridge", self.path, self._description, self._folder)
        try:
            self._instance.begin(_STOP_TIME)
            self._give_zeros()
            self._instance.end_initialization()
        except BaseException:
            self._instance.close()
            raise
        block = self._instance.block
        self.exchange = FmuExchange(
            self._instance,
            inputs=block("Set", self._set, range(len(self._set)), self.inputs),
            outputs=block("Get", self._get, range(len(self._get)), self.outputs),
            given=self.inputs,
            taken=self.outputs,
            angle_stds=self._angle_stds,
        )
        self._step = self.exchange.step

    def failed(self, number: int) -> None:
        """Go on after a step by compiled code that failed with ``number``; raise StrainfmuError if it cannot."""
        try:
            self.exchange.check(number)
        except StrainfmuError as error:
            if not isinstance(refused := self._after(error), StepRefused):
                raise refused from error

    def _after(self, error: StrainfmuError) -> StrainfmuError:
        """Return what an FMI status means: fmi2Discard a lost step, fmi2Error one more try, fmi2Fatal the end."""
        if "returned fmi2Discard" in str(error):
            return StepRefused(str(error))
        if "returned fmi2Fatal" in str(error) or self._retried:
            return error
        self._retried = True
        self._instance.close()
        self._open()
        return StepRefused(str(error))
