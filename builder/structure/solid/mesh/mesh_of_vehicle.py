"""Comparison of a mesh that is read with the vehicle file: its length, its radius, its wall."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from builder.structure.solid.elements.element_faces import FACE_CORNERS
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, INTERNAL, SolidMesh
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution
from builder.workspace import Misfit
from strainfmu.arrays import FloatArray

LENGTH_TOLERANCE = 0.005  # of the length
RADIUS_TOLERANCE = 0.01  # of the base radius, at all but a few nodes
WALL_TOLERANCE = 0.02  # of the thickness, in the middle over the nodes
OTHER_NODES = 5.0  # per cent of the nodes, such as those on the front of a cut tip
SAMPLES = 20_000  # of the outer line, between which a distance is 1e-3 of a thin wall at most


def mesh_misfits(mesh: SolidMesh, body: BodyOfRevolution, wall: Wall) -> list[Misfit]:
    """Return in what a mesh in body axes differs from ``body`` and ``wall``: length, radius, wall thickness.

    Corners of facets are compared: they lie on the surface even where facets are flat.

    Raises
    ------
    InputError
        The mesh has no external or no internal surface.
    """
    outside, inside = _meridian(mesh, EXTERNAL), _meridian(mesh, INTERNAL)
    found = []
    length = float(outside[:, 0].max())
    if abs(length - body.length) > LENGTH_TOLERANCE * body.length:
        found.append(Misfit(entry="length of the mesh", expected=f"{body.length:.4g} m", found=f"{length:.4g} m"))
    meant = body.radius(np.clip(outside[:, 0], 0.0, body.length))
    off = np.abs(outside[:, 1] - meant)
    if np.percentile(off, 100.0 - OTHER_NODES) > RADIUS_TOLERANCE * body.base_radius:
        worst = int(off.argmax())
        found.append(
            Misfit(
                entry=f"outer radius of the mesh at x = {outside[worst, 0]:.4g} m",
                expected=f"{1e3 * meant[worst]:.4g} mm",
                found=f"{1e3 * outside[worst, 1]:.4g} mm",
            )
        )
    thickness = wall_thickness(outside, inside)
    if abs(thickness - wall.thickness) > WALL_TOLERANCE * wall.thickness:
        found.append(
            Misfit(
                entry="wall thickness of the mesh",
                expected=f"{1e3 * wall.thickness:.4g} mm",
                found=f"{1e3 * thickness:.4g} mm",
            )
        )
    return found


def wall_thickness(outside: FloatArray, inside: FloatArray) -> float:
    """Return the median distance [m] of points [x, r] (k, 2) inside from the line through those outside (n, 2)."""
    order = np.lexsort((-outside[:, 1], outside[:, 0]))  # of a plane across the axis the outermost point
    x, first = np.unique(outside[order, 0], return_index=True)
    station = np.linspace(x[0], x[-1], SAMPLES)
    line = np.column_stack([station, np.interp(station, x, outside[order, 1][first])])
    return float(np.median(cKDTree(line).query(inside)[0]))


def _meridian(mesh: SolidMesh, surface: str) -> FloatArray:
    """Return [x, r] (n, 2) [m] of the corners of a surface's facets."""
    corner = np.unique(mesh.named_surface(surface)[:, : FACE_CORNERS[mesh.element_type]])
    node = mesh.node[corner]
    return np.column_stack([node[:, 0], np.hypot(node[:, 1], node[:, 2])])
