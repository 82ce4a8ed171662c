"""Gauge layout: names, positions and directions in body axes, and the CSV file that holds them.

The CSV file of gauges on any surface: each by a place, and a direction in the surface.

The place is one of ``x_m, y_m, z_m`` (body axes), ``x_m, roll_angle_deg`` (roll from +z towards +y), ``node`` and
``element`` (counted from 1 in the order of the mesh file; of an element the middle of its face). The direction is
a vector, ``direction_x, direction_y, direction_z``, or ``angle_deg`` from the local x tangent towards the roll
angle: 0 is axial, 90 is hoop.
"""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from builder.vehicle.toml.toml_sections import MAX_GAUGES, Limits
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


PLACES = (("x_m", "y_m", "z_m"), ("x_m", "roll_angle_deg"), ("node",), ("element",))
DIRECTIONS = (("direction_x", "direction_y", "direction_z"), ("angle_deg",))
LARGEST = 1e6


@dataclass(frozen=True, kw_only=True)
class TableGauge:
    """One gauge of a table.

    Attributes
    ----------
    name : unique.
    place, direction : values of the columns of one of :data:`PLACES` and one of :data:`DIRECTIONS`, by name.
    where : file and line, for messages.
    """

    name: str
    place: dict[str, float]
    direction: dict[str, float]
    where: str


def read_gauge_table(path: Path) -> list[TableGauge]:
    """Read gauges from a CSV file.

    Raises
    ------
    InputError
        The file is missing, the columns are not a place and a direction, a value is no number, or a name occurs
        twice; the message names file, line and column.
    """
    (_, first), *rows = read_csv(path) or [(1, [])]
    header = [name.strip() for name in first]
    place, direction = _columns(path, header)
    if not 1 <= len(rows) <= MAX_GAUGES:
        raise InputError(f"{path}: expected 1 .. {MAX_GAUGES} gauges, got {len(rows)}")
    gauges: dict[str, TableGauge] = {}
    for line, row in rows:
        where = f"{path}, line {line}"
        if len(row) != len(header):
            raise InputError(f"{where}: expected {len(header)} values, got {len(row)}")
        entry = dict(zip(header, row, strict=True))
        name = entry["name"].strip()
        if not name or not name.isprintable() or name in gauges:
            raise InputError(f"{where}: name: expected each name once, in printable text, got {name!r}")
        gauges[name] = TableGauge(
            name=name,
            place={column: _cell(entry[column], f"{where}, column {column}") for column in place},
            direction={column: _cell(entry[column], f"{where}, column {column}") for column in direction},
            where=where,
        )
    return list(gauges.values())


def _columns(path: Path, header: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    for place in PLACES:
        for direction in DIRECTIONS:
            if sorted(header) == sorted(("name", *place, *direction)):
                return place, direction
    places, directions = (" or ".join("+".join(columns) for columns in every) for every in (PLACES, DIRECTIONS))
    got = shown_columns(header, {"name", *(name for columns in (*PLACES, *DIRECTIONS) for name in columns)})
    raise InputError(f"{path}: expected the columns name, {places}, and {directions}, got {got}")


def _cell(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise InputError(f"{where}: expected a number, got '{text}'") from error
    if not isfinite(value) or abs(value) > LARGEST:
        raise InputError(f"{where}: expected a number up to {LARGEST:g}, got '{text}'")
    return value
