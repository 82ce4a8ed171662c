"""A pointed body given by superelliptic sections along x: |y/a|^n + |(z - c)/b|^n = 1."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from builder.vehicle.shape.geometry import SMALLEST_SLOPE_BREAK
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.text_files import read_csv, shown_columns

REQUIRED = ("x_m", "half_width_m", "half_height_m")
OPTIONAL = {"exponent": 2.0, "centre_z_m": 0.0}
EXPONENTS = (1.5, 10.0)
BISECTIONS = 60
STEP = 1e-6
"""Of the length and of a turn: differences that give the normal."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SectionedBody:
    """Outer surface of a body by its sections.

    Attributes
    ----------
    station, half_width, half_height : (k,) [m]; the first section is the tip, a point at x = 0.
    exponent : (k,) n of each section; 2 is an ellipse.
    centre_z : (k,) height of each section's middle [m].
    interpolation : ``"linear"``, with slope breaks at the stations, or ``"monotone"``, smooth between them.
    """

    station: FloatArray
    half_width: FloatArray
    half_height: FloatArray
    exponent: FloatArray
    centre_z: FloatArray
    interpolation: str = "linear"

    @property
    def length(self) -> float:
        """Length from tip to base [m]."""
        return float(self.station[-1])

    @property
    def is_symmetric_up_and_down(self) -> bool:
        """Whether the plane z = 0 is one of symmetry; y = 0 always is."""
        return not self.centre_z.any()

    @cached_property
    def slope_breaks(self) -> FloatArray:
        """Stations [m] at which the slope of the surface jumps."""
        if self.interpolation != "linear":
            return np.empty(0)
        sizes = np.stack([self.half_width, self.half_height, self.centre_z], axis=1)
        slope = np.diff(sizes, axis=0) / np.diff(self.station)[:, None]
        change = np.abs(np.diff(np.arctan(slope), axis=0)).max(axis=1)
        return self.station[1:-1][change > SMALLEST_SLOPE_BREAK]

    @cached_property
    def _of_x(self) -> Callable[[FloatArray], FloatArray]:
        """Half width, half height, exponent, centre (.., 4) at stations."""
        table = np.stack([self.half_width, self.half_height, self.exponent, self.centre_z], axis=1)
        if self.interpolation == "monotone":
            curve = PchipInterpolator(self.station, table, axis=0)
            return lambda x: np.asarray(curve(x))
        return lambda x: np.stack([np.interp(x, self.station, column) for column in table.T], axis=-1)

    def radius(self, x: FloatArray, roll_angle: FloatArray) -> FloatArray:
        """Return the distance from the axis [m] at stations [m] and roll angles [rad], broadcast together."""
        x, roll_angle = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(roll_angle, dtype=float))
        a, b, n, c = np.moveaxis(self._of_x(np.clip(x, 0.0, self.length)), -1, 0)
        sine, cosine = np.abs(np.sin(roll_angle)), np.cos(roll_angle)
        positive = a > 0.0
        a, b = np.where(positive, a, 1.0), np.where(positive, b, 1.0)
        radius = ((sine / a) ** n + np.abs(cosine / b) ** n) ** (-1.0 / n)
        if self.centre_z.any():
            radius = _off_centre(sine / a, cosine, b, n, c)
        return np.where(positive, radius, 0.0)

    def spread_roll_angle(self, x: FloatArray, angle: FloatArray) -> FloatArray:
        """Return roll angles [rad] closer to each other where a flat section turns fast.

        ``angle`` [rad] is that on a circle of which the section is a projection (an ellipse's eccentric angle);
        evenly spaced, it resolves narrow edges.
        """
        x, angle = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(angle, dtype=float))
        a, b, _, _ = np.moveaxis(self._of_x(np.clip(x, STEP * self.length, self.length)), -1, 0)
        return np.mod(np.arctan2(a * np.sin(angle), b * np.cos(angle)), 2.0 * np.pi)

    def point(self, x: FloatArray, roll_angle: FloatArray) -> FloatArray:
        """Return (.., 3) points of the surface [m]."""
        x, roll_angle = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(roll_angle, dtype=float))
        radius = self.radius(x, roll_angle)
        return np.stack([x, radius * np.sin(roll_angle), radius * np.cos(roll_angle)], axis=-1)

    def normal(self, x: FloatArray, roll_angle: FloatArray, side: float = 0.0) -> FloatArray:
        """Return (.., 3) outward unit normals; ``side`` -1 or 1 is that ahead of or behind a slope break."""
        x, roll_angle = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(roll_angle, dtype=float))
        step = STEP * self.length
        back, ahead = (1.0, 1.0) if side == 0.0 else (float(side < 0.0), float(side > 0.0))
        low, high = np.clip(x - back * step, 0.0, None), np.clip(x + ahead * step, None, self.length)
        low = np.where(high > low, low, high - step)  # behind the base there is nothing
        along = (self.point(high, roll_angle) - self.point(low, roll_angle)) / (high - low)[..., None]
        around = self.point(x, roll_angle + STEP) - self.point(x, roll_angle - STEP)
        normal = np.cross(around, along)
        normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
        outward = normal[..., 1] * np.sin(roll_angle) + normal[..., 2] * np.cos(roll_angle)
        return np.asarray(normal * np.sign(outward)[..., None])


def _off_centre(across: FloatArray, cosine: FloatArray, b: FloatArray, n: FloatArray, c: FloatArray) -> FloatArray:
    """Return r with (r across)^n + |(r cosine - c)/b|^n = 1, the axis being inside, by bisection."""
    low = np.zeros_like(b)
    high = np.full_like(b, 4.0 * float(np.max(b + np.abs(c) + 1.0 / np.maximum(across, 1e-9) * (across > 0.1))))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        outside = (middle * across) ** n + np.abs((middle * cosine - c) / b) ** n > 1.0
        low, high = np.where(outside, low, middle), np.where(outside, middle, high)
    return 0.5 * (low + high)


def read_sections(path: Path, interpolation: str = "linear") -> SectionedBody:
    """Read a CSV file of sections: columns x_m, half_width_m, half_height_m, and exponent, centre_z_m if given.

    Raises
    ------
    InputError
        The file is missing, a column or a number is wrong, stations do not increase from a tip at x = 0, or the
        axis leaves a section; the message names the line.
    """
    (_, first), *rows = read_csv(path) or [(1, [])]
    header = [name.strip() for name in first]
    missing = [name for name in REQUIRED if name not in header]
    unknown = [name for name in header if name not in (*REQUIRED, *OPTIONAL)]
    if missing or unknown or len(set(header)) < len(header):
        raise InputError(
            f"{path}: expected the columns {', '.join(REQUIRED)} and perhaps {', '.join(OPTIONAL)}, got "
            f"{shown_columns(header, (*REQUIRED, *OPTIONAL))}"
        )
    values = []
    for number, row in rows:
        try:
            cells = dict(zip(header, map(float, row), strict=True))
        except ValueError as error:
            raise InputError(
                f"{path}: line {number}: expected {len(header)} numbers, got {','.join(row)}"
            ) from error
        values.append([cells.get(name, OPTIONAL.get(name, 0.0)) for name in (*REQUIRED, *OPTIONAL)])
        _check_row(path, number, values)
    if len(values) < 2:
        raise InputError(f"{path}: expected a tip and at least one section, got {len(values)} rows")
    x, width, height, exponent, centre = np.array(values).T
    return SectionedBody(
        station=x,
        half_width=width,
        half_height=height,
        exponent=exponent,
        centre_z=centre,
        interpolation=interpolation,
    )


def _check_row(path: Path, number: int, rows: list[list[float]]) -> None:
    where, (x, width, height, exponent, centre) = f"{path}: line {number}", rows[-1]
    if not all(map(isfinite, rows[-1])):
        raise InputError(f"{where}: expected finite numbers, got nan or inf")
    if not EXPONENTS[0] <= exponent <= EXPONENTS[1]:
        raise InputError(f"{where}: exponent: expected {EXPONENTS[0]:g} .. {EXPONENTS[1]:g}, got {exponent:g}")
    if len(rows) == 1:
        if (x, width, height, centre) != (0.0, 0.0, 0.0, 0.0):
            raise InputError(f"{where}: expected the tip first, a point at x = 0 on the axis, got x = {x:g} m")
        return
    if x <= rows[-2][0]:
        raise InputError(f"{where}: x_m: expected more than {rows[-2][0]:g}, got {x:g}")
    if not (width > 0.0 and height > 0.0):
        raise InputError(f"{where}: expected half_width_m and half_height_m above 0, got {width:g} and {height:g}")
    if abs(centre) >= 0.95 * height:
        raise InputError(
            f"{where}: centre_z_m: expected the x axis inside the section, got {centre:g} of {height:g} m"
        )
