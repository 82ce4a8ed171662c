"""A vehicle of any shape as it flies a manoeuvre: pressure, strains and coefficients of an independent model.

The flow is solved on the finer surface at points of time along the manoeuvre; between them p/p_inf follows by a
cubic spline in time. The structure is another mesh than the map's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from builder.aero.engines import make_engine
from builder.aero.loads import coefficients_of
from builder.aero.section_loads import six_loads
from builder.aero.surface_mesh import SurfaceMesh
from builder.campaign.run import complete_flows, snapshots_of_flows
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots
from builder.campaign.vehicle_campaign import vehicle_campaign
from builder.reporting import Reporter
from builder.structure.mapped_structure import mapped_operator
from builder.structure.mesh_check import MeshCheck
from builder.structure.solid.displaced_gauges import (
    AFT,
    AROUND,
    BACK,
    FORE,
    STEP,
    TURNED_AROUND,
    TURNED_BACK,
    displaced_name,
)
from builder.structure.solid.free_case import FreeCase
from builder.truth.as_built import AsBuilt
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import ConditionSet
from strainfmu.arrays import FloatArray
from strainfmu.cosim.trajectory import Trajectory
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

FLOWS_ALONG_PATH = 25


@dataclass(frozen=True, eq=False, kw_only=True)
class FlownPath:
    """What a vehicle does on its manoeuvre, at n samples.

    Attributes
    ----------
    time : (n,) [s].
    conditions : n flight conditions.
    strain : (n, n_d) of the gauges as built, without noise [m/m].
    coefficients : (n, 5) C_A, C_N, C_Y, M_P, M_Y [1].
    rolling : (n,) M_R [1].
    """

    time: FloatArray
    conditions: tuple[FlightCondition, ...]
    strain: FloatArray
    coefficients: FloatArray
    rolling: FloatArray


def flows_along(vehicle: Vehicle, path: Trajectory, reporter: Reporter) -> tuple[FloatArray, Snapshots]:
    """Solve the flow at points of time along a manoeuvre; return these times (k,) [s] and the pressures there.

    Raises
    ------
    InputError
        The engine is that of a table, or a condition is outside its reach.
    """
    if vehicle.aerodynamics.engine == "table":
        raise InputError(
            "aerodynamics.engine: expected 'euler' or 'newtonian' for a demonstration, got 'table', which holds "
            "the conditions of its manifest alone; `strainfmu build` makes the map"
        )
    time = np.linspace(0.0, path.stop_time, FLOWS_ALONG_PATH)
    conditions = tuple(path.at(float(t)) for t in time)
    engine = make_engine(vehicle, None, vehicle.resolution.truth)
    campaign = vehicle_campaign(vehicle, engine, (ConditionSet("manoeuvre", conditions),))
    flows, _ = complete_flows(
        engine,
        [engine.flow_key(condition) for condition in conditions],
        journal=None,
        known={},
        scheduling=Scheduling(workers=0),
        reporter=reporter,
        title="Flow: the vehicle that flies",
    )
    return time, snapshots_of_flows(campaign, flows, {})


def flown_path(
    vehicle: Vehicle,
    case: FreeCase,
    structure: MeshCheck,
    flows: tuple[FloatArray, Snapshots],
    time: FloatArray,
    path: Trajectory,
    built: AsBuilt,
) -> FlownPath:
    """Return the strains and coefficients of a vehicle as ``built`` at ``time`` (n,) [s].

    Parameters
    ----------
    case : of the map; ``structure`` holds Z_p of its layouts on another mesh.
    flows : of :func:`flows_along`.

    Raises
    ------
    InputError
        The surfaces of flow and structure do not coincide.
    """
    knots, snapshots = flows
    assert structure.point is not None
    assert structure.triangle is not None
    target = SurfaceMesh(structure.point, structure.triangle)
    operator = mapped_operator(structure.strain_operator, target, snapshots)[1]
    conditions = tuple(path.at(float(t)) for t in time)
    ambient = np.array([condition.ambient_pressure for condition in conditions])
    inside = np.array([vehicle.internal_pressure(condition) for condition in conditions])
    at_knots = np.array([condition.ambient_pressure for condition in snapshots.conditions()])
    ratio = CubicSpline(knots, snapshots.pressure / at_knots[:, None], axis=0)
    reference = vehicle.reference_quantities()
    loads = six_loads(snapshots.surface, reference.moment_station)
    scale = np.array([one.dynamic_pressure for one in conditions]) * reference.area * reference.length
    own = _as_built(vehicle, case, operator, built)
    strain, coefficients = np.empty((len(time), len(own))), np.empty((len(time), 5))
    rolling = np.empty(len(time))
    for start in range(0, len(time), 100):  # in blocks: pressures on all nodes are large
        part = slice(start, start + 100)
        net = ambient[part, None] * ratio(time[part]) - inside[part, None]
        coefficients[part] = coefficients_of(net, loads[:5], conditions[part], reference)
        rolling[part] = net @ loads[5] / scale[part]
        strain[part] = (net - built.internal_pressure * ambient[part, None]) @ own.T
    return FlownPath(
        time=time,
        conditions=conditions,
        strain=strain + built.apparent_strain,
        coefficients=coefficients,
        rolling=rolling,
    )


def _as_built(vehicle: Vehicle, case: FreeCase, operator: FloatArray, built: AsBuilt) -> FloatArray:
    """Return Z_p (n_d, n_p) [1/Pa] of the layout in use with the errors of its hardware, to first order."""
    parts, first = {}, 0
    for name, gauges in case.layouts.items():
        parts[name] = operator[first : first + len(gauges.name)]
        first += len(gauges.name)
    layout = vehicle.gauges.layout
    own = parts[layout].copy()
    if vehicle.noise.moves_gauges:
        moved = {how: parts[displaced_name(layout, how)] for how in (AFT, FORE, AROUND, BACK)}
        turned = parts[displaced_name(layout, TURNED_AROUND)] - parts[displaced_name(layout, TURNED_BACK)]
        position = case.layouts[layout].position
        around = built.circumferential_shift + built.layout_roll * np.hypot(position[:, 1], position[:, 2])
        own += built.axial_shift[:, None] * (moved[AFT] - moved[FORE]) / (2.0 * STEP)
        own += around[:, None] * (moved[AROUND] - moved[BACK]) / (2.0 * STEP)
        own += built.orientation[:, None] * turned
    gain = (1.0 + built.gauge_gain) * (1.0 + built.common_gain) / (1.0 + built.wall_thickness)
    return np.asarray(gain[:, None] * own)
