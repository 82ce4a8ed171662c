"""Loss of one gauge: what it does to the sigmas, and placements that bear any."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.placement.gaussian_model import GaussianModel, Posterior
from builder.placement.rules import Rules
from builder.reporting import Progress
from strainfmu.arrays import FloatArray, IntArray

LARGEST_RATIO = 1.3
"""Largest sigma after the loss of any one gauge over the sigma with all."""

PENALTY = 10.0
"""Weight of what a ratio's square is beyond the largest, over the criterion."""

TRIED, LARGEST_PASSES = 24, 12


@dataclass(frozen=True, eq=False, kw_only=True)
class LostGauge:
    """The loss of each gauge of a placement.

    Attributes
    ----------
    gauges : (k,) numbers of the gauges.
    ratio : (k, n_g) sigma of each goal without it, over that with all; root mean squares over the states.
    """

    gauges: IntArray
    ratio: FloatArray


def lost_gauges(model: GaussianModel, sites: Sequence[int] | IntArray, gauges: IntArray) -> LostGauge:
    """Return what the loss of each of ``gauges``, the gauges of ``sites`` one after another, does to the goals."""
    ratio = loss_ratios(model, sites)
    return LostGauge(gauges=gauges, ratio=ratio)


def loss_ratios(model: GaussianModel, sites: Sequence[int] | IntArray) -> FloatArray:
    """Return (k, n_g) ratios of the sigmas without each gauge of ``sites`` to those with all.

    Without a gauge h the variance of goals G z grows by (G P h)^2 / (1 - h' P h).
    """
    rows = model.gauge_rows(sites)
    rows = rows[:, np.any(rows != 0.0, axis=(0, 2))]
    covariance = np.linalg.inv(model.precision_with(sites))
    seen = rows @ covariance
    own = np.einsum("skm,skm->sk", seen, rows)
    of_goals = seen @ np.swapaxes(model.goals, 1, 2)
    variance = model.weight @ (model.fixed + np.einsum("sgm,smn,sgn->sg", model.goals, covariance, model.goals))
    grown = np.einsum("s,skg->kg", model.weight, of_goals**2 / np.maximum(1.0 - own, 1e-12)[..., None])
    return np.asarray(np.sqrt(1.0 + grown / variance))


def without_weak_points(
    model: GaussianModel,
    goals: GaussianModel,
    rules: Rules,
    chosen: Sequence[int],
    progress: Progress | None = None,
) -> list[int]:
    """Return ``chosen`` after exchanges that lower the criterion with a penalty on losses that it cannot bear.

    ``model`` has the criterion, ``goals`` the goals that losses are judged by. For each place the sites that lower
    the criterion most are tried; the placement ends where none of them improves.
    """
    found, forced = list(chosen), set(rules.forced)

    def merit(sites: Sequence[int]) -> float:
        excess = np.maximum(loss_ratios(goals, sites) ** 2 / LARGEST_RATIO**2 - 1.0, 0.0)
        value = model.value(sites)
        return value + abs(value) * PENALTY * float(excess.sum())

    current = merit(found)
    for number in range(LARGEST_PASSES):
        if loss_ratios(goals, found).max() <= LARGEST_RATIO:
            break
        changed, posterior = False, Posterior(model, found)
        for place, site in enumerate(list(found)):
            if site in forced:
                continue
            others = found[:place] + found[place + 1 :]
            worth = np.where(rules.allowed(others), posterior.gains_without(site), -np.inf)
            worth[site] = -np.inf
            tried = [one for one in np.argsort(-worth, kind="stable")[:TRIED].tolist() if np.isfinite(worth[one])]
            merits = [merit([*others, one]) for one in tried]
            if merits and min(merits) < current * (1.0 - 1e-9 * np.sign(current)):
                best = tried[int(np.argmin(merits))]
                posterior.remove(site)
                posterior.add(best)
                found[place], current, changed = best, min(merits), True
            if progress is not None:
                progress(number * len(found) + place + 1, LARGEST_PASSES * len(found))
        if not changed:
            break
    return found
