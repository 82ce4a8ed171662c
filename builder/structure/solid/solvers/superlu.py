"""SuperLU, which scipy brings along."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from builder.structure.solid.solvers.back_end import BackEnd, Factor
from builder.structure.solid.solvers.problem import FloatArray, SolverError, SparseProblem


def factor_symmetric(matrix: csr_array | csc_array) -> Any:
    """Factorise a symmetric or Hermitian positive definite matrix.

    The pattern is ordered by minimum degree on A + A^T and pivots stay on the diagonal: half the fill of the
    general mode, and safe for a definite matrix (Li et al., SuperLU Users' Guide, section 2.7.4).

    Returns
    -------
    scipy.sparse.linalg.SuperLU

    Raises
    ------
    SolverError
        The matrix is singular to round-off, or memory does not suffice.
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
    return solve_in_threads(factor_symmetric(problem.matrix))


def solve_in_threads(factor: Any) -> Factor:
    """Return what solves for right-hand sides (n, k), their columns shared out among the processors.

    SuperLU takes columns one by one and lets other threads run meanwhile; the factors are only read.
    """

    def solve(right_hand_sides: FloatArray) -> FloatArray:
        n_parts = min(os.cpu_count() or 1, right_hand_sides.shape[1])
        if n_parts < 2:
            alone: FloatArray = factor.solve(right_hand_sides)
            return alone
        with ThreadPoolExecutor(n_parts) as pool:
            parts = pool.map(factor.solve, np.array_split(right_hand_sides, n_parts, axis=1))
            return np.hstack(list(parts))

    return solve


SUPERLU = BackEnd("superlu", "BSD-3-Clause", "pip install 'strainfmu[build]'", lambda: True, _factor)
