"""CHOLMOD, supernodal Cholesky: through scikit-sparse, and through cvxopt or kvxopt."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, tril

from builder.structure.solid.solvers.back_end import BackEnd, Factor, importable
from builder.structure.solid.solvers.problem import SolverError, SparseProblem
from strainfmu.arrays import FloatArray

CVXOPT_PACKAGES = ("cvxopt", "kvxopt")  # kvxopt is a fork with the same modules
NOT_POSITIVE = "solver {}: the stiffness is not positive definite"


def _factor_scikit_sparse(problem: SparseProblem) -> Factor:
    from sksparse.cholmod import CholmodNotPositiveDefiniteError, cholesky

    try:
        solve: Factor = cholesky(csc_matrix(problem.matrix), mode="supernodal")
    except CholmodNotPositiveDefiniteError:
        raise SolverError(NOT_POSITIVE.format("cholmod")) from None
    return solve


def _factor_cvxopt(problem: SparseProblem) -> Factor:
    package = next(name for name in CVXOPT_PACKAGES if importable(name))
    base, cholmod = import_module(package), import_module(f"{package}.cholmod")
    lower = tril(problem.matrix, format="coo")
    row, column = (base.matrix(index.astype(np.int64)) for index in (lower.row, lower.col))
    matrix = base.spmatrix(base.matrix(lower.data), row, column, problem.matrix.shape)
    factor: Any = cholmod.symbolic(matrix)
    try:
        cholmod.numeric(matrix, factor)
    except ArithmeticError:
        raise SolverError(NOT_POSITIVE.format("cvxopt")) from None

    def solve(load: FloatArray) -> FloatArray:
        answer = base.matrix(np.asfortranarray(load))
        cholmod.solve(factor, answer)
        return np.array(answer)

    return solve


CHOLMOD = BackEnd(
    name="cholmod",
    licence="BSD-2-Clause over CHOLMOD, LGPL-2.1 and (supernodal) GPL-2.0",
    install="apt-get install libsuitesparse-dev libopenblas0-pthread, then pip install 'strainfmu[cholmod]'",
    installed=lambda: importable("sksparse.cholmod"),
    factor=_factor_scikit_sparse,
)
CVXOPT = BackEnd(
    name="cvxopt",
    licence="GPL-3.0 over CHOLMOD",
    install="pip install 'strainfmu[cvxopt]'",
    installed=lambda: any(importable(name) for name in CVXOPT_PACKAGES),
    factor=_factor_cvxopt,
)
