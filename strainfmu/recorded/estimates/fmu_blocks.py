"""Estimates of blocks of recorded samples by an estimator FMU."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from strainfmu.cosim.estimators.description import outputs_of
from strainfmu.cosim.estimators.fmu_step import SENSORS, TEMPERATURE, FmuStep
from strainfmu.cosim.estimators.step import StepRefused
from strainfmu.cosim.estimators.zeros_file import load_zeros
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX, PREFIX, STD_PREFIX
from strainfmu.interface.sensor_variables import THRUST
from strainfmu.recorded.columns.column_names import FLOW_NAMES, INERTIAL_NAMES, NAVIGATION_NAMES
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.columns.sensor_readings import all_readings, recorded_readings
from strainfmu.recorded.columns.strain_level import LevelReference
from strainfmu.recorded.estimates.block_estimates import BlockEstimates, outside_ranges
from strainfmu.recorded.estimates.fmu_columns import OtherOutput, other_outputs_of

_HEALTH = ("chi_square_limit", "valid_gauges", "suspect_gauge", "suspects", "envelope_score")


@contextmanager
def opened_fmu(source: Path, zeros: Path | None = None) -> Iterator[FmuBlocks]:
    """Load an estimator FMU with the ``zeros`` of its gauges (zeros.toml); free it at the end.

    Raises
    ------
    InputError
        The file is missing or damaged, or no estimator.
    StrainfmuError
        The FMU cannot be loaded on this machine.
    """
    others = other_outputs_of(outputs_of(source))
    asked = (*(f"health.{name}" for name in _HEALTH), *(one.output for one in others))
    scores = [one.output for one in others if one.output.startswith(OUTSIDE_PREFIX)]
    parameters = (one.replace(OUTSIDE_PREFIX, kind, 1) for one in scores for kind in (PREFIX, STD_PREFIX))
    inputs = (*FLOW_NAMES[1:], *NAVIGATION_NAMES, *INERTIAL_NAMES, TEMPERATURE, SENSORS, *parameters)
    with FmuStep(source, inputs, asked) as step:
        if zeros is not None:
            step.set_zeros(load_zeros(zeros, step.gauge_names))
        yield FmuBlocks(step, others)


class FmuBlocks:
    """An estimator FMU, step by step."""

    has_residuals = False
    envelope_score_limit = float("nan")
    inverse_map: InverseMap | None = None

    def __init__(self, step: FmuStep, others: Sequence[OtherOutput]) -> None:
        self._step = step
        self._others = [one.output for one in others]
        self.other_columns = tuple((one.column, one.unit) for one in others)
        self.gauge_names, self.sensor_names = step.gauge_names, step.sensor_names
        self.readings: Mapping[str, str] = recorded_readings(step.reading_units)
        self._readings = dict(zip(self.readings, step.reading_units, strict=True))
        self.row_names = (*step.gauge_names, *(name for name in self.readings if name != THRUST))
        self.inputs = step.other_inputs
        given = (name for name in step.other_inputs if name.startswith(PREFIX))
        self.parameter_names = tuple(name.removeprefix(PREFIX) for name in given)
        self.sharpening = tuple(name for name in self.parameter_names if f"{STD_PREFIX}{name}" in self.inputs)
        self._scores = [self._others.index(f"{OUTSIDE_PREFIX}{name}") for name in self.parameter_names]
        self.reference = LevelReference(
            strain_range=step.strain_nominal,
            noise_std=np.zeros(step.n_gauges) if step.noise_std is None else step.noise_std,
            dynamic_pressure=step.pressure_nominal,
            sensor_range=step.sensor_range,
        )
        self.zero = step.zero_offset

    def estimate(self, block: StrainBlock, last: float) -> BlockEstimates:
        n = len(block.time)
        numbers = np.full((n, 12), np.nan)
        health = np.full((n, len(_HEALTH)), np.nan)
        others = np.full((n, len(self._others)), np.nan)
        flow = {name: values.tolist() for name, values in block.flow.items() if name in self.inputs}
        flow |= {f"{PREFIX}{name}": values.tolist() for name, values in block.parameters.items()}
        flow |= {f"{STD_PREFIX}{name}": values.tolist() for name, values in block.parameters_std.items()}
        flow |= {self._readings[name]: values.tolist() for name, values in block.readings.items()}
        if block.temperature is not None:
            flow |= {f"{TEMPERATURE}[{i}]": one.tolist() for i, one in enumerate(block.temperature.T, start=1)}
        before = np.append(last if np.isfinite(last) else block.time[0] - _first_step(block), block.time[:-1])
        for i in range(n):
            given = {name: values[i] for name, values in flow.items()}
            step_size = float(block.time[i] - before[i])
            try:
                found = self._step(block.strain[i], float(block.dynamic_pressure[i]), step_size, **given)
            except StepRefused:
                continue
            numbers[i] = *found.coefficients, *found.coefficients_std, found.chi_square, found.health
            health[i] = [found.other_outputs.get(f"health.{name}", np.nan) for name in _HEALTH]
            others[i] = [found.other_outputs[name] for name in self._others]
        has_reading = np.isfinite(all_readings(block, self.readings))
        valid = np.hstack([np.abs(block.strain) <= self.reference.sensor_range, has_reading])
        limit, used, suspect, count, score = health.T
        return BlockEstimates(
            coefficients=numbers[:, :5],
            coefficients_std=numbers[:, 5:10],
            chi_square=numbers[:, 10],
            chi_square_limit=limit,
            degrees_of_freedom=np.full(n, np.nan),
            health=numbers[:, 11],
            gauges_used=np.where(np.isfinite(used), used, valid.sum(axis=1)),
            valid=valid,
            suspects=[(int(one) - 1,) if one >= 1 else () for one in suspect],
            suspect_count=count,
            envelope_score=score,
            worst=np.full(n, -1),
            outside=outside_ranges(self.parameter_names, others[:, self._scores]),
            other_values=others,
        )


def _first_step(block: StrainBlock) -> float:
    """Return a step size for the first sample [s], which has no predecessor."""
    return float(block.time[1] - block.time[0]) if len(block.time) > 1 else 1e-3
