"""Estimates of blocks of recorded samples by an inverse map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict, cast

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.estimates.load_estimate import LoadEstimate, LoadEstimates
from strainfmu.estimator.further_loads import further_names, is_moment
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.linear.flow_parameters import flow_parameters
from strainfmu.estimator.manifold.air_data import AIR_DATA_NAMES, AIR_DATA_UNITS
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.manifold.flight_health import gauge_threshold, outside_score
from strainfmu.estimator.manifold.navigation import NAVIGATION
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.settings import default_settings
from strainfmu.interface.input_names import given_flow
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX
from strainfmu.interface.sensor_variables import reading_units
from strainfmu.recorded.columns.column_names import FLOW_NAMES, NAVIGATION_NAMES
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.columns.sensor_readings import recorded_readings, rows_of_map
from strainfmu.recorded.columns.strain_level import LevelReference
from strainfmu.recorded.estimates.block_estimates import USED_PREFIX, BlockEstimates, outside_ranges


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
        self.sharpening: tuple[str, ...] = ()
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
            outside=outside_ranges(self.parameter_names, found.parameter_score),
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
        with np.errstate(invalid="ignore"):  # 0 of 0 without a gauge in use
            moved = found.chi_square_limit / (held.chi_square_scale * nominal[of_sample])
        return np.asarray(threshold[of_sample] * np.sqrt(held.outlier_scale * moved))


class FlightBlocks:
    """An inverse map with tables over the flight state, sample by sample."""

    inputs: tuple[str, ...] = (*FLOW_NAMES[1:], *NAVIGATION_NAMES)
    has_residuals = True
    _columns = (
        *((f"air_data.{name}", unit) for name, unit in zip(AIR_DATA_NAMES, AIR_DATA_UNITS, strict=True)),
        *((f"sigma.air_data.{name}", unit) for name, unit in zip(AIR_DATA_NAMES, AIR_DATA_UNITS, strict=True)),
        *((f"identified.air_data.{name}", "1") for name in AIR_DATA_NAMES),
        *((f"{USED_PREFIX}{name}", "1") for name in NAVIGATION),
        ("linear_loads", "1"),
    )

    def __init__(self, estimator: ManifoldEstimator) -> None:
        self.estimator, self._tracker = estimator, FlightTracker(estimator)
        self.inverse_map: InverseMap | None = estimator.inverse_map
        self._threshold = gauge_threshold(estimator.manifold, estimator.settings.alarm_scale)
        self.envelope_score_limit = outside_score(estimator.manifold)
        self.parameter_names = estimator.parameters.names
        self.sharpening: tuple[str, ...] = () if estimator.manifold.parameters is None else self.parameter_names
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
            outside=outside_ranges(self.parameter_names, np.array([one.parameter_score for one in found])),
            estimates=found,
        )

    def _further(self, one: FlightEstimate) -> FloatArray:
        """Return the values of ``further_columns``."""
        air, of_map = one.air_data, _further_values(one, self._has_loads)
        flags = [*one.navigation_used, one.is_linear]
        return np.concatenate([air.value, air.std, air.is_identified, flags, of_map]).astype(float)

    def _step(self, block: StrainBlock, row: int, readings: FloatArray) -> FlightEstimate:
        flow: dict[str, Any] = given_flow({name: float(values[row]) for name, values in block.flow.items()})
        warm = None if block.temperature is None else block.temperature[row]
        parameters = {name: values[row] for name, values in block.parameters.items()}
        pressure = float(block.dynamic_pressure[row])
        std = given_flow({name: float(values[row]) for name, values in block.parameters_std.items()})
        return self._tracker.step(
            readings, pressure, temperature=warm, parameters=parameters, parameters_std=std, **flow
        )


class _FlowArguments(TypedDict, total=False):
    """Of :meth:`Estimator.estimate`."""

    dynamic_pressure_std: FloatArray
    mach_number: FloatArray
    altitude: FloatArray


def flow_of(block: StrainBlock) -> _FlowArguments:
    """Return what ``block`` holds of the flow beside q_inf, as arguments of an estimator."""
    return cast("_FlowArguments", given_flow(block.flow))


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


def _level_reference(inverse_map: InverseMap) -> LevelReference:
    held = inverse_map.dynamic_pressure_range
    return LevelReference(
        strain_range=inverse_map.strain_range[: inverse_map.n_strain_gauges],
        noise_std=inverse_map.noise_std[: inverse_map.n_strain_gauges],
        dynamic_pressure=inverse_map.nominal_dynamic_pressure,
        sensor_range=default_settings(inverse_map).sensor_range,
        pressure_range=None if held is None else (float(held[0]), float(held[1])),
    )
