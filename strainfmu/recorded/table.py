"""A recording as a table: columns with name, unit and time, whatever its format.

A format gives *frames*: the columns of a frame have their rows, and so their times, in common. A frame is read in
pieces of rows, so that no recording is too long. The times of a frame are times that its format states
(:attr:`Frame.clock`), else a column of times, else they follow from a rate.
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.names import TIME, matched, times_among
from strainfmu.text_cells import DateOrder

BLOCK_ROWS = 4000
"""Samples in one block."""

PIECE_ROWS = 4 * BLOCK_ROWS
"""Rows of a piece of what is read by slices: whole blocks, so that no rows of it are moved."""

LARGEST_MATRIX = 4096
"""Columns of a matrix that are offered."""


@dataclass(frozen=True, kw_only=True)
class Reading:
    """What a reader of a format needs to know of the columns.

    Attributes
    ----------
    is_known : whether a name belongs to a column to be read; texts find their headings by it.
    date_order : of day and month in dates of figures, None where it is not stated.
    time : column of the times that is stated, "" for none.
    """

    is_known: Callable[[str], bool] = lambda _: False
    date_order: DateOrder | None = None
    time: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class Column:
    """A column.

    Attributes
    ----------
    name : without the name of its group.
    unit : as the file states it, None where it states none.
    full : name with the group's ahead, unique in the file.
    group : groups that it is in, the outermost first.
    heading : as it stands in the file, for messages.
    dated : what to say of its dates and times, which are read as seconds; "" where it holds none.
    place : number of its frame, and its own in it, in a table.
    rows : number of rows of a column that is read by slices of rows; None of one value for all rows.
    read : returns the values of a slice of rows.
    clock : what its times are, and returns them [s] of a slice; None where a column of times is needed.
    """

    name: str
    unit: str | None = None
    full: str = ""
    group: tuple[str, ...] = ()
    heading: str = ""
    dated: str = ""
    place: tuple[int, int] = (0, 0)
    rows: int | None = None
    read: Callable[[slice], Any] = lambda _: ()
    clock: tuple[Hashable, Callable[[slice], Any]] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "full", self.full or "/".join((*self.group, self.name)))
        object.__setattr__(self, "heading", self.heading or self.full)


Piece = tuple[IntArray, list[FloatArray], int]
"""Successive rows of some columns: (n,) rows or lines of the file, (n,) values each, the position reached."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """Columns that have their rows in common.

    Attributes
    ----------
    columns : with the times that the format states itself, if it does, ahead.
    pieces : yields the rows of some columns, by index, from a row on; of a text, whose rows are not known, all.
    rows : number of rows, None where it is known at the end alone.
    length : position at the end.
    has_clock : whether the first column is times [s] that the format states itself.
    counted : what places are, "row", or "line" of a text.
    """

    columns: tuple[Column, ...]
    pieces: Callable[[Sequence[int], int], Iterator[Piece]]
    rows: int | None = None
    length: int = 0
    has_clock: bool = False
    counted: str = "row"

    @property
    def times(self) -> list[int]:
        """Columns of times, by index: the format's own, or columns with the first of the known names."""
        if self.has_clock:
            return [0]
        names = [column.name for column in self.columns]
        chosen = times_among(names)
        return [i for i, name in enumerate(names) if name in chosen]


@dataclass(frozen=True, eq=False)
class Table:
    """A recording: its frames, and lines for the user, some of which are known when the rows have been read."""

    path: Path
    frames: tuple[Frame, ...]
    remarks: list[str] = field(default_factory=list)

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """All columns, without times that a format states itself."""
        return tuple(
            replace(column, place=(number, i))
            for number, frame in enumerate(self.frames)
            for i, column in enumerate(frame.columns)
            if i or not frame.has_clock
        )

    @cached_property
    def names(self) -> list[str]:
        """Full names of the columns."""
        return [column.full for column in self.columns]


def table_of(path: Path, columns: Sequence[Column], reading: Reading, remarks: Sequence[str] = ()) -> Table:
    """Return a table of columns that are read by slices: those with the same rows and times are a frame.

    The times of a column are its own, else the column of times of as many rows in its group or the nearest one
    around it, else the only one of as many rows. A column that is ``reading.time`` replaces all these.
    """
    series = [column for column in columns if column.rows is not None]
    names = [column.full for column in series]
    stated = matched(path, "column of times", reading.time, names) if reading.time else None
    if stated is not None:
        series = [replace(column, clock=None) for column in series]
        times = [column for column in series if column.full == stated]
    else:
        named = times_among(column.name for column in series if column.clock is None)
        times = [column for column in series if column.clock is None and column.name in named]
    constants = [column for column in columns if column.rows is None]
    groups: dict[Hashable, list[Column]] = {}
    for column in series:
        times_of = _times_of(column, times)
        if column.rows == 1 and column.clock is None and not times_of:
            # One value without a time of its own counts for all rows.
            constants.append(replace(column, rows=None))
            continue
        clock: Hashable = tuple(map(id, times_of)) if column.clock is None else ("own", column.clock[0])
        groups.setdefault((column.rows, clock), []).append(column)
    largest = max(groups.values(), key=len, default=[])
    frames, starts = [], list[np.datetime64]()
    for members in groups.values():
        more = [time for time in _times_of(members[0], times) if time not in members]
        frames.append(_frame(path, [*members, *(constants if members is largest else ()), *more], starts))
    return Table(path, tuple(frames), list(remarks))


def _times_of(column: Column, times: Sequence[Column]) -> list[Column]:
    """Return the columns of times that a column may have: those nearest to its group, of as many rows."""
    alike = [time for time in times if time.rows == column.rows]
    around = [time for time in alike if time.group == column.group[: len(time.group)]]
    deepest = max((len(time.group) for time in around), default=-1)
    return [time for time in around if len(time.group) == deepest] or alike


def _frame(path: Path, columns: Sequence[Column], starts: list[np.datetime64]) -> Frame:
    """Return the frame of columns with the same rows and times."""
    rows, clock = columns[0].rows or 0, columns[0].clock
    if clock is not None:
        columns = [Column(name=TIME, unit="s", rows=rows, read=clock[1]), *columns]

    def pieces(indices: Sequence[int], begin: int = 0) -> Iterator[Piece]:
        if begin and not starts:  # the first date of the file is the beginning of all its times
            for i in indices:
                _values(path, columns[i], slice(0, min(PIECE_ROWS, rows)), starts)
        for first in range(begin, rows, PIECE_ROWS):
            part = slice(first, min(first + PIECE_ROWS, rows))
            values = [_values(path, columns[i], part, starts) for i in indices]
            yield np.arange(part.start + 1, part.stop + 1), values, part.stop

    return Frame(columns=tuple(columns), pieces=pieces, rows=rows, length=rows, has_clock=clock is not None)


def as_numbers(path: Path, column: Column, values: Any, starts: list[np.datetime64]) -> FloatArray:
    """Return values (n,) of a column as numbers, durations as seconds, dates as seconds since the first, which
    ``starts`` retains: one for all columns of a file.

    Raises
    ------
    InputError
        They are no numbers.
    """
    values = np.asarray(values)
    if values.dtype.kind == "M":
        values = _seconds(values.astype("datetime64[ns]"), starts)
    elif values.dtype.kind == "m":
        values = values / np.timedelta64(1, "s")
    with _refused(f"{path}: column '{column.full}': values that are no numbers"):
        if values.dtype.kind not in "fiubO":
            raise TypeError
        return np.asarray(values, dtype=float)


def _values(path: Path, column: Column, part: slice, starts: list[np.datetime64]) -> FloatArray:
    """Return the values (n,) of a column in a slice of rows; refuse what cannot be read."""
    where = f"{path}: column '{column.full}'"
    with _refused(f"{where}: damaged, cannot be read"):
        read = column.read(part)
    n, values = part.stop - part.start, as_numbers(path, column, read, starts)
    if column.rows is None and values.size == 1:
        return np.full(n, values.ravel()[0])
    if values.shape != (n,):
        raise InputError(f"{where}: expected one number a row, got {values.shape}")
    return values


def _seconds(stamps: Any, starts: list[np.datetime64]) -> FloatArray:
    """Return (n,) seconds since the first of dates and times, NaN where there is none."""
    known = ~np.isnat(stamps)
    if known.any() and not starts:
        starts.append(stamps[known][0])
    if not known.any():
        return np.full(len(stamps), np.nan)
    return np.where(known, (stamps - starts[0]).astype("timedelta64[ns]").astype(float) * 1e-9, np.nan)


def of_format(path: Path, kind: str) -> AbstractContextManager[None]:
    """Turn every error except this package's own into one line; for what does nothing but read.

    Raises
    ------
    InputError
        The file is damaged, or not ``kind``.
    """
    return _refused(f"{path}: damaged, or not {kind}")


@contextmanager
def _refused(line: str) -> Iterator[None]:
    try:
        yield
    except StrainfmuError:
        raise
    except Exception as error:  # the libraries of the formats raise whatever their parsers do
        raise InputError(line) from error


def matrix_columns(name: str, shape: tuple[int, ...]) -> list[str]:
    """Return the names of the columns of an array (n,), (n, 1), (1, n) or (n, k): 'name', or 'name[1]' ..."""
    if len(shape) == 1 or (len(shape) == 2 and 1 in shape):
        return [name]
    if len(shape) == 2 and shape[1] <= LARGEST_MATRIX:
        return [f"{name}[{k}]" for k in range(1, shape[1] + 1)]
    return []


def constant(value: Any) -> Callable[[slice], Any]:
    """Return what reads one value for all rows."""
    return lambda _: value


def as_seconds(name: str) -> str:
    """Return what to say of a column of dates and times."""
    return f"column '{name}': dates and times, read as seconds since the first"
