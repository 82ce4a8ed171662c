"""Channels of several rasters on one, that of most gauges; others are interpolated between their samples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

LONGEST_GAP = 2.5
"""Longest gap that is interpolated, in periods of the channel's own raster."""

_SAME = 1e-3
"""Distance from a sample, in periods, that is none."""


@dataclass(frozen=True, eq=False)
class Channel:
    """One channel: (n,) times [s] and (n,) values."""

    time: FloatArray
    values: FloatArray

    @property
    def period(self) -> float:
        """Median time from one sample to the next [s], NaN with fewer than two."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else float("nan")


@dataclass(frozen=True, eq=False)
class OneRaster:
    """Channels with common times: (n,) times [s], (n,) values by channel, lines for the user."""

    time: FloatArray
    values: dict[str, FloatArray]
    notes: tuple[str, ...] = ()


def on_one_raster(path: Path, channels: Mapping[str, Channel], gauges: Collection[str]) -> OneRaster:
    """Return ``channels`` on the raster that most of ``gauges`` have; of two the one with fewer samples.

    Others are interpolated linearly between their neighbouring samples. Ahead of their first sample, behind their
    last and in gaps of more than LONGEST_GAP periods they are NaN: nothing is held and nothing extrapolated.

    Raises
    ------
    InputError
        The times of a channel do not increase, or a channel has no raster of its own.
    """
    for name, channel in channels.items():
        _check(path, name, channel)
    base = _base(channels, [name for name in channels if name in gauges] or list(channels))
    time = channels[base].time
    values, others = dict[str, FloatArray](), dict[float, list[str]]()
    for name, channel in channels.items():
        if _is_same(channel.time, time, channels[base].period):
            values[name] = channel.values
            continue
        if len(channel.time) < 2:
            raise InputError(f"{path}: channel '{name}': expected two samples or more, got {len(channel.time)}")
        values[name] = _interpolated(channel, time)
        others.setdefault(round(channel.period, 9), []).append(name)
    period = 1e3 * channels[base].period
    notes = tuple(
        f"{path}: {len(names)} channels of {1e3 * own:.6g} ms ('{names[0]}'{', ..' if names[1:] else ''})"
        f" interpolated at the samples of '{base}', every {period:.6g} ms"
        for own, names in others.items()
    )
    return OneRaster(time, values, notes)


def _check(path: Path, name: str, channel: Channel) -> None:
    """Refuse times that do not increase."""
    if not np.isfinite(channel.time).all() or (np.diff(channel.time) <= 0.0).any():
        raise InputError(f"{path}: channel '{name}': expected finite times that increase")


def _base(channels: Mapping[str, Channel], candidates: list[str]) -> str:
    """Return the first of the candidates whose raster most of them have."""
    rasters = [(channels[name].time.tobytes(), len(channels[name].time)) for name in candidates]
    counts = Counter(rasters)
    best = max(counts, key=lambda raster: (counts[raster], -raster[1]))
    return candidates[rasters.index(best)]


def _is_same(time: FloatArray, other: FloatArray, period: float) -> bool:
    """Return whether two rasters are one, but for rounding."""
    if len(time) != len(other):
        return False
    return bool(np.array_equal(time, other) or (np.abs(time - other) <= _SAME * period).all())


def _interpolated(channel: Channel, at: FloatArray) -> FloatArray:
    """Return (m,) values at the (m,) times [s]; NaN where no neighbours are near enough."""
    time, values = channel.time, channel.values
    left = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    gap = time[left + 1] - time[left]
    weight = (at - time[left]) / gap
    near = _SAME * channel.period / gap
    between = (1.0 - weight) * values[left] + weight * values[left + 1]
    is_inside = (weight > 0.0) & (weight < 1.0) & (gap <= LONGEST_GAP * channel.period)
    found = np.where(is_inside, between, np.nan)
    found = np.where(np.abs(weight) <= near, values[left], found)
    return np.where(np.abs(weight - 1.0) <= near, values[left + 1], found)
