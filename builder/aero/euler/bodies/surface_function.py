"""A body's surface as a function of station and roll angle, and the tables of it that the march follows."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import pi, sin
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from builder.aero.euler.scheme.grid import Rays, Wall
from builder.aero.euler.starts.spherical_start import Cap
from builder.vehicle.shape.geometry import BodyOfRevolution, Segment, is_spherical
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

KNOTS_PER_PIECE = 129
KNOTS_PER_ARC = 33
STEEPEST = np.deg2rad(89.0)
"""A tip of infinite slope is tabulated with this angle; the march begins behind it."""


class SurfaceFunction(Protocol):
    """Surface of a pointed body whose sections are star-shaped about the x axis.

    Attributes
    ----------
    length : from the tip at x = 0 to the base [m].
    slope_breaks : stations between which the surface is smooth [m], without tip and base.
    """

    @property
    def length(self) -> float: ...

    @property
    def slope_breaks(self) -> Sequence[float] | FloatArray: ...

    def radius(self, x: FloatArray, roll_angle: FloatArray) -> FloatArray:
        """Return r [m] at stations ``x`` [m] and roll angles [rad] from +z towards +y, broadcast together.

        Towards the tip r/x must tend to a positive limit on every ray.
        """
        ...


def surface_walls(surface: SurfaceFunction, rays: Rays) -> list[list[Wall]]:
    """Tabulate a surface along rays, smooth piece by smooth piece.

    Raises
    ------
    InputError
        The radius is not positive and finite everywhere aft of the tip.
    """
    roll_angle: FloatArray = rays.step * np.arange(rays.sine.size, dtype=np.float64)
    if rays.closed:
        roll_angle[-1] = 0.0
    pieces = []
    for start, end in pairwise([0.0, *(float(x) for x in surface.slope_breaks), float(surface.length)]):
        x = np.linspace(start, end, KNOTS_PER_PIECE)
        radius = np.array(np.broadcast_to(surface.radius(x[:, None], roll_angle), (x.size, roll_angle.size)))
        if start == 0.0:
            radius[0] = 0.0
        aft = radius[1:]
        if not (np.all(np.isfinite(aft)) and np.all(aft > 0.0)):
            raise InputError("surface: the radius must be positive and finite everywhere aft of the tip")
        pieces.append([Wall(x, radius, CubicSpline(x, radius)(x, 1))])
    return pieces


def body_walls(body: BodyOfRevolution, rays: Rays) -> list[list[Wall]]:
    """Tabulate the meridian of a body of revolution segment by segment, grouped into smooth pieces."""
    pieces: list[list[Wall]] = [[]]
    for segment in body.segments:
        if segment.start_x in body.slope_breaks:
            pieces.append([])
        x = _knots(segment)
        radius, slope = segment.radius(x), np.tan(np.minimum(segment.angle(x), STEEPEST))
        all_round = np.ones(rays.sine.size)
        pieces[-1].append(Wall(x, np.outer(radius, all_round), np.outer(slope, all_round)))
    return pieces


def cap_of(body: BodyOfRevolution) -> Cap | None:
    """Return the spherical tip of ``body``, or None where it begins otherwise."""
    first = body.segments[0]
    if not is_spherical(first):
        return None
    return Cap(first.end_x / (1.0 - sin(first.end_angle)), 0.5 * pi - first.end_angle)


def _knots(segment: Segment) -> FloatArray:
    """Return stations [m] of a segment's table; of curves other than arcs denser towards their front."""
    if type(segment) is Segment:
        return np.linspace(segment.start_x, segment.end_x, 2 if segment.is_straight else KNOTS_PER_ARC)
    share = np.linspace(0.0, 1.0, KNOTS_PER_PIECE) ** 2
    return np.asarray(segment.start_x + share * (segment.end_x - segment.start_x))


def cone_wall(slope: FloatArray, end: float) -> Wall:
    """Return the cone r = slope x over slope (n_phi + 1,), from its tip to ``end`` [m]."""
    x = np.array([0.0, end])
    return Wall(x, np.outer(x, slope), np.stack([slope, slope]))
