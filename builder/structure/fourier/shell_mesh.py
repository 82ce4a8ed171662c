"""Meridian mesh of a pointed vehicle: a solid tip and a thin wall behind it.

The apex is kept. The first column of elements collapses onto one node there, so that no surface is cut
off and the loads stay complete. The collapsed elements pass rigid motions exactly; their poor strain is
harmless, because they lie in the solid tip, tens of wall thicknesses ahead of the first possible gauge.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from builder.structure.fourier.meridian_mesh import (
    NO_NODES,
    MeridianMesh,
    check_resolution,
    grid_elements,
    line_edges,
    with_middles,
)
from builder.structure.fourier.wall_layup import SHORTEST_PIECE, furnished, layup_stations, outer_station, steps
from builder.structure.wall import Material, Wall, wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolution
from builder.vehicle.shape.geometry import STEEP, BodyOfRevolution
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

CORE_ELEMENTS = 2  # through the solid tip, inside the wall's layers
FINEST = 0.25  # element length at an edge over the one far from it
EDGE_REACH = 4.0  # lengths 0.78 sqrt(R t) within which elements are shorter: bending has decayed to 2 %
SHORTEST_TURN = 0.05  # over the radius at the tip's end: length along the meridian of a turn to be resolved
TURN_PER_ELEMENT = np.deg2rad(10.0)  # with a steep tip: chords are then 0.2 % of the nose radius off at most


@dataclass(frozen=True, kw_only=True)
class MeshedWall:
    """Wall of a body of revolution, and how finely it is meshed.

    Attributes
    ----------
    body, wall : the outer surface, and the wall behind it.
    element_length : along the meridian [m].
    layers : elements through the wall.
    """

    body: BodyOfRevolution
    wall: Wall
    element_length: float
    layers: int

    def mesh(self, wall: Wall | None = None) -> MeridianMesh:
        """Return the mesh, of another ``wall`` if one is given; errors as of :func:`shell_mesh`."""
        return shell_mesh(self.body, self.wall if wall is None else wall, self.element_length, self.layers)


def meshed_wall(vehicle: Vehicle, resolution: Resolution | None = None) -> MeshedWall:
    """Return the wall of ``vehicle`` at a ``resolution``, by default the map's."""
    resolution = resolution or vehicle.resolution.map
    return MeshedWall(
        body=vehicle.body(),
        wall=wall_of(vehicle),
        element_length=1e-3 * resolution.element_length_mm,
        layers=resolution.wall_layers,
    )


def shell_mesh(body: BodyOfRevolution, wall: Wall, element_length: float, n_layers: int = 1) -> MeridianMesh:
    """Mesh the wall of a pointed vehicle, clamped at its base ring.

    The wall's thickness is measured along the local outer normal; at slope breaks the two inner surfaces
    meet in their intersection, at the base the wall ends in the plane x = length. Elements end on slope
    breaks and on joints of segments, and are shorter near slope breaks, the clamp and the end of the solid
    tip, where edge bending decays as exp(-s / (0.78 sqrt(R t))) (Timoshenko and Woinowsky-Krieger, Theory
    of Plates and Shells, eq. 275).

    Parameters
    ----------
    body : outer shape.
    wall : thickness and solid tip.
    element_length : element length far from edges [m].
    n_layers : elements through the wall.

    Returns
    -------
    MeridianMesh
        Its inner edges start at ``solid_tip_length``.

    Raises
    ------
    InputError
        The tip leaves no hollow part, the wall fills the body somewhere behind the tip, or a resolution is
        not positive.
    """
    check_resolution(element_length, n_layers)
    start = _outer_end_of_tip(body, wall)
    outer, inner = _wall_surfaces(body, wall, start, element_length)
    if np.any(inner[:, 1] <= 0.0):
        worst = inner[np.argmax(inner[:, 1] <= 0.0)]
        raise InputError(
            f"the wall of {1e3 * wall.thickness:g} mm fills the body at x = {worst[0]:.4g} m: "
            "solid_tip_length must be larger or the wall thinner"
        )
    through = np.linspace(0.0, 1.0, 2 * n_layers + 1)[:, None]
    wall_node = inner[:, None] + through * (outer - inner)[:, None]
    core = np.linspace(0.0, 1.0, 2 * CORE_ELEMENTS + 1)[:-1, None] * [0.0, inner[0, 1]]
    core[:, 0] = inner[0, 0]
    tip_x = _tip_stations(body, wall, start, element_length)
    tip_node = tip_columns(tip_x, body.radius(tip_x), np.concatenate([core, wall_node[0]]))
    bare = _join(tip_node, wall_node)
    if wall.is_plain and wall.flight is None and wall.foundation is None:
        return bare
    return furnished(bare, wall, element_length)


def yielding_clamp(mesh: MeridianMesh, material: Material, axial: float, transverse: float) -> MeridianMesh:
    """Return ``mesh`` whose clamped aft ring yields as lengths of the wall's material would [m], both positive.

    Raises
    ------
    InputError
        The mesh has no clamped ring.
    """
    if not len(mesh.clamped_node):
        raise InputError("clamp: expected a body that is clamped aft (structure.support), found another support")
    springs = material.youngs_modulus / axial, material.youngs_modulus / transverse
    ring = line_edges(mesh.clamped_node)
    return replace(mesh, clamped_node=NO_NODES, foundation=(*springs, ring))


def _outer_end_of_tip(body: BodyOfRevolution, wall: Wall) -> float:
    """Return the station [m] on the outer surface whose inward normal meets the tip's end face."""
    face, thickness = wall.solid_tip_length, float(wall.thickness_at(wall.solid_tip_length))
    if face >= body.length:
        raise InputError(f"solid_tip_length {face:g} m must be less than the body's length {body.length:g} m")
    # Bisection, because the angle jumps where a slope break lies within the bracket.
    low, high = max(face - thickness, 0.0), face + thickness
    for _ in range(60):
        middle = 0.5 * (low + high)
        if middle + thickness * np.sin(body.angle(middle)) < face:
            low = middle
        else:
            high = middle
    inner_radius = float(body.radius(low) - thickness * np.cos(body.angle(low)))
    if inner_radius <= 0.0:
        raise InputError(
            f"solid_tip_length {face:g} m is too short: the inner radius there is "
            f"{1e3 * inner_radius:.3g} mm with a wall of {1e3 * thickness:g} mm"
        )
    return low


def _stations(body: BodyOfRevolution, wall: Wall, start: float, ends: list[float], length: float) -> FloatArray:
    """Return stations [m] of element ends from ``ends[0]`` to ``ends[-1]``, on each of ``ends``."""
    breaks = body.slope_breaks[body.slope_breaks > start]
    sudden = [x for x in steps(wall) if start < x < body.length]
    edge = np.array([start, *breaks, *sudden, body.length])
    reach = EDGE_REACH * 0.78 * np.sqrt(body.radius(edge) * wall.thickness_at(edge))
    stations = [np.array(ends[:1])]
    for a, b in pairwise(ends):
        x = np.linspace(a, b, 2 + int(np.ceil(20.0 * (b - a) / (FINEST * length))))
        if body.tip_angle > STEEP:
            x = a + (b - a) * np.linspace(0.0, 1.0, len(x) + 4000) ** 2  # close where the meridian turns fast
        distance = np.abs(x[:, None] - edge) / reach
        size = length * np.minimum(1.0, FINEST + (1.0 - FINEST) * distance.min(axis=1))
        per_length = np.diff(x) * 0.5 * (1.0 / size[:-1] + 1.0 / size[1:])
        if body.tip_angle > STEEP:
            per_length += _turns(body, x, SHORTEST_TURN * float(body.radius(start)))
        count = np.concatenate([[0.0], np.cumsum(per_length)])
        n = max(2, int(np.ceil(count[-1] - 1e-9)))
        stations.append(np.interp(np.linspace(0.0, count[-1], n + 1), count, x)[1:])
        stations[-1][-1] = b
    return np.concatenate(stations)


def _turns(body: BodyOfRevolution, x: FloatArray, shortest: float) -> FloatArray:
    """Return the elements (n - 1,) that the turning of the meridian asks for between stations ``x`` (n,) [m].

    Along the meridian they are not shorter than ``shortest`` [m]: a power law turns without end towards its tip.
    """
    angle = np.concatenate([body.angle(x[:1], "downstream"), body.angle(x[1:])])
    length = np.hypot(np.diff(x), np.diff(body.radius(x)))
    return np.asarray(np.minimum(np.abs(np.diff(angle)) / TURN_PER_ELEMENT, length / shortest))


def _joints(body: BodyOfRevolution, start: float, end: float) -> list[float]:
    """Return ``start``, the joints of segments in between, and ``end`` [m]."""
    inside = [segment.end_x for segment in body.segments if start < segment.end_x < end]
    return [start, *inside, end]


def _wall_joints(body: BodyOfRevolution, wall: Wall, start: float) -> list[float]:
    """Return the stations [m] at which the wall's pieces join: breaks of slope, of thickness and of frames."""
    joint = [start, *(float(x) for x in body.slope_breaks[body.slope_breaks > start]), body.length]
    for x in layup_stations(wall, lambda inner: outer_station(body, wall, inner)):
        if start < x < body.length and all(abs(x - known) > SHORTEST_PIECE for known in joint):
            joint.append(x)
    return sorted(joint)


def _tip_stations(body: BodyOfRevolution, wall: Wall, start: float, element_length: float) -> FloatArray:
    """Return (n,) stations [m] of the tip's columns, apex and middles included."""
    return with_middles(_stations(body, wall, start, _joints(body, 0.0, start), element_length))


def _wall_surfaces(
    body: BodyOfRevolution, wall: Wall, start: float, element_length: float
) -> tuple[FloatArray, FloatArray]:
    """Return (n, 2) points [x, r] [m] on the outer and on the inner surface, joined by the wall's columns."""
    joint = _wall_joints(body, wall, start)
    inner_joint = [wall.solid_tip_length, *(_inner_corner(body, wall, x) for x in joint[1:-1]), body.length]
    outer, inner = [], []
    for i, (a, b) in enumerate(pairwise(joint)):
        x = with_middles(_stations(body, wall, start, _joints(body, a, b), element_length))
        # Linear, so that inner middle nodes lie midway in x too; columns are normal to within t / length.
        inner_x = np.interp(x, [a, b], inner_joint[i : i + 2])
        keep = slice(0 if i == 0 else 1, None)
        outer.append(np.column_stack([x, body.radius(x)])[keep])
        inner.append(np.column_stack([inner_x, _inner_radius(body, wall, a, b, inner_x)])[keep])
    return np.concatenate(outer), np.concatenate(inner)


def _inner_corner(body: BodyOfRevolution, wall: Wall, x: float) -> float:
    """Return the station [m] where the inner surfaces before and behind a slope break at ``x`` meet."""
    before, aft = float(body.angle(x, "upstream")), float(body.angle(x, "downstream"))
    depth = float(wall.thickness_at(x)) / np.cos(0.5 * (before - aft))
    return float(x + depth * np.sin(0.5 * (before + aft)))


def _inner_radius(body: BodyOfRevolution, wall: Wall, start: float, end: float, x: FloatArray) -> FloatArray:
    """Return the radius [m] of the surface parallel to the outer one between ``start`` and ``end``.

    The foot of the normal is found by fixed-point iteration, which contracts by thickness over radius of
    curvature; past the ends the surface goes on along its tangent.
    """
    foot = np.clip(x, start, end)
    for _ in range(40):
        angle = np.where(foot <= start, body.angle(foot, "downstream"), body.angle(foot, "upstream"))
        foot = np.clip(x - wall.thickness_at(foot) * np.sin(angle), start, end)
    angle = np.where(foot <= start, body.angle(foot, "downstream"), body.angle(foot, "upstream"))
    thickness = wall.thickness_at(foot)
    overshoot = x - foot - thickness * np.sin(angle)
    return np.asarray(body.radius(foot) - thickness * np.cos(angle) + overshoot * np.tan(angle))


def tip_columns(x: FloatArray, radius: FloatArray, last: FloatArray) -> FloatArray:
    """Shrink the tip's last column towards the apex.

    Parameters
    ----------
    x, radius : (n,) stations and radii [m] of the columns on the outer surface.
    last : (n_row, 2) nodes [x, r] [m] of the last column, from the axis outwards.

    Returns
    -------
    (n, n_row, 2) nodes [m]; a first column at x = 0 is the apex, n_row times.
    """
    scale = (x / x[-1])[:, None]
    column_x = x[:, None] + scale * (last[:, 0] - last[-1, 0])
    return np.stack([column_x, radius[:, None] * (last[:, 1] / last[-1, 1])], axis=-1)


def _join(tip_node: FloatArray, wall_node: FloatArray) -> MeridianMesh:
    """Number the nodes column by column; the apex is one node, the wall's first column is the tip's last."""
    n_tip, n_row = tip_node.shape[:2]
    n_wall, n_through = wall_node.shape[:2]
    n_tip_node = 1 + (n_tip - 1) * n_row
    tip = np.zeros((n_tip, n_row), dtype=np.intp)
    tip[1:] = np.arange(1, n_tip_node).reshape(n_tip - 1, n_row)
    wall = np.empty((n_wall, n_through), dtype=np.intp)
    wall[0] = tip[-1, -n_through:]
    wall[1:] = n_tip_node + np.arange((n_wall - 1) * n_through).reshape(n_wall - 1, n_through)
    node = np.concatenate([tip_node[0, :1], tip_node[1:].reshape(-1, 2), wall_node[1:].reshape(-1, 2)])
    return MeridianMesh(
        node=node,
        element=np.concatenate([grid_elements(tip), grid_elements(wall)]),
        outer_edge=line_edges(np.concatenate([tip[:, -1], wall[1:, -1]])),
        inner_edge=line_edges(wall[:, 0]),
        clamped_node=wall[-1],
    )
