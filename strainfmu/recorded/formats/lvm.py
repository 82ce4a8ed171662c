"""LabVIEW measurement files: segments of text, each with columns of its own, one time for all or one for each.

Source: National Instruments, Specification for the LabVIEW Measurement File (.lvm), versions 1 and 2.
"""

from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.recorded.formats.text import text_encoding
from strainfmu.recorded.table import Column, Reading, Table, table_of
from strainfmu.text_cells import Numerals, time_form

BEGIN = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SPECIAL = ("***Start_Special***", "***End_Special***")
_X = "X_Value"

Tags = dict[str, list[str]]
"""Cells of the lines of a header by the first."""


@dataclass(eq=False)
class _Segment:
    """A segment: tags with their cells, names of the columns, and rows of numbers, NaN where a cell is empty.

    ``faults`` are refusals of names that are there twice and cells that are no numbers, by column, ``last`` is the
    last line.
    """

    tags: Tags
    names: list[str] = field(default_factory=list)
    rows: list[FloatArray] = field(default_factory=list)
    faults: dict[str, InputError] = field(default_factory=dict)
    last: int = 0

    def tag(self, name: str, column: int) -> str:
        """Return what a tag says of a column, "" for nothing."""
        cells = self.tags.get(name, [])
        return cells[column] if column < len(cells) else ""

    @property
    def columns(self) -> dict[str, int]:
        """Place of each column."""
        return {name: i for i, name in enumerate(self.names) if i and name not in ("", _X, "Comment")}

    @property
    def samples(self) -> dict[int, int]:
        """Stated number of samples of each column."""
        return {place: int(cell) for place, cell in enumerate(self.tags.get("Samples", [])) if cell.isdecimal()}

    @property
    def longest(self) -> int:
        """Stated number of samples of the longest column; of rows, if none is stated."""
        return max(self.samples.values(), default=len(self.rows))


def lvm_table(path: Path, reading: Reading, stack: ExitStack) -> Table:
    """Open a LabVIEW measurement file; times are X_Value, or follow from X0 and Delta_X, behind Date and Time."""
    with path.open(encoding=text_encoding(path), errors="replace") as stream:
        lines = stream.read().split("\n")
    if not lines[0].startswith(BEGIN):
        raise InputError(f"{path}: damaged, or not a LabVIEW measurement file: it does not begin with that name")
    header, segments, remarks = _segments(path, lines)
    if not segments or not segments[-1].names:
        raise InputError(f"{path}: damaged, or without segment headers: no names of channels behind {_X} found")
    _check_ends(path, segments, remarks)
    columns = []
    for name in dict.fromkeys(name for segment in segments for name in segment.columns):
        within = [segment for segment in segments if name in segment.columns]
        units = [*dict.fromkeys(segment.tag("Y_Unit_Label", segment.columns[name]) for segment in within)]
        if len(units) > 1:
            raise InputError(f"{path}: column '{name}': unit: expected one, got '{units[0]}' and '{units[1]}'")
        time, values = _series(path, header, within, name, _start(segments[0]))
        clock = None if time is None else (time.tobytes(), time.__getitem__)
        read = partial(_values, values, [segment.faults[name] for segment in within if name in segment.faults])
        columns.append(Column(name=name, unit=units[0] or None, rows=len(values), read=read, clock=clock))
    return table_of(path, columns, reading, remarks)


def _values(values: FloatArray, faults: Sequence[InputError], rows: slice) -> FloatArray:
    """Return a slice of values; raise what is wrong with a column that is read."""
    for fault in faults:
        raise fault
    return values[rows]


def _segments(path: Path, lines: Sequence[str]) -> tuple[Tags, list[_Segment], list[str]]:
    """Return the tags of the header, the segments, and lines for the user."""
    named = next((line for line in lines[:100] if line.startswith("Separator")), "Separator\tTab")
    between = named[len("Separator") : len("Separator") + 1] or "\t"
    header, tags, segments, remarks = Tags(), Tags(), list[_Segment](), list[str]()
    is_special = is_data = has_header = False
    numerals, first_tag = Numerals(""), 0
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in line.split(between)]
        segment = segments[-1] if segments else None
        if cells[0] in _SPECIAL:
            is_special = cells[0] == _SPECIAL[0]
        elif is_special or not any(cells):
            continue
        elif cells[0] == _END:
            if has_header:
                segments.append(_Segment(tags))
            else:
                header, has_header, numerals = tags, True, _numerals(tags)
            tags, is_data = {}, False
        elif cells[0] == _X and segment is not None and not segment.names:
            segment.names, is_data = cells, True
            for name, times in Counter(cells).items():
                if times > 1:  # said of a column that is read
                    fault = f"{path}: line {number}: expected one column '{name}', got {times}"
                    segment.faults[name] = InputError(fault)
        elif is_data and segment is not None and not cells[0][:1].isalpha():
            if (width := 1 + max(segment.columns.values())) <= len(cells):
                _add_row(path, segment, cells[:width], number, numerals)
            elif number == len(lines):
                remarks.append(f"{path}: line {number}: incomplete, as the file ends there: left out")
            else:
                name = segment.names[-1]
                raise InputError(f"{path}: line {number}: expected a cell of {name!r}, got {len(cells)} cells")
        elif segment is not None and not segment.names:
            raise InputError(
                f"{path}: line {number}: expected the names of channels behind {_X}, got '{line[:40]}'"
            )
        else:
            tags[cells[0]], is_data = cells, False
            first_tag = first_tag if len(tags) > 1 else number
    if tags and segments and segments[-1].rows:
        remarks.append(f"{path}: line {first_tag}: behind the samples, not read ('{next(iter(tags))[:40]}')")
    return header, segments, remarks


def _add_row(path: Path, segment: _Segment, cells: Sequence[str], line: int, numerals: Numerals) -> None:
    """Add the numbers of a line."""
    row = np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        try:
            row[i] = numerals.number(cell) if cell else np.nan
        except ValueError as error:
            name = segment.names[i]
            fault = f"{path}: line {line}, column '{name}': {error}, got '{cell[:40]}'"
            segment.faults.setdefault(name, InputError(fault))
    segment.rows.append(row)
    segment.last = line


def _check_ends(path: Path, segments: Sequence[_Segment], remarks: list[str]) -> None:
    """Refuse a segment with too few rows; of the last one the rows that are there are read, and said."""
    for segment in segments:
        rows, stated = len(segment.rows), segment.longest
        if rows >= stated:
            continue
        if segment is not segments[-1] or not rows:
            where = f"line {segment.last}" if rows else "end"
            raise InputError(f"{path}: {where}: expected {stated} samples in the segment, got {rows}")
        remarks.append(f"{path}: ends early: {rows} of {stated} samples of the last segment are read")


def _series(
    path: Path, header: Tags, segments: Sequence[_Segment], name: str, begin: int | None
) -> tuple[FloatArray | None, FloatArray]:
    """Return times [s], relative ones since the ``begin`` of the first segment [ns], and values (n,) of a column.

    Times are None where X is no time.
    """
    times, values, is_timed = [np.empty(0)], [np.empty(0)], True
    for segment in segments:
        column = segment.columns[name]
        table = np.array(segment.rows) if segment.rows else np.empty((0, len(segment.names)))
        is_timed &= segment.tag("X_Dimension", column) in ("", "Time")
        if _second(header, "X_Columns") == "Multi":  # columns of other lengths have empty cells at their end
            rows = table[np.isfinite(table[:, column - 1 : column + 1]).any(axis=1)]
            time = rows[:, column - 1]
        else:
            # More rows than stated are of segments that were written without headings.
            stated = segment.samples.get(column, segment.longest)
            rows = table[: stated if len(table) <= segment.longest else None]
            time = rows[:, 0]
            if not _has_common_times(path, header, segment, name):
                time = _steps(path, header, segment, name, len(rows))
        start = _start(segment)
        if _second(header, "Time_Pref") != "Absolute" and start is not None and begin is not None:
            time = time + (start - begin) / 1e9
        times.append(time)
        values.append(rows[:, column])
    return (np.concatenate(times) if is_timed else None), np.concatenate(values)


def _has_common_times(path: Path, header: Tags, segment: _Segment, name: str) -> bool:
    """Return whether a column has the times of the first column of a segment, rather than X0 and Delta_X.

    They belong to the first column with the most samples: a column with another X0 or Delta_X has its own.
    """
    column, samples = segment.columns[name], segment.samples
    longest = max(samples, key=lambda place: samples[place], default=1)
    step, first_step = ((segment.tag("X0", place), segment.tag("Delta_X", place)) for place in (column, longest))
    if _second(header, "X_Columns") != "No" and (not all(step) or step == first_step):
        return True
    if samples.get(column, 0) < samples.get(longest, 0) < len(segment.rows):
        raise InputError(
            f"{path}: column '{name}': expected its {samples[column]} samples in one block of {samples[longest]} "
            f"rows, got {len(segment.rows)} rows: save it with headings for each block"
        )
    return False


def _steps(path: Path, header: Tags, segment: _Segment, name: str, n: int) -> FloatArray:
    """Return (n,) times by X0 and Delta_X [s]."""
    column = segment.columns[name]
    cells = segment.tag("X0", column), segment.tag("Delta_X", column)
    try:
        first, step = (_numerals(header).number(cell or "x") for cell in cells)
    except ValueError as error:
        raise InputError(f"{path}: column '{name}': X0 and Delta_X: expected numbers, got {cells}") from error
    return first + step * np.arange(n, dtype=float)


def _numerals(header: Tags) -> Numerals:
    return Numerals("", mark=_second(header, "Decimal_Separator") or ".", is_sure=True)


def _start(segment: _Segment) -> int | None:
    """Return date and time of a segment [ns], None where it states none."""
    stamp = f"{_second(segment.tags, 'Date')} {_second(segment.tags, 'Time')}".replace(",", ".")
    form = time_form(stamp, None)
    return None if form is None else form.first.time


def _second(tags: Tags, name: str) -> str:
    """Return what a tag says of all columns, or of the first, "" for nothing."""
    return next((cell for cell in tags.get(name, [])[1:] if cell), "")
