"""Strain gauges in figures: their kinds by direction, and strokes along it on the unrolled body."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from builder.figures.drawing.unrolled import roll_degrees
from builder.structure.observability import angle_from_meridian, direction_names
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap

KINDS = ("axial", "hoop", "inclined")
SENSOR = "auxiliary sensors"
"""What figures call the rows of a map that are no strain gauges."""

KIND_COLOURS = {"axial": "tab:blue", "hoop": "tab:red", "inclined": "tab:green"}
KIND_MARKERS = {"axial": "o", "hoop": "s", "inclined": "D", SENSOR: "^"}
KIND_OFFSETS = {"axial": -9.0, "hoop": 9.0, "inclined": 0.0, SENSOR: 0.0}
"""Roll angle [deg] by which marks of a kind are moved: gauges at one position would hide each other."""

_ANGLES_NAMED = 2
"""Distinct angles to the meridian that a legend names; more of them are "inclined"."""


def gauge_kinds(position: FloatArray, direction: FloatArray) -> dict[str, BoolArray]:
    """Return (n,) which gauges (n, 3) are of each kind that occurs: along the meridian, across it, or neither.

    Every gauge is of one kind.
    """
    names = np.array([name if name in KINDS else "inclined" for name in direction_names(position, direction)])
    return {kind: names == kind for kind in KINDS if (names == kind).any()}


def kinds_of_map(inverse_map: InverseMap) -> dict[str, BoolArray]:
    """Return (n_d,) which rows of a map are gauges of each kind that occurs, and which are auxiliary sensors."""
    n, rows = inverse_map.n_strain_gauges, np.arange(inverse_map.n_gauges)
    rows_of_kind = gauge_kinds(inverse_map.gauge_position[:n], inverse_map.gauge_direction[:n])
    kinds = {kind: np.append(of_kind, rows[n:] < n) for kind, of_kind in rows_of_kind.items()}
    return kinds if n == len(rows) else kinds | {SENSOR: rows >= n}


def shown_bias(inverse_map: InverseMap, bias: FloatArray) -> tuple[FloatArray, str]:
    """Return (n_d,) numbers for the colours of a bias (n_d,) [m/m], and their label.

    Beside auxiliary sensors, whose units differ, a bias counts in standard deviations of the row's noise.
    """
    if inverse_map.has_auxiliary_sensors:
        return bias / inverse_map.noise_std, "bias [sigma of its noise]"
    return 1e6 * bias, "bias [um/m]"


def kind_label(kind: str, position: FloatArray, direction: FloatArray) -> str:
    """Return a kind and the number of its gauges (n, 3) for a legend; inclined ones by angle, as "45 deg, 9"."""
    if kind == "inclined":
        angles: NDArray[np.float64] = np.unique(np.round(np.degrees(angle_from_meridian(position, direction)), 0))
        if len(angles) <= _ANGLES_NAMED:
            kind = " and ".join(f"{angle:g}" for angle in sorted(angles.tolist(), reverse=True)) + " deg"
    return f"{kind}, {len(position)}"


def draw_strokes(axis: Any, position: FloatArray, direction: FloatArray, size: float) -> None:
    """Draw one stroke per gauge (n, 3) over station [m] and roll angle [deg], along its direction.

    Colours are the kinds'; the legend counts them.
    """
    turn = np.round(np.degrees(angle_from_meridian(position, direction)), 1)
    roll = roll_degrees(position)
    for kind, chosen in gauge_kinds(position, direction).items():
        label: str | None = kind_label(kind, position[chosen], direction[chosen])
        for angle in np.unique(turn[chosen]).tolist():
            along = chosen & (turn == angle)
            axis.plot(
                position[along, 0],
                roll[along],
                linestyle="none",
                marker=(2, 2, angle - 90.0),
                markersize=size,
                markeredgewidth=2.0,
                color=KIND_COLOURS[kind],
                label=label,
            )
            label = None
