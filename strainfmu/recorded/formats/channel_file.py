"""A recording as a set of channels, whatever its format: names, units, values, and the times of each channel."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.columns.column_names import TIME_NAMES, DateOrder
from strainfmu.recorded.formats.name_match import plain_name

LARGEST_MATRIX = 4096
"""Columns of a matrix that are offered as channels."""


@dataclass(frozen=True, kw_only=True)
class Reading:
    """What a reader of a format needs to know of the channels.

    Attributes
    ----------
    is_known : whether a name belongs to a channel to be read; texts find their headings by it.
    date_order : of day and month in dates of figures, None where it is not stated.
    """

    is_known: Callable[[str], bool] = lambda _: False
    date_order: DateOrder | None = None


@dataclass(frozen=True, eq=False)
class Rows:
    """Successive samples of some channels of a text: (n,) lines, (n, k) values, and the position reached in it."""

    lines: IntArray
    values: FloatArray
    done: int


@dataclass(frozen=True, eq=False, kw_only=True)
class ChannelFile:
    """An open recording.

    Attributes
    ----------
    names : of all channels; channels of groups behind the group's name and a slash.
    headings : names as they stand in the file, with units, for messages; empty where they are ``names``.
    own_names : names without the group's, of the channels of groups.
    units : of the channels that state one.
    values : returns (n,) values of a channel, or what gives them by slices; an error of numpy's where they are no
        numbers.
    clock : returns (n,) times [s] that a channel has itself, None where a channel of time is needed.
    time_of : returns the channel of time that belongs to a channel, None where there is none of its group.
    notes : lines for the user on channels of dates and times, which ``values`` returns as seconds.
    rows : yields the samples of some channels in pieces; None of a format whose channels are read one by one.
    length : position at the end of ``rows``.
    lines : returns the line of each sample, of a text that has one sample a line.
    remarks : lines for the user; some are known when the samples have been read.
    """

    path: Path
    names: tuple[str, ...]
    headings: tuple[str, ...] = ()
    own_names: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    values: Callable[[str], Any]
    clock: Callable[[str], FloatArray | None] = lambda _: None
    time_of: Callable[[str], str | None] = lambda _: None
    notes: Mapping[str, str] = field(default_factory=dict)
    rows: Callable[[Sequence[str]], Iterator[Rows]] | None = None
    length: int = 0
    lines: Callable[[], IntArray] | None = None
    remarks: list[str] = field(default_factory=list)

    def series(self, name: str) -> Any:
        """Return (n,) values of a channel, or what gives them by slices where the format reads in pieces.

        Raises
        ------
        InputError
            As :meth:`numbers`.
        """
        with self._readable(name):
            found = self.values(name)
        return self.numbers(name) if isinstance(found, np.ndarray) else found

    def numbers(self, name: str) -> FloatArray:
        """Return (n,) values of a channel.

        Raises
        ------
        InputError
            They are no numbers, or cannot be read.
        """
        with self._readable(name):
            found = np.asarray(self.values(name)[:])
            if found.dtype.kind not in "fiub":
                found = found.astype(float) if found.dtype.kind == "O" else np.array("x").astype(float)
            found = np.asarray(found, dtype=float)
        if found.ndim != 1:
            raise InputError(f"{self.path}: channel '{name}': expected one number a sample, got {found.shape}")
        return found

    def place(self, sample: int) -> str:
        """Return where a sample, counted from 0, stands in the file."""
        return f"sample {sample + 1}" if self.lines is None else f"line {self.lines()[sample]}"

    @contextmanager
    def _readable(self, name: str) -> Iterator[None]:
        try:
            yield
        except (TypeError, ValueError) as error:
            raise InputError(f"{self.path}: channel '{name}': values that are no numbers") from error
        except StrainfmuError:
            raise
        except Exception as error:  # the libraries of the formats raise whatever their parsers do
            raise InputError(f"{self.path}: channel '{name}': damaged, cannot be read") from error

    def time_channels(self) -> list[str]:
        """Return the channels that have a name of times."""
        return [name for name in self.names if last_name(name) in TIME_NAMES]


def last_name(name: str) -> str:
    """Return the plain name behind the groups'."""
    return plain_name(name.replace("\\", "/").rpartition("/")[2].rpartition(".")[2])


def unique_names(path: Path, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names; refuse one that is there twice, as it could be either.

    Raises
    ------
    InputError
        A name is there twice.
    """
    seen = set[str]()
    for name in names:
        if name in seen:
            raise InputError(f"{path}: expected one channel '{name}', got two")
        seen.add(name)
    return tuple(names)


def matrix_columns(name: str, shape: tuple[int, ...]) -> list[str]:
    """Return the names of the channels of an array (n,), (n, 1), (1, n) or (n, k): 'name', or 'name[1]' ..."""
    if len(shape) == 1 or (len(shape) == 2 and 1 in shape):
        return [name]
    if len(shape) == 2 and shape[1] <= LARGEST_MATRIX:
        return [f"{name}[{k}]" for k in range(1, shape[1] + 1)]
    return []


def seconds_of(values: Any) -> FloatArray:
    """Return (n,) seconds since the first of dates and times of numpy, NaN where there is none."""
    stamps = np.asarray(values).astype("datetime64[ns]")
    known = stamps[~np.isnat(stamps)]
    if not len(known):
        return np.full(len(stamps), np.nan)
    seconds = (stamps - known[0]).astype("timedelta64[ns]").astype(float) * 1e-9
    return np.where(np.isnat(stamps), np.nan, seconds)


def dated(path: Path, name: str) -> str:
    """Return what to say of a channel of dates and times."""
    return f"{path}: channel '{name}': dates and times, read as seconds since the first"
