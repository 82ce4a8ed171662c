"""Error of newtonian flow on the leeward side, of which the theory itself has more than one answer.

Ambient pressure in the shadow and a Prandtl-Meyer expansion differ by most of p_inf, and either is far from a real
leeward side. So a part of their difference counts as an error of the pressure, in strain and loads together.
"""

from __future__ import annotations

import numpy as np

from builder.aero.engines.newtonian import NewtonianEngine
from builder.campaign.snapshots import Snapshots
from builder.inverse.modes.ensemble import Ensemble
from builder.inverse.noise.flows_between import same_engine
from builder.vehicle.file import Vehicle
from builder.vehicle.map.model_form import model_form
from strainfmu.arrays import FloatArray

LEEWARD_PRESSURE = "leeward pressure of newtonian flow"
"""Name of the error, in the linear map and in the tables."""

MOST_FLOWS = 100
"""Conditions at most that the error is taken at; of more some are drawn."""


def other_leeward(vehicle: Vehicle) -> str:
    """Return the leeward side of newtonian flow that is not the vehicle's own."""
    entry = vehicle.aerodynamics
    is_expanded = entry.engine == "newtonian" and entry.leeward == "prandtl_meyer"
    return "ambient" if is_expanded else "prandtl_meyer"


def leeward_fields(vehicle: Vehicle, snapshots: Snapshots, ensemble: Ensemble) -> FloatArray | None:
    """Return fields (k, n_p) of the error at the level of ``ensemble`` [Pa], their squares add up to the mean one.

    None where the snapshots are not of newtonian flow round another shape than a body of revolution, or where no
    error is stated.
    """
    size = model_form(vehicle.map, vehicle.noise).of_leeward
    stated_engine = same_engine(vehicle, snapshots) if size > 0.0 else None
    if stated_engine is None:
        return None
    changed_engine = same_engine(vehicle, snapshots, other_leeward(vehicle))
    assert changed_engine is not None
    listed = snapshots.conditions()
    if len(listed) > MOST_FLOWS:
        chosen = np.random.default_rng(1).permutation(len(listed))[:MOST_FLOWS]
        listed = [listed[row] for row in sorted(chosen.tolist())]

    def ratio(engine: NewtonianEngine) -> FloatArray:
        return np.array(
            [engine.solve(engine.flow_key(condition)).arrays["pressure_ratio"] for condition in listed]
        )

    difference = ratio(changed_engine) - ratio(stated_engine)
    return np.asarray(size * ensemble.mean_ambient_pressure * difference / np.sqrt(len(difference)))
