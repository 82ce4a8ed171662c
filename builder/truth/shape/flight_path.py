"""A vehicle of any shape as it flies a manoeuvre on its independent model.

The flow is solved on the finer surface at points of time along the manoeuvre; between them p / p_inf follows by a
cubic spline in time.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicSpline

from builder.campaign.snapshots import Snapshots
from builder.reporting import Reporter
from builder.truth.shape.flights import ShapeFlights, flown_at, ratio_of, shape_flights, shape_flows
from builder.truth.shape.structure import ShapeStructure, on_nodes_of
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.cosim.models.trajectory import Trajectory

FLOWS_ALONG_PATH = 25

BLOCK = 100
"""Samples at a time: pressures on all nodes are large."""


def flows_along(vehicle: Vehicle, path: Trajectory, reporter: Reporter) -> tuple[FloatArray, Snapshots]:
    """Solve the flow at points of time along a manoeuvre; return these times (k,) [s] and the pressures there.

    Raises
    ------
    InputError
        A condition is outside the engine's reach.
    """
    time = np.linspace(0.0, path.stop_time, FLOWS_ALONG_PATH)
    conditions = tuple(path.at(float(t)) for t in time)
    return time, shape_flows(vehicle, conditions, reporter, "Flow: the vehicle that flies")


def flights_along(
    vehicle: Vehicle,
    structure: ShapeStructure,
    flows: tuple[FloatArray, Snapshots],
    time: FloatArray,
    path: Trajectory,
) -> Iterator[ShapeFlights]:
    """Yield the flights at ``time`` (n,) [s], in blocks; ``flows`` are of :func:`flows_along`.

    Raises
    ------
    InputError
        The surfaces of flow and structure do not coincide.
    """
    knots, snapshots = flows
    operator, ratio = on_nodes_of(structure, snapshots), CubicSpline(knots, ratio_of(snapshots), axis=0)
    for first in range(0, len(time), BLOCK):
        part = time[first : first + BLOCK]
        none: IntArray = np.zeros(len(part), dtype=np.int64)
        at = flown_at(snapshots.chosen(none), [path.at(float(t)) for t in part], ratio(part))
        yield shape_flights(vehicle, structure, at, operator)
