"""The further loads of a map: rolling moment and section loads, as the five loads are made."""

from __future__ import annotations

import numpy as np

from builder.inverse.solution import Problem, Solution
from strainfmu.arrays import FloatArray
from strainfmu.estimator.further_loads import FurtherLoads


def further_loads(problem: Problem, solution: Solution, error_load: FloatArray) -> FurtherLoads | None:
    """Return the further loads of a solved ``problem``; None where it has none.

    ``error_load`` (m, k) holds the loads of the columns of the map's ``error_strain`` [N, N m].
    """
    operator = problem.further_operator
    if operator is None:
        return None
    follows, inside = problem.entry.form == "dynamic_pressure", problem.ensemble.fixed_pressure
    return FurtherLoads(
        section_station=np.array(problem.entry.section_stations_m, dtype=float),
        load_per_state=operator @ solution.field_modes,
        load_of_mean=operator @ (solution.mean - inside),
        error_load=error_load,
        fixed_load=-inside * operator.sum(axis=1) if follows and inside != 0.0 else None,
    )
