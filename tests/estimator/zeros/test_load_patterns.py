"""Readings that hold the strain of a flight are no zeros; random zeros of any size are."""

import numpy as np
import pytest
from inertia_maps import with_masses
from scipy.stats import beta
from tare_windows import HELD

from strainfmu.arrays import FloatArray
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.tare import KnownStrain, Tare, largest_part, load_odds, load_patterns, part_survival

pytestmark = pytest.mark.fast

ESTIMATOR = Estimator(HELD)
N_D = HELD.n_gauges


def tare_of(reading: FloatArray, random: np.random.Generator) -> Tare:
    noise = HELD.noise_std * random.normal(size=(200, N_D))
    drift = 1e-6 * random.uniform(-0.5, 0.5, N_D) * np.linspace(0.0, 1.0, 200)[:, None]
    return ESTIMATOR.tare(reading + noise + drift)


def like_load(found: Tare) -> bool:
    return any(one.startswith("readings look like load") for one in found.faults)


@pytest.mark.parametrize(("n_patterns", "n_gauges"), [(2, 8), (2, 54), (4, 54), (12, 51)])
def test_limits_are_quantiles_of_the_beta_distribution(n_patterns: int, n_gauges: int) -> None:
    part = largest_part(n_patterns, n_gauges, 1e-4)
    assert beta.sf(part, n_patterns / 2, (n_gauges - n_patterns) / 2) == pytest.approx(1e-4, rel=1e-9)
    assert part_survival(0.3, n_patterns, n_gauges) == pytest.approx(
        beta.sf(0.3, n_patterns / 2, (n_gauges - n_patterns) / 2), rel=1e-10
    )


def test_the_core_and_numpy_find_the_same_part_along_flights() -> None:
    random = np.random.default_rng(1)
    patterns, odds = load_patterns(HELD), load_odds(HELD)
    for lost in (0, 9):
        reading = 1e-4 * random.normal(size=N_D) + 2e-4 * patterns[0] / np.abs(patterns[0]).max()
        reading[:lost] = np.nan
        found = tare_of(reading, random)
        used = np.arange(lost, N_D)
        basis = np.linalg.qr(patterns[: len(used) // 4, used].T)[0]
        along = float(np.linalg.norm(basis.T @ found.zeros.value[used]))
        rest = float(np.sqrt(np.sum(found.zeros.value[used] ** 2) - along**2))
        assert like_load(found) == (along > np.sqrt(odds[len(used)]) * rest)
        if like_load(found):
            assert f"{1e6 * along:.3g} um/m of them lie along" in " ".join(found.faults)


def test_flights_with_small_zeros_are_refused() -> None:
    """Any mixture of the mean flow and the modes, not the mean flow alone."""
    random = np.random.default_rng(2)
    patterns = load_patterns(HELD)
    refused = 0
    for _ in range(50):
        flight = random.normal(size=len(patterns)) @ patterns
        reading = 5e-5 * flight / np.abs(flight).max() + random.uniform(-5e-6, 5e-6, N_D)
        refused += like_load(tare_of(reading, random))
    assert refused >= 49


def test_own_weight_is_refused_by_a_map_that_knows_masses() -> None:
    held = with_masses(HELD, size=1e-4)
    assert held.inertia is not None
    estimator, random = Estimator(held), np.random.default_rng(4)
    for axis in range(2):  # twelve gauges have room for three patterns, of which one is the mean flow
        weight = 9.81 * held.inertia.mode_strain[:, axis]
        reading = weight + 0.02 * np.abs(weight).max() * random.normal(size=N_D)
        noise = HELD.noise_std * random.normal(size=(200, N_D))
        assert like_load(estimator.tare(reading + noise))
        known = KnownStrain(value=weight)
        assert not like_load(estimator.tare(reading + noise, known=known))


def test_zeros_of_any_size_at_rest_are_taken() -> None:
    random = np.random.default_rng(3)
    for size in np.geomspace(1e-6, 1e-4, 50):
        assert tare_of(size * random.uniform(-1.0, 1.0, N_D), random).faults == ()
