"""Gauge layout: names, positions and directions in body axes, and the CSV file that holds them."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from builder.vehicle.toml.entry_limits import MAX_GAUGES, Limits
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.text_files import read_csv, shown_columns

CSV_COLUMNS = ("name", "x_m", "y_m", "z_m", "direction_x", "direction_y", "direction_z")


STATION = Limits(-1e3, 1e3)
"""Of a coordinate [m]."""
DIRECTION = Limits(-1e6, 1e6)


@dataclass(frozen=True, eq=False)
class GaugeLayout:
    """Gauges in body axes.

    Attributes
    ----------
    names : n_d unique names.
    position : (n_d, 3) [m], x aft, y starboard, z up.
    direction : (n_d, 3) measured direction, any length.
    """

    names: tuple[str, ...]
    position: FloatArray
    direction: FloatArray


def read_layout(path: Path) -> GaugeLayout:
    """Read a layout from a CSV file with the header ``name,x_m,y_m,z_m,direction_x,direction_y,direction_z``.

    Raises
    ------
    InputError
        The file is missing, a column is missing or unknown, a value is not a number, or a name occurs twice.
    """
    (_, header), *rows = read_csv(path) or [(1, [])]
    if sorted(header) != sorted(CSV_COLUMNS):
        got = shown_columns(header, CSV_COLUMNS)
        raise InputError(f"{path}: expected the columns {', '.join(CSV_COLUMNS)}, got {got}")
    if not rows:
        raise InputError(f"{path}: holds no gauges")
    if len(rows) > MAX_GAUGES:
        raise InputError(f"{path}: expected at most {MAX_GAUGES} gauges, got {len(rows)}")
    names, values = [], np.empty((len(rows), 6))
    for i, (line, row) in enumerate(rows):
        if len(row) != len(header):
            raise InputError(f"{path}, line {line}: expected {len(header)} values, got {len(row)}")
        cells = dict(zip(header, row, strict=True))
        names.append(cells["name"])
        for k, column in enumerate(CSV_COLUMNS[1:]):
            limits = STATION if k < 3 else DIRECTION
            values[i, k] = _number(cells[column], limits, f"{path}, line {line}, column {column}")
    layout = GaugeLayout(tuple(names), values[:, :3], values[:, 3:])
    return checked_layout(layout, str(path))


def _number(text: str, limits: Limits, where: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise InputError(f"{where}: '{text}' found, must be a number") from error
    if not isfinite(value):
        raise InputError(f"{where}: '{text}' found, must be finite")
    if not limits.holds(value):
        raise InputError(f"{where}: expected {limits}, got '{text}'")
    return value


def checked_layout(layout: GaugeLayout, where: str) -> GaugeLayout:
    """Return ``layout``; ``where`` is the file or entry that it comes from.

    Raises
    ------
    InputError
        Two gauges have one name, or a name is empty or not printable.
    """
    known: set[str] = set()
    for name in layout.names:
        if not name.isprintable():
            raise InputError(f"{where}: gauge name {name!r} found, must be printable text on one line")
        if not name or name in known:
            raise InputError(f"{where}: gauge name '{name}' {'occurs twice' if name else 'is empty'}")
        known.add(name)
    return layout
