"""Section loads in the filter of the nonlinear estimator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flight_fmu import N_D, FlightSample, random_flight, whole_map
from further_maps import COMBINATION, with_further, with_further_tables

from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.tables.further_tables import FurtherTables

pytestmark = pytest.mark.fast
DT = 0.01


def combined_map() -> InverseMap:
    """Further loads that are a combination of the five, in the linear map and in the tables."""
    held = with_further(whole_map())
    manifold = held.manifold
    assert manifold is not None
    further = FurtherTables(
        response=np.einsum("fl,ijlms->ijfms", COMBINATION, manifold.response[:, :, N_D:]),
        fixed_response=COMBINATION @ manifold.fixed_response[N_D:],
        strain_covariance=COMBINATION @ manifold.load_strain_covariance,
        variance=np.diag(COMBINATION @ manifold.load_covariance @ COMBINATION.T).copy(),
    )
    return replace(held, manifold=replace(manifold, further=further))


def steps(flight: FlightFilter | FlightTracker, samples: list[FlightSample]) -> list[FlightEstimate]:
    found = []
    for sample in samples:
        flow = dict(sample.flow)
        q = flow.pop("dynamic_pressure")
        first = (DT,) if isinstance(flight, FlightFilter) else ()
        found.append(flight.step(*first, sample.strain, q, sample.valid, **flow))
    return found


def flight_of(inverse_map: InverseMap, lost: bool) -> list[FlightSample]:
    samples = random_flight(inverse_map, 12, seed=5)
    if lost:
        samples = [replace(one, valid=np.arange(N_D) % 12 != k % 4) for k, one in enumerate(samples)]
        samples[7] = replace(samples[7], valid=np.zeros(N_D, dtype=bool))
    return samples


@pytest.mark.parametrize("lost", [False, True])
def test_combinations_of_the_five_loads(lost: bool) -> None:
    """What is known of them is what is known of the five, step by step, with memory and while gauges are lost."""
    held = combined_map()
    flight = FlightFilter(ManifoldEstimator(held), FilterSettings(time_constant=1.0))
    found = steps(flight, flight_of(held, lost))
    assert not any(one.is_linear for one in found)
    for one in found:
        expected = COMBINATION @ one.loads
        variance = np.diag(COMBINATION @ one.load_covariance @ COMBINATION.T)
        np.testing.assert_allclose(one.further_loads, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())
        np.testing.assert_allclose(one.further_loads_std, np.sqrt(variance), rtol=1e-8)


def test_without_memory_they_are_those_of_the_static_estimator() -> None:
    held = with_further_tables(whole_map())
    estimator = ManifoldEstimator(held)
    sample = random_flight(held, 1, seed=4)[0]
    # Both settle on the covariance at their own state. The five loads agree to 4e-7 so, with errors of every kind.
    one = steps(FlightFilter(estimator, FilterSettings(time_constant=1e-9)), [sample] * 8)[-1]
    other = steps(FlightTracker(estimator), [sample] * 8)[-1]
    for name in ("further_loads", "further_loads_std", "further_coefficients", "further_coefficients_std"):
        mine, theirs = getattr(one, name), getattr(other, name)
        assert np.max(np.abs(mine - theirs)) < 1e-6 * np.max(np.abs(theirs)), name


def test_they_change_nothing_else_and_get_smaller_deviations() -> None:
    held = with_further_tables(whole_map())
    manifold = held.manifold
    assert manifold is not None
    bare = replace(held, manifold=replace(manifold, further=None), further=None)
    samples = random_flight(held, 30, seed=6)
    settings = FilterSettings(time_constant=1.0, white_navigation=1.0)
    one, other = (steps(FlightFilter(ManifoldEstimator(each), settings), samples)[-1] for each in (held, bare))
    assert one.loads.tobytes() == other.loads.tobytes()
    assert one.load_covariance.tobytes() == other.load_covariance.tobytes()
    alone = steps(FlightTracker(ManifoldEstimator(held)), samples)[-1]
    # But for the rolling moment, which is known.
    assert np.all((one.further_loads_std < alone.further_loads_std)[1:])
