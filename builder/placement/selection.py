"""Choice of sites: greedy, and exchanges until none is left that improves the criterion.

There is no hidden randomness: starts are drawn with their number as the seed, and of sites that are worth the same
within 1e-9 the first is taken.

Source: Fedorov, Theory of Optimal Experiments, 1972 (exchange); Minoux, Accelerated greedy algorithms, 1978.
"""

from collections.abc import Sequence

import numpy as np

from builder.placement.gaussian_model import GaussianModel, Posterior
from builder.placement.limits import Rules
from builder.reporting import Progress
from strainfmu.arrays import FloatArray, IntArray

BLOCK = 512
"""Sites whose worth is brought up to date together."""

ALIKE, IMPROVES = 1e-9, 1e-7
"""Relative difference of two sites' worth that does not count, and of a criterion that an exchange must bring."""

LARGEST_PASSES = 50


def first_of_best(worth: FloatArray) -> int:
    """Return the first index of ``worth`` within :data:`ALIKE` of the largest."""
    best = float(worth.max())
    return int(np.flatnonzero(worth >= best - ALIKE * abs(best))[0])


def greedy(
    model: GaussianModel, rules: Rules, chosen: Sequence[int] = (), progress: Progress | None = None
) -> list[int]:
    """Return ``chosen`` and further sites, each next one that with the largest gain per cost, up to the budget.

    Gains are taken to fall from site to site, which holds exactly for the determinant: a site whose last known
    gain is below the best one that is up to date is not worked out again (lazy greedy).
    """
    sites = list(chosen)
    posterior = Posterior(model, sites)
    worth = posterior.gains() / rules.cost
    fresh = np.ones(model.n_sites, dtype=bool)
    while (allowed := rules.allowed(sites)).any():
        site = _lazily_best(posterior, rules, worth, fresh, allowed)
        posterior.add(site)
        sites.append(site)
        fresh[:] = False
        if progress is not None:
            progress(int(rules.cost[sites].sum()), int(rules.budget))
    return sites


def _lazily_best(
    posterior: Posterior, rules: Rules, worth: FloatArray, fresh: np.ndarray, allowed: np.ndarray
) -> int:
    """Return the best of the ``allowed`` sites, ``worth`` and ``fresh`` updated in place."""
    while True:
        known = allowed & fresh
        best = float(worth[known].max()) if known.any() else -np.inf
        old = np.flatnonzero(allowed & ~fresh & (worth >= best - ALIKE * abs(best)))
        if not len(old):
            return first_of_best(np.where(known, worth, -np.inf))
        order = old[np.argsort(-worth[old], kind="stable")[:BLOCK]]
        order.sort()
        worth[order] = posterior.gains(order) / rules.cost[order]
        fresh[order] = True


def exchanged(
    model: GaussianModel, rules: Rules, chosen: Sequence[int], progress: Progress | None = None
) -> list[int]:
    """Return ``chosen`` after exchanges of one site against another, the best one for each place in turn.

    Ends where a whole pass brings nothing; forced sites stay. What is left of the budget is spent first.
    """
    sites, forced = greedy(model, rules, chosen), set(rules.forced)
    for number in range(LARGEST_PASSES):
        posterior = Posterior(model, sites)  # new in every pass: errors of updates do not add up
        value, changed = model.value(sites), False
        for place, site in enumerate(sites):
            if site in forced:
                continue
            remaining = sites[:place] + sites[place + 1 :]
            allowed = rules.allowed(remaining)
            worth = np.where(allowed, posterior.gains_without(site), -np.inf)
            best = first_of_best(worth)
            if worth[best] > worth[site] + IMPROVES * abs(value):
                posterior.remove(site)
                posterior.add(best)
                sites[place], changed = best, True
            if progress is not None:
                progress(number * len(sites) + place + 1, (number + 1) * len(sites))
        if not changed:
            break
    return greedy(model, rules, sites)


def rounded(weight: FloatArray, rules: Rules, seed: int | None = None) -> list[int]:
    """Return sites by falling ``weight`` (n_a,) of a relaxation as far as the rules allow, the forced ones first.

    With a ``seed`` they are drawn, with probabilities by their weight.
    """
    sites, key = list(rules.forced), weight.copy()
    if seed is not None:
        exponential = np.random.default_rng(seed).exponential(size=len(weight))
        key = weight / exponential  # exponential race: an order without replacement in proportion to the weights
    order = np.argsort(-key, kind="stable")
    blocked, remaining = rules.excluded_by(sites), rules.remaining_budget(sites)
    pointer, index = rules.excludes.indptr, rules.excludes.indices
    for site in order[key[order] > 0.0].tolist():
        if not blocked[site] and rules.cost[site] <= remaining + ALIKE:
            sites.append(site)
            remaining -= float(rules.cost[site])
            blocked[site] = True
            blocked[index[pointer[site] : pointer[site + 1]]] = True
    return sites


def best_of_starts(
    model: GaussianModel, rules: Rules, starts: Sequence[Sequence[int]], progress: Progress | None = None
) -> list[int]:
    """Return the best choice that exchanges reach from ``starts``; of equal ones the first."""
    best: list[int] = []
    value = np.inf
    for number, start in enumerate(starts):
        sites = exchanged(model, rules, start)
        reached = model.value(sites)
        if reached < value - ALIKE * abs(reached) if np.isfinite(value) else True:
            best, value = sites, reached
        if progress is not None:
            progress(number + 1, len(starts))
    return best


def marginal_worth(model: GaussianModel, chosen: Sequence[int] | IntArray) -> FloatArray:
    """Return (k,) what the criterion rises by without each of ``chosen``."""
    value = model.value(chosen)
    sites = list(chosen)
    return np.array([model.value(sites[:k] + sites[k + 1 :]) - value for k in range(len(sites))])
