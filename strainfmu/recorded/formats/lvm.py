"""LabVIEW measurement files: segments of text, each with columns of its own, one time for all or one for each.

Source: National Instruments, Specification for the LabVIEW Measurement File (.lvm), versions 1 and 2.
"""

from __future__ import annotations

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


@dataclass(eq=False)
class _Segment:
    """A segment: tags with their cells, names of the columns, and rows of numbers, NaN where a cell is empty.

    ``faults`` are refusals of cells that are no numbers, by column, ``last`` is the last line.
    """

    tags: dict[str, list[str]]
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
        return {at: int(cell) for at, cell in enumerate(self.tags.get("Samples", [])) if cell.isdecimal()}

    @property
    def longest(self) -> int:
        """Stated number of samples of the longest column; of rows, if none is stated."""
        return max(self.samples.values(), default=len(self.rows))


def lvm_table(path: Path, reading: Reading, stack: ExitStack) -> Table:
    """Open a LabVIEW measurement file; times are X_Value, or follow from X0 and Delta_X, behind Date and Time."""
    file = _File(path)
    columns = []
    for name in dict.fromkeys(name for segment in file.segments for name in segment.columns):
        time, values = file.series(name)
        clock = None if time is None else (time.tobytes(), time.__getitem__)
        faults = [segment.faults[name] for segment in file.segments if name in segment.faults]
        read = partial(_values, values, faults)
        columns.append(Column(name=name, unit=file.unit(name) or None, rows=len(values), read=read, clock=clock))
    return table_of(path, columns, reading, file.remarks)


def _values(values: FloatArray, faults: Sequence[InputError], rows: slice) -> FloatArray:
    """Return a slice of values; raise what is wrong with a column that is read."""
    for fault in faults:
        raise fault
    return values[rows]


class _File:
    """The segments of a file, and what its header states."""

    def __init__(self, path: Path) -> None:
        self.path, self.segments, self.remarks = path, list[_Segment](), list[str]()
        with path.open(encoding=text_encoding(path), errors="replace") as stream:
            lines = stream.read().split("\n")
        if not lines[0].startswith(BEGIN):
            raise InputError(
                f"{path}: damaged, or not a LabVIEW measurement file: it does not begin with that name"
            )
        self._header = self._read(lines)
        if not self.segments or not self.segments[-1].names:
            raise InputError(
                f"{path}: damaged, or without segment headers: no names of channels behind {_X} found"
            )
        self._check_ends()

    def _read(self, lines: Sequence[str]) -> dict[str, list[str]]:
        """Read the segments; return the tags of the header."""
        named = next((line for line in lines[:100] if line.startswith("Separator")), "Separator\tTab")
        between = named[len("Separator") : len("Separator") + 1] or "\t"
        header, tags = dict[str, list[str]](), dict[str, list[str]]()
        is_special = is_data = has_header = False
        numerals, first_tag = Numerals(""), 0
        for number, line in enumerate(lines, start=1):
            cells = [cell.strip() for cell in line.split(between)]
            segment = self.segments[-1] if self.segments else None
            if cells[0] in _SPECIAL:
                is_special = cells[0] == _SPECIAL[0]
            elif is_special or not any(cells):
                continue
            elif cells[0] == _END:
                if has_header:
                    self.segments.append(_Segment(tags))
                else:
                    header, has_header = tags, True
                    numerals = Numerals("", mark=_second(tags, "Decimal_Separator") or ".", is_sure=True)
                tags, is_data = {}, False
            elif cells[0] == _X and segment is not None and not segment.names:
                segment.names, is_data = cells, True
            elif is_data and segment is not None and not cells[0][:1].isalpha():
                self._add_row(segment, cells, number, numerals, is_last=number == len(lines))
            elif segment is not None and not segment.names:
                raise InputError(
                    f"{self.path}: line {number}: expected the names of channels behind {_X}, got '{line[:40]}'"
                )
            else:
                tags[cells[0]], is_data = cells, False
                first_tag = first_tag if len(tags) > 1 else number
        if tags and self.segments and self.segments[-1].rows:
            self.remarks.append(
                f"{self.path}: line {first_tag}: behind the samples, not read ('{next(iter(tags))[:40]}')"
            )
        return header

    def _add_row(
        self, segment: _Segment, cells: Sequence[str], line: int, numerals: Numerals, is_last: bool
    ) -> None:
        """Add the numbers of a line; the last line of the file may be incomplete, and is left out then."""
        width = 1 + max(segment.columns.values())
        if len(cells) < width:
            if is_last:
                self.remarks.append(f"{self.path}: line {line}: incomplete, as the file ends there: left out")
                return
            raise InputError(
                f"{self.path}: line {line}: expected a cell of {segment.names[-1]!r}, got {len(cells)} cells"
            )
        row = np.full(width, np.nan)
        for i, cell in enumerate(cells[:width]):
            try:
                row[i] = numerals.number(cell) if cell else np.nan
            except ValueError as error:
                name = segment.names[i]
                fault = f"{self.path}: line {line}, column '{name}': {error}, got '{cell[:40]}'"
                segment.faults.setdefault(name, InputError(fault))
        segment.rows.append(row)
        segment.last = line

    def _check_ends(self) -> None:
        """Refuse a segment with too few rows; of the last one the rows that are there are read, and said."""
        for segment in self.segments:
            rows, stated = len(segment.rows), segment.longest
            if rows >= stated:
                continue
            if segment is not self.segments[-1] or not rows:
                where = f"line {segment.last}" if rows else "end"
                raise InputError(f"{self.path}: {where}: expected {stated} samples in the segment, got {rows}")
            self.remarks.append(
                f"{self.path}: ends early: {rows} of {stated} samples of the last segment are read"
            )

    def unit(self, name: str) -> str:
        """Return the unit of a column, "" without one; refuse two."""
        within = [segment for segment in self.segments if name in segment.columns]
        units = [*dict.fromkeys(one.tag("Y_Unit_Label", one.columns[name]) for one in within)]
        if len(units) > 1:
            raise InputError(
                f"{self.path}: column '{name}': unit: expected one, got '{units[0]}' and '{units[1]}'"
            )
        return units[0]

    def series(self, name: str) -> tuple[FloatArray | None, FloatArray]:
        """Return times [s], relative ones since the first segment began, and values (n,) of a column.

        Times are None where X is no time.
        """
        times, values, is_timed = [np.empty(0)], [np.empty(0)], True
        for segment in self.segments:
            if name not in segment.columns:
                continue
            column = segment.columns[name]
            table = np.array(segment.rows) if segment.rows else np.empty((0, len(segment.names)))
            is_timed &= segment.tag("X_Dimension", column) in ("", "Time")
            if self._second("X_Columns") == "Multi":  # columns of other lengths have empty cells at their end
                rows = table[np.isfinite(table[:, column - 1 : column + 1]).any(axis=1)]
                time = rows[:, column - 1]
            else:
                # More rows than stated are of segments that were written without headings.
                stated = segment.samples.get(column, segment.longest)
                rows = table[: stated if len(table) <= segment.longest else None]
                time = (
                    rows[:, 0] if self._has_common_times(segment, name) else self._steps(segment, name, len(rows))
                )
            start, begin = _start(segment), _start(self.segments[0])
            if self._second("Time_Pref") != "Absolute" and start is not None and begin is not None:
                time = time + (start - begin) / 1e9
            times.append(time)
            values.append(rows[:, column])
        return (np.concatenate(times) if is_timed else None), np.concatenate(values)

    def _has_common_times(self, segment: _Segment, name: str) -> bool:
        """Return whether a column has the times of the first column of a segment, rather than X0 and Delta_X.

        They belong to the first column with the most samples: a column with another X0 or Delta_X has its own.
        """
        column, samples = segment.columns[name], segment.samples
        longest = max(samples, key=lambda at: samples[at], default=1)
        step, first_step = ((segment.tag("X0", at), segment.tag("Delta_X", at)) for at in (column, longest))
        if self._second("X_Columns") != "No" and (not all(step) or step == first_step):
            return True
        if samples.get(column, 0) < samples.get(longest, 0) < len(segment.rows):
            raise InputError(
                f"{self.path}: column '{name}': expected its {samples[column]} samples in one block of "
                f"{samples[longest]} rows, got {len(segment.rows)} rows: save it with headings for each block"
            )
        return False

    def _steps(self, segment: _Segment, name: str, n: int) -> FloatArray:
        """Return (n,) times by X0 and Delta_X [s]."""
        column = segment.columns[name]
        cells = segment.tag("X0", column), segment.tag("Delta_X", column)
        try:
            first, step = (self._numerals.number(cell or "x") for cell in cells)
        except ValueError as error:
            raise InputError(
                f"{self.path}: column '{name}': X0 and Delta_X: expected numbers, got {cells}"
            ) from error
        return first + step * np.arange(n, dtype=float)

    def _second(self, tag: str) -> str:
        return _second(self._header, tag)

    @property
    def _numerals(self) -> Numerals:
        return Numerals("", mark=self._second("Decimal_Separator") or ".", is_sure=True)


def _start(segment: _Segment) -> int | None:
    """Return date and time of a segment [ns], None where it states none."""
    stamp = f"{_second(segment.tags, 'Date')} {_second(segment.tags, 'Time')}".replace(",", ".")
    form = time_form(stamp, None)
    return None if form is None else form.first.time


def _second(tags: dict[str, list[str]], name: str) -> str:
    """Return what a tag says of all columns, or of the first, "" for nothing."""
    return next((cell for cell in tags.get(name, [])[1:] if cell), "")
