"""The Cramer-Rao bound on a small vehicle whose flow is known in closed form."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from flight_maps import N_D, flight_map
from scaled_maps import scaled_map

from builder.trial.bound import KNOWN, cramer_rao_bound
from builder.trial.conditions import flight_states
from builder.trial.estimators import of_map
from builder.trial.readings import Readings, joined
from builder.trial.score import rows_of
from builder.trial.training_flights import with_drawn_errors
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.tables.flight_tables import evaluate
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast

FLOWN = tuple(
    FlightCondition(mach, radians(alpha), radians(beta), 20e3)
    for mach, alpha, beta in ((5.4, 3.0, 1.0), (6.0, -4.0, 2.0), (6.6, 5.0, -3.0))
)


def small_map(discrepancy: float = 0.0) -> InverseMap:
    return replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=discrepancy, hardware=True))


def bound_of(inverse_map: InverseMap, known: tuple[str, ...] = KNOWN) -> FloatArray:
    found = cramer_rao_bound(inverse_map, FLOWN, known)
    assert found is not None
    return found


def test_an_estimator_that_knows_the_flow_reaches_it() -> None:
    """Noise, gains and navigation drawn for 400 vehicles at three flights, no pressure off the tables."""
    inverse_map, random, vehicles = small_map(), np.random.default_rng(1), 400
    manifold = inverse_map.manifold
    assert manifold is not None
    state = flight_states(FLOWN)
    response, n = evaluate(manifold.tables, state).value, N_D
    mach, pressure, q = (
        np.array([getattr(one, name) for one in FLOWN])
        for name in ("mach_number", "ambient_pressure", "dynamic_pressure")
    )

    def read(number: int) -> Readings:
        strain, _ = with_drawn_errors(manifold, pressure, response[:, :n], response[:, n:], random)
        error = random.standard_normal((3, len(FLOWN)))
        known = {
            "mach_number": mach + manifold.mach_number_error * error[0],
            "static_pressure": pressure * (1.0 + manifold.static_pressure_error * error[1]),
            "dynamic_pressure": q * (1.0 + manifold.dynamic_pressure_error * error[2]),
            "q_source": np.ones(len(FLOWN)),
        }
        of = {"vehicle": np.full(len(FLOWN), number), "flight": np.arange(len(FLOWN))}
        return Readings(strain=strain, known=known, truth=truth, bound=bound_of(inverse_map), **of)

    truth = response[:, n:] / (q[:, None] * manifold.references)
    every = joined([read(number) for number in range(vehicles)])
    rows = rows_of(COEFFICIENT_NAMES, of_map(inverse_map)(every), every)
    assert rows[0]["samples"] == vehicles * len(FLOWN)
    np.testing.assert_allclose([row["over_bound"] for row in rows[1:]], 1.0, atol=0.1)


def test_what_is_not_known_makes_it_larger_and_the_flow_does_not() -> None:
    whole = bound_of(small_map())
    np.testing.assert_allclose(bound_of(small_map(discrepancy=1e-2)), whole, rtol=1e-12)
    for known in (("dynamic_pressure",), ("mach_number", "altitude")):
        fewer = bound_of(small_map(), known)
        assert np.all(fewer >= whole)
        assert np.max(fewer / whole) > 1.05


def test_there_is_none_without_tables_nor_beyond_them() -> None:
    assert cramer_rao_bound(scaled_map(2, 1, N_D), FLOWN, KNOWN) is None
    beyond = (FlightCondition(8.0, 0.0, 0.0, 20e3), FlightCondition(6.0, radians(15.0), 0.0, 20e3), FLOWN[0])
    found = cramer_rao_bound(small_map(), beyond, KNOWN)
    assert found is not None
    assert np.isnan(found).all(axis=1).tolist() == [True, True, False]
