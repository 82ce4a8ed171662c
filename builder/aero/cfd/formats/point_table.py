"""Points with values from a CSV table: one line of column names, one line per point."""

import csv
import re
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from builder.aero.cfd.formats.text_numbers import read_file
from builder.aero.cfd.units import METRES
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.text_cells import Numerals
from strainfmu.text_files import shown_columns

_AXES = ("x", "y", "z")
_AHEAD = re.compile(r"^(#|VARIABLES\s*=)\s*", re.IGNORECASE)
"""What OpenFOAM and Tecplot write ahead of the names of columns."""
_SEEN = 100
"""Lines whose numbers show the decimal mark."""

NORMALS = ("normal_x", "normal_y", "normal_z")


@dataclass(frozen=True, eq=False, kw_only=True)
class PointTable:
    """Points and one quantity.

    Attributes
    ----------
    point : (n, 3) in the file's length unit.
    values : (n,) in the file's unit.
    column : name of the quantity's column.
    normal : (n, 3) from the columns normal_x, normal_y, normal_z, or None.
    """

    point: FloatArray
    values: FloatArray
    column: str
    normal: FloatArray | None


def read_point_table(path: Path, column: str | None, metres_per_unit: float) -> PointTable:
    """Read points and the values of ``column``, which may be None if there is only one besides the coordinates.

    Coordinates are in columns x, y, z, with or without a unit (x_mm), or as ParaView names them (Points:0). A
    unit in a name must be ``metres_per_unit``. Between semicolons or tabs numbers may have decimal commas.

    Raises
    ------
    InputError
        The file is missing or empty, a column is missing, a line has another number of columns, an entry is no
        finite number: file, line, column, what was found.
    """
    text = read_file(path).decode("utf-8-sig", "replace")
    lines = text.splitlines()
    head = next((line for line in lines if line.strip()), "")
    numerals = Numerals(max(",;\t", key=head.count))
    rows = list(csv.reader(lines, delimiter=numerals.delimiter, skipinitialspace=True))
    start = next(number for number, row in enumerate(rows) if row)
    numerals.learn(cell.strip() for row in rows[start + 1 : start + 1 + _SEEN] for cell in row)
    header = [name.strip() for name in rows[start]]
    repeated = sorted({name for name in header if header.count(name) > 1})
    if repeated:
        raise InputError(f"{path}: line {start + 1}: column '{repeated[0]}' occurs twice")
    axes = [_axis_column(path, header, k, metres_per_unit, lines) for k in range(3)]
    normals = [header.index(name) for name in NORMALS if name in header]
    named = _value_column(path, header, column, axes)
    chosen = [*axes, header.index(named), *(normals if len(normals) == 3 else [])]
    table = _numbers(path, rows, start, header, chosen, numerals)
    if not len(table):
        raise InputError(f"{path}: no line of numbers after the column names")
    return PointTable(
        point=table[:, :3], values=table[:, 3], column=named, normal=table[:, 4:7] if len(normals) == 3 else None
    )


def _axis_column(path: Path, header: list[str], k: int, metres_per_unit: float, lines: list[str]) -> int:
    """Return the column of coordinate ``k``; ``lines`` of the file show the columns that it has."""
    names = {_AXES[k]: None, f"Points:{k}": None, f"Points_{k}": None}
    units = {f"{_AXES[k]}_{unit}": unit for unit in METRES}
    for index, name in enumerate(header):
        plain = name.lower() if len(name) == 1 else name
        if plain in names:
            return index
        if name in units:
            if METRES[units[name]] != metres_per_unit:
                raise InputError(f"{path}: column '{name}' found, but the manifest gives another length_unit")
            return index
    above = _names_above_numbers(lines)
    columns = shown_columns(above, above) if above else shown_columns(header, _known_columns())
    raise InputError(
        f"{path}: no column '{_AXES[k]}' found ('{_AXES[k]}', '{_AXES[k]}_m', 'Points:{k}' ... allowed, in the "
        f"first line); there are: {columns}"
    )


def _names_above_numbers(lines: list[str]) -> list[str]:
    """Return the names above the first line of four numbers or more; none of a file that is no table of points."""
    names = dict[int, list[str]]()
    for line in lines[:_SEEN]:
        plain = _AHEAD.sub("", line.strip())
        delimiter = next((mark for mark in ";\t," if mark in plain), " ")
        cells = next(csv.reader([plain], delimiter=delimiter, skipinitialspace=True), [])
        numbers = [_finite(cell.replace(",", "."), float) for cell in cells]
        if len(numbers) - numbers.count(None) >= 4:
            return names.get(len(cells), [])
        names[len(cells)] = cells
    return []


def _known_columns() -> set[str]:
    """Return the names by which a table of points is recognised."""
    by_unit = {f"{axis}_{unit}" for axis in _AXES for unit in METRES}
    by_number = {f"Points{sign}{k}" for sign in ":_" for k in range(3)}
    return {*_AXES, *(axis.upper() for axis in _AXES), *by_unit, *by_number, *NORMALS}


def _value_column(path: Path, header: list[str], column: str | None, axes: list[int]) -> str:
    rest = [name for index, name in enumerate(header) if index not in axes and name not in NORMALS]
    if column is None and len(rest) != 1:
        raise InputError(f"{path}: {len(rest)} columns could be meant, name one with 'array': {', '.join(rest)}")
    if column is not None and column not in rest:
        raise InputError(f"{path}: no column '{column}' found; there are: {', '.join(rest)}")
    return column or rest[0]


def _numbers(
    path: Path, rows: list[list[str]], start: int, header: list[str], chosen: list[int], numerals: Numerals
) -> FloatArray:
    """Return the chosen columns (n, k) of all lines behind the header."""
    number = float if numerals.delimiter == "," else numerals.number
    table = []
    for line, row in enumerate(rows[start + 1 :], start=start + 2):
        if not row:
            continue
        if len(row) != len(header):
            raise InputError(f"{path}: line {line}: {len(row)} columns found, must be {len(header)}")
        table.append([_finite(row[index], number) for index in chosen])
        if None in table[-1]:
            index = chosen[table[-1].index(None)]
            raise InputError(
                f"{path}: line {line}: column '{header[index]}': {row[index][:40]!r} found, must be a finite "
                "number"
            )
    return np.array(table, dtype=np.float64).reshape(-1, len(chosen))


def _finite(word: str, number: Callable[[str], float]) -> float | None:
    """Return the number in a cell, None where there is none that is finite."""
    try:
        value = number(word.strip())
    except ValueError:
        return None
    return value if isfinite(value) else None
