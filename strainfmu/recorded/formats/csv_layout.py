"""The layout of a CSV file as recorders write it: encoding, separator, header block, headings, row of units.

The module csv parses the lines. Libraries that find out a dialect know the separator alone: no header block, no
row of units, no decimal comma.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TextIO

from strainfmu.errors import InputError
from strainfmu.recorded.columns.column_names import split_heading
from strainfmu.units import ALL_UNITS, NUMBER_UNITS

LONGEST_HEADER = 200
"""Lines among which the headings must be."""

DELIMITERS = ",;\t"

NUMBER = re.compile(r"[+-]?([0-9]+[.,]?[0-9]*|[.,][0-9]+)([eE][+-]?[0-9]+)?|[+-]?nan", re.IGNORECASE)
"""A number in a cell: ASCII digits, a decimal point or comma, or NaN. float() accepts more, such as 1_0 for 10."""

_MARKS = (
    (b"\xef\xbb\xbf", "utf-8-sig"),
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)
"""Byte-order marks; the longer ones first."""


@dataclass(frozen=True, kw_only=True)
class CsvLayout:
    """Where what stands in a CSV file.

    Attributes
    ----------
    encoding : of the text.
    delimiter : between the cells.
    headings : names of the columns, as they stand.
    units : unit of each column by a row of its own, None without such a row.
    lines_ahead : lines ahead of the first sample.
    first_row : cells of the first sample, empty without one.
    """

    encoding: str
    delimiter: str
    headings: tuple[str, ...]
    units: tuple[str | None, ...] | None
    lines_ahead: int
    first_row: tuple[str, ...]

    @contextmanager
    def samples(self, path: Path) -> Iterator[TextIO]:
        """Open the file at the line of the first sample."""
        with path.open(encoding=self.encoding, errors="replace") as stream:  # every end of a line as "\n"
            for _ in range(self.lines_ahead):
                stream.readline()
            yield stream


def csv_layout(path: Path, is_known: Callable[[str], bool]) -> CsvLayout:
    """Return the layout of a CSV file.

    The headings are the line with most known names, the first of several. Without any, they are the line ahead
    of the first line of numbers, or else the first line.

    Parameters
    ----------
    is_known : tells whether a name is that of a column to be read.

    Raises
    ------
    InputError
        There are no headings, the file is no text, or two units are stated for a column.
    """
    encoding = _encoding(path)
    with path.open(newline="", encoding=encoding, errors="replace") as stream:
        lines = list(islice(stream, LONGEST_HEADER))
    if any("\x00" in line for line in lines):
        raise InputError(f"{path}: damaged, or not a CSV file: expected text, got bytes of 0")
    at, delimiter = _heading_line(lines, is_known)
    headings = list(_cells(lines[at], delimiter)) if lines else []
    while headings and not headings[-1].strip():
        headings.pop()  # what stands below is refused unless it is empty too
    if not headings:
        raise InputError(f"{path}: no headings found in the first line")
    ahead, units = at + 1, None
    for line in lines[at + 1 :]:
        cells = _cells(line, delimiter)
        if any(cell.strip() for cell in cells):
            if units is None and _is_row_of_units(cells):
                units = _units(path, headings, cells)
            else:
                break
        elif units is None and not _units_follow(lines[ahead + 1 :], delimiter):
            break
        ahead += 1
    rest = [_cells(line, delimiter) for line in lines[ahead:]]
    first = next((cells for cells in rest if any(cell.strip() for cell in cells)), ())
    return CsvLayout(
        encoding=encoding,
        delimiter=delimiter,
        headings=tuple(headings),
        units=units,
        lines_ahead=ahead,
        first_row=tuple(first),
    )


def _encoding(path: Path) -> str:
    """Return the encoding: by a byte-order mark, by zeros of UTF-16, UTF-8 where that is valid, else Latin-1."""
    with path.open("rb") as stream:
        head = stream.read(1 << 18)
    marked = next((name for mark, name in _MARKS if head.startswith(mark)), None)
    if marked is not None:
        return marked
    even, odd = head[0:2000:2].count(0), head[1:2000:2].count(0)
    if max(even, odd) > len(head[:2000]) // 8 and min(even, odd) == 0:
        return "utf-16-le" if odd else "utf-16-be"
    try:
        head[: head.rfind(b"\n") + 1].decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"  # Latin-1 with what Windows adds to it
    return "utf-8"


def _heading_line(lines: Sequence[str], is_known: Callable[[str], bool]) -> tuple[int, str]:
    """Return the index of the line of headings and the delimiter."""
    best, found = 0, (-1, ",")
    for at, line in enumerate(lines):
        for delimiter in sorted(DELIMITERS, key=line.count, reverse=True):
            score = sum(is_known(split_heading(cell)[0]) for cell in _cells(line, delimiter))
            if score > best:
                best, found = score, (at, delimiter)
    if best:
        return found
    for at, line in enumerate(lines[1:]):
        delimiter = max(DELIMITERS, key=line.count)
        cells = [cell.strip() for cell in _cells(line, delimiter)]
        if len(cells) > 1 and any(cells) and all(not cell or NUMBER.fullmatch(cell) for cell in cells):
            return at, max(DELIMITERS, key=lines[at].count)
    return 0, max(DELIMITERS, key=lines[0].count) if lines else ","


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of one line; none of one that csv refuses, which is said when it is read."""
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        return []


def _unit(cell: str) -> str:
    """Return the unit that a cell states, without brackets."""
    text = cell.strip()
    return text[1:-1].strip() if text[:1] + text[-1:] in ("[]", "()") else text


def _is_row_of_units(cells: Sequence[str]) -> bool:
    """Return whether the cells are units: at least one known unit that is no number, and no number."""
    units = [_unit(cell) for cell in cells if cell.strip()]
    is_number = [NUMBER.fullmatch(unit) is not None and unit != "1" for unit in units]
    return not any(is_number) and any(unit in ALL_UNITS and unit not in NUMBER_UNITS for unit in units)


def _units_follow(lines: Sequence[str], delimiter: str) -> bool:
    """Return whether a row of units is the next line that is not empty."""
    rest = (_cells(line, delimiter) for line in lines)
    filled = next((cells for cells in rest if any(cell.strip() for cell in cells)), [])
    return _is_row_of_units(filled)


def _units(path: Path, headings: Sequence[str], cells: Sequence[str]) -> tuple[str | None, ...]:
    """Return the unit of each heading by the row of units; one in the heading must agree."""
    units: list[str | None] = []
    for column, heading in enumerate(headings):
        unit = _unit(cells[column]) if column < len(cells) else ""
        own = split_heading(heading)[1]
        if own and unit and own != unit:
            raise InputError(
                f"{path}: column '{heading}': unit: expected one, got '{own}' in the heading and '{unit}' below"
            )
        units.append(unit or own or None)
    return tuple(units)
