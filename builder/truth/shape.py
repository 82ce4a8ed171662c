"""The independent model of a vehicle of any shape: another mesh than the map's, and a flow on the finer surface
for every flight.

There is no table of flows, and nothing is interpolated between flows. Along a manoeuvre the flow is solved at
points of time; between them p / p_inf follows by a cubic spline in time."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from builder.aero.engines.registry import make_engine
from builder.aero.load_groups import six_loads
from builder.aero.load_operator import coefficients_of
from builder.aero.pressure_map import consistent_map
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.campaign_run import snapshots_in_memory, vehicle_campaign
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots
from builder.reporting import Reporter
from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts
from builder.structure.as_built.displaced_structure import DisplacedGauges, refuse_others, ways_of
from builder.structure.fourier.fourier_model import refuse_beyond_fourier
from builder.structure.mapped_structure import mapped_operator
from builder.structure.solid.case import flying_mesh, structure_case
from builder.structure.solid.gauge_layouts import DISPLACED, displaced_name
from builder.structure.solid.solid_model import on_other_mesh
from builder.structure.structure_file import MeshCheck, Structure
from builder.truth.flights import Flights, pressures_at
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import ConditionSet
from builder.vehicle.map_options import Noise
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.cosim.models.trajectory import Trajectory
from strainfmu.errors import FlowReachError, InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.flight_condition import FlightCondition

NO_SECOND_MESH = "structure.checked_by: entry is missing, a second mesh plays the vehicle in an independent model"


@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeStructure:
    """Strain of the gauges in use on another mesh than the map's.

    Attributes
    ----------
    names : of the n_d gauges.
    position : (n_d, 3) [m].
    operator : (n_w, n_d, n_q) per pressure at the nodes of ``surface``, see
        :data:`~builder.structure.as_built.displaced_structure.WAYS` [1/Pa, then 1/(Pa m) twice,
        1/Pa].
    surface : that carries the pressure.
    """

    names: tuple[str, ...]
    position: FloatArray
    operator: FloatArray
    surface: SurfaceMesh

    @cached_property
    def gauges(self) -> DisplacedGauges:
        return DisplacedGauges(self.position)

    @property
    def counts(self) -> Counts:
        """Numbers of what has errors of its own."""
        return Counts(gauge=len(self.names), row=int(self.gauges.row.max()) + 1)


def refuse_without_independent_model(vehicle: Vehicle) -> None:
    """Refuse a vehicle that has no independent model, before anything is solved.

    Raises
    ------
    InputError
        Names the entry, and what it would need.
    """
    if vehicle.is_axisymmetric:
        refuse_beyond_fourier(vehicle, [vehicle.gauges.layout])
        return
    if vehicle.aerodynamics.engine == "table":
        raise InputError(
            "aerodynamics.engine: expected 'euler' or 'newtonian' for an independent model, got 'table', which "
            "holds the conditions of its manifest alone"
        )
    if vehicle.structure.external is not None:
        raise InputError(
            f"structure.{vehicle.structure.external}: expected none for an independent model, got another code's "
            "strains, of one mesh"
        )
    if vehicle.sensors is not None:
        raise InputError("sensors: expected none for an independent model of this shape, which has gauges alone")
    if vehicle.structure.mesh is not None and vehicle.structure.checked_by is None:
        raise InputError(NO_SECOND_MESH)


def flying_structure(vehicle: Vehicle, known: Structure | None, reporter: Reporter) -> ShapeStructure:
    """Return the gauges in use on the mesh that plays the vehicle that flies.

    The structure of a body of sections is finer than the map's. The structure of a surface is
    ``structure.checked_by``, whose strains are in ``known``, the structure of the map, if that was made with it.

    Raises
    ------
    InputError
        There is no second mesh.
    """
    if vehicle.structure.mesh is not None and known is not None and known.check is not None:
        return structure_of_check(known, known.check, vehicle.gauges.layout, vehicle.noise)
    layout = vehicle.gauges.layout
    case = structure_case(vehicle, [layout])
    mesh = flying_mesh(vehicle, case)
    if mesh is None:
        raise InputError(NO_SECOND_MESH)
    with reporter.stage("Structure: the vehicle that flies") as progress:
        check = on_other_mesh(case, mesh, progress)
    ends = np.cumsum([len(gauges.name) for gauges in case.layouts.values()])
    operators = dict(zip(case.layouts, np.split(check.strain_operator, ends[:-1]), strict=True))
    gauges = case.layouts[layout]
    return _structure(layout, vehicle.noise, gauges.name, gauges.position, check, operators.__getitem__)


def structure_of_check(known: Structure, check: MeshCheck, layout: str, noise: Noise) -> ShapeStructure:
    """Return the gauges of ``layout`` on the mesh that ``known``, the structure of the map, was checked by."""
    gauges = known.gauges_of(layout)
    return _structure(
        layout,
        noise,
        tuple(known.gauge_names[i] for i in gauges),
        known.gauge_position[gauges],
        check,
        lambda name: check.strain_operator[known.gauges_of(name)],
    )


def _structure(
    layout: str,
    noise: Noise,
    names: tuple[str, ...],
    position: FloatArray,
    check: MeshCheck,
    operators: Callable[[str], FloatArray],
) -> ShapeStructure:
    """Return the structure from ``check``, whose ``operators`` by name of layout are of gauges in place and
    displaced."""
    refuse_others(noise)
    assert check.point is not None
    assert check.triangle is not None
    moved = None
    if noise.moves_gauges:
        moved = {how: operators(displaced_name(layout, how)) for how in DISPLACED}.__getitem__
    return ShapeStructure(
        names=names,
        position=position,
        operator=ways_of(operators(layout), moved),
        surface=SurfaceMesh(check.point, check.triangle),
    )


def on_nodes_of(structure: ShapeStructure, snapshots: Snapshots) -> FloatArray:
    """Return the operator (n_w, n_d, n_p) of ``structure`` per pressure at the nodes of ``snapshots``.

    Raises
    ------
    InputError
        The surfaces of flow and structure do not coincide.
    """
    n_w, n_d, n_q = structure.operator.shape
    flat = structure.operator.reshape(n_w * n_d, n_q)
    return mapped_operator(flat, structure.surface, snapshots)[1].reshape(n_w, n_d, -1)


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
        self, as_built: AsBuilt, rows: slice = slice(None), random: np.random.Generator | None = None
    ) -> FloatArray:
        ambient = self.ambient_pressure[rows, None]
        inside = self.internal_pressure[rows, None] + as_built.internal_pressure * ambient
        flown = self.gauges.as_built(self.strain[:, rows], as_built)
        return np.asarray(
            flown - inside * self.gauges.as_built(self.unit_strain, as_built) + as_built.apparent_strain
        )


def shape_flights(
    vehicle: Vehicle,
    structure: ShapeStructure,
    flows: Snapshots,
    operator: FloatArray | None = None,
) -> ShapeFlights:
    """Return the flights of ``vehicle`` at the conditions of ``flows``.

    ``operator`` (n_w, n_d, n_q) is :func:`~builder.truth.shape.on_nodes_of` for these flows, where it is
    known.
    """
    pressures = pressures_at(vehicle.structure, flows.conditions())
    operator = on_nodes_of(structure, flows) if operator is None else operator
    reference = vehicle.reference_quantities()
    loads = six_loads(flows.surface, reference.moment_station)
    net = flows.pressure - pressures["internal_pressure"][:, None]
    rolling = net @ loads[5] / (pressures[DYNAMIC_PRESSURE] * reference.area * reference.length)
    return ShapeFlights(
        strain=np.stack([flows.pressure @ operator_of_way.T for operator_of_way in operator]),
        unit_strain=operator.sum(axis=2),
        gauges=structure.gauges,
        counts=structure.counts,
        coefficients=np.column_stack(
            [coefficients_of(net, loads[:5], pressures["conditions"], reference), rolling]
        ),
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
    return snapshots_in_memory(campaign, Scheduling(workers=0), reporter, title).snapshots


def at_conditions(flows: Snapshots, conditions: Sequence[FlightCondition]) -> Snapshots:
    """Return the pressures of ``flows`` at ``conditions``, at altitudes of their own.

    Conditions without a flow are left out.

    Raises
    ------
    FlowReachError
        All of them are.
    """
    row = {_flow_of(condition): number for number, condition in enumerate(flows.conditions())}
    known = [condition for condition in conditions if _flow_of(condition) in row]
    if not known:
        raise FlowReachError("none of its flows is within the solver's reach")
    rows = np.array([row[_flow_of(condition)] for condition in known])
    return flown_at(flows.chosen(rows), known, ratio_of(flows)[rows])


def ratio_of(flows: Snapshots) -> FloatArray:
    """Return p / p_inf (N, n_p) of ``flows``."""
    return np.asarray(
        flows.pressure / np.array([[condition.ambient_pressure] for condition in flows.conditions()])
    )


def flown_at(flows: Snapshots, conditions: Sequence[FlightCondition], ratio: FloatArray) -> Snapshots:
    """Return ``flows`` at as many other ``conditions``, where p / p_inf is ``ratio`` (N, n_p)."""
    ambient = np.array([condition.ambient_pressure for condition in conditions])
    return replace(
        flows,
        condition=np.array([condition.as_row() for condition in conditions]),
        pressure=ambient[:, None] * ratio,
        internal_pressure=ambient,
    )


def _flow_of(condition: FlightCondition) -> tuple[float, ...]:
    """Return what the flow over p_inf depends on, rounded."""
    mach, alpha, beta, _, *parameters = condition.as_row()
    return tuple(round(entry, 9) for entry in (mach, alpha, beta, *parameters))


def on_nodes(surface: SurfaceMesh, pressure: FloatArray, nodes: SurfaceMesh) -> FloatArray:
    """Return (N, n_q) at ``nodes`` the ``pressure`` (N, n_p) on ``surface``, linear over its triangles."""
    if surface.digest() == nodes.digest():
        return pressure
    return np.asarray((consistent_map(surface, nodes.point, nodes.node_normal) @ pressure.T).T)


FLOWS_ALONG_PATH = 25

BLOCK = 100
"""Samples at a time: pressures on all nodes are large."""


def flows_along(vehicle: Vehicle, path: Trajectory, reporter: Reporter) -> tuple[FloatArray, Snapshots]:
    """Solve the flow at points of time along a manoeuvre; return these times (k,) [s] and the pressures there."""
    time = np.linspace(0.0, path.stop_time, FLOWS_ALONG_PATH)
    conditions = tuple(path.condition_at(float(t)) for t in time)
    return time, shape_flows(vehicle, conditions, reporter, "Flow: the vehicle that flies")


def flights_along(
    vehicle: Vehicle,
    structure: ShapeStructure,
    flows: tuple[FloatArray, Snapshots],
    time: FloatArray,
    path: Trajectory,
) -> Iterator[ShapeFlights]:
    """Yield the flights at ``time`` (n,) [s], in blocks; ``flows`` are of :func:`flows_along`."""
    knots, snapshots = flows
    operator, ratio = on_nodes_of(structure, snapshots), CubicSpline(knots, ratio_of(snapshots), axis=0)
    for first in range(0, len(time), BLOCK):
        part = time[first : first + BLOCK]
        none: IntArray = np.zeros(len(part), dtype=np.int64)
        flows_of_part = flown_at(snapshots.chosen(none), [path.condition_at(float(t)) for t in part], ratio(part))
        yield shape_flights(vehicle, structure, flows_of_part, operator)
