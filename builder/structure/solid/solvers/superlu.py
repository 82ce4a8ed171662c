"""SuperLU, which scipy brings along."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from builder.processors import processors
from builder.structure.solid.solvers.back_end import BackEnd, Factor
from builder.structure.solid.solvers.mirror_symmetry import symmetric_parts
from builder.structure.solid.solvers.problem import SolverError, SparseProblem
from strainfmu.arrays import FloatArray


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
    """Factorise part by part (:mod:`~builder.structure.solid.solvers.mirror_symmetry`), several at once.

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
