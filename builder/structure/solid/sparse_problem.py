"""The linear problem of a held structure, and the checks that no solution escapes.

Interface of a solver back end: a name, a licence, how to get it, and a function that factorises.

Planes of symmetry: a problem that a reflection leaves as it is falls apart into smaller ones.

Reflections about y = 0 and z = 0 commute with each other and, on a symmetric structure, with the matrix. In a
basis of motions that are even or odd about each plane the matrix is block diagonal, so up to four problems of a
quarter of the unknowns take the place of one (Bossavit, Comput. Methods Appl. Mech. Eng. 56, 1986, 167-215).

SuperLU, which scipy brings along.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import product
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, eye_array, issparse
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from builder.processors import processors
from strainfmu.arrays import ComplexArray, FloatArray, IntArray
from strainfmu.errors import InputError, StrainfmuError

RESIDUAL_BOUND = 1e-6
"""Largest ||A x - b|| / ||b|| of a solution accepted; sound ones of gauge rows stay below 1e-8."""

PROBE_BOUND = 1e-3
"""The same of a probe that moves the whole body, where soft ones lose more digits; 1 where singular."""

SYMMETRY_BOUND = 1e-9  # largest |A - A^T| over the largest |A|
SAMPLED_COLUMNS = 3


class SolverError(StrainfmuError):
    """A matrix cannot be factorised, or a solution is not one."""


@dataclass(frozen=True, eq=False)
class SparseProblem:
    """A u = f for a held structure; u = free q with q the free motions.

    Attributes
    ----------
    matrix : (n_free, n_free) free^T A free [N/m], symmetric positive definite.
    free : (n_dof, n_free) free motions, orthonormal columns [-].
    node : (n_dof / 3, 3) positions [m] of the nodes, whose planes of symmetry part the problem; None where the
        unknowns belong to no nodes.
    """

    matrix: csr_array
    free: csr_array
    node: FloatArray | None = None

    def __post_init__(self) -> None:
        n = self.matrix.shape[0]
        if self.matrix.shape != (n, n) or self.free.shape[1] != n or not n:
            raise InputError(f"linear problem: matrix {self.matrix.shape}, free motions {self.free.shape} differ")
        if self.node is not None and 3 * len(self.node) != self.n_dof:
            raise InputError(f"linear problem: {len(self.node)} nodes found for {self.n_dof} dofs")
        if not np.isfinite(self.matrix.data).all():
            raise InputError("linear problem: an entry of the matrix is not finite")
        # On a random vector, because a second matrix would double the memory.
        vector = np.random.default_rng(0).uniform(-1.0, 1.0, n)
        asymmetry = float(np.abs(self.matrix @ vector - self.matrix.T @ vector).max())
        if asymmetry > SYMMETRY_BOUND * float(np.abs(self.matrix.data).max(initial=0.0)):
            raise InputError(f"linear problem: the matrix is not symmetric (by {asymmetry:.1e} N/m)")

    @property
    def n_dof(self) -> int:
        """Displacement components, held ones included."""
        return int(self.free.shape[0])


def checked_loads(loads: FloatArray | csr_array, n_dof: int) -> FloatArray | csc_array:
    """Return loads (n_dof, k), sparse ones by columns."""
    if loads.ndim != 2 or loads.shape[0] != n_dof:
        raise InputError(f"loads {loads.shape} found, must be ({n_dof}, any number)")
    checked = csc_array(loads) if issparse(loads) else np.asarray(loads, dtype=np.float64)
    if not np.isfinite(checked.data if issparse(checked) else checked).all():
        raise InputError("loads: a value is not finite")
    return checked


def relative_residual(
    matrix: csr_array, solution: FloatArray | ComplexArray, right_hand_side: FloatArray | ComplexArray
) -> float:
    """Return the largest ||A x - b|| / ||b|| of a sample of columns.

    The sample is up to three columns and, so that none is left out, the sum of all columns over their norms with
    alternating signs. Columns b = 0 count with ||x||.

    Parameters
    ----------
    matrix : (n, n).
    solution, right_hand_side : (n, k).
    """
    k = right_hand_side.shape[1]
    if not k:
        return 0.0
    norm = np.linalg.norm(right_hand_side, axis=0)
    scale = np.where(norm > 0.0, norm, 1.0)
    mix = (1.0 - 2.0 * (np.arange(k) % 2)) / scale
    picked = np.unique(np.linspace(0, k - 1, SAMPLED_COLUMNS).astype(int))
    x = np.column_stack([solution[:, picked] / scale[picked], solution @ mix])
    b = np.column_stack([right_hand_side[:, picked] / scale[picked], right_hand_side @ mix])
    return float(np.linalg.norm(matrix @ x - b, axis=0).max())


def checked_residual(
    name: str,
    matrix: csr_array,
    solution: FloatArray | ComplexArray,
    right_hand_side: FloatArray | ComplexArray,
    bound: float = RESIDUAL_BOUND,
) -> float:
    """Return :func:`relative_residual`, refusing solutions that are none."""
    residual = relative_residual(matrix, solution, right_hand_side)
    if not residual <= bound:
        raise SolverError(
            f"solver {name}: relative residual {residual:.1e}, at most {bound:g} is allowed; "
            "the stiffness is singular or nearly so (a part not held or not joined to the rest?)"
        )
    return residual


def probe_loads(free: csr_array) -> FloatArray:
    """Return (n_free, 4) loads that a free rigid motion cannot balance.

    Unit forces on all nodes along each axis, and random ones.
    """
    along = np.equal.outer(np.arange(free.shape[0]) % 3, np.arange(3)).astype(np.float64)
    random = np.random.default_rng(0).standard_normal((free.shape[1], 1))
    return np.hstack([free.T @ along, random])


def refuse_indefinite(name: str, matrix: csr_array, solve: Callable[[Any], Any], probe: FloatArray) -> float:
    """Refuse a factorised matrix that is singular or not positive definite; return the probes' relative residual.

    Gauge rows sum to no force, so their solutions may look right while a rigid motion is free. Probes do not sum
    to none: their residual grows with the condition number, and their work, b^T A^-1 b and b^T A b as small
    matrices, must be positive definite. That is a necessary condition, not a proof.

    Parameters
    ----------
    name : of the solver, for messages.
    matrix : (n, n) symmetric or Hermitian.
    solve : (n, k) to A^-1 times it.
    probe : (n, k) loads, such as :func:`probe_loads` gives.
    """
    if not (matrix.diagonal().real > 0.0).all():
        raise SolverError(f"solver {name}: the stiffness is not positive definite (its diagonal is not positive)")
    load = probe[:, np.linalg.norm(probe, axis=0) > 0.0].astype(matrix.dtype)
    load = np.linalg.qr(load)[0]
    answer = solve(load)
    residual = checked_residual(name, matrix, answer, load, PROBE_BOUND)
    for work in (load.conj().T @ answer, load.conj().T @ (matrix @ load)):
        if not np.linalg.eigvalsh(0.5 * (work + work.conj().T)).min() > 0.0:
            raise SolverError(f"solver {name}: the stiffness is not positive definite (negative work found)")
    return residual


Factor = Callable[[FloatArray], FloatArray]
"""(n_free, k) loads [N] to displacements [m]; the prepared matrix is kept inside."""


@dataclass(frozen=True, kw_only=True)
class BackEnd:
    """One way to solve a sparse problem.

    Attributes
    ----------
    name : the name that a user gives.
    licence : licence of the binding over the licence of the library.
    install : the command that installs it.
    installed : returns whether it is there.
    factor : prepares a problem; imports the library when called.
    """

    name: str
    licence: str
    install: str
    installed: Callable[[], bool]
    factor: Callable[[SparseProblem], Factor]

    def missing(self) -> InputError:
        """Return the error for a named back end that is not installed."""
        return InputError(f"solver '{self.name}' is not installed: {self.install} (licence: {self.licence})")


def importable(module: str) -> bool:
    """Return whether a module is there; only packages above it are imported."""
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # the package above it
        return False


SAME_PLACE = 1e-9  # of the size of the body: two nodes at one point
MIRROR_BOUND = 1e-10  # largest |A R - R A| over the largest |A|, on a vector of numbers up to 1

PLANES = {"y = 0": np.array([1.0, -1.0, 1.0]), "z = 0": np.array([1.0, 1.0, -1.0])}


def symmetric_parts(problem: SparseProblem) -> list[csr_array]:
    """Return bases of motions that do not work on one another.

    Returns
    -------
    One to four matrices (n_free, k) with orthonormal columns, which together span all free motions; the identity
    alone if the nodes, supports or stiffness have no plane of symmetry.
    """
    reflections = [
        reflection
        for reflection in (_reflection(problem, sign) for sign in PLANES.values())
        if reflection is not None
    ]
    n = problem.matrix.shape[0]
    if not reflections:
        return [csr_array(eye_array(n))]
    return [_basis(n, reflections, parity) for parity in product((1.0, -1.0), repeat=len(reflections))]


def _reflection(problem: SparseProblem, sign: FloatArray) -> csr_array | None:
    """Return the reflection as (n_free, n_free) signed permutation of free motions; None if it is no symmetry."""
    if problem.node is None:
        return None
    partner = _partners(problem.node, sign)
    if partner is None:
        return None
    dof = np.arange(problem.n_dof)
    target = 3 * partner[dof // 3] + dof % 3
    of_dofs = csr_array((sign[dof % 3], (target, dof)), shape=(problem.n_dof,) * 2)
    mirror = csr_array(problem.free.T @ of_dofs @ problem.free)
    mirror.eliminate_zeros()
    one_each = (np.diff(mirror.indptr) == 1).all() and np.allclose(np.abs(mirror.data), 1.0, rtol=0.0, atol=1e-12)
    if not one_each:  # the supports are not symmetric, or hold directions that a reflection mixes
        return None
    vector = np.random.default_rng(0).uniform(-1.0, 1.0, len(mirror.indptr) - 1)
    coupling = problem.matrix @ (mirror @ vector) - mirror @ (problem.matrix @ vector)
    symmetric = np.abs(coupling).max() <= MIRROR_BOUND * np.abs(problem.matrix.data).max()
    return mirror if symmetric else None


def _partners(node: FloatArray, sign: FloatArray) -> IntArray | None:
    """Return the node (n,) at the mirror image of each node (n, 3) [m]; None if one has none."""
    size = float(np.ptp(node, axis=0).max())
    distance, partner = KDTree(node).query(node * sign, distance_upper_bound=SAME_PLACE * size)
    return np.asarray(partner, dtype=np.int64) if np.isfinite(distance).all() else None


def _basis(n: int, reflections: list[csr_array], parity: tuple[float, ...]) -> csr_array:
    """Return the orthonormal basis (n, k) of motions x with R x = parity x for each reflection R.

    The projection of a unit vector is, but for the sign, the projection of its mirror images: one of them
    represents all.
    """
    projection, first = csr_array(eye_array(n)), np.arange(n)
    for mirror, sign in zip(reflections, parity, strict=True):
        projection = csr_array(0.5 * (projection + sign * (mirror @ projection)))
    entries = coo_array(projection)
    np.minimum.at(first, entries.col, entries.row)
    columns = csr_array(projection[:, np.flatnonzero(first == np.arange(n))])
    norm = np.sqrt(np.asarray(columns.multiply(columns).sum(axis=0)).ravel())
    nonzero = np.flatnonzero(norm > 0.25)  # 1/2 to 1 by the number of images; 0 where they cancel
    scaled = csr_array(columns[:, nonzero])
    scaled.data /= norm[nonzero][scaled.indices]
    return scaled


def factor_symmetric(matrix: csr_array | csc_array) -> Any:
    """Factorise a symmetric or Hermitian positive definite matrix.

    The pattern is ordered by minimum degree on A + A^T and pivots stay on the diagonal: half the fill of the
    general mode, and safe for a definite matrix (Li et al., SuperLU Users' Guide, section 2.7.4).

    Returns
    -------
    scipy.sparse.linalg.SuperLU
    """
    try:
        return splu(
            csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SolverError(f"solver superlu: the stiffness is singular ({error})") from None
    except MemoryError:
        raise SolverError(f"solver superlu: not enough memory for {matrix.shape[0]} unknowns") from None


def _factor(problem: SparseProblem) -> Factor:
    """Factorise part by part (:mod:`~builder.structure.solid.sparse_problem`), several at once.

    SuperLU lets other threads run while it factorises or solves; finished factors are only read.
    """
    parts = symmetric_parts(problem)

    def part_factor(basis: csr_array) -> Any:
        return factor_symmetric(csr_array(basis.T @ problem.matrix @ basis))

    with ThreadPoolExecutor(processors()) as pool:
        factors = list(pool.map(part_factor, parts))

    def solve(right_hand_sides: FloatArray) -> FloatArray:
        n_slices = min(processors(), right_hand_sides.shape[1])
        with ThreadPoolExecutor(n_slices) as pool:
            return np.hstack(list(pool.map(solve_slice, np.array_split(right_hand_sides, n_slices, axis=1))))

    def solve_slice(right_hand_sides: FloatArray) -> FloatArray:
        solutions = [
            basis @ factor.solve(basis.T @ right_hand_sides) for basis, factor in zip(parts, factors, strict=True)
        ]
        total: FloatArray = np.sum(solutions, axis=0)
        return total

    return solve


SUPERLU = BackEnd(
    name="superlu",
    licence="BSD-3-Clause",
    install="pip install 'strainfmu[build]'",
    installed=lambda: True,
    factor=_factor,
)
