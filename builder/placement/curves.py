"""Accuracy against the number of gauges and their noise, of the placement and of others."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from builder.placement.design import Aim, Study, aimed
from builder.placement.flight_models import flight_model
from builder.placement.gaussian_model import GaussianModel
from builder.placement.limits import Limits, rules_of
from builder.placement.rivals import even_sites, qr_sites
from builder.placement.selection import best_of_starts, greedy, rounded
from builder.reporting import Progress
from strainfmu.arrays import FloatArray, IntArray

COUNTS = (6, 9, 12, 18, 24, 36, 54, 72)
"""Numbers of gauges that are drawn."""

NOISES = (0.5, 1.0, 2.0)
"""Noise of the gauges over the noise of the vehicle file."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Curves:
    """Sigmas over the sigmas of the layout in use with the noise of the file.

    Attributes
    ----------
    counts : (n,) numbers of gauges.
    placed : (n_noises, n, 5) of placements, by noise of :data:`NOISES`.
    qr, even : (n, 5) of layouts by QR and of evenly spread rows.
    own_count : gauges of the layout in use, whose sigmas are 1.
    own_name : its name.
    """

    counts: tuple[int, ...]
    placed: FloatArray
    qr: FloatArray
    even: FloatArray
    own_count: int
    own_name: str


def accuracy_curves(study: Study, limits: Limits, aim: Aim, progress: Progress | None = None) -> Curves:
    """Return the curves of a study; each placement is the best of exchanges from greedy choice, QR and rows.

    Gauges are counted whatever ``limits`` counts. Numbers that its distances and zones leave no room for, and
    those below the gauges that are kept, are left out.
    """
    free = replace(limits, budget=None, gauges=max(1, len(study.kept)), costs={})
    offered = [*range(study.offered), *study.kept]
    forced = list(range(study.offered, len(offered)))
    candidates = replace(study.candidates, sites=study.candidates.sites[offered])
    left, rules = rules_of(candidates, free, forced)
    number = {tuple(site): k for k, site in reversed(list(enumerate(study.candidates.sites.tolist())))}
    of_study = np.array([number[tuple(site)] for site in left.sites.tolist()], dtype=np.int64)
    counts = [one for one in COUNTS if len(study.kept) <= one <= left.n_gauges.sum()]
    placed, done = np.full((len(NOISES), len(counts), 5), np.nan), 0
    for i, noise in enumerate(NOISES):
        model, weighed = _with_noise(study, aim, noise)
        inside = weighed.of_sites(of_study)
        for k, count in enumerate(counts):
            allowed = replace(rules, budget=float(count))
            starts = [greedy(inside, allowed, allowed.forced)]
            for rival in (qr_sites(study, count), even_sites(study, count)):
                starts.append(rounded(_by_rank(of_study, rival), allowed))
            chosen = best_of_starts(inside, allowed, starts)
            if float(rules.cost[chosen].sum()) == count:
                placed[i, k] = _ratio(model, of_study[chosen].tolist())
            done += 1
            if progress is not None:
                progress(done, len(NOISES) * len(counts))
    return Curves(
        counts=tuple(counts),
        placed=placed,
        qr=np.array([_ratio(study.model, qr_sites(study, one)) for one in counts]),
        even=np.array([_ratio(study.model, even_sites(study, one)) for one in counts]),
        own_count=int(study.candidates.n_gauges[list(study.own)].sum()),
        own_name=study.parts.vehicle.gauges.layout,
    )


def _by_rank(of_study: IntArray, sites: list[int]) -> FloatArray:
    """Return (n,) weights that fall along ``sites``, 0 for all others of ``of_study``."""
    rank = {site: number for number, site in enumerate(sites)}
    return np.array([1.0 / (1.0 + rank[one]) if one in rank else 0.0 for one in of_study.tolist()])


def _ratio(model: GaussianModel, sites: list[int]) -> FloatArray:
    return np.asarray(np.sqrt(model.weight @ model.goal_variance(sites)))


def _with_noise(study: Study, aim: Aim, noise: float) -> tuple[GaussianModel, GaussianModel]:
    """Return the models of the coefficients and of the aim with other gauge noise."""
    if noise == 1.0:
        return study.model, aimed(study, aim)
    parts = replace(study.parts, noise_std=noise * study.parts.noise_std)
    model = flight_model(parts, study.strain, study.candidates.sites, study.kind)
    scale = study.own_sigma
    model = replace(model, goals=model.goals / scale[:, None], fixed=model.fixed / scale**2)
    return model, aimed(replace(study, parts=parts, model=model), aim)
