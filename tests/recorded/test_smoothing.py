"""Smoothed samples: averages of both sides, known loads, what a filter does not average."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flight_maps import whole_map
from other_load_maps import with_further_tables
from scaled_maps import NOMINAL, scaled_map, whole_scaled_map

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.recorded import estimators
from strainfmu.recorded.samples import Samples

pytestmark = pytest.mark.fast
DT = 0.01
STATE = np.array([6.2, 0.06, -0.03, 8.6])


def smoothed(
    inverse_map: InverseMap, strain: np.ndarray, cut: int | None = None, **given: Any
) -> tuple[SimpleNamespace, SimpleNamespace]:
    """Return estimates filtered and of each sample alone, and smoothed ones; the first ``cut`` come first."""
    estimator, time = Estimator(inverse_map).filter(1.0), DT * np.arange(len(strain))
    alone, samples = estimator.filter(0.0), list[estimators.Filtered]()
    for part in [slice(0, cut), *([slice(cut, None)] if cut else [])]:
        filtered = estimator.track(strain[part], time=time[part], **given)
        samples.append((time[part], filtered, alone.track_again(filtered.sample, filtered.mask, time[part])))
    found = estimators.smoothed(estimator.filter(1.0), samples[0], samples[1] if cut else None)
    return SimpleNamespace(filtered=samples[0][1], alone=samples[0][2]), found


def steady(inverse_map: InverseMap, k: int, seed: int) -> np.ndarray:
    """Return strain (k, n_d) of one flight with noise that samples do not share."""
    random, std = np.random.default_rng(seed), inverse_map.noise_std
    covariance, exact = inverse_map.gauge_covariance, inverse_map.mean_strain
    if inverse_map.manifold is not None:
        covariance = inverse_map.manifold.gauge_covariance
        exact = evaluate(inverse_map.manifold.tables, STATE[None]).value[0, : len(std)]
    part = min(1.0, float(np.linalg.eigvalsh(covariance / np.outer(std, std))[0]))
    return np.asarray(exact + np.sqrt(part) * std * random.standard_normal((k, len(std))))


@pytest.mark.parametrize("kind", ["linear", "nonlinear"])
def test_both_sides_leave_less_noise_than_one(kind: str) -> None:
    inverse_map = whole_scaled_map(2, seed=3) if kind == "linear" else with_further_tables(whole_map())
    given = (
        {"dynamic_pressure": NOMINAL} if kind == "linear" else {"mach_number": 6.2, "static_pressure": np.exp(8.6)}
    )
    samples, found = smoothed(inverse_map, steady(inverse_map, 200, 1), **given)
    inner = slice(60, 140)
    rms = [np.std(one.loads[inner], axis=0) for one in (samples.alone, samples.filtered, found)]
    assert np.all(rms[1] < 0.6 * rms[0])
    assert np.all(rms[2] < 0.9 * rms[1])
    for name in ("loads_std", "coefficients_std", "other_loads_std", "other_coefficients_std"):
        alone, filtered = (getattr(one, name)[inner] for one in (samples.alone, samples.filtered))
        both = np.mean(getattr(found, name)[inner], axis=0)
        assert np.all(both <= np.mean(filtered, axis=0)), name
        assert np.all(filtered <= alone * (1.0 + 1e-12)), name


def test_it_is_the_mean_of_both_windows() -> None:
    """Of a channel whose windows on both sides are known: each sample once, all of one weight."""
    inverse_map = scaled_map(2, 1)
    strain = np.tile(inverse_map.mean_strain, (33, 1))
    strain[16] += 1e-9
    samples, found = smoothed(inverse_map, strain, dynamic_pressure=NOMINAL)
    one = 1.0 / samples.filtered.noise_left[16]
    change = (found.loads - samples.alone.loads[0])[16] / (samples.alone.loads[16] - samples.alone.loads[0])
    np.testing.assert_allclose(change, 1.0 / (2.0 * one - 1.0), rtol=1e-5)


def test_ends_and_jumps_are_those_of_one_side() -> None:
    """The last sample is as it was filtered, and a sample behind a jump takes nothing of before."""
    inverse_map = whole_scaled_map(2, seed=3)
    strain = steady(inverse_map, 60, 2)
    strain[30:] += inverse_map.state_operator[:, 0]
    samples, found = smoothed(inverse_map, strain, dynamic_pressure=NOMINAL)
    np.testing.assert_allclose(found.loads[-1], samples.filtered.loads[-1], rtol=1e-12)
    np.testing.assert_allclose(found.loads_std[-1], samples.filtered.loads_std[-1], rtol=1e-12)
    apart = np.abs(found.loads - samples.alone.loads) / samples.alone.loads_std
    assert np.max(apart) < 1.0


def test_blocks_are_smoothed_by_the_next_one() -> None:
    inverse_map = whole_scaled_map(2, seed=3)
    strain = steady(inverse_map, 400, 2)
    _, whole = smoothed(inverse_map, strain, dynamic_pressure=NOMINAL)
    _, first = smoothed(inverse_map, strain, cut=200, dynamic_pressure=NOMINAL)
    assert len(first.loads) == 200
    np.testing.assert_allclose(first.loads_std, whole.loads_std[:200], rtol=0.05)
    assert np.max(np.abs(first.loads - whole.loads[:200]) / whole.loads_std[:200]) < 0.5


def test_without_strain_the_more_certain_side_counts() -> None:
    inverse_map = whole_map()
    strain = steady(inverse_map, 60, 2)
    strain[30:36] = np.nan
    samples, found = smoothed(inverse_map, strain, mach_number=6.2, static_pressure=np.exp(8.6))
    assert np.isnan(samples.alone.loads[30:36]).all()
    assert np.isfinite(found.loads[30:36]).all()
    assert np.all(found.loads_std[35] < samples.filtered.loads_std[35])
    np.testing.assert_array_equal(found.loads[30], samples.filtered.loads[30])


def test_the_length_of_blocks_as_read_makes_no_difference() -> None:
    inverse_map, n = whole_scaled_map(2, seed=3), 3000
    strain, pressure = steady(inverse_map, n, 2), np.full(n, NOMINAL)
    whole = Samples(DT * np.arange(n), strain, {"dynamic_pressure": pressure}, faults=("",) * n)
    loads = []
    for blocks in ([whole], [whole[:2000], whole[2000:]]):
        reader = estimators.MapBlocks(Estimator(inverse_map).filter(1.0), smooth=True)
        made = reader.estimated(blocks, lambda block, _: block)
        loads.append(np.concatenate([estimates.values["force.normal"] for _, estimates in made]))
    np.testing.assert_array_equal(loads[0], loads[1])
