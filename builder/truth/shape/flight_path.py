"""A vehicle of any shape as it flies a manoeuvre: pressure, strains and coefficients of an independent model.

The flow is solved on the finer surface at points of time along the manoeuvre; between them p/p_inf follows by a
cubic spline in time. The structure is another mesh than the map's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from builder.aero.loads.operator import coefficients_of
from builder.aero.loads.sections import six_loads
from builder.campaign.snapshots import Snapshots
from builder.reporting import Reporter
from builder.structure.as_built.vehicle import AsBuilt
from builder.truth.shape.flights import shape_flows
from builder.truth.shape.structure import ShapeStructure, on_nodes_of
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.cosim.models.trajectory import Trajectory
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
        The engine is a table, or a condition is outside its reach.
    """
    if vehicle.aerodynamics.engine == "table":
        raise InputError(
            "aerodynamics.engine: expected 'euler' or 'newtonian' for a demonstration, got 'table', which holds "
            "the conditions of its manifest alone; `strainfmu build` makes the map"
        )
    time = np.linspace(0.0, path.stop_time, FLOWS_ALONG_PATH)
    conditions = tuple(path.at(float(t)) for t in time)
    return time, shape_flows(vehicle, conditions, reporter, "Flow: the vehicle that flies")


def flown_path(
    vehicle: Vehicle,
    structure: ShapeStructure,
    flows: tuple[FloatArray, Snapshots],
    time: FloatArray,
    path: Trajectory,
    built: AsBuilt,
) -> FlownPath:
    """Return the strains and coefficients of a vehicle as ``built`` at ``time`` (n,) [s].

    Parameters
    ----------
    structure : of the mesh that flies.
    flows : of :func:`flows_along`.

    Raises
    ------
    InputError
        The surfaces of flow and structure do not coincide.
    """
    knots, snapshots = flows
    own = structure.gauges.as_built(np.moveaxis(on_nodes_of(structure, snapshots), 2, 1), built)
    conditions = tuple(path.at(float(t)) for t in time)
    ambient = np.array([condition.ambient_pressure for condition in conditions])
    inside = np.array([vehicle.internal_pressure(condition) for condition in conditions])
    at_knots = np.array([condition.ambient_pressure for condition in snapshots.conditions()])
    ratio = CubicSpline(knots, snapshots.pressure / at_knots[:, None], axis=0)
    reference = vehicle.reference_quantities()
    loads = six_loads(snapshots.surface, reference.moment_station)
    scale = np.array([one.dynamic_pressure for one in conditions]) * reference.area * reference.length
    strain, coefficients = np.empty((len(time), len(structure.names))), np.empty((len(time), 5))
    rolling = np.empty(len(time))
    for start in range(0, len(time), 100):  # in blocks: pressures on all nodes are large
        part = slice(start, start + 100)
        net = ambient[part, None] * ratio(time[part]) - inside[part, None]
        coefficients[part] = coefficients_of(net, loads[:5], conditions[part], reference)
        rolling[part] = net @ loads[5] / scale[part]
        strain[part] = (net - built.internal_pressure * ambient[part, None]) @ own
    return FlownPath(
        time=time,
        conditions=conditions,
        strain=strain + built.apparent_strain,
        coefficients=coefficients,
        rolling=rolling,
    )
