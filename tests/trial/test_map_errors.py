"""Errors that the tables of a nonlinear map include, drawn at the sizes of the map, in strain and loads alike."""

from __future__ import annotations

import numpy as np
import pytest
from flight_maps import whole_map, with_considered_columns, with_considered_error

from builder.trial.readings import Readings, with_map_errors
from strainfmu.estimator.tables.flight_tables import evaluate
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast

CONDITIONS = (FlightCondition(6.2, 0.09, -0.05, 20e3), FlightCondition(5.5, 0.02, 0.03, 24e3))


def test_errors_have_the_covariance_that_the_map_states() -> None:
    """40,000 samples at two conditions, noise of the draw 1 %: strain, loads and what joins them."""
    inverse_map = with_considered_columns(with_considered_error(whole_map()))
    manifold = inverse_map.manifold
    assert manifold is not None
    n, n_d = 80_000, manifold.n_gauges
    flight = np.arange(n) % 2
    read = Readings(
        strain=np.ones((n, n_d)),
        known={},
        truth=np.ones((n, 5)),
        vehicle=np.arange(n),
        flight=flight,
        conditions=CONDITIONS,
    )
    found = with_map_errors(inverse_map, read, np.random.default_rng(1))
    for number, condition in enumerate(CONDITIONS):
        rows = flight == number
        to_load = condition.dynamic_pressure * manifold.references
        errors = np.hstack([found.strain[rows] - 1.0, (found.truth[rows] - 1.0) * to_load])
        columns = np.hstack([np.vstack([manifold.error_strain, manifold.error_load]), manifold.considered_columns])
        tables = manifold.considered_tables
        assert tables is not None
        of_tables = evaluate(tables, found.states[rows][:1]).value.T
        root = np.hstack([condition.ambient_pressure * columns, of_tables])[: n_d + 5]
        expected = root @ root.T
        size = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(
            np.cov(errors.T) / np.outer(size, size), expected / np.outer(size, size), atol=0.03
        )
        np.testing.assert_allclose(errors.mean(axis=0) / size, 0.0, atol=0.03)
