"""LabVIEW measurement files: segments of text, each with channels of its own, one time for all or one for each.

Source: National Instruments, Specification for the LabVIEW Measurement File (.lvm), versions 1 and 2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.recorded.formats.cells import Numerals
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, unique_names
from strainfmu.recorded.formats.csv_layout import text_encoding
from strainfmu.recorded.formats.date_times import time_form

_END = "***End_of_Header***"
_SPECIAL = ("***Start_Special***", "***End_Special***")
_X = "X_Value"


@dataclass
class _Segment:
    """A segment: tags with their cells, names of the columns, and rows of cells with their lines."""

    tags: dict[str, list[str]]
    names: list[str] = field(default_factory=list)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)

    def tag(self, name: str, column: int) -> str:
        """Return what a tag says of the channel in a column, "" for nothing."""
        cells = self.tags.get(name, [])
        return cells[column] if column < len(cells) else ""

    @property
    def channels(self) -> dict[str, int]:
        """Column of each channel."""
        return {name: i for i, name in enumerate(self.names) if i and name not in ("", _X, "Comment")}


@contextmanager
def lvm_channels(path: Path, reading: Reading) -> Iterator[ChannelFile]:
    """Open a LabVIEW measurement file; times are X_Value, or follow from X0 and Delta_X, behind Date and Time."""
    header, segments = _segments(path)
    names = tuple(dict.fromkeys(name for one in segments for name in unique_names(path, list(one.channels))))
    reader = _Reader(path, header, segments)
    yield ChannelFile(
        path=path,
        names=names,
        units={name: unit for name in names if (unit := reader.unit(name))},
        values=reader.values,
        clock=reader.time,
    )


def _segments(path: Path) -> tuple[dict[str, list[str]], list[_Segment]]:
    """Return the tags of the file and its segments."""
    with path.open(encoding=text_encoding(path), errors="replace") as stream:
        lines = stream.read().split("\n")
    if not lines[0].startswith("LabVIEW Measurement"):
        raise InputError(f"{path}: damaged, or not a LabVIEW measurement file: it does not begin with that name")
    named = next((line for line in lines[:100] if line.startswith("Separator")), "Separator\tTab")
    between = named[len("Separator") : len("Separator") + 1] or "\t"
    header: dict[str, list[str]] | None = None
    tags, segments = dict[str, list[str]](), list[_Segment]()
    is_special = is_data = False
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in line.split(between)]
        if cells[0] in _SPECIAL:
            is_special = cells[0] == _SPECIAL[0]
        elif is_special or not any(cells):
            continue
        elif cells[0] == _END:
            if header is None:
                header = tags
            else:
                segments.append(_Segment(tags))
            tags, is_data = {}, False
        elif cells[0] == _X and segments and not segments[-1].names:
            segments[-1].names, is_data = cells, True
        elif is_data and not cells[0][:1].isalpha():
            segments[-1].rows.append((number, cells))
        elif header is not None and segments and not segments[-1].names:
            raise InputError(
                f"{path}: line {number}: expected the names of channels behind {_X}, got '{line[:40]}'"
            )
        else:
            tags[cells[0]] = cells
            is_data = False
    if header is None or not segments or not segments[-1].names:
        raise InputError(f"{path}: damaged, or without segment headers: no names of channels behind {_X} found")
    return header, segments


class _Reader:
    """Values and times of channels, joined over the segments."""

    def __init__(self, path: Path, header: dict[str, list[str]], segments: Sequence[_Segment]) -> None:
        self._path, self._segments = path, segments
        self._is_multi = _second(header, "X_Columns") == "Multi"
        self._has_x = _second(header, "X_Columns") != "No"
        self._is_absolute = _second(header, "Time_Pref") == "Absolute"
        self._numerals = Numerals("", mark=_second(header, "Decimal_Separator") or ".", is_sure=True)
        self._starts = [self._start(segment) for segment in segments]
        self._times: dict[tuple[object, ...], FloatArray] = {}

    def unit(self, name: str) -> str:
        """Return the unit of a channel, "" without one; refuse two."""
        held = (one.tag("Y_Unit_Label", one.channels[name]) for one in self._segments if name in one.channels)
        units = [*dict.fromkeys(held)]
        if len(units) > 1:
            raise InputError(
                f"{self._path}: channel '{name}': unit: expected one, got '{units[0]}' and '{units[1]}'"
            )
        return units[0]

    def values(self, name: str) -> FloatArray:
        """Return (n,) values of a channel."""
        parts = []
        for segment in self._segments:
            if name in segment.channels:
                column = segment.channels[name]
                rows = self._rows(segment, column)
                parts.append([self._number(cells, column, line, name) for line, cells in rows])
        return np.concatenate([np.array(part, dtype=float) for part in parts])

    def time(self, name: str) -> FloatArray | None:
        """Return (n,) times of a channel [s], one array for all that have the same; None where X is no time."""
        key = list[tuple[int, int | tuple[str, str], int]]()
        for at, segment in enumerate(self._segments):
            if name in segment.channels:
                column = segment.channels[name]
                if segment.tag("X_Dimension", column) not in ("", "Time"):
                    return None
                key.append((at, self._axis_of(segment, column, name), len(self._rows(segment, column))))
        if tuple(key) not in self._times:
            self._times[tuple(key)] = np.concatenate([self._axis(name, *part) for part in key])
        return self._times[tuple(key)]

    def _axis_of(self, segment: _Segment, column: int, name: str) -> int | tuple[str, str]:
        """Return the column behind a channel's times, or its X0 and Delta_X where no column holds its times.

        A single column of times belongs to the first channel with the most samples: a channel with another X0 or
        Delta_X has times of its own.
        """
        if self._is_multi:
            return column
        samples = _samples(segment)
        longest = max(samples, key=lambda at: samples[at], default=1)
        step = (segment.tag("X0", column), segment.tag("Delta_X", column))
        if self._has_x and (
            not all(step) or step == (segment.tag("X0", longest), segment.tag("Delta_X", longest))
        ):
            return 1
        if samples.get(column, 0) < samples.get(longest, 0) < len(segment.rows):
            raise InputError(
                f"{self._path}: channel '{name}': expected its {samples[column]} samples in one block of "
                f"{samples[longest]} rows, got {len(segment.rows)} rows: save it with headings for each block"
            )
        return step

    def _axis(self, name: str, at: int, axis: int | tuple[str, str], n: int) -> FloatArray:
        """Return the (n,) times of a channel in a segment [s], of relative ones since the first segment began.

        ``axis`` is the column behind the column of the times, or X0 and Delta_X.
        """
        segment = self._segments[at]
        if isinstance(axis, int):
            rows = self._rows(segment, axis) if self._is_multi else segment.rows[:n]
            time = np.array([self._number(cells, axis - 1, line, _X) for line, cells in rows], dtype=float)
        else:
            try:
                first, step = (self._numerals.number(text or "x") for text in axis)
            except ValueError as error:
                raise InputError(
                    f"{self._path}: channel '{name}': X0 and Delta_X: expected numbers, got {axis}"
                ) from error
            time = first + step * np.arange(n)
        start, begin = self._starts[at], self._starts[0]
        if self._is_absolute or start is None or begin is None:
            return time
        return time + (start - begin).total_seconds()

    def _rows(self, segment: _Segment, column: int) -> list[tuple[int, list[str]]]:
        """Return the rows of a channel in a segment; the rows of a longer channel next to it are left out."""
        rows = segment.rows
        stated = _samples(segment)
        longest = max(stated.values(), default=len(rows))
        if len(rows) < longest:
            where = f"line {rows[-1][0]}" if rows else "end"
            raise InputError(f"{self._path}: {where}: expected {longest} samples in the segment, got {len(rows)}")
        if self._is_multi:
            return [row for row in rows if any(row[1][column - 1 : column + 1])]
        # More rows than stated are of segments that were written without headings.
        return rows[: stated.get(column, longest)] if len(rows) == longest else rows

    def _number(self, cells: Sequence[str], column: int, line: int, name: str) -> float:
        if column >= len(cells):
            raise InputError(f"{self._path}: line {line}: expected a cell of '{name}', got {len(cells)} cells")
        try:
            return self._numerals.number(cells[column]) if cells[column] else float("nan")
        except ValueError as error:
            raise InputError(
                f"{self._path}: line {line}, column '{name}': {error}, got '{cells[column][:40]}'"
            ) from error

    def _start(self, segment: _Segment) -> datetime | None:
        """Return date and time of a segment, None where it states none."""
        stamp = f"{_second(segment.tags, 'Date')} {_second(segment.tags, 'Time')}".replace(",", ".")
        form = time_form(stamp, None)
        return None if form is None else form.moment(stamp)


def _samples(segment: _Segment) -> dict[int, int]:
    """Return the stated number of samples of each column."""
    return {at: int(cell) for at, cell in enumerate(segment.tags.get("Samples", [])) if cell.isdecimal()}


def _second(tags: dict[str, list[str]], name: str) -> str:
    """Return what a tag says of all channels, or of the first, "" for nothing."""
    return next((cell for cell in tags.get(name, [])[1:] if cell), "")
