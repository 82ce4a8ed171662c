"""The further loads of a map: rolling moment and section loads, as the five loads are made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from builder.inverse.loads.covariance import load_covariance_by_terms
from builder.inverse.noise.model import NoiseModel
from builder.inverse.solution import Problem, Solution
from strainfmu.arrays import FloatArray
from strainfmu.estimator.further_loads import FurtherLoads


def further_loads(problem: Problem, solution: Solution, error_load: FloatArray | None) -> FurtherLoads | None:
    """Return the further loads of a solved ``problem``; None where it has none.

    ``error_load`` (m, k) are those of the columns of the map's ``error_strain``; None in form "absolute".
    """
    operator = problem.further_operator
    if operator is None:
        return None
    noise = NoiseModel(tuple(replace(term, load=term.further) for term in solution.noise.terms))
    cross = noise.strain_load_covariance
    per_state = operator @ solution.field_modes
    covariance = load_covariance_by_terms(solution.solved, per_state, noise, cross)
    inside = problem.ensemble.fixed_pressure
    return FurtherLoads(
        section_station=np.array(problem.entry.section_stations_m, dtype=float),
        load_per_state=per_state,
        load_of_mean=operator @ (solution.mean - inside),
        variance=np.diag(covariance).copy(),
        strain_load_covariance=cross,
        error_load=error_load,
        fixed_load=-inside * operator.sum(axis=1) if error_load is not None and inside != 0.0 else None,
    )
