"""Difference of two flow models: the error of a flow that no campaign of one model shows.

Modified newtonian theory gives the pressure on any surface at once, by other equations than the
snapshots. The difference, flow by flow, stands for the model-form error: it has the shape that another flow model
has, and grows with the incidence as its loads do.

Error of newtonian flow on the leeward side, of which the theory itself has more than one answer.

Ambient pressure in the shadow and a Prandtl-Meyer expansion differ by most of p_inf, and either is far from a real
leeward side. So a part of their difference counts as an error of the pressure, in strain and loads together.
"""

from dataclasses import replace

import numpy as np

from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.surface.mesh import mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.ensemble import Ensemble
from builder.inverse.noise.flows_between import SolvedFlows
from builder.inverse.noise.model import FAINT_COLUMN, NoiseTerm, pressure_errors, principal_columns, size_of
from builder.vehicle.model_entries import Aerodynamics
from builder.vehicle.model_form import ModelForm
from strainfmu.arrays import FloatArray

LEEWARD_PRESSURE = "leeward pressure of newtonian flow"
"""Name of the error, in the linear map and in the tables."""

MOST_FLOWS = 100
"""Conditions at most that the error is taken at; of more some are drawn."""


def other_leeward(entry: Aerodynamics) -> str:
    """Return the leeward side of newtonian flow that is not the vehicle's own."""
    is_expanded = entry.engine == "newtonian" and entry.leeward == "prandtl_meyer"
    return "ambient" if is_expanded else "prandtl_meyer"


def leeward_fields(flows: SolvedFlows, sizes: ModelForm, ensemble: Ensemble) -> FloatArray | None:
    """Return fields (k, n_p) of the error at the level of ``ensemble`` [Pa], their squares add up to the mean one.

    None where the snapshots are not of newtonian flow round another shape than a body of revolution, or where no
    error is stated.
    """
    size = sizes.of_leeward
    stated_engine = flows.engine if size > 0.0 else None
    if stated_engine is None:
        return None
    changed_engine = flows.by(other_leeward(flows.entries.engine))
    assert changed_engine is not None
    listed = flows.snapshots.conditions()
    if len(listed) > MOST_FLOWS:
        chosen = np.random.default_rng(1).permutation(len(listed))[:MOST_FLOWS]
        listed = [listed[row] for row in sorted(chosen.tolist())]

    def ratio(engine: NewtonianEngine) -> FloatArray:
        return np.array(
            [engine.solve(engine.flow_key(condition)).arrays["pressure_ratio"] for condition in listed]
        )

    difference = ratio(changed_engine) - ratio(stated_engine)
    return np.asarray(size * ensemble.mean_ambient_pressure * difference / np.sqrt(len(difference)))


FLOW_MODELS, LEVEL = "difference of flow models", "fraction of the overpressure"
"""Names of the errors, in the linear map and in the tables."""


def newtonian_snapshots(sizes: ModelForm, snapshots: Snapshots) -> Snapshots | None:
    """Return ``snapshots`` with the pressure of newtonian flow, Prandtl-Meyer leeward.

    None where no difference is stated, where the snapshots are of newtonian flow themselves, of which the leeward
    side alone is open (:func:`leeward_fields`), and where they depend on flow parameters, which this flow does not
    have.
    """
    if not sizes.of_newtonian > 0.0 or snapshots.engine == "newtonian" or snapshots.parameter_names:
        return None
    engine = NewtonianEngine(mesh_of(snapshots.grid or snapshots.surface), leeward="prandtl_meyer")
    conditions = snapshots.conditions()
    ratio = np.array(
        [engine.solve(engine.flow_key(condition)).arrays["pressure_ratio"] for condition in conditions]
    )
    ambient = np.array([condition.ambient_pressure for condition in conditions])
    return replace(snapshots, pressure=ratio * ambient[:, None])


def flow_model_errors(
    sizes: ModelForm,
    snapshots: Snapshots,
    ensemble: Ensemble,
    newtonian: Ensemble | None,
    strain: FloatArray,
    load: FloatArray,
) -> tuple[NoiseTerm, ...]:
    """Return the terms of the level and of the difference of flow models, where these are stated.

    The level is a part of the mean overpressure of all Mach numbers at the smallest incidence. The difference
    is ``newtonian`` less ``ensemble``, which holds ``snapshots``; its covariance is the mean over the members.
    Strain and loads follow by the operators ``strain`` (n_d, n_p), ``load`` (n_f, n_p).
    """
    terms = list[NoiseTerm]()
    if sizes.of_overpressure > 0.0:
        incidence = np.array([condition.total_incidence for condition in snapshots.conditions()])
        ambient = np.array([condition.ambient_pressure for condition in snapshots.conditions()])
        ratio = (snapshots.pressure / ambient[:, None])[incidence <= incidence.min() + 1e-9].mean(axis=0)
        level = sizes.of_overpressure * ensemble.mean_ambient_pressure * (ratio - 1.0)
        terms.append(pressure_errors(LEVEL, level[None], strain, load))
    if newtonian is not None:
        off = sizes.of_newtonian * (newtonian.pressure - ensemble.pressure)
        difference = replace(ensemble, pressure=off, fixed_pressure=0.0)
        members = np.hstack([difference.responses(strain), difference.responses(load)])
        rows = np.sqrt(difference.member_weight @ members**2)
        rows[rows == 0.0] = 1.0  # rows of unlike units cost no digits
        blocks = difference.columns_by_harmonic(members / rows)
        columns = rows[:, None] * principal_columns(blocks, FAINT_COLUMN * size_of(blocks))
        of_strain, of_load = np.split(columns, [len(strain)])
        terms.append(NoiseTerm(FLOW_MODELS, of_strain, of_load, scales=True))
    return tuple(terms)
