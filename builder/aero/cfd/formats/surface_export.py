"""The vehicle's surface for other flow solvers: coincident nodes merged, and closed where a mesher needs it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from builder.aero.cfd.formats.cart3d import write_cart3d
from builder.aero.cfd.formats.stl import write_stl
from builder.aero.cfd.formats.vtk_files import write_vtk
from builder.aero.surface.edges import connected, merge_nodes
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import IntArray
from strainfmu.errors import InputError

SURFACE_FORMATS = (".stl", ".tri", ".vtp", ".vtu")
_SAME_PLACE = 1e-9
"""Nodes closer than this fraction of the surface's extent are one."""
_FLAT = 1e-4
"""An opening may leave its mean plane by this fraction of the surface's extent to be closed."""


def write_surface(path: Path, mesh: SurfaceMesh, closed: bool = False) -> None:
    """Write a surface in body axes and metres as .stl (binary), .tri (Cart3D), .vtp or .vtu, atomically.

    Nodes at one place are written as one. ``closed`` covers each opening by a flat cap, component 2 in a .tri.

    Raises
    ------
    InputError
        The suffix is none of these, or an opening is not flat.
    StrainfmuError
        The file could not be written, or needs VTK and that is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in SURFACE_FORMATS:
        raise InputError(f"{path}: '{path.suffix}' found, a surface is written as {', '.join(SURFACE_FORMATS)}")
    body = merge_nodes(mesh, _SAME_PLACE * _extent(mesh))
    surface = close_openings(body) if closed else body
    component = np.repeat([1, 2], [len(body.triangle), len(surface.triangle) - len(body.triangle)]).astype(
        np.int64
    )
    if suffix == ".stl":
        write_stl(path, surface.point, surface.triangle)
    elif suffix == ".tri":
        write_cart3d(path, surface.point, surface.triangle, component)
    else:
        write_vtk(path, surface, {})


def open_edges(mesh: SurfaceMesh) -> IntArray:
    """Return the directed edges (k, 2) that no other triangle runs the opposite way: the rims of openings."""
    edge = np.concatenate([mesh.triangle[:, [0, 1]], mesh.triangle[:, [1, 2]], mesh.triangle[:, [2, 0]]])
    forth = edge[:, 0] * mesh.n_nodes + edge[:, 1]
    back = edge[:, 1] * mesh.n_nodes + edge[:, 0]
    return edge[~np.isin(forth, back)]


def close_openings(mesh: SurfaceMesh) -> SurfaceMesh:
    """Return the surface with a fan of triangles over each opening, around a new node in the rim's middle.

    Raises
    ------
    InputError
        A rim is no plane curve.
    """
    rim = open_edges(mesh)
    if not len(rim):
        return mesh
    label = connected(rim[:, 0], rim[:, 1], mesh.n_nodes)[1][rim[:, 0]]
    points, triangles = [mesh.point], [mesh.triangle]
    for number, opening in enumerate(np.unique(label)):
        edge = rim[label == opening]
        around = mesh.point[edge[:, 0]]
        middle = around.mean(axis=0)
        away = float(np.linalg.svd(around - middle, compute_uv=False)[-1]) / np.sqrt(len(around))
        if away > _FLAT * _extent(mesh):
            raise InputError(
                f"surface: the opening around ({', '.join(f'{x:.4g}' for x in middle)}) m is not flat, "
                f"{1e3 * away:.3g} mm from its mean plane; close it in the surface's own file"
            )
        points.append(middle[None])
        hub = np.full(len(edge), mesh.n_nodes + number)
        triangles.append(np.stack([edge[:, 1], edge[:, 0], hub], axis=1))
    return SurfaceMesh(np.concatenate(points), np.concatenate(triangles).astype(np.int64))


def _extent(mesh: SurfaceMesh) -> float:
    return float(np.linalg.norm(np.ptp(mesh.point, axis=0)))
