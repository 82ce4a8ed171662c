"""Fields along the inner surface, with derivatives good enough for strain.

Strain gauges on the inner surface: their position, and the strain that they measure there.
"""

from collections.abc import Sequence
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


LARGEST_DISTANCE = 0.5e-3  # m, normal to the inner surface
LARGEST_TILT = np.deg2rad(5.0)  # out of the tangent plane


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedGauges:
    """Gauges on the inner surface, in the surface's own directions.

    The meridional unit vector is tangent to the inner surface, positive aft; the circumferential one is
    positive towards increasing roll angle (from +z towards +y).

    Attributes
    ----------
    x : (n_gauges,) stations [m].
    roll_angle : (n_gauges,) roll angles [rad] in (-pi, pi].
    meridional, circumferential : (n_gauges,) direction cosines [-] of the measured direction.
    """

    x: FloatArray
    roll_angle: FloatArray
    meridional: FloatArray
    circumferential: FloatArray


def place_gauges(
    mesh: MeridianMesh, position: FloatArray, direction: FloatArray, name: Sequence[str] | None = None
) -> PlacedGauges:
    """Turn gauge positions and directions in body axes into stations, roll angles and direction cosines.

    A direction that leans out of the tangent plane by a tolerated angle is projected onto it.

    Parameters
    ----------
    mesh : mesh whose inner surface carries the gauges.
    position : (n_gauges, 3) [m], body axes: x aft, y starboard, z up.
    direction : (n_gauges, 3) of any length, body axes.
    name : names for messages; by default ``"gauge 1"`` onwards.

    Raises
    ------
    InputError
        The first gauge that lies ahead of or aft of the hollow part, or off the inner surface by more than
        0.5 mm, or whose direction has no length or leans out of the tangent plane by more than 5 degrees.
    """
    position, direction = np.asarray(position, dtype=float), np.asarray(direction, dtype=float)
    names = list(name) if name is not None else [f"gauge {i + 1}" for i in range(len(position))]
    if not position.shape == direction.shape == (len(names), 3):
        raise InputError(
            f"gauge positions {position.shape} and directions {direction.shape} must be ({len(names)}, 3)"
        )
    x, roll_angle = position[:, 0], np.arctan2(position[:, 1], position[:, 2])
    _refuse_outside(mesh, x, names)
    surface = inner_surface_points(mesh, x)
    _refuse_off_surface(np.hypot(position[:, 1], position[:, 2]) - surface.radius, surface.angle, names)
    unit = _unit(direction, names)
    c, s = surface.tangent.T
    radial = unit[:, 1] * np.sin(roll_angle) + unit[:, 2] * np.cos(roll_angle)
    _refuse_tilted(unit[:, 0] * -s + radial * c, names)
    meridional = unit[:, 0] * c + radial * s
    circumferential = unit[:, 1] * np.cos(roll_angle) - unit[:, 2] * np.sin(roll_angle)
    in_plane = np.hypot(meridional, circumferential)
    return PlacedGauges(
        x=x.copy(),
        roll_angle=roll_angle,
        meridional=meridional / in_plane,
        circumferential=circumferential / in_plane,
    )


def _refuse_outside(mesh: MeridianMesh, x: FloatArray, names: list[str]) -> None:
    if not len(mesh.inner_edge):
        raise InputError("the body is solid: it has no inner surface for gauges")
    front, aft = mesh.node[mesh.inner_edge[[0, -1], [0, 2]], 0]
    for i in np.flatnonzero(~((x >= front) & (x <= aft))):
        where = "aft of the base" if x[i] > aft else "ahead of the hollow part"
        raise InputError(f"{names[i]}: x = {x[i]:.4g} m is {where}, which reaches from {front:g} to {aft:g} m")
    for start, end in mesh.covered:
        for i in np.flatnonzero((x > start) & (x < end)):
            raise InputError(
                f"{names[i]}: expected a station next to the ring frame from {start:.4g} to {end:.4g} m, "
                f"got x = {x[i]:.4g} m under it"
            )


def _refuse_off_surface(radial_gap: FloatArray, angle: FloatArray, names: list[str]) -> None:
    distance = radial_gap * np.cos(angle)
    for i in np.flatnonzero(~(np.abs(distance) <= LARGEST_DISTANCE)):
        side = "outside" if distance[i] > 0.0 else "inside"
        raise InputError(
            f"{names[i]}: position is {1e3 * abs(distance[i]):.2f} mm {side} the inner surface, "
            f"at most {1e3 * LARGEST_DISTANCE:g} mm is allowed"
        )


def _unit(direction: FloatArray, names: list[str]) -> FloatArray:
    length = np.linalg.norm(direction, axis=1)
    for i in np.flatnonzero(~(np.isfinite(length) & (length > 0.0))):
        raise InputError(f"{names[i]}: direction has no length")
    return np.asarray(direction / length[:, None])


def _refuse_tilted(normal_part: FloatArray, names: list[str]) -> None:
    tilt = np.arcsin(np.clip(np.abs(normal_part), 0.0, 1.0))
    for i in np.flatnonzero(tilt > LARGEST_TILT):
        raise InputError(
            f"{names[i]}: direction leans {np.rad2deg(tilt[i]):.1f} deg out of the inner surface, "
            f"at most {np.rad2deg(LARGEST_TILT):g} deg is allowed"
        )
