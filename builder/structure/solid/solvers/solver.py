"""One interface to all solvers, and the choice among them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.sparse import csc_array, csr_array, issparse

from builder.structure.solid.operators.cyclic_operator import CyclicProblem
from builder.structure.solid.solvers.back_end import BackEnd
from builder.structure.solid.solvers.cyclic import CyclicSolver
from builder.structure.solid.solvers.iterative import ITERATIVE
from builder.structure.solid.solvers.pardiso import PARDISO
from builder.structure.solid.solvers.petsc import petsc_back_end
from builder.structure.solid.solvers.problem import (
    RESIDUAL_BOUND,
    SolveStatistics,
    SparseProblem,
    checked_loads,
    checked_residual,
    peak_memory,
    probe_loads,
    refuse_indefinite,
    relative_residual,
)
from builder.structure.solid.solvers.superlu import SUPERLU
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

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
            A relative residual is above :data:`~builder.structure.solid.solvers.problem.RESIDUAL_BOUND`.
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
