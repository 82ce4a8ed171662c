"""Flights of a vehicle of any shape on its independent model.

There is no table of flows: each flight has a flow of its own, on the finer surface, and nothing is interpolated
between flows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from builder.aero.engine import FlowKey
from builder.aero.engines.registry import make_engine
from builder.aero.loads.operator import coefficients_of
from builder.aero.loads.sections import six_loads
from builder.aero.mapping.pressure_map import consistent_map
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.run import complete_flows, snapshots_of_flows
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots
from builder.campaign.vehicle_campaign import vehicle_campaign
from builder.reporting import Reporter
from builder.structure.as_built.displaced import DisplacedGauges
from builder.structure.as_built.vehicle import AsBuilt
from builder.truth.flights import Flights, pressures_at
from builder.truth.shape.structure import ShapeStructure, on_nodes_of
from builder.vehicle.conditions.flight_conditions import ConditionSet
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.flight_condition import FlightCondition


@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeFlights(Flights):
    """Flights of a vehicle of any shape.

    Attributes
    ----------
    strain : (n_w, k, n_d) by the outer pressure, see :class:`ShapeStructure` [m/m].
    unit_strain : (n_w, n_d) per uniform outer pressure [1/Pa].
    gauges : as displaced.
    """

    strain: FloatArray
    unit_strain: FloatArray
    gauges: DisplacedGauges

    def read(
        self, built: AsBuilt, rows: slice = slice(None), random: np.random.Generator | None = None
    ) -> FloatArray:
        ambient = self.ambient_pressure[rows, None]
        inside = self.internal_pressure[rows, None] + built.internal_pressure * ambient
        flown = self.gauges.as_built(self.strain[:, rows], built)
        return np.asarray(flown - inside * self.gauges.as_built(self.unit_strain, built) + built.apparent_strain)


def shape_flights(
    vehicle: Vehicle,
    structure: ShapeStructure,
    flows: Snapshots,
    operator: FloatArray | None = None,
) -> ShapeFlights:
    """Return the flights of ``vehicle`` at the conditions of ``flows``.

    ``operator`` (n_w, n_d, n_q) is :func:`~builder.truth.shape.structure.on_nodes_of` for these flows, where it is
    known.

    Raises
    ------
    InputError
        The surfaces of flow and structure do not coincide.
    """
    pressures = pressures_at(vehicle, flows.conditions())
    operator = on_nodes_of(structure, flows) if operator is None else operator
    reference = vehicle.reference_quantities()
    loads = six_loads(flows.surface, reference.moment_station)
    net = flows.pressure - pressures["internal_pressure"][:, None]
    return ShapeFlights(
        strain=np.stack([flows.pressure @ way.T for way in operator]),
        unit_strain=operator.sum(axis=2),
        gauges=structure.gauges,
        counts=structure.counts,
        coefficients=coefficients_of(net, loads[:5], pressures["conditions"], reference),
        rolling=net @ loads[5] / (pressures[DYNAMIC_PRESSURE] * reference.area * reference.length),
        **pressures,
    )


def shape_flows(
    vehicle: Vehicle, conditions: Sequence[FlightCondition], reporter: Reporter, title: str
) -> Snapshots:
    """Solve the flows at ``conditions`` on the finer surface, in memory; those beyond the solver's reach are left
    out.

    Raises
    ------
    FlowReachError
        All of them are.
    """
    engine = make_engine(vehicle, None, vehicle.resolution.truth)
    campaign = vehicle_campaign(vehicle, engine, (ConditionSet("independent model", tuple(conditions)),))
    failed: dict[FlowKey, str] = {}
    flows, _ = complete_flows(
        engine,
        [engine.flow_key(condition) for condition in conditions],
        journal=None,
        known={},
        scheduling=Scheduling(workers=0),
        reporter=reporter,
        title=title,
        failed=failed,
    )
    return snapshots_of_flows(campaign, flows, failed)


def at_conditions(flows: Snapshots, conditions: Sequence[FlightCondition]) -> Snapshots | None:
    """Return the pressures of ``flows`` at ``conditions``, at altitudes of their own; None where none is known.

    Conditions without a flow are left out.
    """
    row = {_flow_of(one): number for number, one in enumerate(flows.conditions())}
    known = [one for one in conditions if _flow_of(one) in row]
    if not known:
        return None
    rows = np.array([row[_flow_of(one)] for one in known])
    return flown_at(flows.chosen(rows), known, ratio_of(flows)[rows])


def ratio_of(flows: Snapshots) -> FloatArray:
    """Return p / p_inf (N, n_p) of ``flows``."""
    return np.asarray(flows.pressure / np.array([[one.ambient_pressure] for one in flows.conditions()]))


def flown_at(flows: Snapshots, conditions: Sequence[FlightCondition], ratio: FloatArray) -> Snapshots:
    """Return ``flows`` at as many other ``conditions``, where p / p_inf is ``ratio`` (N, n_p)."""
    ambient = np.array([one.ambient_pressure for one in conditions])
    return replace(
        flows,
        condition=np.array([one.as_row() for one in conditions]),
        pressure=ambient[:, None] * ratio,
        internal_pressure=ambient,
    )


def _flow_of(condition: FlightCondition) -> tuple[float, ...]:
    """Return what the flow over p_inf depends on, rounded."""
    mach, alpha, beta, _, *parameters = condition.as_row()
    return tuple(round(one, 9) for one in (mach, alpha, beta, *parameters))


def on_nodes(flows: Snapshots, nodes: SurfaceMesh) -> FloatArray:
    """Return (N, n_p) the pressure of ``flows`` at ``nodes`` [Pa], linear over the triangles of their surface."""
    source = flows.surface
    if source.digest() == nodes.digest():
        return flows.pressure
    return np.asarray((consistent_map(source, nodes.point, nodes.node_normal) @ flows.pressure.T).T)
