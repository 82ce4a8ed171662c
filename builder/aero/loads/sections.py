"""Loads of sections along the body, and the rolling moment: rows that act on the pressure at the surface's nodes.

The loads of a section are those of the pressure on the part of the surface ahead of the plane x = x_s. Triangles
that the plane cuts are cut: pressure stays linear over the pieces, so that the loads are exact.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from builder.aero.loads.operator import load_operator
from builder.aero.surface.mesh import SurfaceMesh
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError


def six_loads(mesh: SurfaceMesh, moment_station: float, ahead_of: float = np.inf) -> FloatArray:
    """Return the loads per nodal pressure, (6, n) [m2, m2, m2, m3, m3, m3], of the surface ahead of a station.

    Rows: axial, normal and side force, pitching moment (nose-up), yawing moment (nose to starboard), rolling
    moment (starboard going down) about (moment_station, 0, 0), of F = integral of -p n dS with n outward. Exact
    for pressure linear over each triangle.

    Parameters
    ----------
    mesh : the surface.
    moment_station : x of the moment point [m].
    ahead_of : station [m] of the plane that ends the surface.
    """
    triangle, share = _pieces(mesh, ahead_of)
    corner = share @ mesh.point[triangle]
    area = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    arm = corner - np.array([moment_station, 0.0, 0.0])
    # Integral of N_i N_j over a triangle is A (1 + delta_ij) / 12.
    arm = (arm.sum(axis=1, keepdims=True) + arm) / 12.0
    of_corner = np.concatenate(
        [np.broadcast_to(area[:, None] / 3.0, arm.shape), np.cross(arm, area[:, None])], axis=2
    )
    of_node = -share.transpose(0, 2, 1) @ of_corner
    total = np.zeros((mesh.n_nodes, 6))
    np.add.at(total, triangle, of_node)
    # Nose-up: the nose at -x goes to +z, a rotation about +y. Nose to starboard: -x to +y, a rotation about -z.
    # Starboard, +y, going down to -z: a rotation about -x.
    return np.stack([total[:, 0], total[:, 2], total[:, 1], total[:, 4], -total[:, 5], -total[:, 3]])


def _pieces(mesh: SurfaceMesh, station: float) -> tuple[IntArray, FloatArray]:
    """Return the pieces of the surface ahead of ``station``: (k, 3) nodes of the triangle that each lies in, and
    (k, 3, 3) shares of these nodes in each corner of the piece."""
    x = mesh.point[:, 0][mesh.triangle]
    ahead = x < station
    count = ahead.sum(axis=1)
    whole = count == 3
    nodes, shares = [mesh.triangle[whole]], [np.broadcast_to(np.eye(3), (int(whole.sum()), 3, 3))]
    for alone in (1, 2):
        # Corner 0 is the one on its own side of the plane; the order of the others is kept.
        rows = np.flatnonzero(count == alone)
        odd = np.argmax(ahead[rows] == (alone == 1), axis=1)
        order = (odd[:, None] + np.arange(3)) % 3
        at = np.take_along_axis(x[rows], order, axis=1)
        first, second = (np.zeros((len(rows), 3)) for _ in range(2))
        for cut, other in ((first, 1), (second, 2)):
            part = (station - at[:, 0]) / (at[:, other] - at[:, 0])
            cut[:, 0], cut[:, other] = 1.0 - part, part
        unit = [np.broadcast_to(np.eye(3)[k], (len(rows), 3)) for k in range(3)]
        found = [[unit[0], first, second]] if alone == 1 else [[first, unit[1], unit[2]], [first, unit[2], second]]
        for one in found:
            nodes.append(np.take_along_axis(mesh.triangle[rows], order, axis=1))
            shares.append(np.stack(one, axis=1))
    return np.concatenate(nodes), np.concatenate(shares)


def rolling_operator(surface: SurfaceGrid | SurfaceMesh, moment_station: float) -> FloatArray:
    """Return (1, n) the rolling moment per nodal pressure [m3]; zero of a body of revolution, as every pressure
    acts through the axis."""
    if isinstance(surface, SurfaceGrid):
        return np.zeros((1, surface.n_nodes))
    return six_loads(surface, moment_station)[5:]


def section_operator(surface: SurfaceGrid | SurfaceMesh, stations: Sequence[float]) -> FloatArray:
    """Return (6 n_s, n) the loads of sections at n_s ``stations`` per nodal pressure [m2, m3], load by load.

    Torsions of a body of revolution are zero, as every pressure acts through the axis.

    Raises
    ------
    InputError
        A station lies outside the body.
    """
    x = surface.x if isinstance(surface, SurfaceGrid) else surface.point[:, 0]
    low, high = float(x.min()), float(x.max())
    for station in stations:
        if not low < station <= high:
            raise InputError(f"map.section_stations_m: expected {low:g} to {high:g} m, got {station:g}")
    if isinstance(surface, SurfaceGrid):
        torsion = np.zeros((1, surface.n_nodes))
        sections = [np.vstack([load_operator(surface, x, x), torsion]) for x in stations]
    else:
        sections = [six_loads(surface, x, x) for x in stations]
    by_kind = np.array(sections).reshape(len(stations), 6, surface.n_nodes).swapaxes(0, 1)
    return by_kind.reshape(6 * len(stations), surface.n_nodes)
