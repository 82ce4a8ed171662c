"""Estimates of a block of recorded samples, by a map or by an estimator FMU."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, TypedDict, cast

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.cosim.fmu_step import SENSORS, TEMPERATURE, FmuStep, outputs_of
from strainfmu.cosim.step import StepRefused
from strainfmu.cosim.zeros_file import load_zeros
from strainfmu.errors import InputError
from strainfmu.estimator.flow_parameters import PARAMETER_TOLERANCE, flow_parameters
from strainfmu.estimator.further_loads import further_names, is_moment
from strainfmu.estimator.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.load_estimate import LoadEstimate, LoadEstimates
from strainfmu.estimator.loading import estimator_of
from strainfmu.estimator.manifold.air_data import AIR_DATA_NAMES, AIR_DATA_UNITS
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.manifold.flight_health import OUTSIDE_SCORE, gauge_threshold
from strainfmu.estimator.manifold.navigation import NAVIGATION
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.settings import SENSOR_RANGE
from strainfmu.estimator.step import Estimator
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX, PREFIX
from strainfmu.interface.sensor_variables import THRUST, reading_units
from strainfmu.recorded.column_names import FLOW_NAMES
from strainfmu.recorded.columns import StrainBlock
from strainfmu.recorded.fmu_columns import FurtherOutput, further_outputs_of
from strainfmu.recorded.sensor_readings import all_readings, recorded_readings, rows_of_map
from strainfmu.recorded.strain_level import LevelReference

_HEALTH = ("chi_square_limit", "valid_gauges", "suspect_gauge", "suspects", "envelope_score")


@dataclass(frozen=True, eq=False, kw_only=True)
class BlockEstimates:
    """Estimates of n samples; NaN where there is none.

    Attributes
    ----------
    coefficients, coefficients_std : (n, 5) C_A, C_N, C_Y, M_P, M_Y and their standard deviations [1].
    chi_square, chi_square_limit, degrees_of_freedom : (n,) [1]; an FMU does not state the last.
    health : (n,) numbers of :class:`~strainfmu.estimator.health.HealthState`, NaN for a step that the FMU refused.
    gauges_used : (n,).
    valid : (n, n_d) gauges that gave a usable strain.
    suspects : n tuples of gauges, by index; of an ambiguous group an FMU names the first alone.
    suspect_count : (n,) number of gauges under suspicion.
    envelope_score : (n,) standard deviations by which the coefficients leave the envelope of the map, 0 inside.
    residual : (n, n_d) z of each gauge [1], None of an FMU.
    residual_limit : (n,) alarm level of the largest |z|, NaN of an FMU.
    estimates : n estimates by a map, for their pressure; None of an FMU.
    outside : (n,) whether a further parameter of the flow leaves its range, by its name.
    further : (n, n_f) columns that this kind of estimator has beside, see ``BlockEstimator.further_columns``.
    """

    coefficients: FloatArray
    coefficients_std: FloatArray
    chi_square: FloatArray
    chi_square_limit: FloatArray
    degrees_of_freedom: FloatArray
    health: FloatArray
    gauges_used: FloatArray
    valid: BoolArray
    suspects: Sequence[tuple[int, ...]]
    suspect_count: FloatArray
    envelope_score: FloatArray
    residual: FloatArray | None
    residual_limit: FloatArray
    outside: Mapping[str, BoolArray] = field(default_factory=dict)
    further: FloatArray | None = None
    estimates: Sequence[LoadEstimate] | LoadEstimates | None = None


class BlockEstimator(Protocol):
    """An estimator of blocks.

    Attributes
    ----------
    inputs : quantities beside strain and q_inf that it takes, of ``FLOW_NAMES``.
    reference : the level of strains that it expects.
    has_residuals : whether it gives the z of each gauge.
    envelope_score_limit : score above which the coefficients are outside, NaN where it is not known.
    further_columns : names and units of further columns of the output.
    inverse_map : the map, None of an FMU.
    gauge_names, row_names : strain gauges; the same, then further sensors.
    readings : unit of each further sensor, and of thrust, by its name.
    sensor_names : temperature sensors that it takes.
    parameter_names : further parameters of the flow that it takes.
    """

    gauge_names: tuple[str, ...]
    row_names: tuple[str, ...]
    readings: Mapping[str, str]
    sensor_names: tuple[str, ...]
    parameter_names: tuple[str, ...]
    further_columns: tuple[tuple[str, str], ...]
    inputs: tuple[str, ...]
    reference: LevelReference
    has_residuals: bool
    envelope_score_limit: float
    inverse_map: InverseMap | None

    def estimate(self, block: StrainBlock, last: float) -> BlockEstimates:
        """Return the estimates of a block; ``last`` is the time before its first sample [s], NaN at the start."""


@contextmanager
def open_block_estimator(source: Path, zeros: Path | None = None) -> Iterator[BlockEstimator]:
    """Load an estimator FMU or an inverse map, with the ``zeros`` of its gauges (zeros.toml); free it at the end.

    Raises
    ------
    InputError
        The file is missing, damaged, or neither.
    StrainfmuError
        The FMU cannot be loaded on this machine.
    """
    if source.suffix.lower() == ".fmu":
        further = further_outputs_of(outputs_of(source))
        asked = (*(f"health.{name}" for name in _HEALTH), *(one.output for one in further))
        parameters = tuple(
            f"{PREFIX}{one.output.removeprefix(OUTSIDE_PREFIX)}"
            for one in further
            if one.output.startswith(OUTSIDE_PREFIX)
        )
        with FmuStep(source, (*FLOW_NAMES[1:], TEMPERATURE, SENSORS, *parameters), asked) as step:
            if zeros is not None:
                step.set_zeros(load_zeros(zeros, step.gauge_names))
            yield _FmuBlocks(step, further)
        return
    if source.suffix.lower() not in (".h5", ".hdf5"):
        raise InputError(f"{source}: expected an estimator FMU (X.fmu) or an inverse map (map.h5)")
    inverse_map = load_inverse_map(source)
    known = None if zeros is None else load_zeros(zeros, inverse_map.gauge_names[: inverse_map.n_strain_gauges])
    estimator = estimator_of(inverse_map, zeros=known)
    yield FlightBlocks(estimator) if isinstance(estimator, ManifoldEstimator) else MapBlocks(estimator)


class MapBlocks:
    """An inverse map."""

    inputs: tuple[str, ...] = FLOW_NAMES[1:]
    has_residuals = True

    def __init__(self, estimator: Estimator) -> None:
        inverse_map = estimator.inverse_map
        self._has_loads = inverse_map.further is not None
        self.further_columns = _further_columns(inverse_map, self._has_loads)
        self.estimator = estimator
        self.inverse_map: InverseMap | None = inverse_map
        self.row_names = inverse_map.gauge_names
        self.gauge_names = self.row_names[: inverse_map.n_strain_gauges]
        self.readings: Mapping[str, str] = recorded_readings(reading_units(inverse_map))
        self.sensor_names = _sensor_names(inverse_map)
        self.parameter_names = estimator.parameters.names
        self.envelope_score_limit = inverse_map.envelope_score_limit
        self.reference = _level_reference(inverse_map)

    def estimate(self, block: StrainBlock, last: float) -> BlockEstimates:
        found = self.estimator.estimate(
            rows_of_map(block, self.estimator.inverse_map.sensors, self.readings),
            block.dynamic_pressure,
            temperature=block.temperature,
            parameters=dict(block.parameters),
            **flow_of(block),
        )
        if not isinstance(found, LoadEstimates):
            raise TypeError("strain: expected (n, n_d) values")
        return self.of_series(found)

    def of_series(self, found: LoadEstimates) -> BlockEstimates:
        """Return the estimates ``found`` as a block."""
        return BlockEstimates(
            coefficients=found.coefficients,
            coefficients_std=found.coefficients_std,
            chi_square=np.asarray(found.chi_square),
            chi_square_limit=np.asarray(found.chi_square_limit),
            degrees_of_freedom=np.asarray(found.degrees_of_freedom, dtype=float),
            health=np.asarray(found.health, dtype=float),
            gauges_used=found.valid.sum(axis=1).astype(float),
            valid=found.valid,
            suspects=list(found.suspects),
            suspect_count=np.array([float(len(one)) for one in found.suspects]),
            envelope_score=found.envelope_score,
            residual=found.standardised_residual,
            residual_limit=self._residual_limit(found),
            outside=_outside(self.parameter_names, found.parameter_score),
            further=_further_values(found, self._has_loads) if self.further_columns else None,
            estimates=found,
        )

    def _residual_limit(self, found: LoadEstimates) -> FloatArray:
        """Return (n,) the alarm level of the largest |z|, which moves with that of chi-square from its nominal."""
        held = self.estimator.inverse_map
        masks, which = np.unique(found.valid, axis=0, return_inverse=True)
        maps = [self.estimator.masked_map(mask) for mask in masks]
        threshold = np.array([np.nan if one is None else one.outlier_threshold for one in maps])
        nominal = np.array([np.nan if one is None else one.chi_square_limit for one in maps])
        of_sample = np.ravel(which)
        moved = found.chi_square_limit / (held.chi_square_scale * nominal[of_sample])
        return np.asarray(threshold[of_sample] * np.sqrt(held.outlier_scale * moved))


class FlightBlocks:
    """An inverse map with tables over the flight state, sample by sample."""

    inputs: tuple[str, ...] = FLOW_NAMES[1:]
    has_residuals = True
    envelope_score_limit = OUTSIDE_SCORE
    _columns = (
        *((f"air_data.{name}", unit) for name, unit in zip(AIR_DATA_NAMES, AIR_DATA_UNITS, strict=True)),
        *((f"sigma.air_data.{name}", unit) for name, unit in zip(AIR_DATA_NAMES, AIR_DATA_UNITS, strict=True)),
        *((f"identified.air_data.{name}", "1") for name in AIR_DATA_NAMES),
        *((f"navigation_used.{name}", "1") for name in NAVIGATION),
        ("linear_loads", "1"),
    )

    def __init__(self, estimator: ManifoldEstimator) -> None:
        self.estimator, self._tracker = estimator, FlightTracker(estimator)
        self.inverse_map: InverseMap | None = estimator.inverse_map
        self._threshold = gauge_threshold(estimator.manifold, estimator.settings.alarm_scale)
        self.parameter_names = estimator.parameters.names
        self._has_loads = estimator.manifold.further is not None
        self.further_columns = (*self._columns, *_further_columns(estimator.inverse_map, self._has_loads))
        self.row_names = estimator.inverse_map.gauge_names
        self.gauge_names = self.row_names[: estimator.inverse_map.n_strain_gauges]
        self.readings: Mapping[str, str] = recorded_readings(reading_units(estimator.inverse_map))
        self.sensor_names = _sensor_names(estimator.inverse_map)
        self.reference = _level_reference(estimator.inverse_map)

    def estimate(self, block: StrainBlock, last: float) -> BlockEstimates:
        return self.of_steps([self._step(block, row, one) for row, one in enumerate(self.rows_of(block))])

    def rows_of(self, block: StrainBlock) -> FloatArray:
        """Return (n, n_d) readings of the map's rows."""
        return rows_of_map(block, self.estimator.inverse_map.sensors, self.readings)

    def of_steps(self, found: Sequence[FlightEstimate]) -> BlockEstimates:
        """Return the estimates ``found`` as a block."""
        k = len(found)
        return BlockEstimates(
            coefficients=np.array([one.coefficients for one in found]),
            coefficients_std=np.array([one.coefficients_std for one in found]),
            chi_square=np.array([one.chi_square for one in found]),
            chi_square_limit=np.array([one.chi_square_limit for one in found]),
            degrees_of_freedom=np.array([float(one.degrees_of_freedom) for one in found]),
            health=np.array([float(one.health) for one in found]),
            gauges_used=np.array([float(one.valid.sum()) for one in found]),
            valid=np.array([one.valid for one in found]),
            suspects=[one.suspects for one in found],
            suspect_count=np.array([float(len(one.suspects)) for one in found]),
            envelope_score=np.array([one.envelope_score for one in found]),
            residual=np.array([one.standardised_residual for one in found]),
            residual_limit=np.full(k, self._threshold),
            further=np.array([self._further(one) for one in found]),
            outside=_outside(self.parameter_names, np.array([one.parameter_score for one in found])),
            estimates=found,
        )

    def _further(self, one: FlightEstimate) -> FloatArray:
        """Return the values of ``further_columns``."""
        air, of_map = one.air_data, _further_values(one, self._has_loads)
        flags = [*one.navigation_used, one.is_linear]
        return np.concatenate([air.value, air.std, air.is_identified, flags, of_map]).astype(float)

    def _step(self, block: StrainBlock, row: int, readings: FloatArray) -> FlightEstimate:
        flow = {name: float(values[row]) for name, values in block.flow.items()}
        warm = None if block.temperature is None else block.temperature[row]
        parameters = {name: values[row] for name, values in block.parameters.items()}
        pressure = float(block.dynamic_pressure[row])
        return self._tracker.step(readings, pressure, temperature=warm, parameters=parameters, **flow)


class _FlowArguments(TypedDict, total=False):
    """Of :meth:`Estimator.estimate`."""

    dynamic_pressure_std: FloatArray
    mach_number: FloatArray
    altitude: FloatArray


def flow_of(block: StrainBlock) -> _FlowArguments:
    """Return what ``block`` holds of the flow beside q_inf, as arguments of an estimator."""
    return cast("_FlowArguments", dict(block.flow))


def _sensor_names(inverse_map: InverseMap) -> tuple[str, ...]:
    return () if inverse_map.thermal is None else inverse_map.thermal.sensor_names


def _further_columns(inverse_map: InverseMap, has_loads: bool) -> tuple[tuple[str, str], ...]:
    """Return M_R, rolling moment and section loads with their deviations; none where the map has no such loads.

    Between the two stand the scores of further parameters of the flow.
    """
    scores = tuple((f"{OUTSIDE_PREFIX}{name}", "1") for name in flow_parameters(inverse_map).names)
    if inverse_map.further is None or not has_loads:
        return scores
    stations = inverse_map.further.section_station
    units = np.where(is_moment(len(stations)), "N m", "N").tolist()
    named = (("M_R", "1"), *zip(further_names(stations), units, strict=True))
    return (*named, *scores, *((f"sigma.{name}", unit) for name, unit in named))


def _further_values(found: LoadEstimate | LoadEstimates, has_loads: bool) -> FloatArray:
    """Return the values (n_f,) or (n, n_f) of :func:`_further_columns`."""
    if not has_loads:
        return found.parameter_score
    rolling, std = found.further_coefficients[..., :1], found.further_coefficients_std[..., :1]
    parts = (rolling, found.further_loads, found.parameter_score, std, found.further_loads_std)
    return np.concatenate(parts, axis=-1)


def _outside(names: Sequence[str], score: FloatArray) -> dict[str, BoolArray]:
    """Return (n,) whether each parameter leaves its range, by their ``score`` (n, n_p)."""
    return {name: one > PARAMETER_TOLERANCE for name, one in zip(names, score.T, strict=True)}


def _level_reference(inverse_map: InverseMap) -> LevelReference:
    return LevelReference(
        strain_range=inverse_map.strain_range[: inverse_map.n_strain_gauges],
        noise_std=inverse_map.noise_std[: inverse_map.n_strain_gauges],
        dynamic_pressure=inverse_map.nominal_dynamic_pressure,
    )


class _FmuBlocks:
    """An estimator FMU, step by step."""

    has_residuals = False
    envelope_score_limit = float("nan")
    inverse_map: InverseMap | None = None

    def __init__(self, step: FmuStep, further: Sequence[FurtherOutput]) -> None:
        self._step = step
        self._further = [one.output for one in further]
        self.further_columns = tuple((one.column, one.unit) for one in further)
        self.gauge_names, self.sensor_names = step.gauge_names, step.sensor_names
        self.readings: Mapping[str, str] = recorded_readings(step.reading_units)
        self._readings = dict(zip(self.readings, step.reading_units, strict=True))
        self.row_names = (*step.gauge_names, *(name for name in self.readings if name != THRUST))
        self.inputs = step.further_inputs
        given = (name for name in step.further_inputs if name.startswith(PREFIX))
        self.parameter_names = tuple(name.removeprefix(PREFIX) for name in given)
        self._scores = [self._further.index(f"{OUTSIDE_PREFIX}{name}") for name in self.parameter_names]
        self.reference = LevelReference(
            strain_range=step.strain_nominal,
            noise_std=np.zeros(step.n_gauges),
            dynamic_pressure=step.pressure_nominal,
        )

    def estimate(self, block: StrainBlock, last: float) -> BlockEstimates:
        n = len(block.time)
        numbers = np.full((n, 12), np.nan)
        health = np.full((n, len(_HEALTH)), np.nan)
        further = np.full((n, len(self._further)), np.nan)
        flow = {name: values.tolist() for name, values in block.flow.items() if name in self.inputs}
        flow |= {f"{PREFIX}{name}": values.tolist() for name, values in block.parameters.items()}
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
            health[i] = [found.further.get(f"health.{name}", np.nan) for name in _HEALTH]
            further[i] = [found.further[name] for name in self._further]
        has_reading = np.isfinite(all_readings(block, self.readings))
        valid = np.hstack([np.abs(block.strain) <= SENSOR_RANGE, has_reading])
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
            residual=None,
            residual_limit=np.full(n, np.nan),
            outside=_outside(self.parameter_names, further[:, self._scores]),
            further=further,
        )


def _first_step(block: StrainBlock) -> float:
    """Return a step size for the first sample [s], which has no predecessor."""
    return float(block.time[1] - block.time[0]) if len(block.time) > 1 else 1e-3
