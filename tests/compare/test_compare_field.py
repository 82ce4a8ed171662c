"""Pressure fields of a comparison: interpolation along the body, linear maps, tables and their correction."""

from __future__ import annotations

import numpy as np
import pytest

from builder.campaign.snapshots import Snapshots
from builder.compare.field import (
    field_errors,
    linear_field,
    station_weights,
    table_field,
    true_field,
)
from builder.inverse.build import inverse_problem
from builder.manifold.build import manifold_map
from builder.structure.fourier.model import StructuralModel
from builder.truth.flow_table import FlowTable
from builder.truth.strain import TrueStructure
from builder.vehicle.file import Vehicle
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.flight_condition import FlightCondition


@pytest.mark.fast
def test_a_jump_at_a_slope_break_is_kept() -> None:
    source, target = np.array([0.0, 0.5, 1.0, 1.0, 2.0]), np.array([0.0, 0.25, 1.0, 1.0, 1.5, 2.0])

    def values(x: np.ndarray) -> np.ndarray:
        behind = np.cumsum(np.diff(x, prepend=-1.0) == 0.0) > 0
        return np.where(behind, 10.0 - x, 1.0 + 2.0 * x)

    np.testing.assert_allclose(station_weights(source, target) @ values(source), values(target), rtol=1e-14)


@pytest.mark.fast
def test_the_error_is_relative_to_the_true_field() -> None:
    true = np.array([[3.0, 4.0], [6.0, 8.0]])
    np.testing.assert_allclose(field_errors(true + np.array([[0.0, 0.5], [1.0, 0.0]]), true), [0.1, 0.1])


def test_a_linear_map_returns_its_own_field(gaussian: InverseMap, snapshots: Snapshots) -> None:
    """Without noise the estimate is the field of the map's states, at any q_inf, on top of p_inf."""
    map_ = gaussian
    assert map_.field_mean is not None
    assert map_.field_modes is not None
    state = 0.3 * np.random.default_rng(1).standard_normal((3, map_.state_operator.shape[1]))
    seen = map_.strain_gain @ map_.state_operator
    ratio, p_inf = np.array([0.5, 1.0, 2.0]), np.array([1e3, 2e3, 4e3])
    strain = ratio[:, None] * (map_.mean_strain + state @ map_.state_operator.T)
    found = linear_field(
        inverse_map=map_,
        strain=strain,
        dynamic_pressure=ratio * map_.nominal_dynamic_pressure,
        static_pressure=p_inf,
    )
    expected = ratio[:, None] * (map_.field_mean + (state @ seen.T) @ map_.field_modes.T) + p_inf[:, None]
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_tables_give_the_snapshots_and_correct_what_is_off_them(
    noise_only: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    problem = inverse_problem(noise_only, snapshots, structure)
    manifold, _ = manifold_map(vehicle=noise_only, snapshots=snapshots, structure=structure, problem=problem)
    field = table_field(vehicle=noise_only, snapshots=snapshots, structure=structure, problem=problem)
    conditions = snapshots.conditions()
    rows = [number for number, one in enumerate(conditions) if one.sideslip_angle > 0.0][::9]
    pressure = snapshots.pressure[rows]
    p_inf = np.array([conditions[row].ambient_pressure for row in rows])
    incidence = np.array([conditions[row].total_incidence for row in rows])
    roll = np.array([conditions[row].leeward_roll_angle for row in rows])
    mach = np.array([conditions[row].mach_number for row in rows])
    state = np.column_stack([mach, incidence * np.cos(roll), incidence * np.sin(roll), np.log(p_inf)])
    strain = (pressure - p_inf[:, None]) @ problem.strain_operator.T
    exact = field_errors(field.pressure(manifold, state, strain), pressure)
    assert exact.max() < 0.01
    # A smooth pressure off the tables that makes the section oval, which the gauges see.
    grid = field.grid
    shape = np.outer(np.exp(-0.5 * ((grid.x - 2.0) / 0.7) ** 2), np.cos(2.0 * grid.roll_angle)).ravel()
    off = pressure + 0.05 * p_inf[:, None] * shape
    seen = (off - p_inf[:, None]) @ problem.strain_operator.T
    corrected = field_errors(field.pressure(manifold, state, seen), off)
    without = field_errors(field.pressure(manifold, state, strain), off)
    assert np.all(corrected < 0.6 * without)


def test_the_true_field_is_that_of_the_snapshots(
    snapshots: Snapshots, table: FlowTable, true_model: TrueStructure, structure: StructuralModel
) -> None:
    """One solver on one grid: flows between the knots differ by what the splines of the table leave."""
    chosen = [
        row
        for row, one in enumerate(snapshots.conditions())
        if 5.25 <= one.mach_number <= 6.75 and 0.03 < one.total_incidence <= table.incidence_knots[-1]
    ]
    conditions: list[FlightCondition] = [snapshots.conditions()[row] for row in chosen]
    found = true_field(
        table=table, of_table=true_model.surface, grid=structure.surface, conditions=tuple(conditions)
    )
    assert field_errors(found, snapshots.pressure[chosen]).max() < 0.03
