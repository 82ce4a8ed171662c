"""Curved pieces of a meridian beyond cones and arcs: power law, Haack series, and splines through tables.

Sources: Haack, W., "Geschossformen kleinsten Wellenwiderstandes", Lilienthal-Gesellschaft, Bericht 139 (1941);
Perkins, Jorgensen and Sommer, NACA Report 1386 (1958), bodies of minimum drag and power-law noses.

Pieces of the profile in the vehicle file: what each is called, its entries, and the segment it makes.

Record of a body's meridian in files made for it, and what differs when the body is another.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import asin, atan2, degrees, hypot, isclose, isfinite, pi, radians
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.interpolate import CubicSpline, PchipInterpolator

from builder.vehicle.shape.geometry import BodyOfRevolution, Segment
from builder.vehicle.toml.toml_sections import FileName, HalfAngle, Section, Station
from builder.workspace import Misfit
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.text_files import read_csv, shown_columns

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


JOIN = 1e-6
"""Distance up to which the first point of a table joins the end of the piece before it, in x and in r [m]."""
MIN_POINTS = 4
TablePoint = Annotated[float, Field(ge=0.0, le=1e3)]


class Cone(Section):
    """A straight piece of the meridian."""

    kind: Literal["cone"]
    half_angle_deg: HalfAngle
    end_x_m: Station

    def segment(self, x: float, radius: float, folder: Path) -> Segment:
        """Return the segment that begins at ``x``, ``radius`` [m]."""
        angle = radians(self.half_angle_deg)
        return Segment(start_x=x, end_x=self.end_x_m, start_radius=radius, start_angle=angle, end_angle=angle)


class Arc(Section):
    """A circular arc of the meridian, such as a tangent ogive."""

    kind: Literal["arc"]
    start_half_angle_deg: HalfAngle
    end_half_angle_deg: HalfAngle
    end_x_m: Station

    def segment(self, x: float, radius: float, folder: Path) -> Segment:
        """Return the segment that begins at ``x``, ``radius`` [m]."""
        return Segment(
            start_x=x,
            end_x=self.end_x_m,
            start_radius=radius,
            start_angle=radians(self.start_half_angle_deg),
            end_angle=radians(self.end_half_angle_deg),
        )


class TangentOgive(Section):
    """A circular arc that ends along the axis, given by where it ends."""

    kind: Literal["tangent_ogive"]
    end_x_m: Station
    end_radius_m: Station

    def segment(self, x: float, radius: float, folder: Path) -> Segment:
        """Return the segment that begins at ``x``, ``radius`` [m]."""
        _check_aft(x, self.end_x_m)
        return tangent_ogive(x, self.end_x_m, radius, self.end_radius_m)


class SecantOgive(Section):
    """A circular arc of a stated radius, given by where it ends."""

    kind: Literal["secant_ogive"]
    end_x_m: Station
    end_radius_m: Station
    arc_radius_m: float = Field(ge=1e-4, le=1e6)

    def segment(self, x: float, radius: float, folder: Path) -> Segment:
        """Return the segment that begins at ``x``, ``radius`` [m]."""
        _check_aft(x, self.end_x_m)
        return ogive(x, self.end_x_m, radius, self.end_radius_m, self.arc_radius_m)


class PowerLawNose(Section):
    """r = R (x/L)^n from the tip."""

    kind: Literal["power_law"]
    end_x_m: Station
    end_radius_m: Station
    exponent: float = Field(ge=0.3, le=1.0)

    def segment(self, x: float, radius: float, folder: Path) -> Segment:
        """Return the segment; it must be the first."""
        _check_first(self.kind, x)
        return with_end_angles(
            PowerLaw(
                start_x=0.0,
                end_x=self.end_x_m,
                start_radius=0.0,
                start_angle=0.0,
                end_angle=0.0,
                base_radius=self.end_radius_m,
                exponent=self.exponent,
            )
        )


class VonKarmanNose(Section):
    """The nose of minimum wave drag for its length and diameter, from the tip."""

    kind: Literal["von_karman"]
    end_x_m: Station
    end_radius_m: Station

    def segment(self, x: float, radius: float, folder: Path) -> Segment:
        """Return the segment; it must be the first."""
        return _haack(self.kind, x, self.end_x_m, self.end_radius_m, 0.0)


class HaackNose(Section):
    """A nose of the Haack series, from the tip; shape factor 1/3 is the one for length and volume."""

    kind: Literal["haack"]
    end_x_m: Station
    end_radius_m: Station
    shape_factor: float = Field(ge=0.0, le=2.0 / 3.0)

    def segment(self, x: float, radius: float, folder: Path) -> Segment:
        """Return the segment; it must be the first."""
        return _haack(self.kind, x, self.end_x_m, self.end_radius_m, self.shape_factor)


class SphericalCap(Section):
    """A blunt tip: part of a sphere, up to where its angle equals the angle of the piece behind it."""

    kind: Literal["spherical_cap"]
    nose_radius_m: Station
    end_half_angle_deg: float = Field(ge=0.0, le=80.0)

    def segment(self, x: float, radius: float, folder: Path) -> Segment:
        """Return the segment; it must be the first."""
        _check_first(self.kind, x)
        return spherical_cap(self.nose_radius_m, radians(self.end_half_angle_deg))


class Table(Section):
    """A curve through points, in the file or in a CSV file with the columns x_m and r_m."""

    kind: Literal["table"]
    x_m: Annotated[list[TablePoint], Field(min_length=MIN_POINTS, max_length=2000)] | None = None
    r_m: Annotated[list[TablePoint], Field(min_length=MIN_POINTS, max_length=2000)] | None = None
    file: FileName | None = None
    interpolation: Literal["cubic", "monotone"] = "cubic"

    @model_validator(mode="after")
    def _points_or_file(self) -> Table:
        if (self.file is None) == (self.x_m is None) or (self.x_m is None) != (self.r_m is None):
            raise ValueError("a table needs either x_m and r_m or file")
        return self

    def segment(self, x: float, radius: float, folder: Path) -> Segment:
        """Return the segment that begins at ``x``, ``radius`` [m]."""
        if self.file is not None:
            stations, radii = read_profile(folder / self.file)
        else:
            stations, radii = self.x_m or [], self.r_m or []
        where = self.file or "x_m, r_m"
        _check_points(where, stations, radii, x, radius)
        return with_end_angles(
            Spline(
                start_x=x,
                end_x=stations[-1],
                start_radius=radius,
                start_angle=0.0,
                end_angle=0.0,
                station=(x, *stations[1:]),
                table_radius=(radius, *radii[1:]),
                interpolation=self.interpolation,
            )
        )


Piece = Cone | Arc | TangentOgive | SecantOgive | PowerLawNose | VonKarmanNose | HaackNose | SphericalCap | Table
"""One piece of the profile; ``kind`` states which."""


def read_profile(path: Path) -> tuple[list[float], list[float]]:
    """Read stations and radii [m] from a CSV file with the columns x_m and r_m.

    Raises
    ------
    InputError
        The file is missing, a column is, or a value is no number; the message names file and line.
    """
    (_, header), *rows = read_csv(path) or [(1, [])]
    if [name.strip() for name in header] != ["x_m", "r_m"]:
        got = shown_columns(header, ("x_m", "r_m"))
        raise InputError(f"{path}: expected the columns x_m, r_m, got {got}")
    points = []
    for line, row in rows:
        try:
            x, r = (float(value) for value in row)
        except ValueError as error:
            raise InputError(f"{path}: line {line}: expected two numbers, got {','.join(row)}") from error
        points.append((x, r))
    return [x for x, _ in points], [r for _, r in points]


def _check_points(where: str, x: list[float], r: list[float], start_x: float, start_radius: float) -> None:
    if len(x) != len(r) or len(x) < MIN_POINTS:
        raise InputError(f"{where}: expected {MIN_POINTS} or more points, got {len(x)} x, {len(r)} r")
    if not all(map(isfinite, (*x, *r))):
        raise InputError(f"{where}: expected finite numbers, got nan or inf")
    for first, second in pairwise(x):
        if second <= first:
            raise InputError(f"{where}: expected increasing stations, got {first:g} and then {second:g}")
    if abs(x[0] - start_x) > JOIN or abs(r[0] - start_radius) > JOIN:
        raise InputError(
            f"{where}: expected x {start_x:.9g}, r {start_radius:.9g} m first, within 1 um of the end of the "
            f"piece before it, got x {x[0]:.9g}, r {r[0]:.9g}"
        )


def _check_first(kind: str, x: float) -> None:
    if x != 0.0:
        raise InputError(f"kind: expected '{kind}' as the first piece alone, got it behind x = {x:g} m")


def _check_aft(x: float, end_x: float) -> None:
    if end_x <= x:
        raise InputError(f"end_x_m {end_x:g} must lie aft of {x:g}")


def _haack(kind: str, x: float, end_x: float, end_radius: float, shape_factor: float) -> Segment:
    _check_first(kind, x)
    return with_end_angles(
        Haack(
            start_x=0.0,
            end_x=end_x,
            start_radius=0.0,
            start_angle=0.0,
            end_angle=0.0,
            base_radius=end_radius,
            shape_factor=shape_factor,
        )
    )


SAME = 1e-9  # relative, and in metres and degrees
RADII = 16  # of a curve that is neither cone nor arc


def profile_record(body: BodyOfRevolution) -> list[dict[str, float]]:
    """Return the pieces of the meridian as numbers that JSON can hold; of curves other than arcs, radii too."""
    return [_piece_record(piece) for piece in body.segments]


def _piece_record(piece: Segment) -> dict[str, float]:
    record = {
        "end_x_m": float(piece.end_x),
        "start_half_angle_deg": degrees(piece.start_angle),
        "end_half_angle_deg": degrees(piece.end_angle),
    }
    if type(piece) is Segment:
        return record
    share = np.arange(1, RADII + 1) / RADII
    radius = piece.radius(piece.start_x + share * (piece.end_x - piece.start_x)).tolist()
    return {**record, **{f"radius_{number}_m": value for number, value in enumerate(radius, start=1)}}


def profile_misfits(record: Sequence[dict[str, Any]], body: BodyOfRevolution) -> list[Misfit]:
    """Return in what the recorded meridian differs from ``body``; entries count pieces from 1."""
    expected = profile_record(body)
    if len(record) != len(expected):
        return [Misfit(entry="profile", expected=f"{len(expected)} pieces", actual=f"{len(record)}")]
    return [
        Misfit(
            entry=f"profile.{number}.{name}",
            expected=f"{value:.9g}",
            actual=f"{piece.get(name, float('nan')):.9g}",
        )
        for number, (piece, wanted) in enumerate(zip(record, expected, strict=True), start=1)
        for name, value in wanted.items()
        if not isclose(piece.get(name, float("nan")), value, rel_tol=SAME, abs_tol=SAME)
    ]
