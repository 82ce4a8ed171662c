"""PARDISO of Intel oneMKL through pypardiso: Cholesky of the upper triangle."""

from __future__ import annotations

import weakref

import numpy as np
from scipy.sparse import csr_matrix, triu

from builder.structure.solid.solvers.back_end import BackEnd, Factor, importable
from builder.structure.solid.solvers.problem import SolverError, SparseProblem
from strainfmu.arrays import FloatArray

POSITIVE_DEFINITE = 2  # matrix type of PARDISO: real, symmetric, positive definite
NOT_POSITIVE = -4  # its error: zero or negative pivot


def _factor(problem: SparseProblem) -> Factor:
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
    factor=_factor,
)
