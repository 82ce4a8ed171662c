"""What gauges see of the pressures that fly: the share of the snapshots' variance that the data remove.

Pressure is written in all POD modes of the snapshots, p = p_mean + V c with c_j of standard deviation s_j. A map
estimates c from d - m = Z_p V c + noise as X T (d - m), X the modal coefficients of its states. So its error is
c - X T (Z_p V c + N n), and [(I - X T Z_p V) diag(s), X T N] is a factor C of the error's covariance C C'.
Truncated modes act in it as what they are, pressure that no state holds. The best that a linear map can do is the
same with Bayes' gain (gamma = 1) on all modes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.aero.surface_mesh import SurfaceMesh
from builder.inverse.case_2 import gaussian_map
from builder.inverse.noise_model import NoiseModel
from builder.inverse.pod import PressureModes, area_weights, proper_orthogonal_decomposition
from builder.inverse.solution import Problem, Solution
from builder.reports.symmetry_classes import class_shares, mirror_operators, symmetric_part
from builder.structure.observability import SYMMETRIES
from builder.vehicle.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray

LEAST_SHARE = 1e-6
"""Of the variance, below which a class counts as empty."""

NODES_AT_ONCE = 4096


@dataclass(frozen=True)
class PriorSight:
    """Variance of the snapshots' pressure, area-weighted, and what is left of it in the estimate's error.

    Classes are in the order of :data:`~builder.structure.observability.SYMMETRIES`; k modes, n_p nodes. "Removed"
    is 1 - error's variance / variance: negative where an estimate is worse than the mean.

    Attributes
    ----------
    mode_std : (k,) rms pressure over the surface of each mode at one standard deviation [Pa].
    mode_share : (k,) of the variance [1].
    mode_classes : (k, 4) share of each mode in each class [1]; NaN where the surface has no such symmetry.
    mode_strain : (k,) rms over the gauges of the strain of each mode at one standard deviation [m/m].
    mode_removed, mode_removed_at_best : (k,) by this map, and by the best linear one [1].
    class_share : (4,) of the snapshots' variance [1].
    class_share_of_kept : (4,) of the variance of the modes that the map keeps [1].
    class_strain : (4,) rms over the gauges of the strain of each class's part [m/m].
    class_removed, class_removed_at_best : (4,) [1]; NaN where the class holds no variance.
    removed, removed_at_best : of the whole variance [1].
    node_removed : (n_p,) by this map, at each node [1]; NaN where the snapshots do not vary.
    n_kept : modes that are states, k where all are.
    """

    mode_std: FloatArray
    mode_share: FloatArray
    mode_classes: FloatArray
    mode_strain: FloatArray
    mode_removed: FloatArray
    mode_removed_at_best: FloatArray
    class_share: FloatArray
    class_share_of_kept: FloatArray
    class_strain: FloatArray
    class_removed: FloatArray
    class_removed_at_best: FloatArray
    removed: float
    removed_at_best: float
    node_removed: FloatArray
    n_kept: int


def prior_sight(problem: Problem, solution: Solution, surface: SurfaceGrid | SurfaceMesh) -> PriorSight:
    """Return what the gauges of ``problem`` see of its snapshots, with the map of ``solution``."""
    entry = problem.entry
    weights = area_weights(problem.node_area) if entry.inner_product == "area" else None
    modes = proper_orthogonal_decomposition(problem.pressure, weights)
    std, strain = modes.coefficient_std(), problem.strain_operator @ modes.modes
    error, best = _error_factor(problem, solution, modes, strain), _best_error_factor(problem, modes, strain)
    kept = entry.modes if entry.case == 1 else min(entry.prior_modes or len(std), len(std))
    area = problem.node_area / problem.node_area.sum()
    per_mode = std**2 * (area @ modes.modes**2)
    whole = float(per_mode.sum())
    of_error, of_best = (_variance(modes.modes, area, factor) for factor in (error, best))
    mirrors = mirror_operators(surface)
    classes = np.full((5, len(SYMMETRIES)), np.nan)
    for i, symmetry in enumerate(SYMMETRIES):
        if mirrors is None:
            break
        part = symmetric_part(modes.modes, mirrors, symmetry.even_in_y, symmetry.even_in_z)
        held = std**2 * (area @ part**2)
        rms = np.sqrt(np.sum((problem.strain_operator @ part * std) ** 2) / len(strain))
        left = np.array([_variance(part, area, factor) for factor in (error, best)])
        share = held.sum() / whole
        removed = 1.0 - left / held.sum() if share > LEAST_SHARE else np.full(2, np.nan)
        classes[:, i] = share, held[:kept].sum() / per_mode[:kept].sum(), rms, *removed
    return PriorSight(
        mode_std=np.sqrt(per_mode),
        mode_share=per_mode / whole,
        mode_classes=class_shares(modes.modes, area, mirrors),
        mode_strain=std * np.sqrt(np.mean(strain**2, axis=0)),
        mode_removed=1.0 - np.sum(error**2, axis=1) / std**2,
        mode_removed_at_best=1.0 - np.sum(best**2, axis=1) / std**2,
        class_share=classes[0],
        class_share_of_kept=classes[1],
        class_strain=classes[2],
        class_removed=classes[3],
        class_removed_at_best=classes[4],
        removed=1.0 - of_error / whole,
        removed_at_best=1.0 - of_best / whole,
        node_removed=_node_removed(modes.modes, std, error),
        n_kept=kept,
    )


def _error_factor(problem: Problem, solution: Solution, modes: PressureModes, strain: FloatArray) -> FloatArray:
    """Return C (k, k + noise columns) [Pa]: C C' is the covariance of the map's error in modal coefficients."""
    held = modes.coefficients(solution.field_modes.T + modes.mean).T
    gain = held @ solution.solved.strain_gain
    of_modes = (np.eye(len(held)) - gain @ strain) * modes.coefficient_std()
    return np.hstack([of_modes, *(gain @ term.strain for term in problem.noise)])


def _best_error_factor(problem: Problem, modes: PressureModes, strain: FloatArray) -> FloatArray:
    """Return the same (k, k) [Pa] of Bayes' estimate with all modes as states."""
    std, noise = modes.coefficient_std(), NoiseModel(problem.noise)
    solved = gaussian_map(strain * std, np.zeros(len(strain)), noise.covariance)
    return std[:, None] * solved.error_factor()


def _variance(part: FloatArray, area: FloatArray, factor: FloatArray) -> float:
    """Return the area-weighted mean variance [Pa2] of part (n_p, k) c, c with the covariance of ``factor``."""
    gram = part.T @ (part * area[:, None])
    return float(np.sum(factor * (gram @ factor)))


def _node_removed(modes: FloatArray, std: FloatArray, error: FloatArray) -> FloatArray:
    removed = np.full(len(modes), np.nan)
    for first in range(0, len(modes), NODES_AT_ONCE):
        rows = modes[first : first + NODES_AT_ONCE]
        before, after = np.sum((rows * std) ** 2, axis=1), np.sum((rows @ error) ** 2, axis=1)
        varies = before > 0.0
        removed[first : first + NODES_AT_ONCE][varies] = 1.0 - after[varies] / before[varies]
    return removed
