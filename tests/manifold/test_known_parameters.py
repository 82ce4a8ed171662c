"""Flow parameters that are known with a deviation sharpen the nonlinear estimate of any shape."""

from typing import Any

import numpy as np
import pytest
from deflected_shape import NAME, flights, known_map, snapshots_of_grid
from shape_case import N_D, shape_structure, shape_vehicle

from builder.aero.load_groups import six_loads
from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.nonlinear_map import with_known


def estimated(**known: Any) -> Estimate:
    _, strain, flow = flights()
    return Estimator(known_map()).estimate(strain, **flow, q_source="independent", **known)


def stated(std: float) -> Estimate:
    deflection = flights()[0].condition[:, -1]
    return estimated(parameters={NAME: deflection}, parameters_std={NAME: std})


def test_tables_at_a_known_value_pass_through_its_snapshots() -> None:
    manifold, snapshots = known_map().manifold, snapshots_of_grid()
    assert manifold is not None
    net = snapshots.pressure - snapshots.internal_pressure[:, None]
    readings = net @ shape_structure(snapshots.surface).strain_operator("four_rows").T
    for row in (0, 40, 140, 330):
        condition = snapshots.conditions()[row]
        incidence, roll = condition.total_incidence, condition.leeward_roll_angle
        state = [condition.mach_number, incidence * np.cos(roll), incidence * np.sin(roll)]
        state.append(float(np.log(condition.ambient_pressure)))
        at = with_known(manifold, np.array(condition.parameters), np.zeros(1))
        off, of_mean = (
            evaluate(one.tables, np.array([state])).value[0, :N_D] - readings[row] for one in (at, manifold)
        )
        assert np.abs(off).max() < 2e-3 * np.abs(readings[row]).max()
        if condition.parameters[0] != 0.0:
            assert np.abs(of_mean).max() > 10.0 * np.abs(off).max()


def test_a_known_deflection_sharpens_the_rolling_moment() -> None:
    snapshots = flights()[0]
    vehicle, conditions = shape_vehicle(), snapshots.conditions()
    reference = vehicle.reference_quantities()
    net = snapshots.pressure - snapshots.internal_pressure[:, None]
    scale = np.array([one.dynamic_pressure for one in conditions]) * reference.area * reference.length
    true = net @ six_loads(snapshots.surface, reference.moment_station)[5] / scale
    blind, known, poor = estimated(), stated(0.05), stated(2.0)
    rms = [np.sqrt(np.mean((one.M_R - true) ** 2)) for one in (blind, known)]
    assert rms[1] < 0.6 * rms[0]
    for one in (blind, known, poor):
        assert np.all(np.abs(one.M_R - true) <= 3.0 * one.other_coefficients_std[:, 0])
    deviations = [np.median(one.other_coefficients_std[:, 0]) for one in (known, blind)]
    assert deviations[0] < 0.7 * deviations[1]


def test_a_value_without_deviation_and_one_of_a_boundless_one_change_nothing() -> None:
    deflection = flights()[0].condition[:, -1]
    blind = estimated()
    alone = estimated(parameters={NAME: deflection})
    np.testing.assert_array_equal(alone.coefficients, blind.coefficients)
    boundless = stated(1e9)
    np.testing.assert_allclose(boundless.coefficients, blind.coefficients, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(boundless.coefficients_std, blind.coefficients_std, rtol=1e-5)
    np.testing.assert_allclose(boundless.other_coefficients_std, blind.other_coefficients_std, rtol=1e-5)


def test_values_that_cannot_be_spoil_no_other_sample() -> None:
    """Of a wire that breaks: OUTSIDE, and else as where nothing is known."""
    blind, count = estimated(), len(flights()[1])
    values = np.zeros(count)
    values[:4] = [1e6, -1e308, np.inf, np.nan]
    found = estimated(parameters={NAME: values}, parameters_std={NAME: np.where(np.arange(count) < 8, 0.1, 1e200)})
    np.testing.assert_allclose(found.coefficients[:4], blind.coefficients[:4], rtol=1e-9)
    assert np.all(found.health[:3] == HealthState.OUTSIDE)
    assert found.health[3] == blind.health[3]
    assert np.isfinite(found.coefficients).all()


@pytest.mark.parametrize(
    ("std", "message"), [({NAME: -0.1}, "expected numbers from 0 on"), ({"flap": 0.1}, "got 'flap'")]
)
def test_wrong_deviations_are_refused(std: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        estimated(parameters={NAME: 1.0}, parameters_std=std)
