"""Curved pieces of a meridian beyond cones and arcs: power law, Haack series, and splines through tables.

Sources: Haack, W., "Geschossformen kleinsten Wellenwiderstandes", Lilienthal-Gesellschaft, Bericht 139 (1941);
Perkins, Jorgensen and Sommer, NACA Report 1386 (1958), bodies of minimum drag and power-law noses.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from math import asin, atan2, hypot, pi, radians

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from builder.vehicle.shape.geometry import Segment
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

SAMPLES = 801
"""Points at which the smallest radius of a spline is found."""


class _Curve(Segment, ABC):
    """A piece that is given by its radius and slope."""

    @property
    def is_straight(self) -> bool:
        return False

    @property
    def min_radius(self) -> float:
        x = np.linspace(self.start_x, self.end_x, SAMPLES)[1:]
        return float(self.radius(x).min())

    def angle(self, x: FloatArray) -> FloatArray:
        """Return the angle of the meridian to the axis [rad] at stations ``x`` [m]."""
        return np.asarray(np.arctan(self._slope(x)))

    @abstractmethod
    def _slope(self, x: FloatArray) -> FloatArray:
        """Return the slope dr/dx [1] of the meridian at stations ``x`` [m]."""

    def _share(self, x: FloatArray) -> FloatArray:
        """Return the fraction of the piece's length ahead of stations ``x`` [m]."""
        return np.clip((x - self.start_x) / (self.end_x - self.start_x), 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class PowerLaw(_Curve):
    """r = R (x/L)^n from the tip on.

    Attributes
    ----------
    base_radius : R at its end [m].
    exponent : n in (0, 1]; below 1 the slope at the tip is infinite.
    """

    base_radius: float
    exponent: float

    def radius(self, x: FloatArray) -> FloatArray:
        """Return the radius [m] at stations ``x`` [m]."""
        return np.asarray(self.base_radius * self._share(x) ** self.exponent)

    def _slope(self, x: FloatArray) -> FloatArray:
        share, n = self._share(x), self.exponent
        with np.errstate(divide="ignore"):
            power = np.where(share > 0.0, share ** (n - 1.0), 1.0 if n == 1.0 else np.inf)
        return np.asarray(self.base_radius / self.end_x * n * power)


@dataclass(frozen=True, kw_only=True)
class Haack(_Curve):
    """r = R sqrt((t - sin(2 t)/2 + C sin^3 t)/pi), cos t = 1 - 2 x/L, from the tip on.

    Attributes
    ----------
    base_radius : R at its end [m].
    shape_factor : C; 0 is von Karman's nose (minimum drag for length and diameter), 1/3 for length and volume.
    """

    base_radius: float
    shape_factor: float

    def radius(self, x: FloatArray) -> FloatArray:
        """Return the radius [m] at stations ``x`` [m]."""
        t = np.arccos(1.0 - 2.0 * self._share(x))
        return np.asarray(self.base_radius * np.sqrt(self._square(t)))

    def _square(self, t: FloatArray) -> FloatArray:
        """Return (r/R)^2; by its series where t - sin(2 t)/2 would lose its digits."""
        small = 2.0 / 3.0 * t**3 * (1.0 - t**2 / 5.0)
        difference = np.where(t < 1e-3, small, t - 0.5 * np.sin(2.0 * t))
        return np.asarray((difference + self.shape_factor * np.sin(t) ** 3) / pi)

    def _slope(self, x: FloatArray) -> FloatArray:
        t = np.arccos(1.0 - 2.0 * self._share(x))
        sine = np.sin(t)
        # d(r^2)/dt over dx/dt = L sin(t)/2.
        of_square = (2.0 * sine + 3.0 * self.shape_factor * sine * np.cos(t)) / pi
        radius = np.sqrt(self._square(t))
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = of_square / radius * self.base_radius / self.end_x
        return np.where(t > 0.0, slope, np.inf)


@dataclass(frozen=True, kw_only=True)
class Spline(_Curve):
    """A smooth curve through a table of points.

    Attributes
    ----------
    station, table_radius : points [m], stations increasing.
    interpolation : ``"cubic"``, twice continuously differentiable, or ``"monotone"``, which never swings.
    """

    station: tuple[float, ...]
    table_radius: tuple[float, ...]
    interpolation: str

    @cached_property
    def _curve(self) -> CubicSpline | PchipInterpolator:
        make = PchipInterpolator if self.interpolation == "monotone" else CubicSpline
        return make(self.station, self.table_radius)

    def radius(self, x: FloatArray) -> FloatArray:
        """Return the radius [m] at stations ``x`` [m]."""
        return np.asarray(self._curve(np.clip(x, self.start_x, self.end_x)))

    def _slope(self, x: FloatArray) -> FloatArray:
        return np.asarray(self._curve(np.clip(x, self.start_x, self.end_x), 1))


def ogive(start_x: float, end_x: float, start_radius: float, end_radius: float, arc_radius: float) -> Segment:
    """Return the arc of ``arc_radius`` [m], convex outward, between two points of the meridian [m].

    Raises
    ------
    InputError
        The arc is too small to reach from one to the other.
    """
    length, rise = end_x - start_x, end_radius - start_radius
    chord = hypot(length, rise)
    if not 2.0 * arc_radius > chord:
        raise InputError(f"arc_radius_m: expected more than {0.5 * chord:g}, half the chord, got {arc_radius:g}")
    middle, half = atan2(rise, length), asin(0.5 * chord / arc_radius)
    return Segment(
        start_x=start_x,
        end_x=end_x,
        start_radius=start_radius,
        start_angle=middle + half,
        end_angle=middle - half,
    )


def tangent_ogive(start_x: float, end_x: float, start_radius: float, end_radius: float) -> Segment:
    """Return the arc between two points of the meridian [m] that ends along the axis."""
    length, rise = end_x - start_x, end_radius - start_radius
    if not 0.0 < rise <= length:
        raise InputError(f"end_radius_m: expected a rise up to the length {length:g} m, got {rise:g}")
    arc_radius = (rise**2 + length**2) / (2.0 * rise)
    return Segment(
        start_x=start_x,
        end_x=end_x,
        start_radius=start_radius,
        start_angle=asin(min(length / arc_radius, 1.0)),
        end_angle=0.0,
    )


def spherical_cap(nose_radius: float, end_angle: float) -> Segment:
    """Return the cap of a sphere of ``nose_radius`` [m], from the axis to its angle ``end_angle`` [rad]."""
    return Segment(
        start_x=0.0,
        end_x=nose_radius * (1.0 - np.sin(end_angle)),
        start_radius=0.0,
        start_angle=radians(90.0),
        end_angle=end_angle,
    )


def with_end_angles(piece: _Curve) -> _Curve:
    """Return ``piece`` with the angles at its ends taken from its slope."""
    start, end = piece.angle(np.array([piece.start_x, piece.end_x])).tolist()
    return replace(piece, start_angle=start, end_angle=end)
