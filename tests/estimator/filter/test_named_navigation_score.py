"""How often navigation that becomes wrong by five deviations is named, over many flights."""

import numpy as np
import pytest
from wrong_navigation import BEFORE, MACH, PRESSURE, WRONG, flight_estimator, flown, inside, with_error

from strainfmu.estimator.filter.named_navigation import NAMED_AFTER
from strainfmu.estimator.manifold.navigation import NAVIGATION

pytestmark = pytest.mark.slow
FLIGHTS = 40


@pytest.mark.parametrize("known", [2, 3])
@pytest.mark.parametrize("which", [MACH, PRESSURE])
def test_five_deviations_are_named_in_nearly_every_flight(which: int, known: int) -> None:
    estimator, right, false, held = flight_estimator(), 0, 0, []
    for seed in range(FLIGHTS):
        found, loads, named = flown(estimator, seed, with_error(which, 5.0), NAVIGATION[:known])
        right += bool(named[BEFORE + NAMED_AFTER - 1 : BEFORE + WRONG, which].all())
        false += bool(named[:BEFORE].any() or np.delete(named, which, axis=1).any())
        held.append(inside(found, loads))
    print(f"named {right} of {FLIGHTS}, falsely {false}; loads held in {100.0 * np.mean(held):.2f} %")
    assert right >= 0.95 * FLIGHTS
    assert false <= 0.01 * FLIGHTS
    assert np.mean(held) >= 0.99
