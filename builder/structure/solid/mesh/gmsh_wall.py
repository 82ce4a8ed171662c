"""Meshes of a vehicle's wall by Gmsh: quadratic tetrahedra of one size or graded along the body."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.solid.mesh.gmsh_session import (
    ORIGIN,
    X_AXIS,
    check_length,
    gmsh_model,
    mesh_volumes,
    set_size,
)
from builder.structure.solid.mesh.solid_mesh import INTERNAL, SolidMesh
from builder.structure.solid.mesh.surface_names import PLANE_TOLERANCE
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray, IntArray

CAVITY_FRONT = "cavity_front"

# A constant size fails at the pointed ends of a cone: there elements shrink with the distance to the axis.
# At least 20 elements round the axis are needed to curve with the wall without folding.
SIZE_AT_POINT, SIZE_PER_RADIUS = 0.15, 0.3  # of the wall's thickness; of the radius
STRETCH = 2.0  # of graded meshes: length of elements along the axis over that round it
ARC_POINTS = 24  # through which a curved piece of the meridian is splined


def wall_mesh(body: BodyOfRevolution, wall: Wall, element_length: float) -> SolidMesh:
    """Mesh the wall and the solid tip of a pointed vehicle with tetrahedra of ten nodes of one size.

    The meridian is turned in four quarters; one full turn fails at the pointed ends. Elements are curved with the
    surface except where that would fold them. Surfaces: external, internal, cavity_front, support (the aft ring).

    Parameters
    ----------
    body, wall : outer shape; thickness and solid tip, as in the Fourier model.
    element_length : largest element edge [m].

    Raises
    ------
    InputError
        The wall does not fit the body, or the length is not positive.
    StrainfmuError
        Gmsh is not installed or fails.
    """
    check_length(element_length)
    return _wall_mesh(body, wall, str(element_length), 1.0)


def graded_wall_mesh(body: BodyOfRevolution, wall: Wall, relative_length: float) -> SolidMesh:
    """Mesh the same wall with elements of one size relative to sqrt(r t), the length in which its bending decays.

    Elements lock by their length round the axis over sqrt(r t), so it shrinks with the radius r towards the tip.
    Along the meridian, which is straight or nearly so, they are :data:`STRETCH` times as long.

    Parameters
    ----------
    body, wall : as in :func:`wall_mesh`.
    relative_length : element edge round the axis over sqrt(r t) [1]; longer ones than about 0.5 lock.

    Raises
    ------
    InputError
        The wall does not fit the body, or the length is not positive.
    StrainfmuError
        Gmsh is not installed or fails.
    """
    check_length(relative_length, "relative_length", "")
    decay_length = f"Sqrt({wall.thickness} * Sqrt(y * y + z * z))"
    min_size = SIZE_AT_POINT * wall.thickness
    return _wall_mesh(body, wall, f"Max({min_size}, {relative_length} * {decay_length})", STRETCH)


def _wall_mesh(body: BodyOfRevolution, wall: Wall, size: str, stretch: float) -> SolidMesh:
    """Mesh the wall with elements of a size [m] that is a formula of x / stretch, y, z [m].

    The body is drawn shorter by ``stretch`` and its mesh drawn out: that is how elements come to be longer along
    the axis, since Gmsh's tetrahedra of a volume are as long as they are wide.
    """
    pieces, corner = _meridian_pieces(body, wall)
    shorter = np.array([1.0 / stretch, 1.0])
    with gmsh_model("wall") as gmsh:
        occ = gmsh.model.occ
        face = _meridian_face(occ, [piece * shorter for piece in pieces])
        for quarter in range(4):
            turned = occ.copy([(2, face)])
            occ.rotate(turned, *ORIGIN, *X_AXIS, 0.5 * np.pi * quarter)
            occ.revolve(turned, *ORIGIN, *X_AXIS, 0.5 * np.pi)
            occ.remove(turned)
        occ.remove([(2, face)], recursive=True)
        occ.removeAllDuplicates()
        occ.synchronize()
        slope = SIZE_PER_RADIUS * np.tan(min(body.tip_angle, body.cut_tip_angle)) * stretch
        near_point = f"{SIZE_AT_POINT * wall.thickness} + {slope} * Abs(x)"
        near_cavity = f"{SIZE_PER_RADIUS * corner[1]} + {slope} * Abs(x - {corner[0] / stretch})"
        set_size(gmsh, f"Min({size}, Min({near_point}, {near_cavity}))")
        mesh = mesh_volumes(gmsh, "wall", {}, stretch)
    return replace(mesh, surface=_without_cavity_front(mesh, float(corner[0])))


def _without_cavity_front(mesh: SolidMesh, x: float) -> dict[str, IntArray]:
    """Return the surfaces with the facets in the plane ``x`` [m] taken from the internal one."""
    internal = mesh.surface[INTERNAL]
    front = (np.abs(mesh.node[internal, 0] - x) < PLANE_TOLERANCE * np.ptp(mesh.node[:, 0])).all(axis=1)
    return {**mesh.surface, INTERNAL: internal[~front], CAVITY_FRONT: internal[front]}


def _meridian_pieces(body: BodyOfRevolution, wall: Wall) -> tuple[list[FloatArray], FloatArray]:
    """Return the boundary of the meridian section, and the cavity's front corner [x, r] [m].

    The pieces (n, 2) of points [x, r] [m] follow one another: outer line from the tip, base, inner line forward,
    cavity's front, axis. A piece of more than two points is a smooth curve through them.
    """
    line = shell_mesh(body, wall, body.length / 100.0)
    outer = line.node[np.append(line.outer_edge[:, 0], line.outer_edge[-1, 2])]
    inner = line.node[np.append(line.inner_edge[:, 0], line.inner_edge[-1, 2])]
    n_tip = len(outer) - len(inner)  # columns of the solid tip have no inner node
    joint = [int(np.argmin(np.abs(outer[:, 0] - segment.end_x))) for segment in body.segments]
    outer_cut = [0, *joint]
    inner_cut = [0, *(j - n_tip for j in joint if j > n_tip)]
    outer_straight = [segment.is_straight for segment in body.segments]
    inner_straight = outer_straight[-(len(inner_cut) - 1) :]
    along = [
        _piece(outer[a : b + 1], flat) for (a, b), flat in zip(pairwise(outer_cut), outer_straight, strict=True)
    ]
    back = [
        _piece(inner[a : b + 1], flat) for (a, b), flat in zip(pairwise(inner_cut), inner_straight, strict=True)
    ]
    on_axis = np.array([inner[0, 0], 0.0])
    pieces = [
        *along,
        np.stack([outer[-1], inner[-1]]),
        *(piece[::-1] for piece in back[::-1]),
        np.stack([inner[0], on_axis]),
        np.stack([on_axis, outer[0]]),
    ]
    return pieces, inner[0]


def _piece(point: FloatArray, straight: bool) -> FloatArray:
    """Thin the points (n, 2) of one piece: its two ends, or enough for a spline."""
    count = 2 if straight else min(len(point), ARC_POINTS)
    return point[np.linspace(0, len(point) - 1, count).round().astype(int)]


def _meridian_face(occ: Any, pieces: list[FloatArray]) -> int:
    """Draw the meridian section in the plane z = 0 and return its number."""
    corner = [occ.addPoint(float(piece[0, 0]), float(piece[0, 1]), 0.0) for piece in pieces]
    curves = []
    for piece, start, end in zip(pieces, corner, corner[1:] + corner[:1], strict=True):
        between = [occ.addPoint(float(x), float(r), 0.0) for x, r in piece[1:-1]]
        curves.append(occ.addSpline([start, *between, end]) if between else occ.addLine(start, end))
    return int(occ.addPlaneSurface([occ.addCurveLoop(curves)]))
