"""PARDISO of Intel oneMKL through pypardiso: Cholesky of the upper triangle.

Conjugate gradients with a multigrid of smoothed aggregation (pyamg) that knows the rigid motions.

It needs the smallest memory of all, and is slow: it suits one or a few loads on meshes of tetrahedra. On one layer
of quadratic hexahedra convergence is poor; then an error is raised.

One interface to all solvers, and the choice among them.
"""

from __future__ import annotations

import time
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix, issparse, triu
from scipy.sparse.linalg import cg

from builder.structure.solid.cyclic import CyclicProblem, CyclicSolver
from builder.structure.solid.petsc import petsc_back_end
from builder.structure.solid.sparse_problem import (
    RESIDUAL_BOUND,
    SUPERLU,
    BackEnd,
    Factor,
    SolverError,
    SolveStatistics,
    SparseProblem,
    checked_loads,
    checked_residual,
    importable,
    peak_memory,
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
        _blocked(problem.matrix, problem.free), B=near_null, symmetry="symmetric", max_coarse=INVERTED
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


def _iterative_factor(problem: SparseProblem) -> Factor:
    return multigrid_solver(problem, IterationLimits())


ITERATIVE = BackEnd(
    name="iterative",
    licence="MIT (pyamg)",
    install="pip install 'strainfmu[iterative]'",
    installed=lambda: importable("pyamg"),
    factor=_iterative_factor,
)


BLOCK = 64
"""Right-hand sides solved at once."""

BACK_ENDS = (SUPERLU, PARDISO, ITERATIVE, petsc_back_end())
"""The first is chosen where none is named: its licence binds no program that calls it.

Intel's licence is a user's decision; petsc starts other processes; iterative may not converge.
"""
CYCLIC = "cyclic"


class Solver(Protocol):
    """A prepared problem.

    Attributes
    ----------
    name, licence : what solves, and on what terms.
    statistics : what has been used so far.
    """

    @property
    def name(self) -> str: ...

    @property
    def licence(self) -> str: ...

    @property
    def statistics(self) -> SolveStatistics: ...

    def solve(self, right_hand_sides: FloatArray | csr_array) -> FloatArray:
        """Return displacements (n_dof, k) [m] under loads (n_dof, k) [N], both along body axes.

        Raises
        ------
        SolverError
            A relative residual is above :data:`~builder.structure.solid.sparse_problem.RESIDUAL_BOUND`.
        InputError
            Loads have a wrong shape or are not finite.
        """
        ...


class SparseSolver:
    """A problem prepared by a back end.

    Parameters
    ----------
    problem : the problem.
    back_end : what solves it.

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
        start = time.perf_counter()
        self._factor = back_end.factor(problem)
        seconds = time.perf_counter() - start
        probed = refuse_indefinite(self.name, problem.matrix, self._factor, probe_loads(problem.free))
        entries = int(problem.matrix.nnz)
        self._statistics = SolveStatistics(
            n_dof=problem.n_dof,
            n_entries=entries,
            factor_seconds=seconds,
            solve_seconds=0.0,
            peak_memory=peak_memory(),
            relative_residual=0.0,
            probe_residual=probed,
        )

    @property
    def statistics(self) -> SolveStatistics:
        return replace(self._statistics, peak_memory=peak_memory())

    def solve(self, right_hand_sides: FloatArray | csr_array) -> FloatArray:
        loads = checked_loads(right_hand_sides, self._problem.n_dof)
        displacement = np.empty(loads.shape)
        for first in range(0, loads.shape[1], BLOCK):
            block = loads[:, first : first + BLOCK]
            displacement[:, first : first + BLOCK] = self._solve_block(block)
        return displacement

    def _solve_block(self, loads: FloatArray | csc_array) -> FloatArray:
        reduced = self._problem.free.T @ loads
        start = time.perf_counter()
        dense = reduced.toarray() if issparse(reduced) else reduced
        answer = self._factor(dense)
        if relative_residual(self._problem.matrix, answer, dense) > RESIDUAL_BOUND:
            # A step of refinement: smooth pressures move a slender body far, and round-off goes with the motion.
            answer = answer + self._factor(dense - self._problem.matrix @ answer)
        seconds = time.perf_counter() - start
        residual = checked_residual(self.name, self._problem.matrix, answer, dense)
        self._statistics = replace(
            self._statistics,
            solve_seconds=self._statistics.solve_seconds + seconds,
            relative_residual=max(self._statistics.relative_residual, residual),
        )
        displacement: FloatArray = self._problem.free @ answer
        return displacement


def choose_solver(problem: SparseProblem | CyclicProblem, name: str | None = None) -> SparseSolver | CyclicSolver:
    """Prepare a problem with the named solver, or with the one that fits it.

    A problem made of sectors goes to ``cyclic``, any other to ``superlu``.

    Raises
    ------
    InputError
        The named one does not exist, is not installed (the message gives what to install and its licence), or
        does not fit the problem.
    SolverError
        The matrix is singular, not positive definite or too large.
    """
    if isinstance(problem, CyclicProblem):
        if name not in (None, CYCLIC):
            raise InputError(f"solver '{name}' found: a problem made of sectors is solved by '{CYCLIC}' alone")
        return CyclicSolver(problem)
    if name == CYCLIC:
        raise InputError(f"solver '{CYCLIC}' needs a mesh of equal sectors, such as one swept round the axis")
    return SparseSolver(problem, SUPERLU if name is None else named_back_end(name))


def named_back_end(name: str, back_ends: Sequence[BackEnd] = BACK_ENDS) -> BackEnd:
    """Return the back end of that name.

    Raises
    ------
    InputError
        There is none; the message lists the names.
    """
    for back_end in back_ends:
        if back_end.name == name:
            return back_end
    known = ", ".join((CYCLIC, *(back_end.name for back_end in back_ends)))
    raise InputError(f"solver '{name}' found, must be one of {known}")
