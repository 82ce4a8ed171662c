"""Loss of one gauge or of two: effect on the sigmas, and placements that bear any."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.placement.gaussian_model import GaussianModel, Posterior
from builder.placement.limits import Rules
from builder.reporting import Progress
from strainfmu.arrays import FloatArray, IntArray

LARGEST_RATIO = 1.3
"""Largest sigma after the loss over the sigma with all gauges."""

PENALTY = 10.0
"""Weight of what a ratio's square is beyond the largest, over the criterion."""

TRIED, LARGEST_PASSES = 24, 12


@dataclass(frozen=True, eq=False, kw_only=True)
class LostGauge:
    """The loss of each gauge of a placement.

    Attributes
    ----------
    gauges : (k,) numbers of the gauges.
    ratio : (k, n_g) sigma of each goal without it, over the sigma with all; root mean squares over the states.
    pair_ratio : (k, k, n_g) the same without two; None where only single losses count.
    """

    gauges: IntArray
    ratio: FloatArray
    pair_ratio: FloatArray | None = None

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Pairs whose loss raises a sigma beyond :data:`LARGEST_RATIO`, the worst first."""
        if self.pair_ratio is None:
            return []
        worst = np.triu(self.pair_ratio.max(axis=2), k=1)
        first, second = np.nonzero(worst > LARGEST_RATIO)
        order = np.argsort(-worst[first, second], kind="stable")
        return list(zip(first[order].tolist(), second[order].tolist(), strict=True))


def lost_gauges(
    model: GaussianModel, sites: Sequence[int] | IntArray, gauges: IntArray, losses: int = 1
) -> LostGauge:
    """Return the effect of the loss of each of ``gauges`` on the goals.

    They are the gauges of ``sites`` one after another. With ``losses`` = 2 it includes the loss of each pair.
    """
    pairs = pair_loss_ratios(model, sites) if losses > 1 else None
    return LostGauge(gauges=gauges, ratio=loss_ratios(model, sites), pair_ratio=pairs)


def _seen(model: GaussianModel, sites: Sequence[int] | IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (n_s, k, k) h_i' P h_j of the gauges of ``sites``, (n_s, k, n_g) G P h, and (n_g,) the variances."""
    rows = model.gauge_rows(sites)
    rows = rows[:, np.any(rows != 0.0, axis=(0, 2))]
    covariance = np.linalg.inv(model.precision_with(sites))
    row_covariance = rows @ covariance
    of_goals = row_covariance @ np.swapaxes(model.goals, 1, 2)
    variance = model.weight @ (model.fixed + np.einsum("sgm,smn,sgn->sg", model.goals, covariance, model.goals))
    return row_covariance @ np.swapaxes(rows, 1, 2), of_goals, np.asarray(variance)


def loss_ratios(model: GaussianModel, sites: Sequence[int] | IntArray) -> FloatArray:
    """Return (k, n_g) ratios of the sigmas without each gauge of ``sites`` to the sigmas with all.

    Without a gauge h the variance of goals G z grows by (G P h)^2 / (1 - h' P h).
    """
    between, of_goals, variance = _seen(model, sites)
    redundancy = np.maximum(1.0 - np.diagonal(between, axis1=1, axis2=2), 1e-12)
    grown = np.einsum("s,skg->kg", model.weight, of_goals**2 / redundancy[..., None])
    return np.asarray(np.sqrt(1.0 + grown / variance))


def pair_loss_ratios(model: GaussianModel, sites: Sequence[int] | IntArray) -> FloatArray:
    """Return (k, k, n_g) ratios of the sigmas without each two gauges of ``sites``; 1 on the diagonal.

    Without gauges H the variance of goals G z grows by (G P H') (1 - H P H')^-1 (G P H')'.
    """
    between, of_goals, variance = _seen(model, sites)
    redundancy = np.maximum(1.0 - np.diagonal(between, axis1=1, axis2=2), 1e-12)
    determinant = np.maximum(redundancy[:, :, None] * redundancy[:, None, :] - between**2, 1e-18)
    k = between.shape[1]
    grown = np.zeros((k, k, len(variance)))
    for weight, goals, alone, both, pair in zip(
        model.weight, of_goals, redundancy, between, determinant, strict=True
    ):
        square = goals**2
        of_each = square[:, None] * alone[None, :, None] + square[None] * alone[:, None, None]
        grown += weight * (of_each + 2.0 * both[..., None] * goals[:, None] * goals[None]) / pair[..., None]
    grown[np.arange(k), np.arange(k)] = 0.0
    return np.asarray(np.sqrt(1.0 + grown / variance))


def without_weak_points(
    model: GaussianModel,
    goals: GaussianModel,
    rules: Rules,
    chosen: Sequence[int],
    progress: Progress | None = None,
    losses: int = 1,
) -> list[int]:
    """Return ``chosen`` after exchanges that lower the criterion with a penalty on losses that it cannot bear.

    ``model`` has the criterion, ``goals`` the goals that ``losses`` gauges lost together are judged by. For each
    place the sites that lower the criterion most are tried; the placement ends where none of them improves.
    """
    sites, forced = list(chosen), set(rules.forced)
    ratios = loss_ratios if losses == 1 else pair_loss_ratios

    def merit(sites: Sequence[int]) -> float:
        excess = np.maximum(ratios(goals, sites) ** 2 / LARGEST_RATIO**2 - 1.0, 0.0)
        value = model.value(sites)
        return value + abs(value) * PENALTY * float(excess.sum())

    current = merit(sites)
    for number in range(LARGEST_PASSES):
        if ratios(goals, sites).max() <= LARGEST_RATIO:
            break
        changed, posterior = False, Posterior(model, sites)
        for place, site in enumerate(list(sites)):
            if site in forced:
                continue
            remaining = sites[:place] + sites[place + 1 :]
            worth = np.where(rules.allowed(remaining), posterior.gains_without(site), -np.inf)
            worth[site] = -np.inf
            tried = [new for new in np.argsort(-worth, kind="stable")[:TRIED].tolist() if np.isfinite(worth[new])]
            merits = [merit([*remaining, new]) for new in tried]
            if merits and min(merits) < current * (1.0 - 1e-9 * np.sign(current)):
                best = tried[int(np.argmin(merits))]
                posterior.remove(site)
                posterior.add(best)
                sites[place], current, changed = best, min(merits), True
            if progress is not None:
                progress(number * len(sites) + place + 1, LARGEST_PASSES * len(sites))
        if not changed:
            break
    return sites
