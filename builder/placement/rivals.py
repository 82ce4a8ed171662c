"""Other ways to place gauges, to compare with: pivoted QR of the modes' strain, evenly spread rows, at random.

Source: Manohar, Brunton, Kutz and Brunton, Data-driven sparse sensor placement, IEEE Control Syst. 38 (2018) 63,
which PySensors implements.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr

from builder.placement.design import Study
from builder.placement.gaussian_model import GaussianModel
from builder.placement.rules import Rules
from strainfmu.arrays import FloatArray

ROWS = (0.0, 90.0, 180.0, 270.0)
"""Roll angles of evenly spread rows [deg]: axial gauges on all, hoop gauges on the first and the third."""


def strain_modes(study: Study, count: int) -> FloatArray:
    """Return (n_a, count) the modes of the strain that the flows make at the first gauge of every offered site."""
    flown = study.parts.ensemble.responses(study.parts.basis.fields.T)
    first = study.candidates.sites[: study.offered, 0]
    left, _, _ = np.linalg.svd(study.strain.strain[first] @ flown.T, full_matrices=False)
    return np.asarray(left[:, :count])


def qr_sites(study: Study, count: int) -> list[int]:
    """Return ``count`` offered sites by QR with column pivoting of as many strain modes."""
    modes = strain_modes(study, count)
    _, _, pivots = qr(modes.T, mode="economic", pivoting=True)
    return [int(one) for one in pivots[:count]]


def even_sites(study: Study, count: int) -> list[int]:
    """Return ``count`` offered sites in rows of evenly spaced stations, or fewer where rows have no candidates."""
    candidates, found = study.candidates, list[int]()
    first = candidates.sites[: study.offered, 0]
    x = candidates.x[first]
    roll = np.degrees(candidates.roll_angle[first]) % 360.0
    kind = np.array([candidates.kind[one] for one in first])
    stations = np.unique(x)
    each = max(1, -(-count // 6))
    wanted = stations[np.round(np.linspace(0, len(stations) - 1, min(each, len(stations)))).astype(int)]
    for station in wanted:
        for number, angle in enumerate(ROWS):
            for name in ("axial", "hoop") if number % 2 == 0 else ("axial",):
                apart = np.abs((roll - angle + 180.0) % 360.0 - 180.0)
                there = np.flatnonzero((x == station) & (kind == name))
                if len(there):
                    found.append(int(there[np.argmin(apart[there])]))
    return found[:count]


def best_of_random(model: GaussianModel, rules: Rules, draws: int, seed: int = 0) -> list[int]:
    """Return the best of ``draws`` choices at random that keep the rules."""
    random, best, value = np.random.default_rng(seed), list[int](), np.inf
    for _ in range(draws):
        chosen = list(rules.forced)
        blocked, left = rules.excluded_by(chosen), rules.left(chosen)
        for site in random.permutation(model.n_sites).tolist():
            if not blocked[site] and rules.cost[site] <= left + 1e-9:
                chosen.append(site)
                left -= float(rules.cost[site])
                blocked |= rules.excluded_by([site])
            if left < rules.cost.min():
                break
        reached = model.value(chosen)
        if reached < value:
            best, value = chosen, reached
    return best
