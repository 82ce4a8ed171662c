"""Outer shape of a body of revolution and the pressure nodes on it.

The meridian r(x) consists of segments from the tip at x = 0 to the base: cones, circular arcs, and the curves of
:mod:`builder.vehicle.shape.profile_entries`. Slope breaks between segments are kept as such: the surface pressure
may jump there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

SMALLEST_SLOPE_BREAK = np.deg2rad(0.01)
STEEP = np.deg2rad(60.0)
"""Angle of a tip above which stations follow the meridian's length and turning, not x."""
TURN_PER_STATION = np.deg2rad(5.0)
BLUNT = np.deg2rad(45.5)
CUT_TIP = 0.01
"""Share of the first segment's length whose chord measures how blunt a tip is."""


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One piece of the meridian: a straight line or a circular arc, or a curve of a derived class.

    Attributes
    ----------
    start_x, end_x : axial stations of its ends [m].
    start_radius : radius at ``start_x`` [m].
    start_angle, end_angle : angle of the meridian to the axis at its ends [rad]; equal for a cone.
    """

    start_x: float
    end_x: float
    start_radius: float
    start_angle: float
    end_angle: float

    @property
    def _arc_radius(self) -> float:
        """Radius of curvature of the arc [m], positive where the angle falls towards the base."""
        return (self.end_x - self.start_x) / (np.sin(self.start_angle) - np.sin(self.end_angle))

    @property
    def is_straight(self) -> bool:
        return self.start_angle == self.end_angle

    @property
    def end_radius(self) -> float:
        return float(self.radius(np.array([self.end_x]))[0])

    @property
    def min_radius(self) -> float:
        """Minimum radius [m] aft of the segment's start: at its end, or where a rising arc turns."""
        if self.start_angle < 0.0 < self.end_angle:
            return float(self.start_radius + self._arc_radius * (1.0 - np.cos(self.start_angle)))
        return self.end_radius

    def angle(self, x: FloatArray) -> FloatArray:
        """Return the angle of the meridian to the axis [rad] at stations ``x`` [m]."""
        if self.is_straight:
            return np.full_like(x, self.start_angle)
        return np.arcsin(np.clip(np.sin(self.start_angle) - (x - self.start_x) / self._arc_radius, -1.0, 1.0))

    def radius(self, x: FloatArray) -> FloatArray:
        """Return the radius [m] at stations ``x`` [m]."""
        if self.is_straight:
            return self.start_radius + (x - self.start_x) * np.tan(self.start_angle)
        return self.start_radius + self._arc_radius * (np.cos(self.angle(x)) - np.cos(self.start_angle))


@dataclass(frozen=True)
class BodyOfRevolution:
    """Outer surface of a body of revolution around the x axis, tip at x = 0."""

    segments: tuple[Segment, ...]

    @property
    def length(self) -> float:
        """Length from tip to base [m]."""
        return self.segments[-1].end_x

    @property
    def base_radius(self) -> float:
        """Radius at the base [m]."""
        return self.segments[-1].end_radius

    @property
    def tip_angle(self) -> float:
        """Half-angle of the tip [rad]."""
        return self.segments[0].start_angle

    @property
    def cut_tip_angle(self) -> float:
        """Half-angle [rad] of the cone from the tip to a hundredth of the first segment; near 90 deg if blunt."""
        x = CUT_TIP * self.segments[0].end_x
        return float(np.arctan2(self.radius(x), x))

    @cached_property
    def slope_breaks(self) -> FloatArray:
        """Stations [m] at which the meridian's angle jumps."""
        pairs = zip(self.segments[:-1], self.segments[1:], strict=True)
        return np.array(
            [
                after.start_x
                for before, after in pairs
                if abs(before.end_angle - after.start_angle) > SMALLEST_SLOPE_BREAK
            ]
        )

    def _segment_index(self, x: FloatArray, side: str) -> NDArray[np.intp]:
        ends = np.array([segment.end_x for segment in self.segments[:-1]])
        return np.searchsorted(ends, x, side="left" if side == "upstream" else "right")

    def radius(self, x: FloatArray | float) -> FloatArray:
        """Return the outer radius r(x) [m], same shape as ``x`` [m]."""
        return self._evaluate("radius", x, "upstream")

    def angle(self, x: FloatArray | float, side: str = "upstream") -> FloatArray:
        """Return the meridian's angle to the axis [rad] at ``x`` [m].

        ``side`` is ``"upstream"`` or ``"downstream"`` and matters at slope breaks only.
        """
        return self._evaluate("angle", x, side)

    def _evaluate(self, what: str, x: FloatArray | float, side: str) -> FloatArray:
        stations = np.atleast_1d(np.asarray(x, dtype=float))
        index = self._segment_index(stations, side)
        values = np.empty_like(stations)
        for i, segment in enumerate(self.segments):
            on_piece = index == i
            values[on_piece] = getattr(segment, what)(stations[on_piece])
        return values.reshape(np.shape(x))


def chain_segments(pieces: list[tuple[float, float, float]]) -> BodyOfRevolution:
    """Build a body from ``(end_x [m], start_angle [rad], end_angle [rad])`` pieces, tip first.

    Raises
    ------
    InputError
        Stations do not increase, the tip is not pointed, or the radius falls to zero.

    Example
    -------
    >>> from math import radians
    >>> body = chain_segments([(1.75, radians(5.0), radians(5.0)), (3.6, radians(1.0), radians(1.0))])
    >>> print(f"{body.length} m long, base radius {1e3 * body.base_radius:.1f} mm")
    3.6 m long, base radius 185.4 mm
    """
    return chain_pieces([_arc_maker(*piece) for piece in pieces])


SegmentMaker = Callable[[float, float], Segment]
"""Makes a segment that begins at a station [m] and a radius [m]."""


def _arc_maker(end_x: float, start_angle: float, end_angle: float) -> SegmentMaker:
    return lambda x, radius: Segment(
        start_x=x, end_x=end_x, start_radius=radius, start_angle=start_angle, end_angle=end_angle
    )


def chain_pieces(makers: list[SegmentMaker]) -> BodyOfRevolution:
    """Build a body from makers of its segments, tip first; each begins where the last one ended.

    Raises
    ------
    InputError
        Stations do not increase, the tip has no angle, the radius falls to zero, or a maker refuses.
    """
    segments: list[Segment] = []
    x, radius = 0.0, 0.0
    for number, make in enumerate(makers, start=1):
        try:
            segment = make(x, radius)
        except InputError as error:
            raise InputError(f"profile segment {number}: {error}") from error
        if segment.end_x <= x:
            raise InputError(f"profile segment {number}: end_x_m {segment.end_x:g} must lie aft of {x:g}")
        if segment.min_radius <= 0.0:
            raise InputError(f"profile segment {number}: the radius falls to zero before x = {segment.end_x:g} m")
        segments.append(segment)
        x, radius = segment.end_x, segment.end_radius
    if not segments or segments[0].start_angle <= 0.0:
        raise InputError("profile segment 1: the tip must be pointed, its half-angle greater than 0 deg")
    return BodyOfRevolution(tuple(segments))


def is_blunt(body: BodyOfRevolution) -> bool:
    """Return whether the tip of ``body`` is too blunt for a march, which begins with a cone."""
    return body.cut_tip_angle > BLUNT


def is_spherical(tip: Segment) -> bool:
    """Return whether the first segment of a body is part of a sphere, from the axis on."""
    return type(tip) is Segment and not tip.is_straight and bool(np.isclose(tip.start_angle, 0.5 * np.pi))


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceGrid:
    """Pressure nodes on a body of revolution: a product of stations and roll angles.

    Pressure is linear in x between stations and trigonometric in roll angle. A slope break is a pair
    of equal stations, so that the pressure may jump. A field is stored flat, station by station:
    node = station_index * n_roll + roll_index.

    Attributes
    ----------
    x : (n_x,) stations [m], non-decreasing.
    radius : (n_x,) outer radius [m].
    angle : (n_x,) meridian angle [rad], one-sided at slope breaks.
    n_roll : number of roll angles, evenly spaced from 0 (+z) towards +y.
    """

    x: FloatArray
    radius: FloatArray
    angle: FloatArray
    n_roll: int

    @property
    def roll_angle(self) -> FloatArray:
        """(n_roll,) roll angles [rad]."""
        return 2.0 * np.pi * np.arange(self.n_roll) / self.n_roll

    @property
    def n_nodes(self) -> int:
        return len(self.x) * self.n_roll

    def as_map(self, field: FloatArray) -> FloatArray:
        """View a flat field (..., n_nodes) as (..., n_x, n_roll)."""
        return field.reshape(*field.shape[:-1], len(self.x), self.n_roll)


def surface_grid(body: BodyOfRevolution, n_x: int, n_roll: int) -> SurfaceGrid:
    """Place about ``n_x`` stations on ``body``, evenly, doubled at slope breaks.

    Stations start at the tip, where the pressure of the conical flow is the pressure of the first ring. On a
    smooth piece with a steep tip they follow the length along the meridian, and there are more where it turns.
    """
    joints = np.concatenate([[0.0], body.slope_breaks, [body.length]])
    stations, radii, angles = [], [], []
    for start, end in pairwise(joints.tolist()):
        count = max(3, round(n_x * (end - start) / body.length))
        s = np.linspace(0.0, 1.0, count)
        x = start + (end - start) * s
        if start == 0.0 and body.tip_angle > STEEP:
            x = _stations_from_steep_tip(body, end, count)
        stations.append(x)
        radii.append(body.radius(x))
        angle = body.angle(x, side="upstream")
        angle[0] = body.angle(x[0], side="downstream")
        angles.append(angle)
    return SurfaceGrid(
        x=np.concatenate(stations), radius=np.concatenate(radii), angle=np.concatenate(angles), n_roll=n_roll
    )


def _stations_from_steep_tip(body: BodyOfRevolution, end: float, count: int) -> FloatArray:
    """Return stations [m] from 0 to ``end``: ``count`` by the meridian's length, more by its turning."""
    x = end * np.linspace(0.0, 1.0, 4001) ** 2
    radius = body.radius(x)
    angle = body.angle(x)
    length = np.hypot(np.diff(x), np.diff(radius))
    per_interval = count * length / length.sum() + np.abs(np.diff(angle)) / TURN_PER_STATION
    place = np.concatenate([[0.0], np.cumsum(per_interval)])
    stations = np.interp(np.linspace(0.0, place[-1], int(np.ceil(place[-1])) + 1), place, x)
    stations[-1] = end
    return np.asarray(stations)
