"""Channels of several rasters on the raster of most gauges: interpolated, held, or from the nearest sample."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

LONGEST_GAP = 2.5
"""Longest gap that is interpolated or held over, in periods of the channel's own raster."""

FARTHEST = 0.51
"""Farthest sample that is the nearest one, in periods of the channel's own raster."""

JOINS = {"linear": "interpolated", "hold": "held", "nearest": "taken from the nearest sample"}
"""Rules by which a channel of another raster gets its values, and the word for each."""

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


@dataclass(frozen=True, kw_only=True)
class Join:
    """A rule of JOINS, and its limit [s].

    The limit applies to the gap between two samples ("linear"), to the time since the last sample ("hold"), or to
    the time to the sample before or behind ("nearest"); None for LONGEST_GAP or FARTHEST periods of the channel.
    """

    rule: str = "linear"
    limit: float | None = None


@dataclass(frozen=True, eq=False)
class OneRaster:
    """Channels with common times: (n,) times [s], (n,) values by channel, lines for the user."""

    time: FloatArray
    values: dict[str, FloatArray]
    notes: tuple[str, ...] = ()


def on_one_raster(
    path: Path,
    channels: Mapping[str, Channel],
    gauges: Collection[str],
    join: Join | None = None,
    raster: str | None = None,
) -> OneRaster:
    """Return ``channels`` on the raster of ``raster``, or that most of ``gauges`` have, of two the slower one.

    Others get their values by the rule of ``join``, by default linear interpolation between their neighbouring
    samples. Ahead of their first sample and in gaps longer than its limit they are NaN, and behind their last
    unless that is held: a gap remains a gap.

    Raises
    ------
    InputError
        The times of a channel do not increase, or a channel has no raster of its own.
    """
    for name, channel in channels.items():
        _check(path, name, channel)
    join = join or Join()
    base = raster or _base(channels, [name for name in channels if name in gauges] or list(channels))
    time = channels[base].time
    values, others = dict[str, FloatArray](), dict[float, list[str]]()
    for name, channel in channels.items():
        if _is_same(channel.time, time, channels[base].period):
            values[name] = channel.values
            continue
        if len(channel.time) < 2:
            raise InputError(f"{path}: channel '{name}': expected two samples or more, got {len(channel.time)}")
        values[name] = _joined(channel, time, join)
        others.setdefault(round(channel.period, 9), []).append(name)
    period = 1e3 * channels[base].period
    notes = tuple(
        f"{path}: {len(names)} channels of {1e3 * own:.6g} ms ('{names[0]}'{', ..' if names[1:] else ''})"
        f" {JOINS[join.rule]} at the samples of '{base}', every {period:.6g} ms"
        for own, names in others.items()
    )
    return OneRaster(time, values, notes)


def _check(path: Path, name: str, channel: Channel) -> None:
    """Refuse times that do not increase."""
    wrong = np.flatnonzero(~(np.diff(channel.time, prepend=-np.inf) > 0.0) | ~np.isfinite(channel.time))
    if len(wrong):
        raise InputError(
            f"{path}: channel '{name}', sample {wrong[0] + 1}: expected finite times that increase, "
            f"got {channel.time[wrong[0]]:.9g} s"
        )


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


def _joined(channel: Channel, at: FloatArray, join: Join) -> FloatArray:
    """Return (m,) values at the (m,) times [s] by a rule; NaN where no sample is near enough."""
    if join.rule == "linear":
        return _interpolated(channel, at, LONGEST_GAP * channel.period if join.limit is None else join.limit)
    time = channel.time
    last = np.searchsorted(time, at + _SAME * channel.period, side="right") - 1
    taken = np.maximum(last, 0)
    if join.rule == "nearest":
        following = np.minimum(last + 1, len(time) - 1)
        taken = np.where(np.abs(time[following] - at) < np.abs(at - time[taken]), following, taken)
        last = taken
    periods = FARTHEST if join.rule == "nearest" else LONGEST_GAP
    limit = (periods * channel.period if join.limit is None else join.limit) + _SAME * channel.period
    is_near = (last >= 0) & (np.abs(at - time[taken]) <= limit)
    return np.where(is_near, channel.values[taken], np.nan)


def _interpolated(channel: Channel, at: FloatArray, limit: float) -> FloatArray:
    """Return (m,) values at the (m,) times [s]; NaN where the neighbours are more than ``limit`` [s] apart."""
    time, values = channel.time, channel.values
    left = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    gap = time[left + 1] - time[left]
    weight = (at - time[left]) / gap
    near = _SAME * channel.period / gap
    between = (1.0 - weight) * values[left] + weight * values[left + 1]
    is_inside = (weight > 0.0) & (weight < 1.0) & (gap <= limit)
    found = np.where(is_inside, between, np.nan)
    found = np.where(np.abs(weight) <= near, values[left], found)
    return np.where(np.abs(weight - 1.0) <= near, values[left + 1], found)
