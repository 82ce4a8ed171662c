"""Hinge moments of regions of the surface: rows that act on the pressure at the surface's nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from builder.aero.loads.pieces import Pieces, forces_and_moments, part_below, whole_surface
from builder.aero.surface.mesh import SurfaceMesh, mesh_of
from builder.vehicle.map.options import MapEntry, Region
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.sensors import HingeLines


def hinge_operator(surface: SurfaceGrid | SurfaceMesh, entry: MapEntry) -> FloatArray:
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
            name=tuple(one.name for one in hinges),
            region=tuple(one.region for one in hinges),
            point=np.array([one.point_m for one in hinges]),
            direction=np.array([_unit(one.direction) for one in hinges]),
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
    found: FloatArray = np.array(direction) / np.linalg.norm(direction)
    return found
