"""The CSV file of gauges on any surface: each by a place, and a direction in the surface.

The place is one of ``x_m, y_m, z_m`` (body axes), ``x_m, roll_angle_deg`` (roll from +z towards +y), ``node`` and
``element`` (counted from 1 in the order of the mesh file; of an element the middle of its face). The direction is
a vector, ``direction_x, direction_y, direction_z``, or ``angle_deg`` from the local x tangent towards the roll
angle: 0 is axial, 90 is hoop.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from builder.vehicle.toml.entry_limits import MAX_GAUGES
from strainfmu.errors import InputError
from strainfmu.text_files import read_csv, shown_columns

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
            place={column: _number(entry[column], f"{where}, column {column}") for column in place},
            direction={column: _number(entry[column], f"{where}, column {column}") for column in direction},
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


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise InputError(f"{where}: expected a number, got '{text}'") from error
    if not isfinite(value) or abs(value) > LARGEST:
        raise InputError(f"{where}: expected a number up to {LARGEST:g}, got '{text}'")
    return value
