"""A Gmsh session: the model, the element size, and its tetrahedra as a solid mesh.

Gmsh is optional (extra ``mesh``) and under the GNU General Public License, version 2 or later; nothing of it is
loaded until a mesh is requested.

Meshes of CAD files by Gmsh: quadratic tetrahedra in the solids of a STEP file or inside an STL surface.

Meshes of a vehicle's wall by Gmsh: quadratic tetrahedra of one size or graded along the body.
"""

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.solid.elements import straighten_folded
from builder.structure.solid.solid_mesh import INTERNAL, PLANE_TOLERANCE, SolidMesh, surfaces_of_hollow_body
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError, StrainfmuError

WALL_REGION = "wall"
SYSTEM_PACKAGES = "libglu1-mesa libgl1 libxrender1 libxcursor1 libxft2 libxinerama1 libgomp1"
TETRAHEDRON_OF_4_NODES, TETRAHEDRON_OF_10_NODES = 4, 11  # Gmsh's numbers of the types
# Gmsh has the middles of edges 2-3 and 1-3 the other way round than VTK.
GMSH_TO_VTK = np.array([0, 1, 2, 3, 4, 5, 6, 7, 9, 8])
ORIGIN, X_AXIS = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
"""A point and a direction, as Gmsh takes them."""

OPTIONS = {
    "General.Terminal": 0.0,
    "General.NumThreads": 1.0,
    "Mesh.MeshSizeFromPoints": 0.0,
    "Mesh.MeshSizeFromCurvature": 0.0,
    "Mesh.MeshSizeExtendFromBoundary": 0.0,
}
"""Silent, repeatable, and sizes from our formula alone."""


def load_gmsh() -> Any:
    """Return the module ``gmsh``."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise StrainfmuError(
            f'Gmsh cannot be loaded ({error}): pip install "strainfmu[mesh]", on Debian also '
            f"apt-get install {SYSTEM_PACKAGES}"
        ) from error
    return gmsh


@contextlib.contextmanager
def gmsh_model(what: str) -> Iterator[Any]:
    """Give a fresh, silent Gmsh model, and take it away afterwards; its errors become one line about ``what``."""
    gmsh = load_gmsh()
    ours = not gmsh.isInitialized()
    if ours:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.restoreDefaults()  # options outlive a session
    before = {option: gmsh.option.getNumber(option) for option in OPTIONS}
    try:
        gmsh.model.add("strainfmu")
        for option, value in OPTIONS.items():
            gmsh.option.setNumber(option, value)
        yield gmsh
    except StrainfmuError:
        raise
    except Exception as error:  # Gmsh raises nothing more specific
        raise StrainfmuError(f"{what}: Gmsh fails: {' '.join(str(error).split())}") from error
    finally:
        gmsh.model.remove()
        for option, value in before.items():
            gmsh.option.setNumber(option, value)
        if ours:
            gmsh.finalize()


def check_length(length: float, name: str = "element_length", unit: str = " m") -> None:
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"{name} {length:g}{unit} must be greater than 0")


def set_size(gmsh: Any, formula: str) -> None:
    """Let the element size [m] follow a formula of x, y, z [m]."""
    field = gmsh.model.mesh.field
    size = field.add("MathEval")
    field.setString(size, "F", formula)
    field.setAsBackgroundMesh(size)


def mesh_volumes(gmsh: Any, what: str, region: dict[int, str], stretch: float = 1.0) -> SolidMesh:
    """Mesh all volumes, then draw the mesh out along x by ``stretch``.

    ``region`` names volumes by number, by default all are :data:`WALL_REGION`; ``what`` is for messages.
    """
    gmsh.model.mesh.generate(3)
    if not len(gmsh.model.mesh.getElementsByType(TETRAHEDRON_OF_4_NODES)[0]):
        raise StrainfmuError(f"{what}: Gmsh makes no elements of this surface; look at it in Gmsh")
    gmsh.model.mesh.setOrder(2)
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    position = np.empty((int(tags.max()) + 1, 3))
    position[tags.astype(np.int64)] = np.asarray(xyz).reshape(-1, 3)
    elements, regions, names = [], [], []
    for _, tag in gmsh.model.getEntities(3):
        _, node = gmsh.model.mesh.getElementsByType(TETRAHEDRON_OF_10_NODES, tag)
        name = region.get(tag, WALL_REGION)
        names += [name] if name not in names else []
        elements.append(np.asarray(node, dtype=np.int64).reshape(-1, 10)[:, GMSH_TO_VTK])
        regions.append(np.full(len(elements[-1]), names.index(name), dtype=np.int64))
    used, element = np.unique(np.concatenate(elements), return_inverse=True)
    element = element.reshape(-1, 10).astype(np.int64)
    node = straighten_folded("tetrahedron10", position[used] * np.array([stretch, 1.0, 1.0]), element)
    surface = surfaces_of_hollow_body("tetrahedron10", node, element)
    return SolidMesh(
        element_type="tetrahedron10",
        node=node,
        element=element,
        region=np.concatenate(regions),
        region_names=tuple(names),
        surface=surface,
    )


CREASE_ANGLE = np.deg2rad(20.0)  # between triangles, above which their edge is an edge of the body
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
        gmsh.model.mesh.classifySurfaces(CREASE_ANGLE, True, True, np.pi)
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
    crossing = occ.copy(side)
    occ.rotate(crossing, *ORIGIN, *X_AXIS, 0.5 * np.pi)
    _, origin = occ.fragment(solids, side + crossing)
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
        joined = [shell for shell in shells if any(curves[tag] & curves[member] for member in shell)]
        shells = [shell for shell in shells if shell not in joined] + [{tag}.union(*joined)]

    def reach(shell: set[int]) -> float:
        boxes = np.array([gmsh.model.getBoundingBox(2, tag) for tag in shell])
        return float(np.ptp(boxes[:, [0, 3]]))

    return [sorted(shell) for shell in sorted(shells, key=reach, reverse=True)]


CAVITY_FRONT = "cavity_front"

# A constant size fails at the pointed ends of a cone: there elements shrink with the distance to the axis.
# At least 20 elements round the axis are needed to curve with the wall without folding.
SIZE_AT_POINT, SIZE_PER_RADIUS = 0.15, 0.3  # of the wall's thickness; of the radius
STRETCH = 2.0  # of graded meshes: length of elements along the axis over that round it
ARC_POINTS = 24  # through which a curved piece of the meridian is splined


def graded_wall_mesh(body: BodyOfRevolution, wall: Wall, relative_length: float) -> SolidMesh:
    """Mesh the wall and the solid tip of a pointed vehicle with tetrahedra of ten nodes.

    Elements lock by their length round the axis over sqrt(r t), the length in which bending of the wall decays. So
    they have one size relative to it, and shrink with the radius r towards the tip. Along the meridian, which is
    straight or nearly so, they are :data:`STRETCH` times as long: the body is drawn shorter by that and its mesh
    drawn out, since Gmsh's tetrahedra of a volume are as long as they are wide.

    The meridian is turned in four quarters; one full turn fails at the pointed ends. Elements are curved with the
    surface except where that would fold them. Surfaces: external, internal, cavity_front, support (the aft ring).

    Parameters
    ----------
    body, wall : outer shape; thickness and solid tip, as in the Fourier model.
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
    size = f"Max({SIZE_AT_POINT * wall.thickness}, {relative_length} * {decay_length})"
    pieces, corner = _meridian_pieces(body, wall)
    shorter = np.array([1.0 / STRETCH, 1.0])
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
        slope = SIZE_PER_RADIUS * np.tan(min(body.tip_angle, body.cut_tip_angle)) * STRETCH
        near_point = f"{SIZE_AT_POINT * wall.thickness} + {slope} * Abs(x)"
        near_cavity = f"{SIZE_PER_RADIUS * corner[1]} + {slope} * Abs(x - {corner[0] / STRETCH})"
        set_size(gmsh, f"Min({size}, Min({near_point}, {near_cavity}))")
        mesh = mesh_volumes(gmsh, "wall", {}, STRETCH)
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
