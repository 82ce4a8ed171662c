"""Mesh of the wall of a body of sections: hexahedra in planes across the axis, as in a swept wall.

Every column of nodes lies in a plane x = const. Through the wall they follow the outer normal's direction in that
plane, so that the thickness along the normal is the wall's. The solid tip ahead of the hollow has a bore of a
tenth of the inner section, and is cut off where it has a fiftieth of its radius, as in
:mod:`builder.structure.solid.mesh.swept_mesh`.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from builder.structure.fourier.meridian_mesh import grid_elements, line_edges, with_middles
from builder.structure.fourier.shell_mesh import CORE_ELEMENTS, EDGE_REACH, FINEST
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, INTERNAL, SUPPORT
from builder.structure.solid.mesh.swept_mesh import (
    BORE,
    BORE_FRACTION,
    SweptMesh,
    SweptResolution,
    cut_station,
    full_mesh,
    sweep,
)
from builder.structure.wall import Wall
from builder.vehicle.shape.sectioned_body import SectionedBody
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

QUARTERS: FloatArray = 0.5 * np.pi * np.arange(4.0)


def section_wall(body: SectionedBody, wall: Wall, resolution: SweptResolution) -> SweptMesh:
    """Mesh the wall of ``body`` with its solid tip, held at the base.

    Returns
    -------
    SweptMesh
        Surfaces external, internal (the wall's, behind the tip), support (the base ring) and tip_bore.

    Raises
    ------
    InputError
        The tip leaves no hollow part, or the wall fills the body behind the tip.
    """
    tip = wall.solid_tip_length
    if not tip < body.length:
        raise InputError(f"solid_tip_length {tip:g} m must be less than the body's length {body.length:g} m")
    tip_x, wall_x = _stations(body, wall, resolution.element_length)
    n_layers = 2 * resolution.n_layers + 1
    core = 2 * CORE_ELEMENTS
    tip_number = np.arange(len(tip_x) * (core + n_layers)).reshape(len(tip_x), -1)
    hollow = np.empty((len(wall_x), n_layers), dtype=np.int64)
    hollow[0] = tip_number[-1, core:]
    hollow[1:] = tip_number.size + np.arange((len(wall_x) - 1) * n_layers).reshape(-1, n_layers)
    # Columns and rows instead of x and r: the sweep numbers nodes, their places follow.
    column = np.concatenate([np.repeat(tip_x, core + n_layers), np.repeat(wall_x[1:], n_layers)])
    row = np.concatenate(
        [np.tile(np.arange(core + n_layers), len(tip_x)), np.tile(core + np.arange(n_layers), len(wall_x) - 1)]
    )
    element = np.concatenate([grid_elements(tip_number), grid_elements(hollow)])
    outside = np.concatenate([tip_number[:, -1], hollow[1:, -1]])
    edges = {
        EXTERNAL: np.concatenate([line_edges(tip_number[0]), line_edges(outside)]),
        INTERNAL: line_edges(hollow[:, 0]),
        SUPPORT: line_edges(hollow[-1]),
        BORE: np.concatenate([line_edges(tip_number[:, 0]), line_edges(tip_number[-1, : core + 1])]),
    }
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
    ahead, behind = body.normal(x, roll, -1.0), body.normal(x, roll, 1.0)
    at_end = x >= body.length * (1.0 - 1e-9)
    behind[at_end] = ahead[at_end]
    normal = ahead + behind
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
