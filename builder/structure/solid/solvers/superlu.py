"""SuperLU, which scipy brings along."""

from __future__ import annotations

from typing import Any

from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from builder.structure.solid.solvers.back_end import BackEnd, Factor
from builder.structure.solid.solvers.problem import SolverError, SparseProblem


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
    solve: Factor = factor_symmetric(problem.matrix).solve
    return solve


SUPERLU = BackEnd("superlu", "BSD-3-Clause", "pip install 'strainfmu[build]'", lambda: True, _factor)
