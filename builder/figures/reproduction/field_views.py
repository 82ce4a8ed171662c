"""Views of a field on a body of revolution, as the source shows it: from the side, from leeward, from ahead."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import COLOUR_MAP, blank_figure
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MAX_STATIONS = 160
"""Stations drawn along the body, at most."""

FRONT = "front"
STARBOARD = "from starboard (+y)"
SIDES = {STARBOARD: 0.5 * np.pi, "from port (-y)": 1.5 * np.pi}
"""Roll angle [rad] of the meridian that faces the reader, of the two views onto the xz-plane."""

COLOUR_PERCENTILE = 99.0
"""Percentile at which colours end: at the nose pressure is far higher, as the source notes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldRow:
    """One row of a figure.

    Attributes
    ----------
    title : name of the field.
    field : (n_p,).
    low, high : ends of the colours.
    label : of the colour bar, with unit.
    """

    title: str
    field: FloatArray
    low: float
    high: float
    label: str


def pressure_rows(named: Mapping[str, FloatArray], error: FloatArray) -> list[FieldRow]:
    """Return rows of pressures (n_p,) [Pa] on one scale, and one of the absolute ``error`` on its own; in kPa."""
    first = next(iter(named.values()))
    high = 1e-3 * float(np.percentile(first, COLOUR_PERCENTILE))
    rows = [
        FieldRow(title=title, field=1e-3 * field, low=0.0, high=high, label="p [kPa]")
        for title, field in named.items()
    ]
    size = np.abs(error)
    end = 1e-3 * float(np.percentile(size, COLOUR_PERCENTILE))
    return [*rows, FieldRow(title="absolute error", field=1e-3 * size, low=0.0, high=end, label="kPa")]


def field_figure(rows: list[FieldRow], grid: SurfaceGrid, views: dict[str, float | str], title: str) -> Figure:
    """Draw each row in every view: a roll angle [rad] that faces the reader, or :data:`FRONT`."""
    height = 0.7 + 1.6 * len(rows)
    figure = blank_figure(10.0, height)
    figure.set_layout_engine(None)  # fixed margins take half the time
    figure.subplots_adjust(0.06, 0.45 / height, 0.93, 1.0 - 0.55 / height, 0.16, 0.55)
    widths = [*(1.0 if view == FRONT else 2.6 for view in views.values()), 0.06]
    axes = figure.subplots(len(rows), len(widths), width_ratios=widths, squeeze=False)
    for line, row in zip(axes, rows, strict=True):
        for axis, (name, view) in zip(line[:-1], views.items(), strict=True):
            image = _draw_front(axis, row, grid) if isinstance(view, str) else _draw_side(axis, row, grid, view)
            axis.set_title(f"{row.title}, {name}", fontsize=8)
            axis.tick_params(labelsize=6)
        figure.colorbar(image, cax=line[-1], label=row.label)
    figure.suptitle(title, fontsize=10)
    return figure


def _thinned(row: FieldRow, grid: SurfaceGrid) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return stations (n,), radii (n,) and values (n, n_roll) of few enough stations to be drawn."""
    chosen = np.unique(np.linspace(0, len(grid.x) - 1, MAX_STATIONS).astype(int))
    return grid.x[chosen], grid.radius[chosen], grid.as_map(row.field)[chosen]


def _draw_side(axis: Any, row: FieldRow, grid: SurfaceGrid, facing: float) -> Any:
    """Draw the half that faces the reader; with the nose to the left a roll angle of ``facing`` + 90 deg is up.

    From starboard the nose is to the right, so that +z is up there too.
    """
    x, radius, values = _thinned(row, grid)
    n = grid.n_roll
    around = round(facing / (2.0 * np.pi) * n) + np.arange(-(n // 4), n // 4 + 1)
    away = 2.0 * np.pi * around / n - facing
    turned = bool(np.isclose(facing, SIDES[STARBOARD]))
    across = (-1e3 if turned else 1e3) * np.outer(radius, np.sin(away))
    shown = values[:, around % n]
    colour = 0.25 * (shown[1:, 1:] + shown[:-1, 1:] + shown[1:, :-1] + shown[:-1, :-1])
    along = np.repeat(x[:, None], len(around), axis=1)
    axis.set_xlim((x[-1], 0.0) if turned else (0.0, x[-1]))
    axis.set_ylim(-1.05e3 * radius.max(), 1.05e3 * radius.max())
    axis.set_xlabel("x [m]", fontsize=6)
    axis.set_ylabel("across [mm]", fontsize=6)
    return axis.pcolormesh(along, across, colour, vmin=row.low, vmax=row.high, cmap=COLOUR_MAP, rasterized=True)


def _draw_front(axis: Any, row: FieldRow, grid: SurfaceGrid) -> Any:
    """Draw the body from ahead of its nose: starboard is on the left."""
    _, radius, values = _thinned(row, grid)
    roll = 2.0 * np.pi * (np.arange(grid.n_roll + 1) - 0.5) / grid.n_roll
    y, z = 1e3 * np.outer(radius, np.sin(roll)), 1e3 * np.outer(radius, np.cos(roll))
    image = axis.pcolormesh(
        y, z, 0.5 * (values[1:] + values[:-1]), vmin=row.low, vmax=row.high, cmap=COLOUR_MAP, rasterized=True
    )
    axis.set_aspect("equal")
    axis.invert_xaxis()
    axis.set_xlabel("y [mm]", fontsize=6)
    axis.set_ylabel("z [mm]", fontsize=6)
    return image
