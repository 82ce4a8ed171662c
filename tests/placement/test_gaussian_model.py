"""Criterion and choice against closed forms and against all subsets."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from gaussian_case import count_rules, random_model

from builder.placement.gaussian_model import Criterion, GaussianModel, Posterior
from builder.placement.limits import Rules
from builder.placement.lost_gauge import LARGEST_RATIO, loss_ratios, without_weak_points
from builder.placement.relaxation import knapsack, relaxed
from builder.placement.selection import best_of_starts, exchanged, greedy, marginal_worth, rounded

pytestmark = pytest.mark.fast


def by_joint_covariance(model: GaussianModel, sites: list[int]) -> float:
    """The mean trace by conditioning the joint normal of goals and readings, which needs no information form."""
    total = 0.0
    for s, weight in enumerate(model.weight):
        prior, h = np.linalg.inv(model.precision[s]), model.gauge_rows(sites)[s]
        cross = model.goals[s] @ prior @ h.T
        readings = h @ prior @ h.T + np.eye(len(h))
        after = model.goals[s] @ prior @ model.goals[s].T - cross @ np.linalg.solve(readings, cross.T)
        total += weight * np.trace(after)
    return total


@pytest.mark.parametrize("b", [1, 3])
def test_the_criterion_is_the_covariance_of_a_linear_gaussian_model(b: int) -> None:
    model, sites = random_model(1, b=b), [4, 7, 1]
    assert model.value(sites) == pytest.approx(by_joint_covariance(model, sites), rel=1e-12)
    fixed = float(model.weight @ model.fixed.sum(axis=1))
    whole = float(model.weight @ model.goal_variance(sites).sum(axis=1))
    assert whole == pytest.approx(model.value(sites) + fixed, rel=1e-12)


@pytest.mark.parametrize("criterion", ["trace", "determinant"])
@pytest.mark.parametrize("b", [1, 2])
def test_gains_are_differences_of_the_criterion(criterion: Criterion, b: int) -> None:
    """After sites were taken and taken away, for all sites and for some, and with a site left out."""
    model = random_model(2, b=b, criterion=criterion)
    posterior = Posterior(model, [3])
    for site in (0, 5, 9):
        posterior.add(site)
    posterior.gains(np.array([2, 4]))
    posterior.remove(5)
    now, without = model.value([3, 0, 9]), model.value([3, 9])
    np.testing.assert_allclose(posterior.gains(), [now - model.value([3, 0, 9, k]) for k in range(12)], rtol=1e-9)
    np.testing.assert_allclose(
        posterior.gains_without(0), [without - model.value([3, 9, k]) for k in range(12)], rtol=1e-9
    )
    np.testing.assert_allclose(marginal_worth(model, [3, 0, 9])[1], without - now, rtol=1e-9)


@pytest.mark.parametrize("criterion", ["trace", "determinant"])
@pytest.mark.parametrize("b", [1, 2])
def test_exchanges_find_the_best_of_all_subsets_and_the_bound_is_below_it(criterion: Criterion, b: int) -> None:
    for seed in range(2):
        model = random_model(seed, b=b, criterion=criterion)
        rules = count_rules(model, 4)
        best = min(model.value(one) for one in combinations(range(12), 4))
        first = greedy(model, rules)
        relaxation = relaxed(model, rules, first, tolerance=1e-4)
        starts = [
            first,
            rounded(relaxation.weight, rules),
            *(rounded(relaxation.weight, rules, k) for k in range(8)),
        ]
        assert model.value(best_of_starts(model, rules, starts)) == pytest.approx(best, rel=1e-9)
        assert best - 0.6 * abs(best) < relaxation.bound <= min(best, relaxation.value)
        assert relaxation.weight.sum() == pytest.approx(4.0)


def test_the_bound_is_exact_where_no_choice_is_left() -> None:
    model = random_model(3)
    rules = count_rules(model, 12)
    assert relaxed(model, rules, greedy(model, rules)).bound == pytest.approx(model.value(range(12)), rel=1e-12)


def test_the_knapsack_is_the_linear_programme() -> None:
    from scipy.optimize import linprog

    random = np.random.default_rng(4)
    worth, cost = random.normal(size=20), random.uniform(0.5, 2.0, 20)
    found = linprog(-worth, A_ub=cost[None], b_ub=[5.0], bounds=(0.0, 1.0))
    assert worth @ knapsack(worth, cost, 5.0) == pytest.approx(-found.fun, rel=1e-9)


def test_of_equal_sites_the_first_is_taken_each_time() -> None:
    model = random_model(5)
    twice = replace(model, rows=np.concatenate([model.rows, model.rows * (1.0 + 1e-13)], axis=1))
    rules = count_rules(twice, 3)
    one, other = (exchanged(twice, rules, greedy(twice, rules)) for _ in range(2))
    assert one == other
    assert greedy(twice, rules)[0] < 12
    assert greedy(model, count_rules(model, 3))[0] == greedy(twice, rules)[0]
    drawn = [rounded(np.linspace(0.1, 0.9, 24), rules, seed) for seed in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]


def test_loss_of_a_gauge_is_the_placement_without_it() -> None:
    model, sites = random_model(6), [1, 3, 5, 7, 9]
    ratio = loss_ratios(model, sites)
    whole = model.weight @ model.goal_variance(sites)
    for k in range(len(sites)):
        left = model.weight @ model.goal_variance(sites[:k] + sites[k + 1 :])
        np.testing.assert_allclose(ratio[k], np.sqrt(left / whole), rtol=1e-9)


def test_a_robust_placement_bears_any_loss_where_one_of_all_subsets_does() -> None:
    found = 0
    for seed in range(8):
        model = random_model(seed, n_sites=11)
        rules: Rules = count_rules(model, 7)
        start = exchanged(model, rules, greedy(model, rules))
        borne = [one for one in combinations(range(11), 7) if loss_ratios(model, list(one)).max() <= LARGEST_RATIO]
        chosen = without_weak_points(model, model, rules, start)
        assert loss_ratios(model, chosen).max() <= max(LARGEST_RATIO, loss_ratios(model, start).max())
        found += (
            bool(borne) and loss_ratios(model, chosen).max() <= LARGEST_RATIO < loss_ratios(model, start).max()
        )
    assert found > 0


def test_two_models_make_one_criterion() -> None:
    """Each its part, with unknowns that only one has; states that are left out have no weight."""
    first, second = random_model(5), random_model(6)
    fewer = replace(
        second, rows=second.rows[..., :4], precision=second.precision[:, :4, :4], goals=second.goals[..., :4]
    )
    sites = [1, 5, 8]
    both = first.joined(fewer, 0.3)
    assert both.value(sites) == pytest.approx(0.3 * first.value(sites) + 0.7 * fewer.value(sites), rel=1e-12)
    assert both.weight.sum() == pytest.approx(1.0)
    one, other = first.of_states(slice(0, None, 2)), first.of_states(slice(1, None, 2))
    parts = 0.7 * one.value(sites) + 0.3 * other.value(sites)
    assert first.value(sites) == pytest.approx(parts, rel=1e-12)
