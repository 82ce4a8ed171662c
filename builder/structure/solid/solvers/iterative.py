"""Conjugate gradients with a multigrid of smoothed aggregation (pyamg) that knows the rigid motions.

It needs the smallest memory of all, and is slow: it suits one or a few loads on meshes of tetrahedra. On one layer
of quadratic hexahedra convergence is poor; then an error is raised.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array, csr_matrix
from scipy.sparse.linalg import cg

from builder.structure.solid.operators.supports import rigid_motions
from builder.structure.solid.solvers.back_end import BackEnd, Factor, importable
from builder.structure.solid.solvers.problem import SolverError, SparseProblem
from strainfmu.arrays import FloatArray

COARSEST = 200  # unknowns of the level that is inverted


@dataclass(frozen=True)
class IterationLimits:
    """When conjugate gradients end.

    Attributes
    ----------
    tolerance : ||A x - b|| / ||b|| reached.
    max_iterations : per right-hand side; more is a failure.
    """

    tolerance: float = 1e-9
    max_iterations: int = 500


def multigrid_solver(problem: SparseProblem, limits: IterationLimits) -> Factor:
    """Set up the multigrid of a problem.

    Smoothed aggregation needs the motions that cost little energy, which for a solid are the rigid ones (Vanek,
    Mandel and Brezina, Computing 56, 1996).

    Returns
    -------
    (n_free, k) loads to displacements; raises SolverError with the iterations and the residual reached where the
    tolerance is not met.
    """
    from pyamg import smoothed_aggregation_solver

    near_null = None if problem.node is None else problem.free.T @ _unit_rigid_motions(problem.node)
    hierarchy = smoothed_aggregation_solver(
        _blocked(problem.matrix, problem.free), B=near_null, symmetry="symmetric", max_coarse=COARSEST
    )
    preconditioner = hierarchy.aspreconditioner()

    def solve(load: FloatArray) -> FloatArray:
        answer = [_conjugate_gradients(problem.matrix, column, preconditioner, limits) for column in load.T]
        return np.column_stack(answer)

    return solve


def _unit_rigid_motions(node: FloatArray) -> FloatArray:
    centre = node.mean(axis=0)
    return rigid_motions((node - centre) / np.abs(node - centre).max())


def _blocked(matrix: csr_array, free: csr_array) -> Any:
    """Return the matrix in 3 x 3 blocks of nodes where every node moves in all directions or in none."""
    row = free.tocsc().indices
    whole = free.nnz == free.shape[1] and len(row) % 3 == 0
    # Old matrix classes: pyamg multiplies matrices with an asterisk.
    if whole and (row.reshape(-1, 3) == 3 * (row[::3, None] // 3) + np.arange(3)).all():
        return csr_matrix(matrix).tobsr(blocksize=(3, 3))
    return csr_matrix(matrix)


def _conjugate_gradients(
    matrix: csr_array, load: FloatArray, preconditioner: Any, limits: IterationLimits
) -> FloatArray:
    iterations = 0

    def count(_: FloatArray) -> None:
        nonlocal iterations
        iterations += 1

    answer, _ = cg(
        matrix, load, rtol=limits.tolerance, maxiter=limits.max_iterations, M=preconditioner, callback=count
    )
    size = float(np.linalg.norm(load))
    residual = float(np.linalg.norm(matrix @ answer - load)) / (size or 1.0)
    # The recurrence's own residual drifts from the true one, hence the factor.
    if not residual <= 10.0 * limits.tolerance:
        raise SolverError(
            f"solver iterative: residual {residual:.1e} after {iterations} iterations, must be "
            f"at most {limits.tolerance:g}; use a direct solver"
        )
    return np.asarray(answer)


def _factor(problem: SparseProblem) -> Factor:
    return multigrid_solver(problem, IterationLimits())


ITERATIVE = BackEnd(
    name="iterative",
    licence="MIT (pyamg)",
    install="pip install 'strainfmu[iterative]'",
    installed=lambda: importable("pyamg"),
    factor=_factor,
)
