"""Pressure fields of a comparison: interpolation along the body, linear maps, tables and their correction."""

from __future__ import annotations

import numpy as np
import pytest

from builder.campaign.snapshots import Snapshots
from builder.compare.field import estimated_fields, field_errors, station_weights, true_field
from builder.inverse.problem import inverse_problem
from builder.manifold.build import with_manifold
from builder.structure.fourier.model import StructuralModel
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import Vehicle
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
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


def test_the_field_of_a_linear_map_stands_on_the_ambient_pressure(gaussian: InverseMap) -> None:
    """The mean strain is that of the mean pressure, at any q_inf."""
    assert gaussian.field_is_net
    ratio, p_inf = np.array([0.5, 1.0, 2.0]), np.array([1e3, 2e3, 4e3])
    found = Estimator(gaussian).estimate(
        ratio[:, None] * gaussian.mean_strain, ratio * gaussian.nominal_dynamic_pressure
    )
    expected = ratio[:, None] * gaussian.field_mean + p_inf[:, None]
    np.testing.assert_allclose(estimated_fields(found, p_inf), expected, rtol=1e-12)


def test_the_nonlinear_estimator_states_the_fields_of_the_snapshots(
    gaussian: InverseMap, noise_only: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """Its field is absolute: nothing is added to it."""
    full = with_manifold(inverse_map=gaussian, vehicle=noise_only, snapshots=snapshots, structure=structure)
    conditions = snapshots.conditions()
    rows = [number for number, one in enumerate(conditions) if one.sideslip_angle > 0.0][::9]
    chosen, pressure = [conditions[row] for row in rows], snapshots.pressure[rows]
    p_inf, q, mach = (
        np.array([getattr(one, name) for one in chosen])
        for name in ("ambient_pressure", "dynamic_pressure", "mach_number")
    )
    strain = (pressure - p_inf[:, None]) @ inverse_problem(noise_only, snapshots, structure).strain_operator.T
    found = Estimator(full).estimate(strain, q, mach_number=mach, static_pressure=p_inf)
    assert not found.is_linear.any()
    errors = field_errors(estimated_fields(found, np.full(len(rows), np.nan)), pressure)
    assert errors.max() < 0.01


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
