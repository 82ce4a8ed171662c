"""PARDISO of Intel oneMKL through pypardiso: Cholesky of the upper triangle.

Conjugate gradients with a multigrid of smoothed aggregation (pyamg) that knows the rigid motions.

It needs the smallest memory of all, and is slow: it suits one or a few loads on meshes of tetrahedra. On one layer
of quadratic hexahedra convergence is poor; then an error is raised.

One interface to all solvers, and the choice among them.
"""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix, issparse, triu
from scipy.sparse.linalg import cg

from builder.structure.solid.petsc import PETSC
from builder.structure.solid.sparse_problem import (
    RESIDUAL_BOUND,
    SUPERLU,
    BackEnd,
    Factor,
    SolverError,
    SparseProblem,
    checked_loads,
    checked_residual,
    importable,
    probe_loads,
    refuse_indefinite,
    relative_residual,
)
from builder.structure.solid.supports import rigid_motions
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

POSITIVE_DEFINITE = 2  # matrix type of PARDISO: real, symmetric, positive definite
NOT_POSITIVE = -4  # its error: zero or negative pivot


def _pardiso_factor(problem: SparseProblem) -> Factor:
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    upper = csr_matrix(triu(problem.matrix, format="csr"))
    solver = PyPardisoSolver(mtype=POSITIVE_DEFINITE)
    try:
        solver.factorize(upper)
    except PyPardisoError as error:
        cause = "the stiffness is not positive definite" if error.value == NOT_POSITIVE else str(error)
        raise SolverError(f"solver pardiso: {cause}") from None

    def solve(load: FloatArray) -> FloatArray:
        answer: FloatArray = solver.solve(upper, np.asfortranarray(load))
        return answer

    # The library keeps its factor outside Python's memory.
    weakref.finalize(solve, solver.free_memory, everything=True)
    return solve


PARDISO = BackEnd(
    name="pardiso",
    licence="BSD-3-Clause over Intel oneMKL, Intel Simplified Software License",
    install="pip install 'strainfmu[pardiso]'",
    installed=lambda: importable("pypardiso"),
    factor=_pardiso_factor,
)


INVERTED = 200  # unknowns of the level that is inverted


TOLERANCE = 1e-9  # ||A x - b|| / ||b|| at which conjugate gradients end
MAX_ITERATIONS = 500  # per right-hand side; more is a failure


def _multigrid_factor(problem: SparseProblem) -> Factor:
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
        _blocked(problem.matrix, problem.free), B=near_null, symmetry="symmetric", max_coarse=INVERTED
    )
    preconditioner = hierarchy.aspreconditioner()

    def solve(load: FloatArray) -> FloatArray:
        answer = [_conjugate_gradients(problem.matrix, column, preconditioner) for column in load.T]
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


def _conjugate_gradients(matrix: csr_array, load: FloatArray, preconditioner: Any) -> FloatArray:
    iterations = 0

    def count(_: FloatArray) -> None:
        nonlocal iterations
        iterations += 1

    answer, _ = cg(matrix, load, rtol=TOLERANCE, maxiter=MAX_ITERATIONS, M=preconditioner, callback=count)
    size = float(np.linalg.norm(load))
    residual = float(np.linalg.norm(matrix @ answer - load)) / (size or 1.0)
    # The recurrence's own residual drifts from the true one, hence the factor.
    if not residual <= 10.0 * TOLERANCE:
        raise SolverError(
            f"solver iterative: residual {residual:.1e} after {iterations} iterations, must be "
            f"at most {TOLERANCE:g}; use a direct solver"
        )
    return np.asarray(answer)


ITERATIVE = BackEnd(
    name="iterative",
    licence="MIT (pyamg)",
    install="pip install 'strainfmu[iterative]'",
    installed=lambda: importable("pyamg"),
    factor=_multigrid_factor,
)


BLOCK = 64
"""Right-hand sides solved at once."""

BACK_ENDS = (SUPERLU, PARDISO, ITERATIVE, PETSC)
"""The first is chosen where none is named: its licence binds no program that calls it.

Intel's licence is a user's decision; petsc starts other processes; iterative may not converge.
"""
CYCLIC = "cyclic"


class SparseSolver:
    """A problem prepared by a back end.

    Parameters
    ----------
    problem : the problem.
    back_end : what solves it.

    Attributes
    ----------
    name, licence : what solves, and on what terms.
    relative_residual : largest ||A x - b|| / ||b|| of requested solutions so far.
    probe_residual : the same of probes that move the whole body
        (:func:`~builder.structure.solid.sparse_problem.probe_loads`): rounding error times the condition of the
        matrix, a pessimistic guide to the relative error of Z_p where the body bends as a beam.

    Raises
    ------
    InputError
        The back end is not installed.
    SolverError
        The matrix is singular, not positive definite or too large.
    """

    def __init__(self, problem: SparseProblem, back_end: BackEnd) -> None:
        if not back_end.installed():
            raise back_end.missing()
        self.name, self.licence = back_end.name, back_end.licence
        self._problem = problem
        self._factor = back_end.factor(problem)
        self.relative_residual = 0.0
        self.probe_residual = refuse_indefinite(self.name, problem.matrix, self._factor, probe_loads(problem.free))

    def solve(self, right_hand_sides: FloatArray | csr_array) -> FloatArray:
        """Return displacements (n_dof, k) [m] under loads (n_dof, k) [N], both along body axes.

        Raises
        ------
        SolverError
            A relative residual is above :data:`~builder.structure.solid.sparse_problem.RESIDUAL_BOUND`.
        InputError
            Loads have a wrong shape or are not finite.
        """
        loads = checked_loads(right_hand_sides, self._problem.n_dof)
        displacement = np.empty(loads.shape)
        for first in range(0, loads.shape[1], BLOCK):
            block = loads[:, first : first + BLOCK]
            displacement[:, first : first + BLOCK] = self._solve_block(block)
        return displacement

    def _solve_block(self, loads: FloatArray | csc_array) -> FloatArray:
        reduced = self._problem.free.T @ loads
        dense = reduced.toarray() if issparse(reduced) else reduced
        answer = self._factor(dense)
        if relative_residual(self._problem.matrix, answer, dense) > RESIDUAL_BOUND:
            # A step of refinement: smooth pressures move a slender body far, and round-off goes with the motion.
            answer = answer + self._factor(dense - self._problem.matrix @ answer)
        residual = checked_residual(self.name, self._problem.matrix, answer, dense)
        self.relative_residual = max(self.relative_residual, residual)
        displacement: FloatArray = self._problem.free @ answer
        return displacement


def choose_solver(problem: SparseProblem, name: str | None = None) -> SparseSolver:
    """Prepare a problem with the named solver, ``superlu`` by default.

    Raises
    ------
    InputError
        The named one does not exist, is not installed (the message gives what to install and its licence), or
        does not fit the problem.
    SolverError
        The matrix is singular, not positive definite or too large.
    """
    if name == CYCLIC:
        raise InputError(f"solver '{CYCLIC}' needs a mesh of equal sectors, such as one swept round the axis")
    return SparseSolver(problem, SUPERLU if name is None else named_back_end(name))


def named_back_end(name: str) -> BackEnd:
    """Return the back end of that name.

    Raises
    ------
    InputError
        There is none; the message lists the names.
    """
    for back_end in BACK_ENDS:
        if back_end.name == name:
            return back_end
    known = ", ".join((CYCLIC, *(back_end.name for back_end in BACK_ENDS)))
    raise InputError(f"solver '{name}' found, must be one of {known}")
