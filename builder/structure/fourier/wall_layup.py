"""What a wall has beyond one thickness and material: where its mesh must have joints, its frames, masses, support.

A ring frame is a block of elements inside the wall, joined to it between its two sides. The inner surface keeps
its edges under the frame; gauges are refused there.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from builder.structure.fourier.meridian_mesh import (
    NO_NODES,
    MeridianMasses,
    MeridianMesh,
    grid_elements,
    line_edges,
    line_nodes,
)
from builder.structure.wall import Material, RingFrame, Wall
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import IntArray
from strainfmu.errors import InputError

STEEP = 0.05
"""Slope of the thickness from which its ends are edges, near which elements are short."""

SHORTEST_PIECE = 1e-6
"""Stations nearer to each other than this [m] are one."""

MOST_LAYERS = 24
"""Elements from a frame's inner edge to the wall."""

_OUTSIDE = 5
"""Local node of an element in the middle of its outer side."""


def steps(wall: Wall) -> list[float]:
    """Return the stations of the outer surface [m] near which the wall bends: steps, regions' ends, frames."""
    stations = [x for frame in wall.frames for x in frame.ends]
    stations += [x for region in wall.regions for x in (region.start, region.end)]
    for (x, share), (after, next_share) in pairwise(wall.profile):
        if wall.thickness * abs(next_share - share) > STEEP * (after - x):
            stations += [x, after]
    return stations


TOUCHES = 1e-9
"""Rounding of stations [m]."""


def change_stations(body: BodyOfRevolution, wall: Wall) -> dict[float, str]:
    """Return the stations [m] near which strain changes within millimetres, and what changes at each."""
    causes = dict.fromkeys((wall.solid_tip_length, *steps(wall)), "thickness, material or frames")
    return causes | dict.fromkeys(body.slope_breaks.tolist(), "slope")


def layup_stations(wall: Wall, outer_of: Callable[[float], float]) -> list[float]:
    """Return the stations of the outer surface [m] on which elements must end.

    ``outer_of`` returns that over a station of the inner surface, on which the sides of frames are given.
    """
    stations = [x for x, _ in wall.profile]
    stations += [x for region in wall.regions for x in (region.start, region.end)]
    return stations + [outer_of(x) for frame in wall.frames for x in frame.ends]


def outer_station(body: BodyOfRevolution, wall: Wall, inner: float) -> float:
    """Return the station [m] on the outer surface whose inward normal meets the inner surface at ``inner`` [m]."""
    x = inner
    for _ in range(60):
        station = min(max(x, 0.0), body.length)
        x = inner - float(wall.thickness_at(station)) * float(np.sin(body.angle(station)))
    return x


def furnished(mesh: MeridianMesh, wall: Wall, element_length: float) -> MeridianMesh:
    """Return the mesh of a bare wall with the materials, frames, masses and support of ``wall``.

    Raises
    ------
    InputError
        A frame does not lie on the hollow part, or reaches beyond the axis or into another one.
    """
    materials: list[Material] = [region.material for region in wall.regions]
    of_wall = 0.0 if wall.flight is None else wall.flight.density
    densities = [of_wall, *(density or 0.0 for density in other_densities(wall))]
    material_of = np.zeros(len(mesh.element), dtype=np.intp)
    middle = mesh.node[mesh.element[:, _OUTSIDE], 0]
    for number, region in enumerate(wall.regions, start=1):
        material_of[(middle > region.start) & (middle < region.end)] = number
    sides = [NO_NODES]
    for frame in _in_order(wall.frames):
        mesh, at_side, under = _with_frame(mesh, frame, element_length)
        sides.append(at_side)
        index = int(material_of[under])
        if frame.material is not None:
            materials.append(frame.material)
            index = len(materials)
        material_of = np.append(material_of, np.full(len(mesh.element) - len(material_of), index, dtype=np.intp))
    aft, flight = mesh.clamped_node, wall.flight
    is_clamped = wall.foundation is None if flight is None else flight.has_stiff_base
    return replace(
        mesh,
        materials=tuple(materials),
        material_of=material_of if materials else None,
        inner_break=np.concatenate([*sides, _at_borders(mesh, wall)]),
        covered=np.array([frame.ends for frame in wall.frames]).reshape(-1, 2),
        masses=None
        if flight is None
        else MeridianMasses(density=tuple(densities), points=flight.points, covers=flight.covers),
        foundation=None if wall.foundation is None else (*wall.foundation, line_edges(aft)),
        clamped_node=aft if is_clamped else NO_NODES,
    )


def other_densities(wall: Wall) -> tuple[float | None, ...]:
    """Return the density [kg/m3] of each of the materials of :func:`furnished`, None where none is stated."""
    frames = (frame.density for frame in _in_order(wall.frames) if frame.material is not None)
    return (*(region.density for region in wall.regions), *frames)


def _at_borders(mesh: MeridianMesh, wall: Wall) -> IntArray:
    """Return the nodes of the inner surface under the ends of the wall's regions."""
    inner, outer = line_nodes(mesh.inner_edge)[::2], line_nodes(mesh.outer_edge)[::2]
    over = mesh.node[outer[-len(inner) :], 0]
    ends = [x for region in wall.regions for x in (region.start, region.end)]
    near = np.abs(over[:, None] - np.array(ends)).min(axis=1, initial=np.inf) < SHORTEST_PIECE
    return np.asarray(inner[near], dtype=np.intp)


def _in_order(frames: tuple[RingFrame, ...]) -> list[RingFrame]:
    """Return the frames from the front aft.

    Raises
    ------
    InputError
        Two overlap.
    """
    ordered = sorted(frames, key=lambda frame: frame.station)
    for before, after in pairwise(ordered):
        if before.ends[1] > after.ends[0] - SHORTEST_PIECE:
            raise InputError(
                f"ring frame at {after.station:.4g} m: expected its front behind {before.ends[1]:.4g} m, where "
                f"that at {before.station:.4g} m ends, got {after.ends[0]:.4g} m"
            )
    return ordered


def _with_frame(mesh: MeridianMesh, frame: RingFrame, element_length: float) -> tuple[MeridianMesh, IntArray, int]:
    """Return the mesh with a frame, the nodes of the inner surface at its sides, and a wall element there."""
    line = line_nodes(mesh.inner_edge)
    x = mesh.node[line, 0]
    front, aft = (int(np.abs(x - end).argmin()) for end in frame.ends)
    where = f"ring frame at {frame.station:.4g} m"
    off = max(abs(x[front] - frame.ends[0]), abs(x[aft] - frame.ends[1]))
    if off > 1e-3 * frame.width or front % 2 or aft % 2 or aft - front < 2:
        raise InputError(
            f"{where}: expected it on the hollow part, {x[0]:.4g} .. {x[-1]:.4g} m, away from slope breaks, "
            f"got {frame.ends[0]:.4g} .. {frame.ends[1]:.4g} m"
        )
    root = line[front : aft + 1]
    radius = mesh.node[root, 1]
    smallest = float(radius.min())
    depth = smallest if frame.depth is None else frame.depth
    if depth >= smallest and frame.depth is not None:
        raise InputError(f"{where}: expected a depth below {1e3 * smallest:.4g} mm, got {1e3 * depth:.4g} mm")
    inside = np.zeros(len(root)) if frame.depth is None else radius - depth
    layers = int(np.clip(np.ceil(depth / max(frame.width, 0.5 * element_length)), 2, MOST_LAYERS))
    through = np.linspace(0.0, 1.0, 2 * layers + 1)[:-1]
    r = inside[:, None] + (radius - inside)[:, None] * through
    grid = np.empty((len(root), 2 * layers + 1), dtype=np.intp)
    grid[:, :-1] = len(mesh.node) + np.arange(r.size).reshape(r.shape)
    grid[:, -1] = root
    node = np.column_stack([np.repeat(x[front : aft + 1], len(through)), r.ravel()])
    under = int(np.flatnonzero((mesh.element == root[1]).any(axis=1))[0])
    joined = replace(
        mesh, node=np.concatenate([mesh.node, node]), element=np.concatenate([mesh.element, grid_elements(grid)])
    )
    return joined, root[[0, -1]], under
