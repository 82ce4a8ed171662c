"""Readings of a window in few numbers: means of stretches of equal length, which tell noise from drift.

A window of n readings falls into stretches of L = 2^k readings each, so that 16 to 31 of them are whole; an even
number of those counts. What does not fill them joins the mean and the scatter alone. So a longer window needs no
more room: :class:`ReadingWindow` takes readings one by one, :func:`window_statistics` all at once.

Numbers are about the first reading of each gauge: zeros are up to 10^5 times the noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray

LEAST_STRETCHES = 16
"""Number of whole stretches of a window at least; below twice as many."""

LEAST_PART = 0.9
"""Part of a window in which a gauge must read."""

_TABLES = ("first", "square", "total", "count")
"""Arrays of :class:`ReadingWindow`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WindowStatistics:
    """What a window of readings tells of n_d gauges.

    Attributes
    ----------
    samples : number n of readings.
    reads : (n_d,) whether a gauge read in :data:`LEAST_PART` of them; the rest is 0 for those that did not.
    mean : (n_d,) [m/m].
    scatter : (n_d,) standard deviation of one reading [m/m].
    stretch : (b, n_d) means of stretches less the first reading [m/m].
    length : readings of each of them.
    """

    samples: int
    reads: BoolArray
    mean: FloatArray
    scatter: FloatArray
    stretch: FloatArray
    length: int


@dataclass(kw_only=True, eq=False)
class ReadingWindow:
    """Readings of ``n_gauges`` gauges, taken one by one.

    Attributes
    ----------
    samples, length, stretches, filled : readings; those of a stretch; whole stretches; readings of the next one.
    first : (n_d,) first reading of each gauge, 0 before it [m/m].
    square : (n_d,) sum of squares of the readings less the first.
    total, count : (32, n_d) sums of the same and numbers of readings of each stretch.
    """

    n_gauges: int
    samples: int = 0
    length: int = 1
    stretches: int = 0
    filled: int = 0
    first: FloatArray = field(init=False)
    square: FloatArray = field(init=False)
    total: FloatArray = field(init=False)
    count: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.first, self.square = np.zeros(self.n_gauges), np.zeros(self.n_gauges)
        self.total, self.count = (np.zeros((2 * LEAST_STRETCHES, self.n_gauges)) for _ in range(2))

    def add(self, strain: FloatArray) -> None:
        """Take the readings (n_d,) [m/m] of one time, NaN where there is none."""
        known = np.isfinite(strain)
        begins = known & ~self.count.any(axis=0)
        self.first[begins] = strain[begins]
        part = np.where(known, strain - self.first, 0.0)
        self.square += part * part
        self.total[self.stretches] += part
        self.count[self.stretches] += known
        self.samples += 1
        self.filled += 1
        if self.filled == self.length:
            self.filled = 0
            self.stretches += 1
            if self.stretches == 2 * LEAST_STRETCHES:
                self._join_stretches()

    def _join_stretches(self) -> None:
        for table in (self.total, self.count):
            table[:LEAST_STRETCHES] = table[0::2] + table[1::2]
            table[LEAST_STRETCHES:] = 0.0
        self.length *= 2
        self.stretches = LEAST_STRETCHES

    def saved(self) -> dict[str, list[Any]]:
        """Return all of it as numbers and lists, for :meth:`restore`."""
        return {
            "counts": [self.samples, self.length, self.stretches, self.filled],
            **{name: getattr(self, name).tolist() for name in _TABLES},
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from what :meth:`saved` gave.

        Raises
        ------
        KeyError, TypeError, ValueError
            It is of another number of gauges, or no window.
        """
        counts = [int(one) for one in saved["counts"]]
        tables = [np.array(saved[name], dtype=float).reshape(getattr(self, name).shape) for name in _TABLES]
        samples, length, stretches, filled = counts
        fits = samples == stretches * length + filled and 0 <= filled < length
        if not (fits and 0 <= stretches < 2 * LEAST_STRETCHES):
            raise ValueError(f"no window: {samples} readings, {stretches} stretches of {length}")
        self.samples, self.length, self.stretches, self.filled = counts
        for name, table in zip(_TABLES, tables, strict=True):
            setattr(self, name, table)

    def statistics(self) -> WindowStatistics:
        """Return what the readings tell; at least 16 of them."""
        return _statistics(self, self.stretches & ~1)


def window_statistics(strain: FloatArray) -> WindowStatistics:
    """Return what the readings (n, n_d) [m/m] tell, NaN where there is none; at least 16 of them."""
    n, n_d = strain.shape
    length = 1
    while n // length >= 2 * LEAST_STRETCHES:
        length *= 2
    whole = n // length
    known = np.isfinite(strain)
    window = ReadingWindow(n_gauges=n_d, samples=n, length=length, stretches=whole, filled=n - whole * length)
    window.first = np.where(known.any(axis=0), strain[np.argmax(known, axis=0), np.arange(n_d)], 0.0)
    part = np.where(known, strain - window.first, 0.0)
    window.square = np.sum(part * part, axis=0)
    for table, values in ((window.total, part), (window.count, known)):
        table[:whole] = values[: whole * length].reshape(whole, length, n_d).sum(axis=1)
        table[whole] = values[whole * length :].sum(axis=0)
    return _statistics(window, whole & ~1)


def _statistics(window: ReadingWindow, used: int) -> WindowStatistics:
    """Return the statistics by the first ``used`` stretches; readings that are missing count as the mean."""
    n, length = window.samples, window.length
    count, total = window.count.sum(axis=0), window.total.sum(axis=0)
    reads = count >= LEAST_PART * n
    mean = np.where(reads, total / np.maximum(count, 1.0), 0.0)
    square = np.maximum(window.square - mean * total, 0.0)
    stretch = (window.total[:used] + (length - window.count[:used]) * mean) / length
    return WindowStatistics(
        samples=n,
        reads=reads,
        mean=np.where(reads, window.first + mean, 0.0),
        scatter=np.where(reads, np.sqrt(square / (n - 1)), 0.0),
        stretch=np.where(reads, stretch, 0.0),
        length=length,
    )
