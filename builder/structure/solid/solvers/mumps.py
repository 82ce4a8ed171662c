"""MUMPS through python-mumps: multifrontal L D L^T of the upper triangle."""

from __future__ import annotations

from builder.structure.solid.solvers.back_end import BackEnd, Factor, importable
from builder.structure.solid.solvers.problem import SolverError, SparseProblem

NEGATIVE_PIVOTS = 12  # index of their number in MUMPS's INFOG


def _factor(problem: SparseProblem) -> Factor:
    from mumps import Context, MUMPSError

    context = Context()
    context.set_matrix(problem.matrix, symmetric=True)
    try:
        # No pivots off the diagonal: a definite matrix needs none.
        context.factor(pivot_tol=0.0)
    except MUMPSError as error:
        raise SolverError(f"solver mumps: {error}") from None
    negative = context.mumps_instance.infog[NEGATIVE_PIVOTS]
    if negative:
        raise SolverError(f"solver mumps: the stiffness is not positive definite ({negative} negative pivots)")
    solve: Factor = context.solve
    return solve


MUMPS = BackEnd(
    name="mumps",
    licence="BSD-2-Clause over MUMPS, CeCILL-C",
    install="apt-get install libmumps-seq-dev gfortran libopenblas0-pthread, then pip install 'strainfmu[mumps]'",
    installed=lambda: importable("mumps"),
    factor=_factor,
)
