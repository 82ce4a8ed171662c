"""Difference of two flow models: the error of a flow that no campaign of one model shows.

Modified newtonian theory gives the pressure on any surface at once, by other equations than the
snapshots. The difference, flow by flow, stands for the model-form error: it has the shape that another flow model
has, and grows with the incidence as its loads do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.surface.mesh import mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.modes.ensemble import Ensemble, ensemble_of
from builder.inverse.noise.model import NoiseTerm
from builder.vehicle.file import Vehicle
from builder.vehicle.map.model_form import model_form
from strainfmu.arrays import FloatArray

FLOW_MODELS = "difference of flow models"
"""Name of the error, in the linear map and in the tables."""


def newtonian_snapshots(vehicle: Vehicle, snapshots: Snapshots) -> Snapshots | None:
    """Return ``snapshots`` with the pressure of newtonian flow, Prandtl-Meyer leeward.

    None where no difference is stated, where the snapshots are of newtonian flow themselves, of which the leeward
    side alone is open (:mod:`builder.inverse.noise.leeward`), and where they depend on flow parameters, which this
    flow does not have.
    """
    is_stated = model_form(vehicle.map, vehicle.noise).of_newtonian > 0.0
    if not is_stated or snapshots.engine == "newtonian" or snapshots.parameter_names:
        return None
    engine = NewtonianEngine(mesh_of(snapshots.grid or snapshots.surface), leeward="prandtl_meyer")
    conditions = snapshots.conditions()
    ratio = np.array([engine.solve(engine.flow_key(one)).arrays["pressure_ratio"] for one in conditions])
    ambient = np.array([one.ambient_pressure for one in conditions])
    return replace(snapshots, pressure=ratio * ambient[:, None])


def newtonian_difference(vehicle: Vehicle, snapshots: Snapshots, ensemble: Ensemble) -> Ensemble | None:
    """Return newtonian flow less ``ensemble``, which holds ``snapshots``, at one standard deviation.

    None where :func:`newtonian_snapshots` gives none.
    """
    newtonian = newtonian_snapshots(vehicle, snapshots)
    if newtonian is None:
        return None
    size = model_form(vehicle.map, vehicle.noise).of_newtonian
    off = size * (ensemble_of(vehicle, newtonian).pressure - ensemble.pressure)
    return replace(ensemble, pressure=off, fixed_pressure=0.0)


def overpressure_error(vehicle: Vehicle, snapshots: Snapshots, ensemble: Ensemble) -> FloatArray | None:
    """Return (n_p,) the error of the overpressure at the smallest incidence, its mean over the Mach numbers [Pa];
    None where none is stated."""
    size = model_form(vehicle.map, vehicle.noise).of_overpressure
    incidence = np.array([one.total_incidence for one in snapshots.conditions()])
    ambient = np.array([one.ambient_pressure for one in snapshots.conditions()])
    ratio = (snapshots.pressure / ambient[:, None])[incidence <= incidence.min() + 1e-9].mean(axis=0)
    return size * ensemble.mean_ambient_pressure * (ratio - 1.0) if size > 0.0 else None


def difference_term(difference: Ensemble, strain: FloatArray, load: FloatArray) -> NoiseTerm:
    """Return the term of ``difference``, its covariance the mean over the members.

    Strain and loads follow by the operators ``strain`` (n_d, n_p), ``load`` (n_f, n_p).
    """
    columns = difference_columns(difference, np.vstack([strain, load]))
    return NoiseTerm(FLOW_MODELS, columns[: len(strain)], columns[len(strain) :], scales=True)


def difference_columns(difference: Ensemble, operator: FloatArray) -> FloatArray:
    """Return columns (m, k) of ``operator`` (m, n_p) times the members, whose squares add up to the mean ones."""
    columns = (np.sqrt(difference.member_weight)[:, None] * difference.responses(operator)).T
    left, size, _ = np.linalg.svd(columns / _rows(columns), full_matrices=False)
    return np.asarray(_rows(columns) * left * size)


def _rows(columns: FloatArray) -> FloatArray:
    """Return the size (m, 1) of each row, 1 where it is 0: rows of unlike units cost no digits."""
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    return np.where(size > 0.0, size, 1.0)
