"""The inverse map from snapshots and strain per pressure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from builder.aero.loads.operator import coefficients_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.envelope.score_limit import with_score_limit
from builder.inverse.noise.model import NoiseTerm
from builder.inverse.problem import AnyStructure, inverse_problem, on_structure
from builder.inverse.solution import Problem, solve
from builder.inverse.solved_map import inverse_map_of, on_observable_states
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap


def build_inverse_map(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    nuisance: Sequence[NoiseTerm] = (),
    problem: Problem | None = None,
) -> InverseMap:
    """Build the map of the case in the vehicle file, for the layout in use.

    Parameters and errors are as in :func:`~builder.inverse.problem.inverse_problem`, whose result ``problem``
    is where it is known. The gauges may also fail to identify the requested modes.
    """
    snapshots = on_structure(snapshots, structure)
    problem = problem or inverse_problem(vehicle, snapshots, structure, nuisance)
    solution = solve(problem)
    inverse_map = on_observable_states(inverse_map_of(vehicle, snapshots, structure, problem, solution))
    return with_score_limit(inverse_map, problem, solution)


def snapshot_coefficients(vehicle: Vehicle, snapshots: Snapshots, loads: FloatArray) -> FloatArray:
    """Return (N, 5) coefficients of the snapshots; ``loads`` is the load operator (5, n_p)."""
    conditions = snapshots.conditions()
    inside = np.array([vehicle.internal_pressure(condition) for condition in conditions])
    return coefficients_of(snapshots.pressure - inside[:, None], loads, conditions, vehicle.reference_quantities())
