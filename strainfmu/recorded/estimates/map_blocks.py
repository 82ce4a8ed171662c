"""Estimates of blocks of recorded samples by an inverse map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.air_data import AIR_DATA_NAMES, AIR_DATA_UNITS, NAVIGATION
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.alarm_limits import outside_score
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState, chi_square_limit
from strainfmu.estimator.map.flow_parameters import flow_parameters
from strainfmu.estimator.map.inertia import LATERAL_FORCES, contradicted_forces
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import load_arrays
from strainfmu.estimator.settings import default_settings
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.interface.input_names import given_flow
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX
from strainfmu.interface.sensor_variables import reading_units
from strainfmu.recorded.columns.column_names import FLOW_NAMES, INERTIAL_NAMES, NAVIGATION_NAMES
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.columns.sensor_readings import recorded_readings, rows_of_map
from strainfmu.recorded.columns.strain_level import LevelReference
from strainfmu.recorded.estimates.block_estimates import USED_PREFIX, BlockEstimates, outside_ranges

AIR_DATA_COLUMNS = (
    *((f"air_data.{name}", unit) for name, unit in zip(AIR_DATA_NAMES, AIR_DATA_UNITS, strict=True)),
    *((f"sigma.air_data.{name}", unit) for name, unit in zip(AIR_DATA_NAMES, AIR_DATA_UNITS, strict=True)),
    *((f"identified.air_data.{name}", "1") for name in AIR_DATA_NAMES),
    *((f"{USED_PREFIX}{name}", "1") for name in NAVIGATION),
    ("linear_loads", "1"),
)
"""Columns of a nonlinear map in addition to the loads."""


class MapBlocks:
    """An inverse map: a linear one estimates each sample by itself, a nonlinear or filtered one along time."""

    has_residuals = True

    def __init__(self, estimator: Estimator) -> None:
        inverse_map, self.estimator = estimator.inverse_map, estimator
        self.inverse_map: InverseMap | None = inverse_map
        manifold = inverse_map.manifold
        self.inputs: tuple[str, ...] = (
            *FLOW_NAMES[1:],
            *(NAVIGATION_NAMES if estimator.is_nonlinear else ()),
            *(INERTIAL_NAMES if inverse_map.has_masses else ()),
        )
        self.envelope_score_limit = (
            inverse_map.envelope_score_limit if manifold is None else outside_score(manifold)
        )
        self.parameter_names = estimator.parameters.names
        sharpens = manifold is not None and manifold.parameters is not None
        self.sharpening: tuple[str, ...] = self.parameter_names if sharpens else ()
        self.has_loads = inverse_map.has_other_loads
        air_data = AIR_DATA_COLUMNS if estimator.is_nonlinear else ()
        self.other_columns = (*air_data, *_other_columns(inverse_map, self.has_loads))
        self.row_names = inverse_map.gauge_names
        self.gauge_names = self.row_names[: inverse_map.n_strain_gauges]
        self.readings: Mapping[str, str] = recorded_readings(reading_units(inverse_map))
        self.sensor_names = inverse_map.thermal.sensor_names
        self.reference = _level_reference(inverse_map)
        self.zero = estimator.zeros.value

    def estimate(self, block: StrainBlock, last: float) -> BlockEstimates:
        found = self.block_estimates(self.estimates(block))
        return replace(found, contradicted=self._contradicted(block, found))

    def _contradicted(self, block: StrainBlock, found: BlockEstimates) -> dict[str, BoolArray]:
        """Return which specific forces of a block contradict the loads."""
        estimates, unknown = found.estimates, np.full(len(block.time), np.nan)
        assert estimates is not None
        return contradicted_forces(
            self.estimator.inverse_map.inertia,
            {name: block.flow.get(name, unknown) for name in LATERAL_FORCES},
            np.asarray(estimates.loads),
            np.asarray(estimates.loads_std),
            self.estimator.settings.alarm_scale * chi_square_limit(1),
        )

    def block_estimates(self, found: Estimate) -> BlockEstimates:
        """Return the estimates ``found`` of a block as such."""
        of_air_data = air_data_values(found) if self.estimator.is_nonlinear else np.zeros((len(found), 0))
        valid, suspects, worst = self._questioned(found)
        return BlockEstimates(
            coefficients=found.coefficients,
            coefficients_std=found.coefficients_std,
            chi_square=found.chi_square,
            chi_square_limit=found.chi_square_limit,
            degrees_of_freedom=found.degrees_of_freedom.astype(float),
            health=found.health.astype(float),
            gauges_used=found.valid_gauges.astype(float),
            valid=valid,
            suspects=suspects,
            suspect_count=found.suspect_count.astype(float),
            envelope_score=found.envelope_score,
            worst=worst,
            make_residual=lambda: (found.standardised_residual, found.residual_limit),
            outside=outside_ranges(self.parameter_names, found.parameter_score),
            other_values=np.hstack([of_air_data, other_values(found, self.has_loads)]),
            estimates=found,
        )

    def _questioned(self, found: Estimate) -> tuple[BoolArray, list[tuple[int, ...]], IntArray]:
        """Return valid gauges (n, n_d), n tuples of suspects, and worst gauges (n,) of a block.

        They are made of the samples alone whose health is not OK, with which they take twice the time.
        """
        rows = np.flatnonzero(found.health != HealthState.OK)
        valid = np.ones((len(found), len(self.row_names)), dtype=bool)
        suspects: list[tuple[int, ...]] = [()] * len(found)
        worst = np.full(len(found), -1)
        if len(rows):
            part = found[rows]
            valid[rows] = part.valid
            for row, of_row in zip(rows.tolist(), part.suspects, strict=True):
                suspects[row] = of_row
            worst[rows] = np.argmax(np.abs(part.standardised_residual), axis=1)
        return valid, suspects, worst

    def estimates(self, block: StrainBlock) -> Estimate:
        """Return the estimates of a block."""
        readings = rows_of_map(block, self.estimator.inverse_map.sensors, self.readings)
        arguments: dict[str, Any] = {
            DYNAMIC_PRESSURE: block.dynamic_pressure,
            TEMPERATURE: block.temperature,
            "parameters": dict(block.parameters),
            "parameters_std": given_flow(block.parameters_std) if self.sharpening else None,
            **given_flow(block.flow),
        }
        if self.estimator.filter_time_constant > 0.0:
            return self.estimator.track(readings, time=block.time, **arguments)
        if self.estimator.is_nonlinear:
            return self.estimator.track(readings, **arguments)
        return self.estimator.estimate(readings, **arguments)


def _other_columns(inverse_map: InverseMap, has_loads: bool) -> tuple[tuple[str, str], ...]:
    """Return the loads behind the five, coefficients and sigma; none where the map has no such loads.

    Between the two stand the scores of flow parameters.
    """
    scores = tuple((f"{OUTSIDE_PREFIX}{name}", "1") for name in flow_parameters(inverse_map).names)
    if not has_loads:
        return scores
    arrays = sorted(load_arrays(inverse_map.load_groups), key=lambda one: one.is_std)
    named = [(name, one.unit.replace(".", " ")) for one in arrays for name in one.columns]
    n = sum(one.group.size for one in arrays if not one.is_std)
    return (*named[:n], *scores, *named[n:])


def air_data_values(found: Any) -> FloatArray:
    """Return the values (n, n_c) of :data:`AIR_DATA_COLUMNS`."""
    air = found.air_data
    flags = [air.is_identified, found.air_data_used, found.is_linear[:, None]]
    return np.hstack([air.value, air.std, *(flag.astype(float) for flag in flags)])


def other_values(found: Any, has_loads: bool) -> FloatArray:
    """Return the values (n, n_c) of the columns of the loads behind the five, and of scores of estimates."""
    if not has_loads:
        return np.asarray(found.parameter_score)
    arrays = load_arrays(found.load_groups)
    held = (found.other_loads, found.other_loads_std, found.other_coefficients, found.other_coefficients_std)
    values, deviations = (
        [held[one.value][..., one.group.rows] for one in arrays if one.is_std == std] for std in (False, True)
    )
    return np.concatenate([*values, found.parameter_score, *deviations], axis=-1)


def _level_reference(inverse_map: InverseMap) -> LevelReference:
    low, high = inverse_map.dynamic_pressure_range.tolist()
    return LevelReference(
        strain_range=inverse_map.strain_range[: inverse_map.n_strain_gauges],
        noise_std=inverse_map.noise_std[: inverse_map.n_strain_gauges],
        dynamic_pressure=inverse_map.nominal_dynamic_pressure,
        sensor_range=default_settings(inverse_map).sensor_range,
        pressure_range=(low, high) if isfinite(high) else None,
    )
