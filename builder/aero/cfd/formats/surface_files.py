"""Triangulated surfaces: read from files of any format that is known, and written for other flow solvers.

Coincident nodes are merged. A surface is closed where a mesher needs it.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np

from builder.aero.cfd.formats.cart3d import read_cart3d, write_cart3d
from builder.aero.cfd.formats.stl import read_stl, write_stl
from builder.aero.cfd.formats.text_numbers import read_file
from builder.aero.cfd.formats.vtk_files import write_vtk
from builder.aero.surface.edges import connected, merge_nodes
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

VTK_FORMATS = (".vtk", ".vtp", ".vtu")
FORMATS = (".stl", ".tri", ".triq", ".obj", *VTK_FORMATS)


def read_surface(path: Path, scale: float = 1.0) -> SurfaceMesh:
    """Read a triangulated surface; the format is known by the suffix.

    Parameters
    ----------
    path : .stl (ASCII, binary; equal corners merged), .tri, .triq (Cart3D, ASCII), .obj, .vtk, .vtp, .vtu.
    scale : metres per length unit of the file.

    Returns
    -------
    The mesh in the file's axes; triangles without area and nodes without triangle are left out. Normals point to
    where the file has them point.

    Raises
    ------
    InputError
        The format is none of these, the file is missing or damaged, or holds no triangle with an area.
    """
    suffix = path.suffix.lower()
    if suffix == ".stl":
        point, triangle = read_stl(path)
    elif suffix in (".tri", ".triq"):
        triangulation = read_cart3d(path)
        point, triangle = triangulation.point, triangulation.triangle
    elif suffix == ".obj":
        point, triangle = _read_obj(path)
    elif suffix in VTK_FORMATS:
        from builder.aero.cfd.formats.vtk_files import read_vtk

        content = read_vtk(path)
        point, triangle = content.point, content.triangle
    else:
        raise InputError(f"{path}: '{path.suffix}' found, a surface must be one of {', '.join(FORMATS)}")
    return _clean(path, scale * point, triangle)


def _clean(path: Path, point: FloatArray, triangle: IntArray) -> SurfaceMesh:
    """Leave out triangles without area and nodes that belong to none."""
    try:
        mesh = SurfaceMesh(point, triangle)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    solid = mesh.area > 0.0
    if not solid.any():
        raise InputError(f"{path}: no triangle has an area")
    used, inverse = np.unique(triangle[solid], return_inverse=True)
    return SurfaceMesh(point[used], inverse.reshape(-1, 3).astype(np.int64))


def _read_obj(path: Path) -> tuple[FloatArray, IntArray]:
    """Read vertices and faces of a Wavefront OBJ; polygons are cut into a fan from their first corner."""
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(read_file(path).decode("utf-8", "replace").splitlines(), start=1):
        words = line.split("#")[0].split()
        try:
            if words[:1] == ["v"]:
                vertices.append([float(words[1]), float(words[2]), float(words[3])])
            elif words[:1] == ["f"]:
                corners = [_obj_index(word, len(vertices)) for word in words[1:]]
                triangles += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
        except (ValueError, IndexError) as error:
            raise InputError(
                f"{path}: line {number}: {line.strip()[:60]!r} found, no OBJ vertex or face"
            ) from error
    if not triangles:
        raise InputError(f"{path}: the OBJ file holds no face")
    return np.array(vertices, dtype=np.float64).reshape(-1, 3), np.array(triangles, dtype=np.int64)


def _obj_index(word: str, count: int) -> int:
    """Return the vertex number from 0 on: counted from 1, or backward from -1, texture and normal left out."""
    index = int(word.split("/")[0])
    if index == 0:
        raise ValueError("vertex numbers begin at 1")
    return index - 1 if index > 0 else count + index


SURFACE_FORMATS = (".stl", ".tri", ".vtp", ".vtu")
_SAME_PLACE = 1e-9
"""Nodes closer than this fraction of the surface's extent are merged."""
_FLAT = 1e-4
"""An opening may leave its mean plane by this fraction of the surface's extent to be closed."""


def write_surface(path: Path, mesh: SurfaceMesh, closed: bool = False) -> None:
    """Write a surface in body axes and metres as .stl (binary), .tri (Cart3D), .vtp or .vtu, atomically.

    Nodes at the same place are merged. ``closed`` covers each opening by a flat cap, component 2 in a .tri.

    Raises
    ------
    InputError
        The suffix is none of these, or an opening is not flat.
    StrainfmuError
        The file could not be written, or needs VTK and that is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in SURFACE_FORMATS:
        raise InputError(f"{path}: expected a surface as {', '.join(SURFACE_FORMATS)}, got '{path.suffix}'")
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
