"""Meshes of CAD files by Gmsh: quadratic tetrahedra in the solids of a STEP file or inside an STL surface."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from builder.structure.solid.mesh.gmsh_session import (
    ORIGIN,
    X_AXIS,
    check_length,
    gmsh_model,
    mesh_volumes,
    set_size,
)
from builder.structure.solid.mesh.solid_mesh import SolidMesh
from strainfmu.errors import InputError

MIN_SIZE = 0.02  # of the element length, on the axis of graded meshes


def step_mesh(path: Path, element_length: float, graded_from: float | None = None) -> SolidMesh:
    """Mesh the solids of a STEP file with tetrahedra of ten nodes; its length unit is read from the file.

    Several solids are joined at their common faces; each is a region of the name it has in the file, or
    ``solid 1`` onwards. Surfaces are named by :func:`surfaces_of_hollow_body`: the file must hold the body in our
    axes, nose ahead at the minimum x, base in a plane across x.

    Parameters
    ----------
    path : the STEP file.
    element_length : largest element edge [m].
    graded_from : radius [m] from the x axis at which elements have that length; nearer to the axis it falls with
        the root of the radius, as the length does in which bending of a wall decays. None for one size.

    Raises
    ------
    InputError
        The file is missing or holds no solid, or the length is not positive.
    StrainfmuError
        Gmsh is not installed or fails.
    """
    _check_file(path, element_length)
    with gmsh_model(str(path)) as gmsh:
        unit = gmsh.option.getString("Geometry.OCCTargetUnit")
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        try:
            shapes = gmsh.model.occ.importShapes(str(path))
        finally:  # it outlives the session
            gmsh.option.setString("Geometry.OCCTargetUnit", unit)
        solids = [shape for shape in shapes if shape[0] == 3]
        if not solids:
            raise InputError(f"{path}: no solid found; surfaces alone must be sewn to a solid in the CAD system")
        gmsh.model.occ.synchronize()
        names = [
            gmsh.model.getEntityName(*solid).split("/")[-1] or f"solid {i}" for i, solid in enumerate(solids, 1)
        ]
        parts = _cut_in_quarters(gmsh, solids)
        region = {tag: name for tags, name in zip(parts, names, strict=True) for tag in tags}
        set_size(gmsh, _graded(element_length, graded_from))
        return mesh_volumes(gmsh, str(path), region)


def stl_mesh(
    path: Path,
    element_length: float,
    file_unit: float,
    crease_angle: float = np.deg2rad(20.0),
    graded_from: float | None = None,
) -> SolidMesh:
    """Mesh the volume inside the closed surface of an STL file with tetrahedra of ten nodes.

    The surface is meshed again. A surface within the first one bounds a cavity. An outer skin alone is a solid
    body: no wall is made from it. Surfaces are named as in :func:`step_mesh`.

    Parameters
    ----------
    path : the STL file, ASCII or binary, in our axes.
    element_length : element edge [m].
    file_unit : length of the file's unit [m]: STL files have none.
    crease_angle : angle between triangles [rad] above which their edge is kept as an edge of the body.
    graded_from : as in :func:`step_mesh`.

    Raises
    ------
    InputError
        The file is missing or its surface is not closed, or a length is not positive.
    StrainfmuError
        Gmsh is not installed or fails.
    """
    _check_file(path, element_length)
    if not (np.isfinite(file_unit) and file_unit > 0.0):
        raise InputError(f"{path}: file_unit {file_unit:g} m must be greater than 0")
    with gmsh_model(str(path)) as gmsh:
        gmsh.merge(str(path))
        gmsh.model.mesh.removeDuplicateNodes()
        _refuse_open_surface(gmsh, path)
        gmsh.model.mesh.affineTransform(np.hstack([np.diag([file_unit] * 3), np.zeros((3, 1))]).ravel())
        gmsh.model.mesh.classifySurfaces(crease_angle, True, True, np.pi)
        gmsh.model.mesh.createGeometry()
        loops = [gmsh.model.geo.addSurfaceLoop(shell) for shell in _shells(gmsh)]
        gmsh.model.geo.addVolume(loops)
        gmsh.model.geo.synchronize()
        set_size(gmsh, _graded(element_length, graded_from))
        return mesh_volumes(gmsh, str(path), {})


def _graded(element_length: float, radius: float | None) -> str:
    """Return the formula of an element size [m] that falls with the root of the distance from the x axis."""
    if radius is None:
        return str(element_length)
    ratio = f"Sqrt(Sqrt(y * y + z * z) / {radius})"
    return f"{element_length} * Min(1, Max({MIN_SIZE}, {ratio}))"


def _check_file(path: Path, element_length: float) -> None:
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    check_length(element_length)


def _refuse_open_surface(gmsh: Any, path: Path) -> None:
    _, node = gmsh.model.mesh.getElementsByType(2)
    triangle = np.asarray(node, dtype=np.int64).reshape(-1, 3)
    if not len(triangle):
        raise InputError(f"{path}: no triangle found")
    edge = np.sort(np.stack([triangle, np.roll(triangle, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    count = np.unique(edge, axis=0, return_counts=True)[1]
    open_edges = int((count != 2).sum())
    if open_edges:
        raise InputError(f"{path}: not closed: {open_edges} of {len(count)} edges do not join two triangles")


def _cut_in_quarters(gmsh: Any, solids: list[tuple[int, int]]) -> list[list[int]]:
    """Join solids at common faces and cut them in the planes y = 0 and z = 0; return the parts of each.

    Gmsh cannot mesh a surface that goes once round the axis and ends in a point on it.
    """
    occ = gmsh.model.occ
    box = np.array([gmsh.model.getBoundingBox(*solid) for solid in solids])
    low, high = box[:, :3].min(axis=0), box[:, 3:].max(axis=0)
    reach = 1.1 * float(np.abs([low, high])[:, 1:].max())
    margin = 0.1 * (high[0] - low[0])
    side = [(2, occ.addRectangle(low[0] - margin, -reach, 0.0, high[0] - low[0] + 2.0 * margin, 2.0 * reach))]
    other = occ.copy(side)
    occ.rotate(other, *ORIGIN, *X_AXIS, 0.5 * np.pi)
    _, origin = occ.fragment(solids, side + other)
    occ.synchronize()
    faces = {tag for part in origin[len(solids) :] for _, tag in part}
    outside = [(2, tag) for tag in faces if not len(gmsh.model.getAdjacencies(2, tag)[0])]
    occ.remove(outside, recursive=True)
    occ.synchronize()
    return [[tag for dimension, tag in part if dimension == 3] for part in origin[: len(solids)]]


def _shells(gmsh: Any) -> list[list[int]]:
    """Return the surfaces of each connected shell, the one that reaches furthest first."""
    surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
    curves = {tag: {abs(c) for _, c in gmsh.model.getBoundary([(2, tag)], combined=False)} for tag in surfaces}
    shells: list[set[int]] = []
    for tag in surfaces:
        joined = [shell for shell in shells if any(curves[tag] & curves[other] for other in shell)]
        shells = [shell for shell in shells if shell not in joined] + [{tag}.union(*joined)]

    def reach(shell: set[int]) -> float:
        boxes = np.array([gmsh.model.getBoundingBox(2, tag) for tag in shell])
        return float(np.ptp(boxes[:, [0, 3]]))

    return [sorted(shell) for shell in sorted(shells, key=reach, reverse=True)]
