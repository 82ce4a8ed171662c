"""The filter: closed forms of the reference's windows, and the compiled core against them."""

import nonlinear_kinds
import numpy as np
import pytest
from scaled_maps import NOMINAL, whole_scaled_map

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.reference import linear
from strainfmu.estimator.reference.windows import averaged, span_counts, windows

pytestmark = pytest.mark.fast
LONGEST = 1e3


def times(k: int, seed: int) -> np.ndarray:
    """Return times (k,) [s] of uneven steps."""
    return np.cumsum(np.random.default_rng(seed).uniform(0.002, 0.02, k))


def test_spans_are_powers_of_two_of_which_at_most_two_are_alike() -> None:
    for samples in range(200):
        counts = span_counts(samples)
        assert sum(counts) == samples
        assert counts == sorted(counts, reverse=True)
        assert all(counts.count(one) <= 2 and one & (one - 1) == 0 for one in counts)


def test_windows_end_at_the_longest_time() -> None:
    time = 0.01 * np.arange(400.0)
    assert len(windows(time, LONGEST)[-1]) == 400
    whole = len(windows(time, 1.0)[-1])
    assert 70 < whole < 250


def test_a_mean_of_what_does_not_move_leaves_one_over_its_samples() -> None:
    k, m = 65, 3
    noise = np.tile([1.0, 4.0, 9.0], (k, 1))
    found = averaged(0.01 * np.arange(k), np.ones((k, m)), noise, LONGEST)
    count = max(len(one) for one in windows(0.01 * np.arange(k), LONGEST) if len(one) <= 0.5 * k)
    assert found.noise_part == pytest.approx(1.0 / count)
    np.testing.assert_allclose(found.noise, noise[-1] / count)


def test_a_line_is_followed_without_lag() -> None:
    """A line at the end of n even samples leaves (4 n - 2) / (n (n + 1)) of the variance."""
    time = 0.01 * np.arange(65)
    value = np.column_stack([1e3 * time, -2.0 + 1e4 * time])
    found = averaged(time, value, np.ones((65, 2)), LONGEST)
    np.testing.assert_allclose(found.value, value[-1], rtol=1e-9)
    counts = [len(one) for one in windows(time, LONGEST) if len(one) <= 32]
    assert found.noise_part == pytest.approx(min((4 * n - 2) / (n * (n + 1)) for n in counts if n > 2))


def test_a_jump_ends_the_window_in_its_sample() -> None:
    value = np.where(np.arange(50) < 49, 0.0, 5.0)[:, None]
    found = averaged(0.01 * np.arange(50), value, np.ones((50, 1)), LONGEST)
    assert (found.noise_part, found.value[0]) == (1.0, 5.0)


def test_one_channel_that_moves_ends_the_window_of_all() -> None:
    value = np.zeros((50, 2))
    value[-1, 1] = 5.0
    assert averaged(0.01 * np.arange(50), value, np.ones((50, 2)), LONGEST).noise_part == 1.0


@pytest.mark.parametrize("rate", [0.0, 1e-4, 5e-3, 0.05, 1.0])
def test_the_mean_square_error_is_never_above_the_noise(rate: float) -> None:
    """Of a swing of this curvature [standard deviations per sample, per sample], by 400 draws of noise."""
    k, draws = 40, 400
    random, time = np.random.default_rng(3), np.arange(float(k))
    path = 0.5 * rate * (time - time[-1]) ** 2
    error = [
        averaged(time, (path + random.standard_normal(k))[:, None], np.ones((k, 1)), LONGEST).value[0] - path[-1]
        for _ in range(draws)
    ]
    assert np.sqrt(np.mean(np.square(error))) < 1.1


def gains(inverse_map: InverseMap, used: np.ndarray, pressure: float) -> np.ndarray:
    """Return (5, n_d) the change of loads per strain of each gauge, of the reference."""
    n = inverse_map.n_gauges
    rows = np.vstack([np.zeros(n), np.eye(n)])
    q, std = np.full(n + 1, pressure), np.zeros(n + 1)
    found = linear.estimate(inverse_map, rows, used, q, std).loads[:, :5]
    return np.asarray((found[1:] - found[0]).T)


@pytest.mark.parametrize("case", [1, 2])
@pytest.mark.parametrize("lost", [0, 3])
@pytest.mark.parametrize("moves", [0.0, 0.3])
def test_the_core_filters_a_linear_map_as_the_reference(case: int, lost: int, moves: float) -> None:
    inverse_map, k = whole_scaled_map(case, seed=3), 90
    n, random, time = inverse_map.n_gauges, np.random.default_rng(8), times(90, 4)
    white = inverse_map.noise_std**2 * smallest_part(inverse_map)
    strain = inverse_map.mean_strain + np.sqrt(white) * random.standard_normal((k, n))
    strain += moves * np.sin(4.0 * time)[:, None] * inverse_map.state_operator[:, 0]
    strain[60:] += inverse_map.state_operator[:, 1]
    strain[:, :lost] = np.nan
    estimator = Estimator(inverse_map)
    alone = estimator.estimate(strain, NOMINAL, dynamic_pressure_std=1e-6)
    core = estimator.filter(0.3).track(strain, NOMINAL, dynamic_pressure_std=1e-6, time=time)
    assert np.all(alone.fits)
    of_gauge = gains(inverse_map, np.arange(n) >= lost, NOMINAL) ** 2 @ white
    scale = (alone.coefficients / alone.loads)[0]
    value = np.hstack([alone.loads, alone.coefficients])
    std = np.hstack([alone.loads_std, alone.coefficients_std])
    noise = np.tile(np.append(of_gauge, scale**2 * of_gauge), (k, 1))
    found_std = np.hstack([core.loads_std, core.coefficients_std])
    for row in range(k):
        known = slice(0, row + 1)
        expected = averaged(time[known], value[known], noise[known], 0.3)
        assert core.noise_left[row] == pytest.approx(expected.noise_part, rel=1e-9)
        found = np.append(core.loads[row], core.coefficients[row])
        np.testing.assert_allclose((found - expected.value) / std[row], 0.0, atol=1e-9)
        variance = std[row] ** 2 - noise[row] + expected.noise
        np.testing.assert_allclose(found_std[row], np.sqrt(variance), rtol=1e-9)
    assert core.noise_left.min() < 0.3
    assert core.noise_left[60] == 1.0


def smallest_part(inverse_map: InverseMap) -> float:
    """Return the part of the stated variance of noise that the covariance of the gauges holds."""
    std = inverse_map.noise_std
    return min(1.0, float(np.linalg.eigvalsh(inverse_map.gauge_covariance / np.outer(std, std))[0]))


STATE = np.array([6.2, 0.06, -0.03, 8.6])
FLOW = {"mach_number": STATE[0], "static_pressure": np.exp(STATE[3])}


def flight_case() -> tuple[Estimator, np.ndarray, np.ndarray]:
    """Return a nonlinear estimator, strain (n_d,) at :data:`STATE`, and variances (n_d,) of the noise."""
    inverse_map = nonlinear_kinds.KINDS["revolution"].make()
    manifold, std = inverse_map.manifold, inverse_map.noise_std
    assert manifold is not None
    part = min(1.0, float(np.linalg.eigvalsh(manifold.gauge_covariance / np.outer(std, std))[0]))
    return Estimator(inverse_map), evaluate(manifold.tables, STATE[None]).value[0, : len(std)], part * std**2


def test_noise_of_a_nonlinear_estimate_is_that_of_differences() -> None:
    """Of each gauge, and a fifth of the variance of air data; the deviations of a steady flight hold it."""
    estimator, strain, white = flight_case()
    assert estimator.inverse_map.manifold is not None
    std = {name: float(value) for name, value in zip(FLOW, (0.05, 0.02 * FLOW["static_pressure"]), strict=True)}
    given = FLOW | {f"{name}_std": value for name, value in std.items()}
    k, step = 40, 0.1 * np.sqrt(white)
    found = estimator.filter(10.0).track(np.tile(strain, (k, 1)), time=0.01 * np.arange(k), **given)
    alone = estimator.track(np.tile(strain, (k, 1)), **given)
    start = np.tile(alone.state[-1], (len(strain), 1))
    sides = [estimator.estimate(strain + sign * np.diag(step), start=start, **given) for sign in (1.0, -1.0)]
    of_air = []
    for name, value in std.items():
        pair = [FLOW | {name: FLOW[name] + sign * 0.1 * value} for sign in (1.0, -1.0)]
        names = {f"{one}_std": one_std for one, one_std in std.items()}
        of_air.append([estimator.estimate(strain[None], start=start[:1], **one, **names) for one in pair])
    for name in ("loads", "coefficients", "state"):
        one, other = (getattr(side, name) for side in sides)
        expected = white @ ((one - other) / (2.0 * step[:, None])) ** 2
        for above, below in of_air:
            slope = (getattr(above, name) - getattr(below, name))[0] / 0.2
            expected = expected + POLICIES.white_navigation * slope**2
        before, after = (variances(each, name)[-1] for each in (alone, found))
        # Deviations of coefficients are wider by a tenth: three of them reach as far as those of ln q_inf.
        wider = 0.1 if name == "coefficients" else 0.02
        np.testing.assert_allclose((before - after) / (1.0 - found.noise_left[-1]), expected, rtol=wider)


def variances(found: Estimate, name: str) -> np.ndarray:
    """Return (k, n) the variances of a field."""
    if name == "state":
        return np.diagonal(found.state_covariance, axis1=1, axis2=2)
    return np.asarray(getattr(found, f"{name}_std") ** 2)


def test_the_core_filters_a_nonlinear_map_as_the_reference() -> None:
    """The windows in use, by the part that they leave, and the averages over them."""
    estimator, exact, white = flight_case()
    k, random, time = 60, np.random.default_rng(5), times(60, 6)
    strain = exact + np.sqrt(white) * random.standard_normal((k, len(exact)))
    flight = estimator.filter(1.0)
    alone, core = estimator.track(strain, **FLOW), flight.track(strain, time=time, **FLOW)
    averages = core.noise_left < 1.0
    assert np.mean(averages) > 0.8
    for name in ("loads", "coefficients", "state"):
        value, found = getattr(alone, name), getattr(core, name)
        std = np.sqrt(variances(alone, name))
        np.testing.assert_array_equal(found[~averages], value[~averages])
        for row in np.flatnonzero(averages).tolist():
            weight, rows = nearest_window(time[: row + 1], float(core.noise_left[row]))
            np.testing.assert_allclose((found[row] - weight @ value[rows]) / std[row], 0.0, atol=1e-5)


def nearest_window(time: np.ndarray, left: float) -> tuple[np.ndarray, np.ndarray]:
    """Return weights of the samples of the window, of a mean or a line, that leaves ``left``; and the samples."""
    fits = [
        (np.linalg.pinv(np.vander(time[one] - time[-1], degree + 1, increasing=True))[0], one)
        for one in windows(time, 1.0)
        for degree in (0, 1)
        if len(one) > 2 * degree
    ]
    weight, rows = min(fits, key=lambda fit: abs(float(fit[0] @ fit[0]) - left))
    assert float(weight @ weight) == pytest.approx(left, rel=1e-6)
    return weight, rows
