"""Tables of raw numbers with units: shown rounded, written in full to CSV and JSON."""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.files import write_bytes_atomically

Cell = str | bool | int | float | None
"""None and NaN, shown as a dash, stand for a missing number."""

NO_VALUE = "–"

SCALES = {"%": 100.0, "um/m": 1e6}
"""Factors from SI to the units that tables show."""


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes
    ----------
    heading : its title without unit.
    unit : of its numbers, "" for words.
    digits : format specification of its numbers that are no integers.
    """

    heading: str
    unit: str = ""
    digits: str = ".4g"

    @property
    def title(self) -> str:
        """Heading and unit as one text."""
        return f"{self.heading} [{self.unit}]" if self.unit else self.heading


@dataclass(frozen=True)
class Table:
    """Rows of raw numbers and words under headings.

    Attributes
    ----------
    name : of its CSV file and its entry in JSON: lower case, words joined by underscores.
    caption : one sentence for the reader.
    columns : headings with units.
    rows : as many cells each as there are columns.
    """

    name: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows, start=1):
            if len(row) != len(self.columns):
                raise ValueError(
                    f"table {self.name}: {len(row)} cells in row {number}, {len(self.columns)} columns"
                )


def make_table(name: str, caption: str, columns: Sequence[Column], rows: Sequence[Sequence[Any]]) -> Table:
    """Return a table of numbers and words; numpy's numbers become Python's.

    Raises
    ------
    ValueError
        A row has more or fewer cells than there are columns.
    """
    return Table(
        name=name,
        caption=caption,
        columns=tuple(columns),
        rows=tuple(tuple(_plain(cell) for cell in row) for row in rows),
    )


def records_table(
    name: str, caption: str, records: Iterable[Any], columns: Sequence[tuple[str | Callable[[Any], Any], Column]]
) -> Table:
    """Return a table with one row per record.

    Parameters
    ----------
    columns : source of the cells, an attribute of the record or a function of it, and their column. Records are in
        SI; in columns with a unit of :data:`SCALES` numbers are converted to it.

    Raises
    ------
    ValueError
        A cell is neither a number nor a word.
    """
    takes = [attrgetter(source) if isinstance(source, str) else source for source, _ in columns]
    headings = [column for _, column in columns]
    rows = [
        [_scaled(_plain(take(record)), heading) for take, heading in zip(takes, headings, strict=True)]
        for record in records
    ]
    return make_table(name, caption, headings, rows)


def by_name(tables: Iterable[Table]) -> dict[str, Table]:
    """Return tables by their names, in their order."""
    return {table.name: table for table in tables}


def write_csv(tables: Mapping[str, Table], folder: Path) -> None:
    """Write each table to ``NAME.csv`` in ``folder``, atomically.

    Raises
    ------
    StrainfmuError
        A file could not be written.
    """
    for name, table in tables.items():
        write_bytes_atomically(folder / f"{name}.csv", table_csv(table).encode("utf-8"))


def shown(cell: Cell, column: Column) -> str:
    """Return a cell as text for a reader: rounded, a dash where there is no number."""
    if cell is None or (isinstance(cell, float) and isnan(cell)):
        return NO_VALUE
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, float):
        if not isfinite(cell):
            return "infinite" if cell > 0.0 else "-infinite"
        text = format(cell, column.digits)
        # A number that rounds to 0 has no sign.
        return text[1:] if text.startswith("-") and float(text) == 0.0 else text
    return str(cell)


def percent(fraction: float, digits: str = ".1f") -> str:
    """Return a fraction in per cent as text for a reader, as :func:`shown` rounds it."""
    return f"{shown(100.0 * float(fraction), Column('', '%', digits))} %"


def is_number(cell: Cell) -> bool:
    """Return whether a cell is aligned as a number: a number, or a missing one."""
    return cell is None or (isinstance(cell, int | float) and not isinstance(cell, bool))


def table_csv(table: Table) -> str:
    """Return the table as CSV (RFC 4180): headings with units, numbers in full, empty where there is no number."""
    stream = io.StringIO()
    writer = csv.writer(stream)
    writer.writerow([column.title for column in table.columns])
    writer.writerows([_in_full(cell) for cell in row] for row in table.rows)
    return stream.getvalue()


def tables_json(tables: Mapping[str, Table]) -> dict[str, Any]:
    """Return tables for JSON by name."""
    return {name: table_json(table) for name, table in tables.items()}


def table_json(table: Table) -> dict[str, Any]:
    """Return the table for JSON: caption, columns with units, rows of raw values; no NaN or infinity."""
    return {
        "caption": table.caption,
        "columns": [{"heading": column.heading, "unit": column.unit} for column in table.columns],
        "rows": [[json_number(cell) for cell in row] for row in table.rows],
    }


def json_number(cell: Cell) -> Cell:
    """Return a cell as a value of JSON: infinity as a word, NaN as null."""
    if isinstance(cell, float) and not isfinite(cell):
        return None if isnan(cell) else ("infinite" if cell > 0.0 else "-infinite")
    return cell


def _scaled(cell: Cell, column: Column) -> Cell:
    if column.unit in SCALES and isinstance(cell, int | float) and not isinstance(cell, bool):
        return SCALES[column.unit] * cell
    return cell


def _plain(cell: Any) -> Cell:
    value = cell.item() if isinstance(cell, np.generic) else cell
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise ValueError(f"table: {value!r} is neither a number nor a word")


def _in_full(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float) and isnan(cell)):
        return ""
    return repr(cell) if isinstance(cell, float) and isfinite(cell) else shown(cell, Column(""))
