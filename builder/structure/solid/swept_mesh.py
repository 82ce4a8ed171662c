"""Hexahedra of second order swept round the axis: a mesh made of equal sectors.

One sector holds one element round the axis. Its first face (nodes of the meridian plane) and its middle nodes
belong to it, its second face is the first of the next sector. Nodes lie on true circles.

Mesh of the wall of a body of sections: hexahedra in planes across the axis, as in a swept wall.

Every column of nodes lies in a plane x = const. Through the wall they follow the outer normal's direction in that
plane, so that the thickness along the normal is the wall's. The solid tip ahead of the hollow has a bore of a
tenth of the inner section, and is cut off where it has a fiftieth of its radius, as in
:mod:`builder.structure.solid.swept_mesh`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from builder.structure.fourier.meridian_mesh import (
    grid_elements,
    line_edges,
    line_nodes,
    with_middles,
)
from builder.structure.fourier.shell_mesh import CORE_ELEMENTS, EDGE_REACH, FINEST, shell_mesh, tip_columns
from builder.structure.solid.elements import element_faces, reference_nodes
from builder.structure.solid.solid_mesh import EXTERNAL, HEXAHEDRON, INTERNAL, SUPPORT, SolidMesh
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution
from builder.vehicle.shape.sectioned_body import SectionedBody
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

MIN_SECTORS = 6
REGION = "wall"
BORE = "tip_bore"

# Local nodes 3 * along + through of a meridian element on its four edges, and the face of the hexahedron there.
EDGE_NODES = ((0, 1, 2), (6, 7, 8), (0, 3, 6), (2, 5, 8))
_FACE_OF_EDGE = (0, 1, 4, 5)

BORE_FRACTION = 0.1  # radius of the bore through the solid tip over the inner radius of the wall behind it
CUT_FRACTION = 0.02  # radius at which the apex is cut off over the radius at the tip's end
BISECTIONS = 60


@dataclass(frozen=True, eq=False, kw_only=True)
class SweptSector:
    """One of ``n_sectors`` equal sectors round the x axis.

    Numbers below ``n_nodes`` are nodes of the sector, number ``n_nodes + i`` is node i of the next one. Sector s
    is the first one rolled by s times 2 pi / n_sectors, and displacements in sector frames are rolled with it.

    Attributes
    ----------
    n_sectors : number of sectors.
    node : (n_s, 3) nodes of the first sector [m], body axes.
    element : (m, n_e) node numbers of its elements.
    surface : per name the facets (f, n_f), outward.
    element_type : of its elements.
    """

    n_sectors: int
    node: FloatArray
    element: IntArray
    surface: Mapping[str, IntArray]
    element_type: str = HEXAHEDRON

    @property
    def n_nodes(self) -> int:
        """Nodes of one sector."""
        return len(self.node)

    @property
    def n_dof(self) -> int:
        """Displacement components of one sector."""
        return 3 * len(self.node)

    @cached_property
    def full(self) -> SolidMesh:
        """All sectors."""
        return full_mesh(self)

    def rotation(self, sector: int) -> FloatArray:
        """Return (3, 3): a vector in the frame of ``sector`` to body axes; roll goes from +z towards +y."""
        angle = 2.0 * np.pi * sector / self.n_sectors
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


@dataclass(frozen=True)
class SweptResolution:
    """Resolution of the wall by a swept mesh.

    Attributes
    ----------
    element_length : along the wall far from edges [m]; a quarter of it at the tip's end, slope breaks, the clamp.
    n_layers : elements through the wall.
    n_sectors : elements round the axis.
    """

    element_length: float
    n_layers: int
    n_sectors: int


RESOLUTIONS = {
    "coarse": SweptResolution(0.030, 1, 32),
    "medium": SweptResolution(0.018, 1, 48),
    "paper": SweptResolution(0.0145, 1, 80),
}
"""By name; ``paper`` has at least the 461,664 displacement components of the source on the shipped vehicle."""


def sweep(
    meridian_node: FloatArray,
    meridian_element: IntArray,
    meridian_edge: Mapping[str, IntArray],
    n_sectors: int,
) -> SweptSector:
    """Sweep nine-node quadrilaterals of the meridian plane round the axis.

    The middle node of a quadrilateral is left out: the elements are of the serendipity family.

    Parameters
    ----------
    meridian_node : (n, 2) positions [x, r] [m].
    meridian_element : (m, 9) nodes, local node = 3 * (node along, aft) + (node through, outwards).
    meridian_edge : per name of a surface its edges (f, 3).
    n_sectors : elements round the axis.
    """
    if n_sectors < MIN_SECTORS:
        raise InputError(f"n_sectors {n_sectors} must be at least {MIN_SECTORS}")
    used = np.unique(np.delete(meridian_element, 4, axis=1))
    corner = np.unique(meridian_element[:, [0, 2, 6, 8]])
    if np.any(meridian_node[used, 1] <= 0.0):
        raise InputError("a body that reaches the axis cannot be swept round it: elements would have no thickness")
    number = np.full((3, len(meridian_node)), -1)
    number[0, used] = np.arange(len(used))
    number[1, corner] = len(used) + np.arange(len(corner))
    number[2, used] = len(used) + len(corner) + np.arange(len(used))
    # Reference axes along, round, through: a right-handed set, because roll goes from +z towards +y.
    along, around, through = np.rint(2.0 * reference_nodes(HEXAHEDRON)).astype(int).T
    element = number[around, meridian_element[:, 3 * along + through]]
    roll = np.pi / n_sectors * np.repeat([0.0, 1.0], [len(used), len(corner)])
    x, r = meridian_node[np.concatenate([used, corner])].T
    surface = {name: _facets(element, meridian_element, edge) for name, edge in meridian_edge.items() if len(edge)}
    return SweptSector(
        n_sectors=n_sectors,
        node=np.column_stack([x, r * np.sin(roll), r * np.cos(roll)]),
        element=element,
        surface=surface,
    )


def _facets(element: IntArray, meridian_element: IntArray, edge: IntArray) -> IntArray:
    """Return the facets (f, 8) of hexahedra over edges (f, 3) of their meridian elements."""
    middle = meridian_element[:, [nodes[1] for nodes in EDGE_NODES]].ravel()
    order = np.argsort(middle, kind="stable")
    index = order[np.searchsorted(middle[order], edge[:, 1])]
    face = np.array(_FACE_OF_EDGE)[index % 4]
    facet: IntArray = element[(index // 4)[:, None], element_faces(HEXAHEDRON)[face]]
    return facet


def swept_wall(body: BodyOfRevolution, wall: Wall, resolution: SweptResolution | str = "medium") -> SweptSector:
    """Mesh a pointed vehicle with its solid tip, held at the base ring.

    Stations, layers and grading of the wall are as in :func:`builder.structure.fourier.shell_mesh.shell_mesh`.
    Elements without thickness on the axis would tie all sectors together, so the solid tip has a bore of a tenth
    of the wall's inner radius behind it, and is cut off where its radius is a fiftieth of the one at its end.
    Neither has an effect: on the shipped vehicle compliance under uniform and under lateral pressure is within
    5e-5, and strain 1 mm behind the tip within 0.3 %, of the Fourier model's, which has the whole tip. The cut
    belongs to the external surface, so that the air load of the meshed surface is complete.

    Parameters
    ----------
    body : outer shape.
    wall : thickness, solid tip.
    resolution : sizes, or a key of :data:`RESOLUTIONS`.

    Returns
    -------
    SweptSector
        Surfaces external, internal (the wall's, behind the tip), support (the base ring) and tip_bore (the bore
        and the front of the cavity).
    """
    size = _named_resolution(resolution)
    meridian = shell_mesh(body, wall, size.element_length, size.n_layers)
    inner = meridian.node[line_nodes(meridian.inner_edge)]
    outer = meridian.node[line_nodes(meridian.outer_edge)]
    n_tip = len(outer) - len(inner) + 1
    through = np.linspace(0.0, 1.0, 2 * size.n_layers + 1)[:, None]
    wall_node = inner[:, None] + through * (outer[n_tip - 1 :] - inner)[:, None]
    core = np.linspace(BORE_FRACTION, 1.0, 2 * CORE_ELEMENTS + 1)[:-1, None] * [0.0, inner[0, 1]]
    core[:, 0] = inner[0, 0]
    tip_x = _cut_tip(body.radius, outer[:n_tip, 0])
    tip_node = tip_columns(tip_x, body.radius(tip_x), np.concatenate([core, wall_node[0]]))
    node = np.concatenate([tip_node.reshape(-1, 2), wall_node[1:].reshape(-1, 2)])
    element, edges = _tip_and_hollow(n_tip, len(inner), len(through))
    return sweep(node, element, edges, size.n_sectors)


def _tip_and_hollow(n_tip: int, n_hollow: int, n_through: int) -> tuple[IntArray, dict[str, IntArray]]:
    """Return meridian elements (m, 9) and, per surface, edges (f, 3) of a solid tip and the wall behind it.

    Nodes are numbered column by column: the tip's ``n_tip`` of the core and the wall, then the hollow part's,
    whose first is the tip's last.
    """
    core = 2 * CORE_ELEMENTS
    tip = np.arange(n_tip * (core + n_through)).reshape(n_tip, -1)
    hollow = np.empty((n_hollow, n_through), dtype=np.int64)
    hollow[0] = tip[-1, core:]
    hollow[1:] = tip.size + np.arange((n_hollow - 1) * n_through).reshape(-1, n_through)
    outside = np.concatenate([tip[:, -1], hollow[1:, -1]])
    edges = {
        EXTERNAL: np.concatenate([line_edges(tip[0]), line_edges(outside)]),
        INTERNAL: line_edges(hollow[:, 0]),
        SUPPORT: line_edges(hollow[-1]),
        BORE: np.concatenate([line_edges(tip[:, 0]), line_edges(tip[-1, : core + 1])]),
    }
    return np.concatenate([grid_elements(tip), grid_elements(hollow)]), edges


def _named_resolution(resolution: SweptResolution | str) -> SweptResolution:
    if isinstance(resolution, SweptResolution):
        return resolution
    if resolution not in RESOLUTIONS:
        raise InputError(f"resolution '{resolution}' found, must be one of {', '.join(RESOLUTIONS)}")
    return RESOLUTIONS[resolution]


def _cut_tip(radius: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Move the first station from the apex to where the tip is cut, and the middle after it along."""
    cut = x.copy()
    cut[0] = min(cut_station(radius, float(x[-1])), 0.5 * x[1])
    cut[1] = 0.5 * (cut[0] + x[2])
    return cut


def cut_station(radius: Callable[[FloatArray], FloatArray], tip: float) -> float:
    """Return the station [m] at which a solid tip of the length ``tip`` [m] is cut off.

    It follows from the radius, not from the length: a fiftieth of a blunt tip's length is a third of its radius.
    ``radius`` gives radii [m] at stations (n,) [m], 0 at the apex.
    """
    low, high = 0.0, tip
    wanted = CUT_FRACTION * float(radius(np.array([tip]))[0])
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(radius(np.array([middle]))[0]) < wanted else (low, middle)
    return high


def sector_window(sector: SweptSector, before: int = 0, after: int = 0) -> SolidMesh:
    """Return the sectors from ``before`` ahead of the first to ``after`` behind it, body axes.

    The nodes of the sector behind the last are there too.
    """
    turns = [sector.rotation(s) for s in range(-before, after + 2)]
    return _repeated(sector, np.concatenate([sector.node @ turn.T for turn in turns]), before + after + 1)


def full_mesh(sector: SweptSector) -> SolidMesh:
    """Return all sectors: node = sector * n_nodes + local node, elements and facets sector by sector."""
    turns = np.stack([sector.rotation(s) for s in range(sector.n_sectors)])
    node = np.einsum("sij,nj->sni", turns, sector.node).reshape(-1, 3)
    return _repeated(sector, node, sector.n_sectors)


def _repeated(sector: SweptSector, node: FloatArray, n_sectors: int) -> SolidMesh:
    """Return the elements of neighbouring sectors on their nodes (n, 3) [m], the first node after the last."""
    first = sector.n_nodes * np.arange(n_sectors)[:, None, None]

    def repeated(numbers: IntArray) -> IntArray:
        every: IntArray = ((numbers + first) % len(node)).reshape(-1, numbers.shape[1])
        return every

    element = repeated(sector.element)
    return SolidMesh(
        element_type=sector.element_type,
        node=node,
        element=element,
        region=np.zeros(len(element), dtype=np.int64),
        region_names=(REGION,),
        surface={name: repeated(facet) for name, facet in sector.surface.items()},
        is_swept=True,
    )


AnyMesh = SweptSector | SolidMesh
"""A mesh, a swept one as its sector."""


QUARTERS: FloatArray = 0.5 * np.pi * np.arange(4.0)


def section_wall(body: SectionedBody, wall: Wall, resolution: SweptResolution) -> SolidMesh:
    """Mesh the wall of ``body`` with its solid tip, held at the base.

    Returns
    -------
    SolidMesh
        Surfaces external, internal (the wall's, behind the tip), support (the base ring) and tip_bore.
    """
    tip = wall.solid_tip_length
    if not tip < body.length:
        raise InputError(f"solid_tip_length {tip:g} m must be less than the body's length {body.length:g} m")
    tip_x, wall_x = _stations(body, wall, resolution.element_length)
    n_layers = 2 * resolution.n_layers + 1
    core = 2 * CORE_ELEMENTS
    # Columns and rows instead of x and r: the sweep numbers nodes, their places follow.
    column = np.concatenate([np.repeat(tip_x, core + n_layers), np.repeat(wall_x[1:], n_layers)])
    row = np.concatenate(
        [np.tile(np.arange(core + n_layers), len(tip_x)), np.tile(core + np.arange(n_layers), len(wall_x) - 1)]
    )
    element, edges = _tip_and_hollow(len(tip_x), len(wall_x), n_layers)
    sector = sweep(np.column_stack([column, 1.0 + row]), element, edges, resolution.n_sectors)
    mesh = full_mesh(sector)
    x, y, z = mesh.node.T
    roll = body.spread_roll_angle(np.maximum(x, wall.solid_tip_length), np.arctan2(y, z))
    row = np.rint(np.hypot(y, z) - 1.0)
    place = _places(body, wall, x, roll, row=row, core=core, layers=n_layers - 1)
    return replace(mesh, node=place)


def _places(
    body: SectionedBody, wall: Wall, x: FloatArray, roll: FloatArray, row: FloatArray, core: int, layers: int
) -> FloatArray:
    """Return the places (n, 3) [m] of nodes at stations ``x`` [m], by their rows: the core's, then the wall's."""
    tip = wall.solid_tip_length
    at_wall = np.maximum(x, tip)
    outer = body.point(at_wall, roll)
    inner = outer - _inward(body, wall, at_wall, roll)
    distance = np.einsum("ni,ni->n", inner[:, 1:], outer[:, 1:]) / np.einsum(
        "ni,ni->n", outer[:, 1:], outer[:, 1:]
    )
    if (distance <= 0.0).any():
        worst = float(at_wall[int(distance.argmin())])
        raise InputError(
            f"the wall of {1e3 * wall.thickness:g} mm fills the body at x = {worst:.4g} m: solid_tip_length must "
            "be larger or the wall thinner"
        )
    through = np.clip((row - core) / layers, 0.0, 1.0)[:, None]
    place = inner + through * (outer - inner)
    in_core = row < core
    share = BORE_FRACTION + (1.0 - BORE_FRACTION) * row / core
    place[in_core, 1:] = share[in_core, None] * inner[in_core, 1:]
    # Ahead of the tip's end the section there is drawn together to the outer one.
    smaller = body.radius(x, roll) / body.radius(at_wall, roll)
    place[:, 1:] *= smaller[:, None]
    place[:, 0] = x
    return np.asarray(place)


def _inward(body: SectionedBody, wall: Wall, x: FloatArray, roll: FloatArray) -> FloatArray:
    """Return the vectors (n, 3) [m] in the plane x = const from the inner to the outer surface."""
    ahead, aft = body.normal(x, roll, -1.0), body.normal(x, roll, 1.0)
    at_end = x >= body.length * (1.0 - 1e-9)
    aft[at_end] = ahead[at_end]
    normal = ahead + aft
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = normal.copy()
    across[:, 0] = 0.0
    # n . v = t with v along the normal's part in the plane.
    return np.asarray(wall.thickness * across / np.einsum("ni,ni->n", across, across)[:, None])


def _stations(body: SectionedBody, wall: Wall, element_length: float) -> tuple[FloatArray, FloatArray]:
    """Return stations [m] of the tip's and of the wall's columns, middles included, finer at edges."""
    tip = wall.solid_tip_length
    breaks = [float(x) for x in body.slope_breaks if x > tip]
    ends = [tip, *breaks, body.length]
    across, up = (body.radius(np.array(ends), np.array(angle)) for angle in (0.5 * np.pi, 0.0))
    size = np.sqrt(np.maximum(across * up, 1e-12))
    reach = EDGE_REACH * 0.78 * np.sqrt(size * wall.thickness)
    wall_x = [np.array([tip])]
    for start, end in pairwise(ends):
        x = np.linspace(start, end, 2001)
        near = (np.abs(x[:, None] - np.array(ends)) / reach).min(axis=1)
        length = element_length * np.minimum(1.0, FINEST + (1.0 - FINEST) * near)
        count = np.concatenate([[0.0], np.cumsum(np.diff(x) * 0.5 * (1.0 / length[:-1] + 1.0 / length[1:]))])
        n = max(2, int(np.ceil(count[-1])))
        wall_x.append(np.interp(np.linspace(0.0, count[-1], n + 1), count, x)[1:])
    n_tip = max(2, int(np.ceil(tip / element_length)))
    tip_ends = np.linspace(0.0, tip, n_tip + 1)
    inside = [float(x) for x in body.slope_breaks if 0.0 < x < tip]
    cut = cut_station(lambda x: body.radius(x[:, None], QUARTERS).max(axis=1), tip)
    tip_ends = np.unique(np.concatenate([tip_ends, inside]))
    tip_ends = np.append(cut, tip_ends[tip_ends > cut])
    stations = np.concatenate(wall_x)
    stations[-1] = body.length
    return with_middles(tip_ends), with_middles(stations)
