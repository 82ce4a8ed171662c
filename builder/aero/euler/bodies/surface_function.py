"""A body's surface as a function of station and roll angle, and the tables of it that the march follows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi, sin, tan
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from builder.aero.euler.scheme.grid import Rays, Wall, find_wall
from builder.aero.euler.starts.spherical_start import Cap
from builder.vehicle.shape.geometry import BodyOfRevolution, Segment, is_spherical
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError, InputError

KNOTS_PER_PIECE = 129
KNOTS_PER_ARC = 33
STEEPEST = np.deg2rad(89.0)
"""A tip of infinite slope is tabulated with this angle; the march begins behind it."""
TIP_SAMPLES = 2000
"""Stations at which the slope of a tip is looked up where a sphere stands for it."""


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


@dataclass(frozen=True, eq=False)
class CappedBody:
    """A body of revolution whose tip is replaced by a sphere, tangent to the wall.

    Attributes
    ----------
    cap : the sphere's part up to ``end``.
    end : station on the body's wall at which the wall goes on [m].
    shift : station of the sphere's foremost point [m], from which the walls of ``pieces`` count.
    pieces : the wall from ``end`` on.
    tip_station, tip_angle : (n,) stations [m] up to ``end``, and pi/2 less the wall's angle there [rad].
    """

    cap: Cap
    end: float
    shift: float
    pieces: list[list[Wall]]
    tip_station: FloatArray
    tip_angle: FloatArray

    def on_body(self, stations: FloatArray, pressure: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return stations on the body itself [m], and p/p_inf there, of ``stations`` from the sphere's tip [m].

        The tip has the sphere's pressure at the same inclination.
        """
        on_cap = stations < self.end - self.shift
        angle = np.arccos(1.0 - stations[on_cap] / self.cap.radius)
        x = np.append(np.interp(angle, self.tip_angle, self.tip_station), stations[~on_cap] + self.shift)
        # A pointed tip has no place for the steepest parts of the sphere.
        distinct = np.append(np.diff(x) > 0.0, True)
        return x[distinct], pressure[distinct]


def capped_body(pieces: list[list[Wall]], needed_angle: Callable[[], float]) -> CappedBody | None:
    """Return the body of ``pieces`` with the smallest cap that reaches an angle [rad] round its centre.

    None where the body is not of revolution, its first smooth piece does not begin steeper and become as slender
    as the end of such a cap, or ``needed_angle`` is out of reach.
    """
    first = pieces[0][0]
    if np.any(np.ptp(first.radius, axis=1) > 0.0) or np.ptp(first.slope) == 0.0:
        return None
    try:
        slope = 1.0 / tan(needed_angle())
    except FlowReachError:
        return None
    # A table of an infinite slope says nothing between its first two knots.
    begin = first.x[1] if first.slope[0, 0] >= np.tan(STEEPEST) else first.x[0]
    x = np.append(0.0, begin + (first.x[-1] - begin) * np.linspace(0.0, 1.0, TIP_SAMPLES) ** 2)
    radii, slopes = np.empty((2, len(x), first.radius.shape[1]))
    for station, radius, own_slope in zip(x, radii, slopes, strict=True):
        find_wall(station, first, radius, own_slope)
    slender = np.flatnonzero(slopes[:, 0] <= slope)
    if not len(slender) or slender[0] == 0:
        return None
    last = int(slender[0])
    end, radius = float(x[last]), float(radii[last, 0])
    end_angle = float(np.arctan2(1.0, slopes[last, 0]))
    cap = Cap(radius / sin(end_angle), end_angle)
    shift = end - cap.radius * (1.0 - cos(end_angle))
    beyond_cap = first.x > end
    begun = Wall(
        np.append(end, first.x[beyond_cap]) - shift,
        np.vstack([radii[last], first.radius[beyond_cap]]),
        np.vstack([slopes[last], first.slope[beyond_cap]]),
    )
    rest = [[wall._replace(x=wall.x - shift) for wall in piece] for piece in pieces]
    return CappedBody(
        cap=cap,
        end=end,
        shift=shift,
        pieces=[[begun, *rest[0][1:]], *rest[1:]],
        tip_station=x[: last + 1],
        tip_angle=np.maximum.accumulate(np.arctan2(1.0, slopes[: last + 1, 0])),
    )


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
