"""Tables over the flight state: derivatives, zero incidence, roll, agreement with the flow in closed form."""

import numpy as np
import pytest
from flight_maps import exact_response, flight_map
from scipy.interpolate import BSpline

from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.numerics import basis, padded_knots

pytestmark = pytest.mark.fast

STATES = np.column_stack(
    [
        np.linspace(4.6, 7.4, 12),
        0.16 * np.cos(np.linspace(0.0, 6.0, 12)) * np.linspace(0.0, 1.2, 12),
        0.16 * np.sin(np.linspace(0.0, 6.0, 12)) * np.linspace(0.0, 1.2, 12),
        np.linspace(7.0, 10.0, 12),
    ]
)


def test_basis_is_that_of_scipy() -> None:
    knots, x = np.array([1.0, 2.0, 2.5, 4.0, 7.0]), np.linspace(1.0, 7.0, 41)
    found = basis(knots, x)
    reference = BSpline.design_matrix(x, padded_knots(knots), 3).toarray()
    assert np.max(np.abs(found.value - reference)) < 1e-14
    slopes = [BSpline(padded_knots(knots), row, 3).derivative()(x) for row in np.eye(len(knots) + 2)]
    assert np.max(np.abs(found.derivative - np.array(slopes).T)) < 1e-13


def test_splines_go_on_along_their_tangent() -> None:
    knots = np.array([1.0, 2.0, 4.0])
    inside, outside = basis(knots, np.array([4.0])), basis(knots, np.array([5.0]))
    assert np.allclose(outside.value, inside.value + inside.derivative, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("axis", range(4))
def test_jacobian_is_that_of_central_differences(axis: int) -> None:
    tables, step = flight_map().tables, 1e-5 * np.eye(4)[axis]
    reference = (evaluate(tables, STATES + step).value - evaluate(tables, STATES - step).value) / 2e-5
    found = evaluate(tables, STATES).jacobian[:, :, axis]
    assert np.max(np.abs(found - reference)) < 1e-7 * np.max(np.abs(reference))


def test_tables_hold_the_flow_between_their_knots() -> None:
    inside = STATES[(STATES[:, 0] > 5.0) & (STATES[:, 0] < 7.0)]
    found = evaluate(flight_map().tables, inside).value
    exact = np.array([exact_response(m, u, w, np.exp(p)) for m, u, w, p in inside])
    scale = np.max(np.abs(exact), axis=0)
    assert np.max(np.abs(found - exact) / scale) < 2e-4


def test_zero_incidence_is_crossed_without_a_jump() -> None:
    u = np.linspace(-2e-3, 2e-3, 401)
    states = np.column_stack([np.full(401, 6.0), u, np.full(401, 1e-12), np.full(401, 8.6)])
    found = evaluate(flight_map().tables, states)
    second = np.abs(np.diff(found.value, n=2, axis=0))
    assert np.max(second) < 1e-6 * np.max(np.abs(found.value))
    assert np.max(np.abs(np.diff(found.jacobian[:, :, 1], axis=0))) < 0.01 * np.max(
        np.abs(found.jacobian[:, :, 1])
    )
    exact = np.array([exact_response(6.0, one, 1e-12, np.exp(8.6)) for one in u])
    assert np.max(np.abs(found.value - exact)) < 1e-4 * np.max(np.abs(exact))
