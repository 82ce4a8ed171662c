"""Observability of the prior: the fraction of the snapshots' pressure variance that the data remove.

Pressure is written in all POD modes of the snapshots, p = p_mean + V c with c_j of standard deviation s_j. A map
estimates c from d - m = Z_p V c + noise as X T (d - m), X the modal coefficients of its states. So its error is
c - X T (Z_p V c + N n), and [(I - X T Z_p V) diag(s), X T N] is a factor C of the error's covariance C C'.
Truncated modes act in it as what they are, pressure that no state holds. The best linear map is the same with the
Bayesian gain (gamma = 1) on all modes.

Symmetry classes of pressure: its parts that are even or odd under y -> -y and under z -> -z, as projections.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from builder.aero.pressure_map import mirror_operator
from builder.aero.surface.mesh import Surface, SurfaceMesh, grid_of, mesh_of
from builder.inverse.solution import Problem, Solution, mode_choice
from builder.structure.observability import SYMMETRIES
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import BoolArray, FloatArray, lower_factor

Mirrors = tuple[sparse.csr_array, sparse.csr_array]


def mirror_operators(surface: Surface) -> Mirrors | None:
    """Return sparse (n_p, n_p) M_y, M_z: (M_y p)(x, y, z) = p(x, -y, z). None where the surface is not symmetric.

    A grid always is symmetric. On other surfaces the value is the closest point's.
    """
    grid = grid_of(surface)
    if grid is not None:
        return grid_mirrors(grid)
    of_y, of_z = (mirror_operator(mesh_of(surface), axis) for axis in (1, 2))
    return None if of_y is None or of_z is None else (of_y, of_z)


def grid_mirrors(grid: SurfaceGrid) -> Mirrors:
    """Return the same for a grid, without interpolation error.

    Pressure is trigonometric in roll angle. Where no node lies opposite another, it is mirrored wave by wave.
    """
    rings = sparse.identity(len(grid.x))
    of_y, of_z = (sparse.csr_array(sparse.kron(rings, of_ring)) for of_ring in _ring_mirrors(grid.n_roll))
    return of_y, of_z


def _ring_mirrors(n_roll: int) -> Mirrors:
    """Return the mirrors (n_roll, n_roll) of one ring of nodes at even steps of roll angle from 0."""
    node, every = np.arange(n_roll), np.ones(n_roll)
    of_y = sparse.csr_array((every, (node, -node % n_roll)))
    if n_roll % 2 == 0:
        return of_y, sparse.csr_array((every, (node, (n_roll // 2 - node) % n_roll)))
    # phi -> pi - phi keeps cos(m phi) of even m and sin(m phi) of odd m. An odd number of nodes carries both of
    # every m up to (n_roll - 1) / 2 and nothing else: these waves are an orthogonal basis.
    harmonic = np.arange(1, n_roll // 2 + 1)
    phase = np.outer(2.0 * np.pi * node / n_roll, harmonic)
    scale, sign = np.sqrt(2.0 / n_roll), np.where(harmonic % 2 == 0, 1.0, -1.0)
    cosines, sines = scale * np.cos(phase), scale * np.sin(phase)
    return of_y, sparse.csr_array(1.0 / n_roll + (cosines * sign) @ cosines.T - (sines * sign) @ sines.T)


def class_fractions(fields: FloatArray, area: FloatArray, mirrors: Mirrors | None) -> FloatArray:
    """Return (n, 4) fraction [1] of each class of symmetry in the mean square of each field.

    Parameters
    ----------
    fields : (n_p, n) pressures, none of them 0 throughout.
    area : (n_p,) of the nodes, in any unit.
    mirrors : of the surface; None gives NaN.
    """
    if mirrors is None:
        return np.full((fields.shape[1], len(SYMMETRIES)), np.nan)
    parts = (symmetric_part(fields, mirrors, symmetry.even_in_y, symmetry.even_in_z) for symmetry in SYMMETRIES)
    variance = np.stack([area @ part**2 for part in parts], axis=1)
    return variance / variance.sum(axis=1, keepdims=True)


def symmetric_part(field: FloatArray, mirrors: Mirrors, even_in_y: bool, even_in_z: bool) -> FloatArray:
    """Return the part of ``field`` (n_p, n) that is even, or odd, under y -> -y and z -> -z."""
    part = field
    for mirror, even in zip(mirrors, (even_in_y, even_in_z), strict=True):
        image = mirror @ part
        part = 0.5 * (part + image if even else part - image)
    return part


MIN_FRACTION = 1e-6
"""Fraction of the variance below which a class counts as empty."""

ROUND_OFF = 1e-9
"""Fraction of a variance below which what is removed of it is 0: a blind class removes nothing, and not -1e-16."""

NODES_AT_ONCE = 4096


@dataclass(frozen=True, eq=False, kw_only=True)
class PriorObservability:
    """Variance of the snapshots' pressure, area-weighted, and the part that remains as error of the estimate.

    Classes are in the order of :data:`~builder.structure.observability.SYMMETRIES`; k modes by falling energy, n_p
    nodes. "Removed"
    is 1 - error's variance / variance. It is negative where an estimate is worse than the mean.

    Attributes
    ----------
    mode_std : (k,) rms pressure over the surface of each mode at one standard deviation [Pa].
    mode_fraction : (k,) fraction of the variance [1].
    mode_classes : (k, 4) fraction of each mode in each class [1]; NaN where the surface has no such symmetry.
    mode_strain : (k,) rms over the gauges of the strain of each mode at one standard deviation [m/m].
    mode_removed, mode_removed_at_best : (k,) fraction removed by this map, and by the best linear one [1].
    class_fraction : (4,) fraction of the snapshots' variance [1].
    class_fraction_of_kept : (4,) fraction of the variance of the modes that the map keeps [1].
    class_strain : (4,) rms over the gauges of the strain of each class's pressure [m/m].
    class_removed, class_removed_at_best : (4,) [1]; NaN where the class holds no variance.
    removed, removed_at_best : fraction of the whole variance [1].
    node_mean, node_std : (n_p,) mean and standard deviation at each node [Pa] of the ensemble's pressure.
    node_removed : (n_p,) by this map, at each node [1]; NaN where the snapshots do not vary.
    is_state : (k,) whether a mode is a state of the map.
    """

    mode_std: FloatArray
    mode_fraction: FloatArray
    mode_classes: FloatArray
    mode_strain: FloatArray
    mode_removed: FloatArray
    mode_removed_at_best: FloatArray
    class_fraction: FloatArray
    class_fraction_of_kept: FloatArray
    class_strain: FloatArray
    class_removed: FloatArray
    class_removed_at_best: FloatArray
    removed: float
    removed_at_best: float
    node_mean: FloatArray
    node_std: FloatArray
    node_removed: FloatArray
    is_state: BoolArray


def prior_observability(
    problem: Problem, solution: Solution, surface: SurfaceGrid | SurfaceMesh
) -> PriorObservability:
    """Return what the gauges of ``problem`` observe of its snapshots, with the map of ``solution``."""
    entry = problem.entry
    modes, strain = problem.modes, problem.strain_of_modes
    std, error, best = modes.coefficient_std, _error_factor(problem, solution), _best_error_factor(problem)
    is_state = np.zeros(len(std), dtype=bool)
    is_state[mode_choice(problem)[0] if entry.case == 1 else slice(entry.prior_modes)] = True
    area = problem.node_area / problem.node_area.sum()
    per_mode = std**2 * (area @ modes.modes**2)
    total = float(per_mode.sum())
    of_error, of_best = (_variance(modes.modes, area, factor) for factor in (error, best))
    mirrors = mirror_operators(surface)
    node_std, node_removed = _at_nodes(modes.modes, std, error)
    classes = np.full((5, len(SYMMETRIES)), np.nan)
    for i, symmetry in enumerate(SYMMETRIES):
        if mirrors is None:
            break
        part = symmetric_part(modes.modes, mirrors, symmetry.even_in_y, symmetry.even_in_z)
        variance = std**2 * (area @ part**2)
        rms = np.sqrt(np.sum((problem.strain_operator @ part * std) ** 2) / len(strain))
        remaining = np.array([_variance(part, area, factor) for factor in (error, best)])
        fraction = variance.sum() / total
        removed = _removed(remaining, variance.sum()) if fraction > MIN_FRACTION else np.full(2, np.nan)
        classes[:, i] = fraction, variance[is_state].sum() / per_mode[is_state].sum(), rms, *removed
    return PriorObservability(
        mode_std=np.sqrt(per_mode),
        mode_fraction=per_mode / total,
        mode_classes=class_fractions(modes.modes, area, mirrors),
        mode_strain=std * np.sqrt(np.mean(strain**2, axis=0)),
        mode_removed=_removed(np.sum(error**2, axis=1), std**2),
        mode_removed_at_best=_removed(np.sum(best**2, axis=1), std**2),
        class_fraction=classes[0],
        class_fraction_of_kept=classes[1],
        class_strain=classes[2],
        class_removed=classes[3],
        class_removed_at_best=classes[4],
        removed=float(_removed(of_error, total)),
        removed_at_best=float(_removed(of_best, total)),
        node_mean=modes.mean,
        node_std=node_std,
        node_removed=node_removed,
        is_state=is_state,
    )


def _error_factor(problem: Problem, solution: Solution) -> FloatArray:
    """Return C (k, k) [Pa]: C C' is the covariance of the map's error in modal coefficients."""
    modes, gain = problem.modes, solution.solved.strain_gain
    states_in_modes = modes.coefficients(solution.field_modes.T + modes.mean).T
    estimated = states_in_modes @ (gain @ problem.strain_of_modes)
    of_modes = (np.eye(len(estimated)) - estimated) * modes.coefficient_std
    of_noise = lower_factor(np.hstack([term.by_gain(gain) for term in problem.noise]))
    return lower_factor(np.hstack([of_modes, states_in_modes @ of_noise]))


def _best_error_factor(problem: Problem) -> FloatArray:
    """Return the same (k, k) [Pa] of the Bayesian estimate with all modes as states."""
    std = problem.modes.coefficient_std
    whitened = problem.noise_model.whitening @ (problem.strain_of_modes * std)
    _, singular, right = np.linalg.svd(whitened, full_matrices=len(whitened) < len(std))
    eigenvalues = np.pad(singular**2, (0, len(std) - len(singular)))
    # The covariance of the error is the inverse Hessian, V diag(1 / (lambda + 1)) V^T of unit states.
    return np.asarray(std[:, None] * right.T / np.sqrt(eigenvalues + 1.0))


def _removed(remaining: FloatArray | float, prior: FloatArray | float) -> FloatArray:
    """Return 1 - left / of, 0 where that is round-off."""
    fraction = np.asarray(1.0 - remaining / prior)
    return np.where(np.abs(fraction) < ROUND_OFF, 0.0, fraction)


def _variance(part: FloatArray, area: FloatArray, factor: FloatArray) -> float:
    """Return the area-weighted mean variance [Pa2] of part (n_p, k) c, c with the covariance of ``factor``."""
    gram = part.T @ (part * area[:, None])
    return float(np.sum(factor * (gram @ factor)))


def _at_nodes(modes: FloatArray, std: FloatArray, error: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (n_p,) standard deviation [Pa] and the fraction of its square that is removed, NaN where it is 0."""
    spread, removed = np.empty(len(modes)), np.full(len(modes), np.nan)
    for first in range(0, len(modes), NODES_AT_ONCE):
        rows = modes[first : first + NODES_AT_ONCE]
        before, after = np.sum((rows * std) ** 2, axis=1), np.sum((rows @ error) ** 2, axis=1)
        varies = before > 0.0
        spread[first : first + NODES_AT_ONCE] = np.sqrt(before)
        removed[first : first + NODES_AT_ONCE][varies] = _removed(after[varies], before[varies])
    return spread, removed
