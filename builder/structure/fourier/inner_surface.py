"""Fields along the inner surface, with derivatives good enough for strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.structure.fourier.meridian_mesh import MeridianMesh, line_nodes, locate_on_edge, quadratic_shape
from builder.vehicle.shape.geometry import SMALLEST_SLOPE_BREAK
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

STENCIL = 5  # nodes of two edges


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfacePoints:
    """Points on the inner surface, each with the nodes whose values give a field there.

    Attributes
    ----------
    node : (n, 5) nodes around each point.
    value : (n, 5) weights that give a nodal field at the point [-].
    slope : (n, 5) weights that give its derivative along the meridian, positive aft [1/m].
    radius : (n,) radius [m].
    tangent : (n, 2) unit vector [x, r] along the meridian, positive aft.
    """

    node: IntArray
    value: FloatArray
    slope: FloatArray
    radius: FloatArray
    tangent: FloatArray

    @property
    def angle(self) -> FloatArray:
        """(n,) angle of the meridian to the axis [rad]."""
        return np.asarray(np.arctan2(self.tangent[:, 1], self.tangent[:, 0]))


def inner_surface_points(mesh: MeridianMesh, x: FloatArray) -> SurfacePoints:
    """Find points at stations ``x`` on the inner surface.

    A field is the polynomial in x through the five nodes of the edge that holds the point and of the
    nearer neighbour on the same smooth part of the surface. Nodal displacements are an order more
    accurate than the derivative of an element's own polynomial, which this brings to the strain.

    Parameters
    ----------
    mesh : the mesh.
    x : (n,) stations [m]; one on a slope break counts to the aft side.

    Raises
    ------
    InputError
        The body is solid.
    """
    if not len(mesh.inner_edge):
        raise InputError("the body is solid: it has no inner surface for gauges")
    edge, xi = locate_on_edge(mesh, mesh.inner_edge, x)
    first, last = _smooth_part(mesh)
    start = np.clip(np.where(xi > 0.0, 2 * edge, 2 * edge - 2), 2 * first[edge], 2 * last[edge] - 2)
    node = line_nodes(mesh.inner_edge)[start[:, None] + np.arange(STENCIL)]
    value, by_x = _lagrange(mesh.node[node, 0], x)
    radius = np.einsum("ga,ga->g", value, mesh.node[node, 1])
    rise = np.einsum("ga,ga->g", by_x, mesh.node[node, 1])
    length = np.hypot(1.0, rise)[:, None]
    return SurfacePoints(
        node=node,
        value=value,
        slope=by_x / length,
        radius=radius,
        tangent=np.column_stack([np.ones(len(x)), rise]) / length,
    )


def _smooth_part(mesh: MeridianMesh) -> tuple[IntArray, IntArray]:
    """Return, for every inner edge, the first and last edge (n_i,) of its part between slope breaks."""
    _, by_xi = quadratic_shape(np.array([-1.0, 1.0]))
    tangent = np.einsum("pa,eac->epc", by_xi, mesh.node[mesh.inner_edge])
    angle = np.arctan2(tangent[..., 1], tangent[..., 0])
    kink = np.abs(angle[1:, 0] - angle[:-1, 1]) > SMALLEST_SLOPE_BREAK
    kink |= np.isin(mesh.inner_edge[1:, 0], mesh.inner_break)
    part = np.concatenate([[0], np.cumsum(kink)])
    starts = np.flatnonzero(np.diff(part, prepend=-1))
    ends = np.append(starts[1:], len(part)) - 1
    return starts[part], ends[part]


def _lagrange(node_x: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the Lagrange polynomials of each row of nodes and their derivatives at ``x``.

    Parameters
    ----------
    node_x : (n, k) distinct nodes [m].
    x : (n,) points [m].

    Returns
    -------
    value : (n, k) [-].
    derivative : (n, k) [1/m].
    """
    k = node_x.shape[1]
    value, derivative = np.empty_like(node_x), np.empty_like(node_x)
    for a in range(k):
        remaining = [b for b in range(k) if b != a]
        gap = x[:, None] - node_x[:, remaining]
        scale = np.prod(node_x[:, [a]] - node_x[:, remaining], axis=1)
        value[:, a] = np.prod(gap, axis=1) / scale
        # Product rule; gaps may be zero, so no division by them.
        derivative[:, a] = sum(np.prod(np.delete(gap, c, axis=1), axis=1) for c in range(k - 1)) / scale
    return value, derivative
