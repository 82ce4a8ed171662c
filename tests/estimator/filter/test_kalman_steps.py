"""Steps of the Kalman filter: textbook recursion, steady state, considered errors, stationary processes."""

import numpy as np
import pytest

from strainfmu.errors import InputError
from strainfmu.estimator.filter.consistency import WINDOW, Consistency, band, noted
from strainfmu.estimator.filter.kalman import (
    Law,
    Measurement,
    Transition,
    given,
    measured,
    predicted,
    stationary_law,
)
from strainfmu.estimator.filter.motion import decaying, with_rates
from strainfmu.estimator.filter.seen_errors import seen_errors, white_and_lasting
from strainfmu.estimator.filter.settings import FilterSettings, checked_time_step

pytestmark = pytest.mark.fast


def scalar(correlation: float, considered: float = 0.0) -> Transition:
    return Transition(
        matrix=np.array([[correlation]]), mean=np.zeros(1), covariance=np.ones((1, 1)), considered=considered
    )


def reading(value: float, law: Law, noise: float, lasting: float = 0.0) -> Measurement:
    return Measurement(
        innovation=np.array([value]) - law.mean,
        jacobian=np.ones((1, 1)),
        considered=np.full((1, 1), lasting),
        noise=np.array([[noise]]),
    )


def test_variance_of_a_scalar_reaches_the_solution_of_its_riccati_equation() -> None:
    a, noise = 0.95, 0.3
    law = stationary_law(scalar(a), 1)
    for _ in range(200):
        law = measured(predicted(law, scalar(a)), reading(0.0, law, noise)).law
    before = predicted(law, scalar(a)).covariance[0, 0]
    # p = a^2 p r / (p + r) + 1 - a^2, a quadratic equation in p.
    b = noise * (1.0 - a * a) - (1.0 - a * a)
    expected = 0.5 * (-b + np.sqrt(b * b + 4.0 * noise * (1.0 - a * a)))
    assert before == pytest.approx(expected, rel=1e-12)


def test_a_series_agrees_with_the_textbook_recursion() -> None:
    rng = np.random.default_rng(3)
    n, m = 5, 7
    root = rng.standard_normal((n, n))
    stationary = root @ root.T
    step = Transition(matrix=0.9 * np.eye(n), mean=rng.standard_normal(n), covariance=stationary, considered=0.0)
    law = stationary_law(step, 1)
    mean, cov = step.mean, stationary
    for _ in range(20):
        h, noise, value = rng.standard_normal((m, n)), rng.uniform(0.1, 1.0, m), rng.standard_normal(m)
        law = predicted(law, step)
        update = measured(
            law,
            Measurement(
                innovation=value - h @ law.mean, jacobian=h, considered=np.zeros((m, 1)), noise=np.diag(noise)
            ),
        )
        law = update.law
        mean = step.mean + 0.9 * (mean - step.mean)
        cov = 0.81 * cov + 0.19 * stationary
        s = h @ cov @ h.T + np.diag(noise)
        k = cov @ h.T @ np.linalg.inv(s)
        chi_square = (value - h @ mean) @ np.linalg.solve(s, value - h @ mean)
        mean, cov = mean + k @ (value - h @ mean), (np.eye(n) - k @ h) @ cov
        assert np.allclose(law.mean, mean, rtol=1e-9, atol=1e-10)
        assert np.allclose(law.covariance, cov, rtol=1e-8, atol=1e-10)
        assert update.chi_square == pytest.approx(chi_square, rel=1e-9)


def test_stated_variance_is_that_of_a_series_with_an_error_that_lasts() -> None:
    lasting, noise, k = 0.5, 0.2, 30
    step = scalar(1.0, considered=1.0)

    def estimate(readings: np.ndarray) -> Law:
        law = stationary_law(step, 1)
        for value in readings:
            law = predicted(law, step)
            law = measured(law, reading(value, law, noise, lasting)).law
        return law

    weight = np.array([estimate(row).mean[0] for row in np.eye(k)])
    total = weight.sum()
    expected = (1.0 - total) ** 2 + (total * lasting) ** 2 + noise * np.sum(weight**2)
    stated = estimate(np.zeros(k)).covariance[0, 0]
    assert stated == pytest.approx(expected, rel=1e-9)
    assert stated > lasting**2 / (1.0 + lasting**2)


def test_considered_errors_without_memory_are_noise() -> None:
    law = stationary_law(scalar(0.5), 1)
    both = measured(law, reading(0.7, law, 0.2, 0.5))
    noise = measured(law, reading(0.7, law, 0.45))
    assert both.law.mean == pytest.approx(noise.law.mean, rel=1e-14)
    assert both.law.covariance == pytest.approx(noise.law.covariance, rel=1e-14)


def test_many_steps_keep_the_covariance_positive() -> None:
    # One state is seen to twelve digits, the other hardly: round-off of the short form would pass zero.
    step = Transition(
        matrix=np.diag([1.0, 0.999999]), mean=np.zeros(2), covariance=np.diag([1.0, 1.0]), considered=0.9
    )
    law = stationary_law(step, 1)
    rows = Measurement(
        innovation=np.zeros(2),
        jacobian=np.array([[1e6, 1.0], [1e6, 1.0 + 1e-6]]),
        considered=np.array([[1e-3], [0.0]]),
        noise=np.eye(2),
    )
    for _ in range(4000):
        law = measured(predicted(law, step), rows).law
    assert np.all(np.linalg.eigvalsh(law.covariance) > 0.0)
    assert np.all(np.isfinite(law.covariance))


def test_the_mean_of_the_other_states_follows_a_given_one() -> None:
    law = Law(mean=np.array([1.0, 2.0]), covariance=np.array([[4.0, 2.0], [2.0, 3.0]]), cross=np.zeros((2, 1)))
    mean, distance = given(law, 1, np.array([3.0]))
    assert mean == pytest.approx([3.0, 3.0])
    assert distance == pytest.approx(1.0)


def test_rates_keep_their_stationary_law_and_two_steps_are_one() -> None:
    std, rate = np.array([0.5, 0.2]), np.array([0.2, 0.3])
    one, two = with_rates(std, rate, 0.07), with_rates(std, rate, 0.14)
    assert np.allclose(one @ one, two, atol=1e-15)
    stationary = np.diag(np.concatenate([std, rate]) ** 2)
    assert np.all(np.linalg.eigvalsh(stationary - one @ stationary @ one.T) > 0.0)
    assert np.all(with_rates(std, 1e9 * rate, 0.07) == 0.0)
    assert decaying(np.array([2.0]), 1.0)[0] == pytest.approx(np.exp(-0.5))


def test_seen_errors_and_the_rest_add_up() -> None:
    rng = np.random.default_rng(1)
    strain, load = rng.standard_normal((8, 30)) * 0.5 ** np.arange(30), rng.standard_normal((5, 30))
    seen = seen_errors(strain, load, 1.0, np.ones(8))
    assert 0 < seen.strain.shape[1] < 8
    assert np.allclose(seen.strain @ seen.strain.T + seen.rest_strain, strain @ strain.T)
    assert np.allclose(seen.load @ seen.strain.T + seen.rest_cross, load @ strain.T)
    assert np.allclose(seen.load @ seen.load.T + seen.rest_load, load @ load.T)


def test_gauge_covariance_is_split_into_noise_common_and_lasting_errors() -> None:
    std, common = np.array([1.0, 1.5, 2.0, 1.0]), np.array([5.0, 5.0, 5.0, 5.0])
    covariance = np.diag(std**2) + np.outer(common, common)
    noise, columns, rest = white_and_lasting(covariance, std)
    assert np.allclose(noise, std**2)
    assert columns.shape == (4, 1)
    assert np.allclose(columns @ columns.T + rest + np.diag(noise), covariance)


def test_one_large_innovation_widens_nothing_a_window_of_them_does() -> None:
    held = Consistency()
    for i in range(3 * WINDOW):
        held = noted(held, 300.0 if i == 150 else 50.0, 50.0)
    assert held.widening == 1.0
    for _ in range(WINDOW):
        held = noted(held, 60.0, 50.0)
    assert held.widening > 1.0
    assert held.mean > 1.0 + band(50.0)
    for _ in range(20 * WINDOW):
        held = noted(held, 45.0, 50.0)
    assert held.widening == 1.0


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_time_steps_that_are_not_positive_are_refused(value: float) -> None:
    with pytest.raises(InputError, match=r"time_step: .* found, must be positive"):
        checked_time_step(value)
    with pytest.raises(InputError, match=r"time_constant: .* found, must be between 1e-09 and 1e"):
        FilterSettings(time_constant=value)
