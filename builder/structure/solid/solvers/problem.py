"""The linear problem of a held structure, and the checks that no solution escapes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array, issparse

from strainfmu.arrays import ComplexArray, FloatArray
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
    node : (n_dof / 3, 3) positions [m] of the nodes, from which multigrid takes the rigid motions; None where
        the unknowns belong to no nodes.

    Raises
    ------
    InputError
        Shapes do not fit, an entry is not finite, or the matrix is not symmetric.
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


def unheld_problem(matrix: csr_array) -> SparseProblem:
    """Return the problem of a matrix (n, n) whose every unknown is free."""
    return SparseProblem(matrix, csr_array(eye_array(matrix.shape[0])))


def checked_loads(loads: FloatArray | csr_array, n_dof: int) -> FloatArray | csc_array:
    """Return loads (n_dof, k), sparse ones by columns.

    Raises
    ------
    InputError
        They have another shape, or one is not finite.
    """
    if loads.ndim != 2 or loads.shape[0] != n_dof:
        raise InputError(f"loads {loads.shape} found, must be ({n_dof}, any number)")
    checked = csc_array(loads) if issparse(loads) else np.asarray(loads, dtype=np.float64)
    if not np.isfinite(checked.data if issparse(checked) else checked).all():
        raise InputError("loads: a value is not finite")
    return checked


@dataclass(frozen=True, kw_only=True)
class SolveStatistics:
    """Resources that a solver has used so far.

    Attributes
    ----------
    n_dof : displacement components, held ones included.
    n_entries : stored entries of the matrix.
    factor_seconds, solve_seconds : wall time [s] of preparing (ordering included) and of all solutions.
    peak_memory : maximum memory the process has held [byte]; 0 where the platform does not report it.
    relative_residual : largest ||A x - b|| / ||b|| of requested solutions.
    probe_residual : the same of probes that move the whole body (:func:`probe_loads`): rounding error times the
        condition of the matrix, a pessimistic guide to the relative error of Z_p where the body bends as a beam.
    """

    n_dof: int
    n_entries: int
    factor_seconds: float
    solve_seconds: float
    peak_memory: int
    relative_residual: float
    probe_residual: float


def peak_memory() -> int:
    """Return the maximum memory this process has held [byte]; 0 where the platform does not report it."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(held if sys.platform == "darwin" else 1024 * held)


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
    """Return :func:`relative_residual`, refusing solutions that are none.

    Raises
    ------
    SolverError
        It is above ``bound`` or not a number; ``name`` is the solver's, for the message.
    """
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


def refuse_indefinite(
    name: str, matrix: csr_array, solve: Callable[[Any], Any], probe: FloatArray, bound: float = PROBE_BOUND
) -> float:
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
    bound : largest relative residual of a probe.

    Raises
    ------
    SolverError
        A check fails.
    """
    if not (matrix.diagonal().real > 0.0).all():
        raise SolverError(f"solver {name}: the stiffness is not positive definite (its diagonal is not positive)")
    load = probe[:, np.linalg.norm(probe, axis=0) > 0.0].astype(matrix.dtype)
    load = np.linalg.qr(load)[0]
    answer = solve(load)
    residual = checked_residual(name, matrix, answer, load, bound)
    for work in (load.conj().T @ answer, load.conj().T @ (matrix @ load)):
        if not np.linalg.eigvalsh(0.5 * (work + work.conj().T)).min() > 0.0:
            raise SolverError(f"solver {name}: the stiffness is not positive definite (negative work found)")
    return residual
