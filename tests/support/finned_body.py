"""A cone-cylinder with four fins: makes the surfaces and meshes of ``builder/vehicles/finned_body.toml``.

``python tests/support/finned_body.py builder/vehicles`` writes the files that are shipped.

Body: cone to x = 0.5 m, radius 0.1 m, cylinder to 1.2 m; wall 4 mm, solid ahead of 0.2 m. Fins at roll angles
45, 135, 225, 315 deg, root x = 0.95 to 1.17 m, tip at radius 0.19 m from x = 1.06 m; 12 mm thick at the root, 4
mm at the tip, solid. A deflection turns each fin about its span line through x = 1.06 m, all by one angle,
positive where the trailing edge goes towards smaller roll angle, which at no incidence gives a rolling moment
C_l > 0. Nodes on the body stay; the first row of elements is sheared.
"""

import sys
from dataclasses import replace
from math import atan
from pathlib import Path

import numpy as np

from builder.aero.cfd.formats.stl import write_stl
from builder.structure.solid.elements import boundary_facets, element_edges, face_keys
from builder.structure.solid.mesh_files import write_mesh
from builder.structure.solid.solid_mesh import EXTERNAL, HEXAHEDRON, SolidMesh
from builder.structure.solid.swept_mesh import SweptResolution, full_mesh, swept_wall
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import chain_segments
from strainfmu.arrays import FloatArray, IntArray

LENGTH, RADIUS, CONE_END = 1.2, 0.1, 0.5
ROOT, TIP = (0.95, 1.17), (1.06, 1.17)
TIP_RADIUS = 0.19
ROOT_HALF, TIP_HALF = 0.006, 0.002
FIN_ANGLES = np.deg2rad([45.0, 135.0, 225.0, 315.0])
HINGE = 1.06
STRETCHED_FROM = 0.6
"""Station [m] aft of which columns are moved so that two of them lie at the ends of the fins' roots."""

MAP = SweptResolution(0.045, 1, 60), 4
CHECK = SweptResolution(0.05, 1, 52), 4
SURFACE = SweptResolution(0.035, 1, 60), 4
OTHER_SURFACE = SweptResolution(0.03, 1, 76), 6
"""Sizes of the body's elements, and rows of a fin. Sectors are 8 m + 4, so that each fin stands on one. The last
size is for tests: a surface with other nodes."""
DEFLECTIONS_DEG = (-4.0, 4.0)


def finned_mesh(resolution: SweptResolution, fin_rows: int, deflection: float = 0.0) -> SolidMesh:
    """Return 20-node hexahedra of body and fins, the fins turned by ``deflection`` [rad]."""
    cone = atan(RADIUS / CONE_END)
    body = chain_segments([(CONE_END, cone, cone), (LENGTH, 0.0, 0.0)])
    wall = Wall(thickness=0.004, solid_tip_length=0.2, material=Material(70e9, 0.33))
    mesh = full_mesh(swept_wall(body, wall, resolution))
    mesh = replace(mesh, node=_moved(mesh, resolution.n_sectors))
    external = mesh.surface[EXTERNAL]
    node, element = [mesh.node], [mesh.element]
    for angle in FIN_ANGLES:
        fin_nodes, hexahedra = _fin(mesh, external[_at_root(mesh.node[external], angle)], angle, fin_rows)
        shift = sum(map(len, node)) - mesh.n_nodes
        element.append(np.where(hexahedra < mesh.n_nodes, hexahedra, hexahedra + shift))
        node.append(_turned(fin_nodes, angle, deflection))
    every = np.concatenate(element)
    facet, _ = boundary_facets(HEXAHEDRON, every)
    inner_quads = np.concatenate([quads for name, quads in mesh.surface.items() if name != EXTERNAL])
    inside = {tuple(key) for key in face_keys(HEXAHEDRON, inner_quads).tolist()}
    outer = np.array([tuple(key) not in inside for key in face_keys(HEXAHEDRON, facet).tolist()])
    return SolidMesh(
        element_type=HEXAHEDRON,
        node=np.concatenate(node),
        element=every,
        region=np.zeros(len(every), dtype=np.int64),
        region_names=mesh.region_names,
        surface={**mesh.surface, EXTERNAL: facet[outer]},
    )


def _moved(mesh: SolidMesh, n_sectors: int) -> FloatArray:
    """Return the nodes with columns at the ends of the roots and sectors as wide as a root."""
    x, y, z = mesh.node.T
    outside = np.unique(mesh.surface[EXTERNAL][:, :4])  # columns through the wall lean a little
    stations = np.unique(np.round(x[outside][x[outside] > STRETCHED_FROM], 9))
    ends = [float(stations[np.abs(stations - end).argmin()]) for end in ROOT]
    x = np.interp(x, [0.0, STRETCHED_FROM, *ends, LENGTH], [0.0, STRETCHED_FROM, *ROOT, LENGTH])
    roll, step = np.mod(np.arctan2(y, z), 2.0 * np.pi), 2.0 * np.pi / n_sectors
    half = np.arcsin(ROOT_HALF / RADIUS)
    before, after = [0.0], [0.0]
    for angle in FIN_ANGLES:
        before += [angle - 1.5 * step, angle - 0.5 * step, angle + 0.5 * step, angle + 1.5 * step]
        after += [angle - 1.5 * step, angle - half, angle + half, angle + 1.5 * step]
    roll = np.interp(roll, [*before, 2.0 * np.pi], [*after, 2.0 * np.pi])
    r = np.hypot(y, z)
    return np.column_stack([x, r * np.sin(roll), r * np.cos(roll)])


def _at_root(corner: FloatArray, angle: float) -> IntArray:
    """Return which facets (f, 8, 3) lie under the fin at ``angle``."""
    middle = corner[:, :4].mean(axis=1)
    roll = np.mod(np.arctan2(middle[:, 1], middle[:, 2]), 2.0 * np.pi)
    under = (np.abs(roll - angle) < 1e-6) & (middle[:, 0] > ROOT[0]) & (middle[:, 0] < ROOT[1])
    return np.flatnonzero(under)


def _fin(mesh: SolidMesh, facet: IntArray, angle: float, rows: int) -> tuple[FloatArray, IntArray]:
    """Grow ``rows`` of elements on the facets (f, 8) of a root.

    Returns
    -------
    Own nodes (n, 3), and elements (m, 20) whose own nodes are numbered from ``mesh.n_nodes``.
    """
    span, across = _axes(angle)
    number: dict[tuple[int, int], int] = {}
    place: list[FloatArray] = []

    def node(root: int, level: int) -> int:
        if level == 0:
            return root
        if (root, level) not in number:
            number[root, level] = mesh.n_nodes + len(place)
            start = mesh.node[root]
            share = (start[0] - ROOT[0]) / (ROOT[1] - ROOT[0])
            width = (start @ across) * TIP_HALF / ROOT_HALF
            end = TIP_RADIUS * span + width * across + [TIP[0] + share * (TIP[1] - TIP[0]), 0.0, 0.0]
            place.append(start + level / (2 * rows) * (end - start))
        return number[root, level]

    ring = element_edges(HEXAHEDRON)[:4]
    assert np.array_equal(ring, [(0, 1), (1, 2), (2, 3), (3, 0)])
    element = []
    for quad in facet.tolist():
        for row in range(rows):
            low, middle, high = 2 * row, 2 * row + 1, 2 * row + 2
            element.append(
                [
                    *(node(corner, low) for corner in quad[:4]),
                    *(node(corner, high) for corner in quad[:4]),
                    *(node(corner, low) for corner in quad[4:]),
                    *(node(corner, high) for corner in quad[4:]),
                    *(node(corner, middle) for corner in quad[:4]),
                ]
            )
    return np.array(place), np.array(element)


def _axes(angle: float) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors (3,) outward along the span of the fin at ``angle``, and towards greater roll angle."""
    return np.array([0.0, np.sin(angle), np.cos(angle)]), np.array([0.0, np.cos(angle), -np.sin(angle)])


def _turned(node: FloatArray, angle: float, deflection: float) -> FloatArray:
    """Return the nodes of a fin turned about its span line at the hinge's station."""
    span, across = _axes(angle)
    x, w = node[:, 0] - HINGE, node @ across
    c, s = np.cos(deflection), np.sin(deflection)
    turned_x, turned_w = c * x + s * w, -s * x + c * w
    along: FloatArray = (node @ span)[:, None] * span
    return along + turned_w[:, None] * across + np.column_stack([HINGE + turned_x, *np.zeros((2, len(node)))])


def surface_triangles(mesh: SolidMesh) -> FloatArray:
    """Return the triangles (t, 3, 3) [m] of the external surface, six a facet; the bore at the tip is closed."""
    facet = mesh.surface[EXTERNAL]
    cut = [(0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 7), (5, 6, 7)]
    triangle = mesh.node[facet[:, cut]].reshape(-1, 3, 3)
    start = triangle.reshape(-1, 3)
    end = np.roll(triangle, -1, axis=1).reshape(-1, 3)
    edges = {tuple(np.round([*a, *b], 9)) for a, b in zip(start.tolist(), end.tolist(), strict=True)}
    alone = [tuple(np.round([*b, *a], 9)) not in edges for a, b in zip(start.tolist(), end.tolist(), strict=True)]
    rim = np.array(alone) & (start[:, 0] < 0.01)
    centre = np.broadcast_to(start[rim].mean(axis=0), start[rim].shape)
    cap = np.stack([end[rim], start[rim], centre], axis=1)
    return np.concatenate([triangle, cap])


def write_surface(path: Path, resolution: SweptResolution, fin_rows: int, deflection: float = 0.0) -> None:
    """Write the surface, fins turned by ``deflection`` [rad], as binary STL in mm."""
    triangle = surface_triangles(finned_mesh(resolution, fin_rows, deflection))
    write_stl(path, 1e3 * triangle.reshape(-1, 3), np.arange(3 * len(triangle)).reshape(-1, 3))


def make_files(folder: Path) -> None:
    """Write the shipped files into ``folder``: two meshes, the surface as it is and with its fins turned."""
    for name, size in (("finned_body", MAP), ("finned_body_check", CHECK)):
        write_mesh(folder / f"{name}.vtu", finned_mesh(*size), with_surfaces=True)
    write_surface(folder / "finned_body.stl", *SURFACE)
    for degrees in DEFLECTIONS_DEG:
        write_surface(folder / f"finned_body_roll_{degrees:+g}deg.stl", *SURFACE, deflection=np.deg2rad(degrees))


if __name__ == "__main__":
    make_files(Path(sys.argv[1]))
