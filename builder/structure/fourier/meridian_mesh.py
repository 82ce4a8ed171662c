"""Quadrilaterals of second order in the meridian plane of a body of revolution.

Every element has nine nodes, the tensor product of three along the wall (xi, positive aft) and three
through it (eta, positive outwards): local node = 3 * (node along) + (node through).
"""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np

from builder.structure.wall import Material
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

End = Literal["free", "guided", "clamped"]

NO_NODES: IntArray = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True, eq=False, kw_only=True)
class MeridianMasses:
    """Masses of a body of revolution.

    Attributes
    ----------
    density : of each material, the wall's own first [kg/m3].
    points : (station [m], mass [kg]) on the axis, carried by the outer surface there.
    covers : (start, end [m], mass per area [kg/m2]) on the outer surface.
    """

    density: tuple[float, ...]
    points: tuple[tuple[float, float], ...] = ()
    covers: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class MeridianMesh:
    """Mesh of the meridian plane.

    The middle node of an edge on a surface lies midway in x, so that x is linear along such an edge.

    Attributes
    ----------
    node : (n, 2) positions [x, r] [m].
    element : (n_e, 9) nodes of each element.
    outer_edge : (n_o, 3) nodes of the edges on the outer surface, from the front aft.
    inner_edge : (n_i, 3) nodes of the edges on the inner surface, from the front aft; none if solid.
    clamped_node : nodes that do not move.
    guided_node : nodes that do not move axially (a plane of symmetry, or plane strain).
    materials : materials other than the wall's own.
    material_of : (n_e,) of each element, 0 the wall's own, 1 onwards from ``materials``; None where all are
        0.
    inner_break : nodes of the inner surface at which strain may jump, as at the side of a ring frame.
    covered : (k, 2) stations [m] between which the inner surface carries a ring frame.
    masses : what balances the load of a body that nothing holds; None where supports do.
    foundation : stiffness per area along and across the normal of the aft ring [N/m3], and its edges (n, 3).
    """

    node: FloatArray
    element: IntArray
    outer_edge: IntArray
    inner_edge: IntArray
    clamped_node: IntArray = field(default_factory=lambda: NO_NODES)
    guided_node: IntArray = field(default_factory=lambda: NO_NODES)
    materials: tuple[Material, ...] = ()
    material_of: IntArray | None = None
    inner_break: IntArray = field(default_factory=lambda: NO_NODES)
    covered: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    masses: MeridianMasses | None = None
    foundation: tuple[float, float, IntArray] | None = None

    @property
    def n_dof(self) -> int:
        """Number of displacement amplitudes; dof = 3 * node + component (x, r, phi)."""
        return 3 * len(self.node)

    @property
    def axis_node(self) -> IntArray:
        """Nodes on the axis r = 0."""
        return np.flatnonzero(self.node[:, 1] == 0.0)


def quadratic_shape(xi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the three Lagrange polynomials at ``xi`` in [-1, 1] and their derivatives, (..., 3) each."""
    value = np.stack([0.5 * xi * (xi - 1.0), 1.0 - xi**2, 0.5 * xi * (xi + 1.0)], axis=-1)
    derivative = np.stack([xi - 0.5, -2.0 * xi, xi + 0.5], axis=-1)
    return value, derivative


def locate_on_edge(mesh: MeridianMesh, edge: IntArray, x: FloatArray) -> tuple[IntArray, FloatArray]:
    """Find stations ``x`` [m] on a surface.

    Parameters
    ----------
    mesh : the mesh.
    edge : (n_edge, 3) its ``outer_edge`` or ``inner_edge``.
    x : (n,) stations [m]; one on a joint of two edges counts to the aft one.

    Returns
    -------
    (n,) index of the edge, and (n,) coordinate on it, -1 at its front and 1 at its aft end.
    """
    front, aft = mesh.node[edge[:, 0], 0], mesh.node[edge[:, 2], 0]
    index = np.clip(np.searchsorted(front, x, side="right") - 1, 0, len(edge) - 1)
    return index, (2.0 * x - front[index] - aft[index]) / (aft[index] - front[index])


def grid_elements(grid: IntArray) -> IntArray:
    """Cut a structured grid of node numbers into elements.

    Parameters
    ----------
    grid : (2 n_along + 1, 2 n_through + 1) node numbers, from the front aft and outwards.

    Returns
    -------
    (n_along * n_through, 9) nodes of each element.
    """
    n_along, n_through = (np.array(grid.shape) - 1) // 2
    local = [grid[i : i + 2 * n_along - 1 : 2, j : j + 2 * n_through - 1 : 2] for i in range(3) for j in range(3)]
    return np.stack(local, axis=-1).reshape(-1, 9)


def line_edges(line: IntArray) -> IntArray:
    """Cut (2 n + 1,) node numbers along a line into (n, 3) edges."""
    return np.column_stack([line[:-2:2], line[1:-1:2], line[2::2]])


def line_nodes(edge: IntArray) -> IntArray:
    """Return the (2 n + 1,) nodes along a line of edges (n, 3): the inverse of :func:`line_edges`."""
    return np.append(edge[:, :2], edge[-1, 2])


def with_middles(x: FloatArray) -> FloatArray:
    """Insert the middle between consecutive values: (n,) to (2 n - 1,)."""
    both = np.empty(2 * len(x) - 1)
    both[::2] = x
    both[1::2] = 0.5 * (x[:-1] + x[1:])
    return both


def tube_mesh(
    x: FloatArray,
    inner_radius: FloatArray,
    outer_radius: FloatArray,
    element_length: float,
    n_layers: int = 1,
    front: End = "free",
    aft: End = "clamped",
) -> MeridianMesh:
    """Mesh a tube of straight pieces: cylinders, cones, or solid bars (inner radius 0).

    Parameters
    ----------
    x : (n,) stations [m], increasing; elements end on them.
    inner_radius, outer_radius : (n,) radii there [m], linear in between; along x, not along the normal.
    element_length : largest element length along x [m].
    n_layers : elements through the wall.
    front, aft : what holds the ends; ``"guided"`` fixes the axial displacement only.

    Raises
    ------
    InputError
        Stations do not increase, the wall has no thickness, or a resolution is not positive.
    """
    x, inner_radius, outer_radius = (np.asarray(a, dtype=float) for a in (x, inner_radius, outer_radius))
    check_resolution(element_length, n_layers)
    if len(x) < 2 or np.any(np.diff(x) <= 0.0):
        raise InputError("tube stations must increase")
    if np.any(inner_radius < 0.0) or np.any(outer_radius <= inner_radius):
        raise InputError("tube radii must satisfy 0 <= inner radius < outer radius")
    pieces = [np.linspace(a, b, max(2, int(np.ceil((b - a) / element_length - 1e-9))) + 1) for a, b in pairwise(x)]
    column_x = with_middles(np.unique(np.concatenate(pieces)))
    through = np.linspace(0.0, 1.0, 2 * n_layers + 1)
    inside, outside = np.interp(column_x, x, inner_radius), np.interp(column_x, x, outer_radius)
    r = inside[:, None] + (outside - inside)[:, None] * through
    grid = np.arange(r.size).reshape(r.shape)
    ends = {front: grid[0]} if front != aft else {front: np.concatenate([grid[0], grid[-1]])}
    ends.setdefault(aft, grid[-1])
    return MeridianMesh(
        node=np.column_stack([np.repeat(column_x, len(through)), r.ravel()]),
        element=grid_elements(grid),
        outer_edge=line_edges(grid[:, -1]),
        inner_edge=line_edges(grid[:, 0]) if inner_radius.all() else np.zeros((0, 3), dtype=np.intp),
        clamped_node=ends.get("clamped", NO_NODES),
        guided_node=ends.get("guided", NO_NODES),
    )


def check_resolution(element_length: float, n_layers: int) -> None:
    """Refuse an element length [m] or a number of layers that is not positive.

    Raises
    ------
    InputError
        One of them is not.
    """
    if not (np.isfinite(element_length) and element_length > 0.0):
        raise InputError(f"element_length {element_length:g} m must be greater than 0")
    if n_layers < 1:
        raise InputError(f"n_layers {n_layers} must be at least 1")
