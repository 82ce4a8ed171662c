"""Section loads in the filter of the nonlinear estimator."""

from dataclasses import replace

import numpy as np
import pytest
from flight_fmu import N_D, FlightSample, random_flight, whole_map
from other_load_maps import COMBINATION, with_further, with_further_tables

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.resource.map_file import white_noise

pytestmark = pytest.mark.fast
DT = 0.01


def combined_map() -> InverseMap:
    """Other loads that are a combination of the five, in the linear map and in the tables."""
    return with_further(whole_map())


def track(flight: Estimator, samples: list[FlightSample]) -> Estimate:
    """Return the estimates of ``samples`` along time."""
    flow = {name: np.array([one.flow[name] for one in samples]) for name in samples[0].flow}
    strain, valid = np.array([one.strain for one in samples]), np.array([one.valid for one in samples])
    return flight.track(strain, valid=valid, time=DT * np.arange(len(samples)), q_source="independent", **flow)


def flight_of(inverse_map: InverseMap, lost: bool) -> list[FlightSample]:
    samples = random_flight(inverse_map, 12, seed=5)
    if lost:
        samples = [replace(one, valid=np.arange(N_D) % 12 != k % 4) for k, one in enumerate(samples)]
        samples[7] = replace(samples[7], valid=np.zeros(N_D, dtype=bool))
    return samples


@pytest.mark.parametrize("lost", [False, True])
def test_combinations_of_the_five_loads(lost: bool) -> None:
    """What is known of them is what is known of the five, step by step, with memory and while gauges are lost.

    Without any gauge covariances are not known, and factors of averages differ where windows hold other gauges.
    """
    held = combined_map()
    found = track(Estimator(held).filter(1.0), flight_of(held, lost))
    assert not found.is_linear.any()
    for one in found:
        expected = COMBINATION @ one.loads
        variance = np.diag(COMBINATION @ one.load_covariance @ COMBINATION.T)
        np.testing.assert_allclose(one.other_loads, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())
        if one.valid_gauges:
            tolerance = 1e-8 if one.noise_left == 1.0 else 0.02
            np.testing.assert_allclose(one.other_loads_std, np.sqrt(variance), rtol=tolerance)


def test_without_memory_they_are_those_of_the_static_estimator() -> None:
    held = with_further_tables(whole_map())
    estimator = Estimator(held)
    sample = random_flight(held, 1, seed=4)[0]
    # Both settle on the covariance at their own state. The five loads agree to 4e-7 so, with errors of every kind.
    one, other = (track(flight, [sample] * 8)[-1] for flight in (estimator.filter(1e-9), estimator))
    for name in ("other_loads", "other_loads_std", "other_coefficients", "other_coefficients_std"):
        mine, theirs = getattr(one, name), getattr(other, name)
        assert np.max(np.abs(mine - theirs)) < 1e-6 * np.max(np.abs(theirs)), name


def test_they_are_averaged() -> None:
    """But for the rolling moment, which is known."""
    held = with_further_tables(whole_map())
    sample, random = random_flight(held, 1, seed=6)[0], np.random.default_rng(2)
    noise = np.sqrt(white_noise(held)) * random.standard_normal((30, held.n_gauges))
    samples = [replace(sample, strain=sample.strain + own) for own in noise]
    one, alone = (track(flight, samples) for flight in (Estimator(held).filter(1.0), Estimator(held)))
    assert one.noise_left[-1] < 0.5
    assert np.all((one.other_loads_std[-1] < alone.other_loads_std[-1])[1:])
    assert np.all(np.std(one.other_loads[15:], axis=0)[1:] < np.std(alone.other_loads[15:], axis=0)[1:])
