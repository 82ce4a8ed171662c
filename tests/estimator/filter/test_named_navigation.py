"""Navigation that becomes wrong in flight: named, left out while it lasts, and back when it is good again."""

import numpy as np
import pytest
from wrong_navigation import BEFORE, MACH, PRESSURE, WRONG, N, flight_estimator, flown, inside, with_error

from strainfmu.estimator.filter.named_navigation import NAMED_AFTER
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.navigation import NAVIGATION

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module", name="estimator")
def _estimator() -> ManifoldEstimator:
    return flight_estimator()


@pytest.mark.parametrize("which", [MACH, PRESSURE])
def test_five_deviations_are_named_at_once_and_return(estimator: ManifoldEstimator, which: int) -> None:
    for seed, size in enumerate((-5.0, 5.0)):
        found, loads, named = flown(estimator, seed, with_error(which, size))
        left_out = ~np.array([one.navigation_used for one in found])
        wrong, after = slice(BEFORE, BEFORE + WRONG), slice(BEFORE + WRONG + 1, None)
        assert left_out[wrong, which].all()
        assert named[BEFORE + NAMED_AFTER - 1 : BEFORE + WRONG, which].all()
        assert not np.delete(left_out, which, axis=1)[BEFORE:].any()
        assert not left_out[after].any()
        assert all(one.health is HealthState.DEGRADED for one in found[wrong])
        assert all(one.health is HealthState.OK for one in found[after])
        assert inside(found, loads) >= 0.99


@pytest.mark.parametrize("which", [MACH, PRESSURE])
def test_what_is_not_known_to_be_good_stays_out(estimator: ManifoldEstimator, which: int) -> None:
    """Without a third quantity the filter forgets what the wrong one should read: then any reading fits."""
    for seed in range(2):
        found, loads, _ = flown(estimator, seed, with_error(which, 5.0), NAVIGATION[:2], step=0.1)
        used = np.array([one.navigation_used[which] for one in found])
        assert not used[BEFORE : BEFORE + WRONG].any()
        assert inside(found, loads) >= 0.99


@pytest.mark.parametrize("white", [0.2, 1.0])
def test_correct_navigation_is_never_named(estimator: ManifoldEstimator, white: float) -> None:
    """Whether its error lasts as the filter has it, or is drawn in every sample, as it has not."""
    for seed in range(2):
        assert not flown(estimator, seed, np.zeros((N, 3)), white=white)[2].any()
