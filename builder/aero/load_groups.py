"""Loads behind the five that a vehicle file asks for: rows that act on the pressure, and fields of the map.

There is one entry here for each family of :mod:`strainfmu.estimator.other_loads`: hinge moments of regions of the
surface, loads of sections along the body, and the rolling moment.

The loads of a section are the loads of the pressure on the part of the surface ahead of the plane x = x_s.
Triangles that the plane cuts are cut: pressure stays linear over the pieces, so that the loads are exact.

Parts of a triangulated surface, cut exactly: pressure stays linear over the pieces of a triangle.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, radians, sin
from typing import Any

import numpy as np

from builder.aero.load_operator import load_operator
from builder.aero.surface.mesh import Surface, SurfaceMesh, grid_of, mesh_of
from builder.vehicle.map_options import MapEntry, Region
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.sensors import HingeLines
from strainfmu.estimator.other_loads import BENDING, BODY, FAMILIES, HINGES, SECTIONS, LoadFamily


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of triangles of a surface.

    Attributes
    ----------
    triangle : (k, 3) nodes of the triangle that each piece lies in.
    share : (k, 3, 3) shares of these nodes in each corner of the piece.
    """

    triangle: IntArray
    share: FloatArray


def whole_surface(mesh: SurfaceMesh) -> Pieces:
    """Return every triangle of ``mesh`` as a piece."""
    return Pieces(mesh.triangle, np.broadcast_to(np.eye(3), (len(mesh.triangle), 3, 3)))


def part_below(pieces: Pieces, value: FloatArray, level: float) -> Pieces:
    """Return the part of ``pieces`` on which ``value`` (n,), linear between the nodes, is below ``level``."""
    at_corner = np.squeeze(pieces.share @ value[pieces.triangle][:, :, None], axis=2)
    below = at_corner < level
    count = below.sum(axis=1)
    nodes, shares = [pieces.triangle[count == 3]], [pieces.share[count == 3]]
    for alone in (1, 2):
        # Corner 0 is the one on its own side of the level; the order of the others is kept.
        rows = np.flatnonzero(count == alone)
        odd = np.argmax(below[rows] == (alone == 1), axis=1)
        order = (odd[:, None] + np.arange(3)) % 3
        ordered = np.take_along_axis(at_corner[rows], order, axis=1)
        turned = np.take_along_axis(pieces.share[rows], order[:, :, None], axis=1)
        turned = np.take_along_axis(turned, order[:, None, :], axis=2)
        first, second = (np.zeros((len(rows), 3)) for _ in range(2))
        for cut, end in ((first, 1), (second, 2)):
            part = (level - ordered[:, 0]) / (ordered[:, end] - ordered[:, 0])
            cut[:, 0], cut[:, end] = 1.0 - part, part
        unit = [np.broadcast_to(np.eye(3)[k], (len(rows), 3)) for k in range(3)]
        parts = [[unit[0], first, second]] if alone == 1 else [[first, unit[1], unit[2]], [first, unit[2], second]]
        for corners in parts:
            nodes.append(np.take_along_axis(pieces.triangle[rows], order, axis=1))
            shares.append(np.stack(corners, axis=1) @ turned)
    return Pieces(np.concatenate(nodes), np.concatenate(shares))


def forces_and_moments(mesh: SurfaceMesh, pieces: Pieces, about: FloatArray) -> FloatArray:
    """Return (n, 6) force and moment about ``about`` (3,) [m], in body axes, per nodal pressure [m2, m3].

    They are of F = integral of -p n dS over ``pieces`` with n outward. Exact for pressure linear over triangles.
    """
    corner = pieces.share @ mesh.point[pieces.triangle]
    area = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    arm = corner - about
    # Integral of N_i N_j over a triangle is A (1 + delta_ij) / 12.
    arm = (arm.sum(axis=1, keepdims=True) + arm) / 12.0
    of_corner = np.concatenate(
        [np.broadcast_to(area[:, None] / 3.0, arm.shape), np.cross(arm, area[:, None])], axis=2
    )
    of_node = -pieces.share.transpose(0, 2, 1) @ of_corner
    total = np.zeros((mesh.n_nodes, 6))
    np.add.at(total, pieces.triangle, of_node)
    return total


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
    pieces = whole_surface(mesh)
    if np.isfinite(ahead_of):
        pieces = part_below(pieces, mesh.point[:, 0], ahead_of)
    total = forces_and_moments(mesh, pieces, np.array([moment_station, 0.0, 0.0]))
    # Nose-up: the nose at -x goes to +z, a rotation about +y. Nose to starboard: -x to +y, a rotation about -z.
    # Starboard, +y, going down to -z: a rotation about -x.
    return np.stack([total[:, 0], total[:, 2], total[:, 1], total[:, 4], -total[:, 5], -total[:, 3]])


def loads_ahead_of(surface: Surface, moment_station: float, ahead_of: float = np.inf) -> FloatArray:
    """Return the rows of :func:`six_loads` of any surface.

    The rolling moment of a body of revolution is zero, as every pressure acts through the axis.
    """
    grid = grid_of(surface)
    if grid is None:
        return six_loads(mesh_of(surface), moment_station, ahead_of)
    return np.vstack([load_operator(grid, moment_station, ahead_of), np.zeros((1, grid.n_nodes))])


def rolling_operator(surface: Surface, moment_station: float) -> FloatArray:
    """Return (1, n) the rolling moment per nodal pressure [m3]."""
    return loads_ahead_of(surface, moment_station)[5:]


def section_operator(
    surface: Surface, stations: Sequence[float], entry: str = "map.section_stations_m"
) -> FloatArray:
    """Return (6 n_s, n) the loads of sections at n_s ``stations`` per nodal pressure [m2, m3], load by load.

    ``entry`` of the vehicle file states them.

    Raises
    ------
    InputError
        A station lies outside the body.
    """
    x = mesh_of(surface).point[:, 0]
    low, high = float(x.min()), float(x.max())
    for station in stations:
        if not low < station <= high:
            raise InputError(f"{entry}: expected {low:g} to {high:g} m, got {station:g}")
    sections = np.array([loads_ahead_of(surface, station, station) for station in stations])
    by_kind = sections.reshape(len(stations), 6, surface.n_nodes).swapaxes(0, 1)
    return by_kind.reshape(6 * len(stations), surface.n_nodes)


def bending_operator(surface: Surface, entry: MapEntry) -> FloatArray:
    """Return (n, n_p) the bending moments of ``entry`` per nodal pressure [m3].

    Raises
    ------
    InputError
        A station lies outside the body.
    """
    rows = np.zeros((len(entry.bending_moments), surface.n_nodes))
    for row, (number, moment) in zip(rows, enumerate(entry.bending_moments, start=1), strict=True):
        section = section_operator(surface, (moment.station_m,), f"map.bending_moments.{number}.station_m")
        angle = radians(moment.roll_angle_deg)
        row[:] = cos(angle) * section[3] + sin(angle) * section[4]
    return rows


def bending_fields(entry: MapEntry) -> dict[str, Any]:
    """Return the field of a map that states the lines of the bending moments; none where there are none."""
    asked = entry.bending_moments
    if not asked:
        return {}
    angles = [radians(moment.roll_angle_deg) for moment in asked]
    return {
        "bending_lines": HingeLines(
            name=tuple(moment.name for moment in asked),
            region=tuple(f"ahead of x = {moment.station_m:g} m" for moment in asked),
            point=np.array([(moment.station_m, 0.0, 0.0) for moment in asked]),
            direction=np.array([(0.0, cos(angle), -sin(angle)) for angle in angles]),
        )
    }


def hinge_operator(surface: Surface, entry: MapEntry) -> FloatArray:
    """Return (n, n_p) the hinge moments of ``entry`` per nodal pressure [m3].

    Each is t . integral of (r - a) x (-p n) dS over the region, n outward, a and t point and direction of the
    hinge line: right-handed about t. Triangles that the box of the region cuts are cut.

    Raises
    ------
    InputError
        A region holds nothing of the surface.
    """
    mesh = mesh_of(surface)
    rows = np.zeros((len(entry.hinge_moments), mesh.n_nodes))
    for row, (number, hinge) in zip(rows, enumerate(entry.hinge_moments, start=1), strict=True):
        pieces = _inside(mesh, entry.regions[hinge.region])
        if not len(pieces.triangle):
            low, high = (", ".join(f"{x:g}" for x in side(mesh.point, axis=0)) for side in (np.min, np.max))
            raise InputError(
                f"map.hinge_moments.{number}.region: expected a box that holds some of the surface, which lies "
                f"between ({low}) and ({high}) m, got '{hinge.region}', which holds none"
            )
        row[:] = forces_and_moments(mesh, pieces, np.array(hinge.point_m))[:, 3:] @ _unit(hinge.direction)
    return rows


def hinge_fields(entry: MapEntry) -> dict[str, Any]:
    """Return the field of a map that states the hinge lines; none where there are none."""
    hinges = entry.hinge_moments
    if not hinges:
        return {}
    return {
        "hinge_lines": HingeLines(
            name=tuple(hinge.name for hinge in hinges),
            region=tuple(hinge.region for hinge in hinges),
            point=np.array([hinge.point_m for hinge in hinges]),
            direction=np.array([_unit(hinge.direction) for hinge in hinges]),
        )
    }


def _inside(mesh: SurfaceMesh, region: Region) -> Pieces:
    """Return the part of ``mesh`` inside the box of ``region``."""
    pieces = whole_surface(mesh)
    for axis, (low, high) in enumerate(zip(region.from_m, region.to_m, strict=True)):
        pieces = part_below(pieces, mesh.point[:, axis], high)
        pieces = part_below(pieces, -mesh.point[:, axis], -low)
    return pieces


def _unit(direction: tuple[float, float, float]) -> FloatArray:
    unit: FloatArray = np.array(direction) / np.linalg.norm(direction)
    return unit


@dataclass(frozen=True)
class _Asked:
    """How a family is asked for.

    Attributes
    ----------
    rows : (m, n) loads per nodal pressure [m2, m3] of surface, section [map] and moment station [m], load by load,
        place by place.
    fields : fields of the map that state the places, from the section [map].
    """

    rows: Callable[[Surface, MapEntry, float], FloatArray]
    fields: Callable[[MapEntry], dict[str, Any]]


_ASKED: dict[LoadFamily, _Asked] = {
    BODY: _Asked(
        rows=lambda surface, _, moment_station: rolling_operator(surface, moment_station), fields=lambda _: {}
    ),
    SECTIONS: _Asked(
        rows=lambda surface, entry, _: section_operator(surface, entry.section_stations_m),
        fields=lambda entry: {"section_station": np.array(entry.section_stations_m, dtype=float)},
    ),
    HINGES: _Asked(rows=lambda surface, entry, _: hinge_operator(surface, entry), fields=hinge_fields),
    BENDING: _Asked(rows=lambda surface, entry, _: bending_operator(surface, entry), fields=bending_fields),
}


def other_load_operator(surface: Surface, entry: MapEntry, moment_station: float) -> FloatArray:
    """Return (m, n) the loads behind the five per nodal pressure [m2, m3], in the order of the map's groups.

    m is 0 for a body of revolution of which the rolling moment alone, which is zero, is asked for.

    Raises
    ------
    InputError
        A place that ``entry`` states is not on the surface.
    """
    rows = [_ASKED[family].rows(surface, entry, moment_station) for family in FAMILIES]
    operator = np.concatenate(rows)
    return operator if len(operator) > len(BODY.loads) or operator.any() else operator[:0]


def other_load_fields(entry: MapEntry) -> dict[str, Any]:
    """Return the fields of a map that state the places of these loads."""
    return {name: value for family in FAMILIES for name, value in _ASKED[family].fields(entry).items()}
