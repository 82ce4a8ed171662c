"""Hinge moments of regions of the surface: rows that act on the pressure at the surface's nodes.

The loads behind the five that a vehicle file asks for: rows that act on the pressure, and fields of the map.

There is one entry here for each family of :mod:`strainfmu.estimator.other_loads`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.aero.loads.sections import (
    Pieces,
    bending_fields,
    bending_operator,
    forces_and_moments,
    part_below,
    rolling_operator,
    section_operator,
    whole_surface,
)
from builder.aero.surface.mesh import Surface, SurfaceMesh, mesh_of
from builder.vehicle.map.options import MapEntry, Region
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.sensors import HingeLines
from strainfmu.estimator.other_loads import BENDING, BODY, FAMILIES, HINGES, SECTIONS, LoadFamily


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
