"""The layout of a CSV file as recorders write it: encoding, separator, header block, headings, row of units.

The module csv parses the lines. Libraries that find out a dialect know the separator alone: no header block, no
row of units, no decimal comma.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TextIO

from strainfmu.errors import InputError
from strainfmu.recorded.columns.column_names import split_heading
from strainfmu.recorded.formats.cells import NUMBER, Numerals, is_number
from strainfmu.recorded.formats.date_times import time_form
from strainfmu.units import ALL_UNITS, NUMBER_UNITS

LONGEST_HEADER = 200
"""Lines among which the headings must be."""

SEEN = 400
"""Lines of the file that are looked at for its layout, its first samples among them."""

DELIMITERS = ",;\t"

_UNIT_LABELS = ("unit", "units", "einheit", "einheiten")
"""What stands ahead of a row of units in a column of labels, in small letters."""

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
    first_line : its line.
    numerals : how numbers are written, by the first samples.
    passed_over : lines of channel information between headings and samples, with their first cells.
    """

    encoding: str
    delimiter: str
    headings: tuple[str, ...]
    units: tuple[str | None, ...] | None
    lines_ahead: int
    first_row: tuple[str, ...]
    first_line: int
    numerals: Numerals
    passed_over: tuple[tuple[int, str], ...] = ()

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
    of the first line of numbers, and of a row of units, or else the first line.

    Parameters
    ----------
    is_known : whether a name belongs to a column to be read.

    Raises
    ------
    InputError
        There are no headings, the file is no text, or two units are stated for a column.
    """
    encoding = text_encoding(path)
    with path.open(newline="", encoding=encoding, errors="replace") as stream:
        lines = list(islice(stream, SEEN))
    if any("\x00" in line for line in lines):
        raise InputError(f"{path}: damaged, or not a CSV file: expected text, got bytes of 0")
    at, delimiter = _heading_line(lines[:LONGEST_HEADER], is_known)
    headings = list(_cells(lines[at], delimiter)) if lines else []
    while headings and not headings[-1].strip():
        headings.pop()  # what stands below is refused unless it is empty too
    if not headings:
        raise InputError(f"{path}: no headings found in the first line")
    used = [i for i, heading in enumerate(headings) if is_known(split_heading(heading)[0])]
    used = used or list(range(len(headings)))
    rows = [tuple(_cells(line, delimiter)) for line in lines[at + 1 :]]
    ahead, units, passed = _rows_of_information(path, headings, rows, used)
    filled = [row for row in rows[ahead:] if any(cell.strip() for cell in row)]
    numerals = Numerals(delimiter)
    numerals.learn(row[i].strip() for row in filled for i in used if i < len(row))
    return CsvLayout(
        encoding=encoding,
        delimiter=delimiter,
        headings=tuple(headings),
        units=units,
        lines_ahead=at + 1 + ahead,
        first_row=filled[0] if filled else (),
        first_line=at + 2 + next((i for i, row in enumerate(rows) if i >= ahead and row in filled[:1]), ahead),
        numerals=numerals,
        passed_over=tuple((at + 2 + row, first) for row, first in passed),
    )


def _rows_of_information(
    path: Path, headings: Sequence[str], rows: Sequence[tuple[str, ...]], used: Sequence[int]
) -> tuple[int, tuple[str | None, ...] | None, list[tuple[int, str]]]:
    """Return the number of rows ahead of the first sample, the units by a row of them, and the other rows.

    Ahead of the samples may stand, for each channel, its unit, rate, range or date. No row is passed over where no
    sample follows it: what is wrong in a file without samples is said of its first row.
    """
    samples = (at for at, row in enumerate(rows) if _is_sample(row, used) and not _is_row_of_units(row))
    first = next(samples, None)
    units, passed, ahead = None, [], 0
    for at, row in enumerate(rows[:first]):
        if not any(cell.strip() for cell in row):
            continue
        if units is None and _is_row_of_units(row):
            units, ahead = _units(path, headings, row), at + 1
        elif first is not None:
            passed.append((at, row[0].strip()))
    return (ahead if first is None else first), units, passed


def _is_sample(row: Sequence[str], used: Sequence[int]) -> bool:
    """Return whether a row is a sample rather than a text for each channel, or numbers behind a label."""
    cells = [row[i].strip() if i < len(row) else "" for i in used]
    values = [is_number(cell) or time_form(cell, None) is not None for cell in cells]
    label = row[0].strip() if row else ""
    has_label = bool(label) and used[0] == 0 and not values[0]
    return any(values) and not has_label


def text_encoding(path: Path) -> str:
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
            if line.count(delimiter) < best:
                break  # by no delimiter more cells than the best line has names
            cells = _cells(line, delimiter)
            unknown = (cell for cell in cells if not is_known(split_heading(cell)[0]))
            # Each name costs a search: no more of them than decide whether the line has more than the best.
            score = len(cells) - len(list(islice(unknown, max(len(cells) - best, 0))))
            if score > best:
                best, found = score, (at, delimiter)
    if best:
        return found
    for at, line in enumerate(lines[1:]):
        if any(_is_row_of_numbers(_cells(line, delimiter)) for delimiter in DELIMITERS):
            filled = [index for index in range(at + 1) if lines[index].strip()] or [0]
            delimiter = max(DELIMITERS, key=lines[filled[-1]].count)
            is_units = len(filled) > 1 and _is_row_of_units(_cells(lines[filled[-1]], delimiter))
            return filled[-2 if is_units else -1], delimiter
    return 0, max(DELIMITERS, key=lines[0].count) if lines else ","


def _is_row_of_numbers(cells: Sequence[str]) -> bool:
    """Return whether there are several cells, all of them numbers or empty."""
    held = [cell.strip() for cell in cells]
    return len(held) > 1 and any(held) and all(not cell or NUMBER.fullmatch(cell) for cell in held)


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of one line; none of one that csv refuses, which is said when it is read."""
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        return []


def _unit(cell: str) -> str:
    """Return the unit that a cell states, without brackets; "" for a label of such a row."""
    text = cell.strip()
    if text.casefold().rstrip(":") in _UNIT_LABELS:
        return ""
    return text[1:-1].strip() if text[:1] + text[-1:] in ("[]", "()") else text


def _is_row_of_units(cells: Sequence[str]) -> bool:
    """Return whether the cells are units: at least one known unit that is no number, and no number."""
    units = [unit for cell in cells if (unit := _unit(cell))]
    is_number = [NUMBER.fullmatch(unit) is not None and unit != "1" for unit in units]
    return not any(is_number) and any(unit in ALL_UNITS and unit not in NUMBER_UNITS for unit in units)


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
