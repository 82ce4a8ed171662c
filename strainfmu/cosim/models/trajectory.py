"""The flown trajectory: a CSV table of flight conditions, smooth between its rows."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from os import PathLike
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import CONDITION_COLUMNS, CONDITION_QUANTITIES, FlightCondition
from strainfmu.text_files import MIB, read_csv, shown_columns

HEADER = ("time_s", *CONDITION_COLUMNS)
LARGEST_FILE = 64 * MIB
"""Hours of a flight, recorded at 100 Hz."""
# What cannot be meant; what a flight model holds is narrower.
_RANGES = ((0.0, 1e8), (-100.0, 100.0), (-180.0, 180.0), (-180.0, 180.0), (-10.0, 1000.0))
# From the user's units in the header to SI.
_TO_SI = np.array([1.0, *(quantity.factor for quantity in CONDITION_QUANTITIES)])


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Flight conditions over time, interpolated by shape-preserving cubics.

    Attributes
    ----------
    time : (n,) increasing from 0 [s].
    conditions : (n, 4 + k) columns in the order and units of :class:`FlightCondition`, k flow parameters last.
    slopes : (n, 4 + k) their derivatives at ``time`` [per s].
    """

    time: FloatArray
    conditions: FloatArray
    slopes: FloatArray

    @property
    def stop_time(self) -> float:
        """Time of the last row [s]."""
        return float(self.time[-1])

    def condition_at(self, time: float) -> FlightCondition:
        """Return the flight condition at ``time`` [s]; outside the rows it is the nearest row's."""
        t = min(max(time, 0.0), self.stop_time)
        i = min(int(np.searchsorted(self.time, t, side="right")) - 1, len(self.time) - 2)
        width = self.time[i + 1] - self.time[i]
        s = (t - self.time[i]) / width
        rise = self.conditions[i + 1] - self.conditions[i]
        # Written from the left value on, so that a constant column stays exactly constant.
        value = self.conditions[i] + s * (
            width * self.slopes[i] * (1.0 - s) ** 2
            + rise * s * (3.0 - 2.0 * s)
            - width * self.slopes[i + 1] * s * (1.0 - s)
        )
        return FlightCondition.of_row(value.tolist())


def shape_preserving_slopes(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the slopes of the monotone cubic Hermite interpolant of ``y`` over ``x``.

    Parameters
    ----------
    x : (n,) increasing, n >= 2.
    y : (n, k) one column per quantity.

    Source: Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984): weighted harmonic means of the secants,
    zero where they change sign; three-point slopes kept to the data's shape at both ends (Moler, 2004).
    """
    step = np.diff(x)[:, None]
    secant = np.diff(y, axis=0) / step
    if len(x) == 2:
        return np.repeat(secant, 2, axis=0)
    slopes = np.empty_like(y)
    left_weight = 2.0 * step[1:] + step[:-1]
    right_weight = step[1:] + 2.0 * step[:-1]
    same_sign = secant[:-1] * secant[1:] > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (left_weight + right_weight) / (left_weight / secant[:-1] + right_weight / secant[1:])
    slopes[1:-1] = np.where(same_sign, mean, 0.0)
    slopes[0] = _end_slope(step[0], step[1], secant[0], secant[1])
    slopes[-1] = _end_slope(step[-1], step[-2], secant[-1], secant[-2])
    return slopes


def _end_slope(
    near_step: FloatArray, far_step: FloatArray, near_secant: FloatArray, far_secant: FloatArray
) -> FloatArray:
    """Return (k,) one-sided three-point slopes that do not overshoot the data."""
    slope = ((2.0 * near_step + far_step) * near_secant - near_step * far_secant) / (near_step + far_step)
    slope = np.where(np.sign(slope) != np.sign(near_secant), 0.0, slope)
    turns = np.sign(near_secant) != np.sign(far_secant)
    return np.where(turns & (np.abs(slope) > 3.0 * np.abs(near_secant)), 3.0 * near_secant, slope)


def load_trajectory(path: str | PathLike[str], parameters: Sequence[str] = ()) -> Trajectory:
    """Read a trajectory from a CSV file: its first line is :data:`HEADER` and the names of ``parameters``.

    Raises
    ------
    InputError
        The file is missing or no text, or a row is wrong; the message names row (1 = header) and column.
    """
    path = Path(path)
    (_, first), *rows = read_csv(path, LARGEST_FILE) or [(1, [])]
    header = (*HEADER, *parameters)
    if tuple(cell.strip() for cell in first) != header:
        got = shown_columns(first, header)
        raise InputError(f"{path}: row 1: expected the header '{','.join(header)}', got {got}")
    filled = [(number, row) for number, row in rows if any(row)]
    numbers = [_parse_row(path, header, number, row) for number, row in filled]
    if len(numbers) < 2:
        raise InputError(f"{path}: expected at least 2 rows of values, got {len(numbers)}")
    table = np.array(numbers)
    if table[0, 0] != 0.0:
        raise InputError(f"{path}: row 2, column time_s: {table[0, 0]:g} found, must start at 0")
    for i in np.flatnonzero(np.diff(table[:, 0]) <= 0.0):
        raise InputError(
            f"{path}: row {filled[int(i) + 1][0]}, column time_s: {table[i + 1, 0]:g} found after "
            f"{table[i, 0]:g}, time must increase"
        )
    table[:, : len(HEADER)] *= _TO_SI
    return Trajectory(table[:, 0], table[:, 1:], shape_preserving_slopes(table[:, 0], table[:, 1:]))


def _parse_row(path: Path, header: tuple[str, ...], number: int, row: list[str]) -> list[float]:
    """Return the numbers of one row."""
    if len(row) != len(header):
        raise InputError(f"{path}: row {number}: expected {len(header)} values, got {len(row)}")
    values = []
    ranges = (*_RANGES, *((-1e9, 1e9),) * (len(header) - len(HEADER)))
    for column, cell, (low, high) in zip(header, row, ranges, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = float("nan")
        if not isfinite(value):
            raise InputError(f"{path}: row {number}, column {column}: expected a finite number, got '{cell}'")
        if not low <= value <= high:
            raise InputError(f"{path}: row {number}, column {column}: expected {low:g} .. {high:g}, got '{cell}'")
        values.append(value)
    return values
