"""Strain gauges on the inner surface: their position, and the strain that they measure there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

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
