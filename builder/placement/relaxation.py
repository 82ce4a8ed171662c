"""The convex relaxation of a choice of sites, and its duality gap: a bound that no choice can pass.

Every site a counts w_a times, 0 <= w_a <= 1, with the costs adding up to the budget. The criterion is convex in w,
so that for any w and every choice s

    f(s) >= f(w) + grad f(w) . (s - w) >= f(w) - gap,    gap = max over s of grad f(w) . (w - s),

where s may be any weights within budget: a fractional knapsack. Sites that exclude each other may both count in
the relaxation: the bound is then lower than it might be, and still one. Newton's method finds the minimum with a
logarithmic barrier on some hundred sites; sites with larger gradients join them until the gap is small.

Source: Joshi and Boyd, Sensor selection via convex optimization, IEEE Trans. Signal Process. 57 (2009) 451;
Jaggi, Revisiting Frank-Wolfe, ICML 2013 (gap); Boyd and Vandenberghe, Convex Optimization, 2004, chapters 10, 11.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.placement.gaussian_model import GaussianModel
from builder.placement.limits import Rules
from builder.reporting import Progress
from strainfmu.arrays import FloatArray, IntArray

JOIN = 60
"""Sites that join in a round at most."""

LEAVES = 1e-6
"""Weight below which a site leaves the round."""

ROUNDS, STEPS = 40, 60
"""Rounds, and Newton steps of each barrier, at most."""

BARRIERS = (1e-1, 1e-2, 1e-3, 2e-4)
"""Weights of the barrier, over the criterion and per site, in turn."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Relaxed:
    """The relaxation.

    Attributes
    ----------
    weight : (n_a,) of every site.
    value, bound : the criterion at ``weight``, and what no choice is below.
    gradient : (n_a,) of the criterion there.
    """

    weight: FloatArray
    value: float
    bound: float
    gradient: FloatArray


def relaxed(
    model: GaussianModel,
    rules: Rules,
    start: Sequence[int],
    tolerance: float = 1e-3,
    progress: Progress | None = None,
) -> Relaxed:
    """Return the relaxation to a gap of ``tolerance`` times the criterion; ``start`` is a choice of sites."""
    forced = list(rules.forced)
    known, budget = model.with_known(forced), rules.remaining_budget(forced)
    free, scale = rules.free, _scale(model)
    active = np.array([site for site in start if site not in set(forced)], dtype=np.int64)
    weight = np.zeros(model.n_sites)
    best: Relaxed | None = None
    if budget <= 0.0 or rules.cost[free].sum() <= budget:
        every = np.zeros(model.n_sites)
        every[[*forced, *(free if budget > 0.0 else ())]] = 1.0
        value = model.value(np.flatnonzero(every))
        return Relaxed(weight=every, value=value, bound=value, gradient=np.zeros(model.n_sites))
    for number in range(ROUNDS):
        if rules.cost[active].sum() > budget * (1.0 + 1e-9) and number > 0:
            within = _newton(known.of_sites(active), rules.cost[active], budget, weight[active], scale)
            weight = np.zeros(model.n_sites)
            weight[active] = within
        else:
            weight[active] = 1.0
        value, gradient = _value_and_gradient(known, active, weight[active])
        lowest = knapsack(-gradient[free], rules.cost[free], budget)
        gap = float(gradient @ weight - gradient[free] @ lowest)
        if best is None or value - gap > best.bound:
            all_weights = weight.copy()
            all_weights[forced] = 1.0
            best = Relaxed(weight=all_weights, value=value, bound=value - gap, gradient=gradient)
        size = abs(value) if model.criterion == "trace" else scale
        if progress is not None:
            progress(number + 1, ROUNDS)
        if gap <= tolerance * size:
            break
        active = _joined(active[weight[active] > LEAVES], free, gradient / rules.cost, number)
    assert best is not None
    return best


def knapsack(worth: FloatArray, cost: FloatArray, budget: float) -> FloatArray:
    """Return weights (n,) in 0 .. 1 with the largest ``worth`` in all whose cost is within ``budget``."""
    order = np.argsort(-worth / cost, kind="stable")
    order = order[worth[order] > 0.0]
    spent = np.cumsum(cost[order])
    weight = np.zeros(len(worth))
    weight[order] = np.clip((budget - (spent - cost[order])) / cost[order], 0.0, 1.0)
    return weight


def _scale(model: GaussianModel) -> float:
    """Return the size that the gap is compared with: of a log determinant, its number of unknowns."""
    return abs(model.value([])) if model.criterion == "trace" else float(model.precision.shape[1])


def _joined(active: IntArray, free: IntArray, gradient: FloatArray, number: int) -> IntArray:
    """Return ``active`` and the free sites of the largest gradients per cost."""
    outside = np.setdiff1d(free, active)
    order = np.argsort(gradient[outside], kind="stable")[: JOIN if number else 2 * JOIN]
    return np.sort(np.concatenate([active, outside[order]]))


def _value_and_gradient(model: GaussianModel, active: IntArray, weight: FloatArray) -> tuple[float, FloatArray]:
    """Return the criterion and its gradient (n_a,) by the weight of every site."""
    precision = model.precision_with(active, weight)
    covariance = np.linalg.inv(precision)
    gradient = np.zeros(model.n_sites)
    for s, (rows, posterior) in enumerate(zip(model.rows, covariance, strict=True)):
        if model.criterion == "determinant":
            gradient -= model.weight[s] * np.einsum("abm,abm->a", rows @ posterior, rows)
        else:
            gradient -= model.weight[s] * np.sum((rows @ (posterior @ model.goals[s].T)) ** 2, axis=(1, 2))
    return model.value_of(precision), gradient


def _newton(model: GaussianModel, cost: FloatArray, budget: float, start: FloatArray, scale: float) -> FloatArray:
    """Return the weights (n_a,) of the minimum over all sites of ``model``, whose costs add up to ``budget``."""
    even = budget / cost.sum()
    weight = 0.9 * np.clip(start, 0.0, 1.0) * min(1.0, budget / max(float(cost @ start), 1e-300)) + 0.1 * even
    weight *= budget / float(cost @ weight)
    weight = np.clip(weight, 1e-6 * even, 1.0 - 1e-6 * (1.0 - even))
    weight += (budget - float(cost @ weight)) * cost / float(cost @ cost)
    if weight.min() <= 0.0 or weight.max() >= 1.0:
        weight = np.full(len(cost), even)
    size = abs(model.value(np.arange(model.n_sites), weight)) if model.criterion == "trace" else scale
    for barrier in BARRIERS:
        weight = _centred(model, cost, weight, barrier * size / len(cost))
    return weight


def _centred(model: GaussianModel, cost: FloatArray, weight: FloatArray, barrier: float) -> FloatArray:
    """Return the minimum of criterion plus barrier, by Newton steps from ``weight``."""
    every = np.arange(model.n_sites)

    def merit(weights: FloatArray) -> float:
        return model.value(every, weights) - barrier * float(np.sum(np.log(weights) + np.log1p(-weights)))

    current = merit(weight)
    for _ in range(STEPS):
        gradient, hessian = _derivatives(model, weight)
        gradient = gradient - barrier * (1.0 / weight - 1.0 / (1.0 - weight))
        hessian[every, every] += barrier * (weight**-2 + (1.0 - weight) ** -2)
        solved = np.linalg.solve(hessian, np.column_stack([gradient, cost]))
        step = -(solved[:, 0] - solved[:, 1] * (cost @ solved[:, 0]) / (cost @ solved[:, 1]))
        decrement = -float(gradient @ step)
        if decrement <= 0.2 * barrier:
            break
        falls = np.where(step < 0.0, -step / weight, step / (1.0 - weight))
        length = min(1.0, 0.95 / max(float(falls.max()), 1e-300))
        while (reached := merit(weight + length * step)) > current - 0.1 * length * decrement and length > 1e-8:
            length *= 0.5
        if length <= 1e-8:
            break
        weight, current = weight + length * step, reached
    return weight


def _derivatives(model: GaussianModel, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return gradient (n,) and Hessian (n, n) of the criterion by the weights of all sites."""
    every = np.arange(model.n_sites)
    covariance = np.linalg.inv(model.precision_with(every, weight))
    n, b = model.n_sites, model.rows.shape[2]
    gradient, hessian = np.zeros(n), np.zeros((n, n))
    for s, (rows, posterior) in enumerate(zip(model.gauge_rows(every), covariance, strict=True)):
        row_covariance = rows @ posterior
        between = row_covariance @ rows.T
        if model.criterion == "determinant":
            first, second = np.diag(between), between * between
        else:
            of_goals = row_covariance @ model.goals[s].T
            first, second = np.sum(of_goals**2, axis=1), 2.0 * between * (of_goals @ of_goals.T)
        gradient -= model.weight[s] * first.reshape(n, b).sum(axis=1)
        hessian += model.weight[s] * second.reshape(n, b, n, b).sum(axis=(1, 3))
    return gradient, hessian
