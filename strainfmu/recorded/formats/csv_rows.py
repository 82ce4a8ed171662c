"""The samples of a CSV file as numbers: decimal point or comma, relative and ISO 8601 times."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.recorded.formats.csv_layout import NUMBER, CsvLayout


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
    time : the one of the times, -1 without one.
    time_unit : [s], divides ISO times, which are in seconds from the first one on.
    """

    path: Path
    layout: CsvLayout
    names: Sequence[str]
    columns: Sequence[int]
    time: int
    time_unit: float = 1.0
    done: int = 0
    _mark: str = field(default="", init=False)
    _start: datetime | None = field(default=None, init=False)

    def rows(self) -> Iterator[tuple[int, list[float]]]:
        """Yield the line and the numbers of each sample; ``done`` counts the bytes.

        Raises
        ------
        InputError
            A line has too few or too many cells, or a cell is no number.
        """
        width = 4 if "32" in self.layout.encoding else 2 if "16" in self.layout.encoding else 1
        with self.layout.samples(self.path) as stream:

            def counted() -> Iterator[str]:
                for text in stream:
                    self.done += width * len(text)
                    yield text

            reader = csv.reader(counted(), delimiter=self.layout.delimiter)
            ahead = self.layout.lines_ahead
            try:
                for line, cells in enumerate(reader, start=ahead + 1):
                    if cells and (len(cells) > 1 or cells[0].strip()):
                        yield line, self._numbers(cells, line)
            except csv.Error as error:
                raise InputError(f"{self.path}: line {ahead + reader.line_num}: {error}") from error

    def _numbers(self, cells: Sequence[str], line: int) -> list[float]:
        """Return the cells in use as numbers; an empty cell is no value."""
        # A surplus cell shifts all after it, as a decimal comma between commas does.
        if max(self.columns) >= len(cells) or any(cell.strip() for cell in cells[len(self.names) :]):
            raise InputError(f"{self.path}: line {line}: expected {len(self.names)} cells, got {len(cells)}")
        return [self._number(cells[column].strip(), column, line) for column in self.columns]

    def _number(self, text: str, column: int, line: int) -> float:
        if not text:
            return float("nan")
        if NUMBER.fullmatch(text) is None:
            is_time = column == self.time
            moment = iso_time(text) if is_time else None
            if moment is not None:
                return self._seconds(moment, line)
            allowed = "a number or a time of ISO 8601" if is_time and self._start else "a number"
            raise self._fault(line, column, f"expected {allowed}, got '{text[:40]}'")
        if column == self.time and self._start is not None:
            raise self._fault(line, column, f"expected a time of ISO 8601, as at the start, got '{text[:40]}'")
        mark = "," if "," in text else "." if "." in text else ""
        if mark == "," and self.layout.delimiter == ",":
            raise self._fault(line, column, f"expected a number with a decimal point, got '{text[:40]}'")
        if mark and self._mark and mark != self._mark:
            raise self._fault(
                line, column, f"expected a number with a decimal '{self._mark}', as before, got '{text[:40]}'"
            )
        self._mark = self._mark or mark
        return float(text.replace(",", "."))

    def _seconds(self, moment: datetime, line: int) -> float:
        """Return the time since the first one in the file's unit."""
        if self._start is None:
            self._start = moment
        try:
            return (moment - self._start).total_seconds() / self.time_unit
        except TypeError as error:
            raise self._fault(line, self.time, "expected a time zone everywhere or nowhere, got both") from error

    def _fault(self, line: int, column: int, text: str) -> InputError:
        return InputError(f"{self.path}: line {line}, column '{self.names[column]}': {text}")


def time_notes(path: Path, layout: CsvLayout, names: Sequence[str], time: int) -> tuple[str, ...]:
    """Return what is to be said of ISO times: the zero of the seconds that stand for them."""
    text = layout.first_row[time].strip() if 0 <= time < len(layout.first_row) else ""
    if NUMBER.fullmatch(text) or iso_time(text) is None:
        return ()
    return (f"{path}: column '{names[time]}': times of ISO 8601, read as seconds since {text}",)
