"""The samples of a CSV file as numbers, in pieces: what each cell means, and in which line it is wrong."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import TextIO

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.recorded.formats.cells import Numerals
from strainfmu.recorded.formats.channel_file import Rows
from strainfmu.recorded.formats.csv_arrow import arrow_columns
from strainfmu.recorded.formats.csv_layout import CsvLayout
from strainfmu.recorded.formats.date_times import TimeForm

PIECE = 1 << 21
"""Characters that are read at a time, before the end of a line."""

DAY = 86400.0
"""[s]"""


@dataclass
class RowReader:
    """Turns the cells of samples into numbers.

    Attributes
    ----------
    names : of all columns, for messages.
    columns : those that are read, in this order.
    dated : form of the columns of dates and times, which become seconds from the first one on.
    remarks : takes lines for the user on what the cells have shown.
    """

    path: Path
    layout: CsvLayout
    names: Sequence[str]
    columns: Sequence[int]
    dated: Mapping[int, TimeForm] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    _numerals: Numerals = field(init=False)
    _starts: dict[int, datetime] = field(default_factory=dict, init=False)
    _lasts: dict[int, float] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self._numerals = replace(self.layout.numerals)

    def pieces(self) -> Iterator[Rows]:
        """Yield the samples, some thousand at a time, with their lines.

        Raises
        ------
        InputError
            A line has too few or too many cells, or a cell is no number.
        """
        width = 4 if "32" in self.layout.encoding else 2 if "16" in self.layout.encoding else 1
        line, done = self.layout.lines_ahead, 0
        with self.layout.samples(self.path) as stream:
            while text := _piece(stream):
                found = self._whole(text, line) or self._samples(text, line)
                line += text.count("\n")
                done = done + width * len(text) if len(text) > PIECE else self.path.stat().st_size
                if len(found[0]):
                    yield Rows(*found, done)

    def _whole(self, text: str, ahead: int) -> tuple[IntArray, FloatArray] | None:
        """Return line and numbers of each sample of a piece of plain numbers by pyarrow, None of any other."""
        mark, delimiter = self._numerals.mark, self.layout.delimiter
        if not mark and ("." in text or "," in text):  # the cells are to show which is the decimal mark
            return None
        surplus = range(len(self.names), len(self.layout.first_row))
        columns = [*self.columns, *surplus]
        found = arrow_columns(
            text,
            width=max(len(self.names), len(self.layout.first_row)),
            columns=columns,
            texts={*self.dated, *surplus},
            delimiter=delimiter,
            mark=mark,
        )
        if found is None or any(cell.strip() for column in found[len(self.columns) :] for cell in column):
            return None
        lines = np.arange(ahead + 1, ahead + 1 + len(found[0]))
        for i, column in enumerate(self.columns):
            if column in self.dated:
                texts = zip(found[i], lines.tolist(), strict=True)
                found[i] = np.array([self._number(cell.strip(), column, line) for cell, line in texts])
        return lines, np.column_stack(found[: len(self.columns)])

    def _samples(self, text: str, ahead: int) -> tuple[IntArray, FloatArray]:
        """Return line and numbers of each sample of a piece; ``ahead`` lines stand above it."""
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=self.layout.delimiter)
        lines, values = list[int](), list[list[float]]()
        try:
            for cells in reader:
                if cells and (len(cells) > 1 or cells[0].strip()):
                    lines.append(ahead + reader.line_num)
                    values.append(self._numbers(cells, lines[-1]))
        except csv.Error as error:
            raise InputError(f"{self.path}: line {ahead + reader.line_num}: {error}") from error
        return np.array(lines, dtype=int), np.array(values)

    def _numbers(self, cells: Sequence[str], line: int) -> list[float]:
        """Return the cells in use as numbers; an empty cell is no value."""
        # A surplus cell shifts all after it, as a decimal comma between commas does.
        if max(self.columns) >= len(cells) or any(cell.strip() for cell in cells[len(self.names) :]):
            raise InputError(f"{self.path}: line {line}: expected {len(self.names)} cells, got {len(cells)}")
        return [self._number(cells[column].strip(), column, line) for column in self.columns]

    def _number(self, text: str, column: int, line: int) -> float:
        if not text:
            return float("nan")
        if column in self.dated:
            return self._seconds(text, column, line)
        was_grouped = self._numerals.grouped
        try:
            found = self._numerals.number(text)
        except ValueError as error:
            raise self._fault(line, column, f"{error}, got '{text[:40]}'") from error
        if self._numerals.grouped != was_grouped:
            self.remarks.append(
                f"{self.path}: line {line}, column '{self.names[column]}': '{text}' read as {found:.12g}: numbers "
                "with separators of thousands"
            )
        return found

    def _seconds(self, text: str, column: int, line: int) -> float:
        """Return the time since the first one of a column; times of day go on behind midnight."""
        form = self.dated[column]
        moment = form.moment(text)
        if moment is None:
            raise self._fault(
                line, column, f"expected a time {form.order.value}, as at the start, got '{text[:40]}'"
            )
        try:
            found = (moment - self._starts.setdefault(column, moment)).total_seconds()
        except TypeError as error:
            raise self._fault(line, column, "expected a time zone everywhere or nowhere, got both") from error
        if not form.has_date:
            last = self._lasts.get(column, found)
            found += DAY * max(0, round((last - found) / DAY))
            self._lasts[column] = found
        return found

    def _fault(self, line: int, column: int, text: str) -> InputError:
        return InputError(f"{self.path}: line {line}, column '{self.names[column]}': {text}")


def _piece(stream: TextIO) -> str:
    """Return the next whole lines of a text, "" at its end; a cell in quotes may hold the end of a line."""
    text = stream.read(PIECE) + stream.readline()
    while text.count('"') % 2 and len(text) < 2 * PIECE and (more := stream.readline()):
        text += more
    return text
