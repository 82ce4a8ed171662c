"""The samples of a CSV file as numbers: decimal point or comma, relative and ISO 8601 times."""

from __future__ import annotations

import csv
import io
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TextIO

import numpy as np

from strainfmu.errors import InputError
from strainfmu.recorded.formats.channel_file import Rows
from strainfmu.recorded.formats.csv_layout import NUMBER, CsvLayout

PIECE = 1 << 21
"""Characters that are read at a time, before the end of a line."""


def iso_time(text: str) -> datetime | None:
    """Return an ISO 8601 date and time, or a time of day, of a day in 1970; None for any other text."""
    text = text.strip()
    for candidate in (text, f"1970-01-01T{text}"):
        try:
            found = datetime.fromisoformat(candidate)
        except ValueError:
            continue
        # A compact date, such as 20260101, is a number here.
        return found if ":" in text or "-" in text[1:] else None
    return None


@dataclass
class RowReader:
    """Turns the cells of samples into numbers.

    Attributes
    ----------
    names : of all columns, for messages.
    columns : those that are read, in this order.
    dated : those of dates and times, which become seconds from the first one on.
    """

    path: Path
    layout: CsvLayout
    names: Sequence[str]
    columns: Sequence[int]
    dated: Container[int] = ()
    _mark: str = field(default="", init=False)
    _starts: dict[int, datetime] = field(default_factory=dict, init=False)

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
                lines, values = self._samples(text, line)
                line += text.count("\n")
                done = done + width * len(text) if len(text) > PIECE else self.path.stat().st_size
                if len(lines):
                    yield Rows(np.array(lines), np.array(values), done)

    def _samples(self, text: str, ahead: int) -> tuple[list[int], list[list[float]]]:
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
        return lines, values

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
        if NUMBER.fullmatch(text) is None:
            raise self._fault(line, column, f"expected a number, got '{text[:40]}'")
        mark = "," if "," in text else "." if "." in text else ""
        if mark == "," and self.layout.delimiter == ",":
            raise self._fault(line, column, f"expected a number with a decimal point, got '{text[:40]}'")
        if mark and self._mark and mark != self._mark:
            raise self._fault(
                line, column, f"expected a number with a decimal '{self._mark}', as before, got '{text[:40]}'"
            )
        self._mark = self._mark or mark
        return float(text.replace(",", "."))

    def _seconds(self, text: str, column: int, line: int) -> float:
        """Return the time since the first one of a column."""
        moment = iso_time(text) if NUMBER.fullmatch(text) is None else None
        if moment is None:
            raise self._fault(line, column, f"expected a time of ISO 8601, as at the start, got '{text[:40]}'")
        try:
            return (moment - self._starts.setdefault(column, moment)).total_seconds()
        except TypeError as error:
            raise self._fault(line, column, "expected a time zone everywhere or nowhere, got both") from error

    def _fault(self, line: int, column: int, text: str) -> InputError:
        return InputError(f"{self.path}: line {line}, column '{self.names[column]}': {text}")


def _piece(stream: TextIO) -> str:
    """Return the next whole lines of a text, "" at its end; a cell in quotes may hold the end of a line."""
    text = stream.read(PIECE) + stream.readline()
    while text.count('"') % 2 and len(text) < 2 * PIECE and (more := stream.readline()):
        text += more
    return text


def time_notes(path: Path, layout: CsvLayout, names: Sequence[str], time: int) -> tuple[str, ...]:
    """Return what is to be said of ISO times: the zero of the seconds that stand for them."""
    text = layout.first_row[time].strip() if 0 <= time < len(layout.first_row) else ""
    if NUMBER.fullmatch(text) or iso_time(text) is None:
        return ()
    return (f"{path}: column '{names[time]}': times of ISO 8601, read as seconds since {text}",)
