"""The times of a recording's channels: their own, the times of a channel of time, or times by a rate."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.recorded.formats.channel_file import ChannelFile
from strainfmu.recorded.formats.name_match import matched, suggestion
from strainfmu.units import TIME_UNITS


class ChannelClock:
    """Times of the channels of a file.

    Parameters
    ----------
    stated : file that states the channel of time, its unit or a rate; None where nothing is stated.
    channel : of the times, None for the one of a channel's group, or the only one.
    unit : of it, None for the recording's.
    rate : samples per second of a recording without times [Hz], None if it has them.
    ahead : samples of the recording ahead of the samples of the file, which is a piece of it.
    """

    def __init__(
        self,
        file: ChannelFile,
        stated: Path | None = None,
        *,
        channel: str | None = None,
        unit: str | None = None,
        rate: float | None = None,
        ahead: int = 0,
    ) -> None:
        self._file, self._stated, self._ahead = file, stated, ahead
        self._channel, self._unit, self._rate = channel, unit, rate
        self._times: dict[str, FloatArray] = {}

    @property
    def used(self) -> tuple[str, ...]:
        """Channels of time that were read."""
        return tuple(self._times)

    @property
    def notes(self) -> list[str]:
        """Lines on channels of dates and times that were read."""
        return [self._file.notes[name] for name in self._times if name in self._file.notes]

    def of(self, name: str, n: int) -> FloatArray:
        """Return (n,) times [s] of a channel of n samples, one array for all channels with the same times.

        Raises
        ------
        InputError
            There are no times, or not n.
        """
        own = None if self._channel is not None else self._file.clock(name)
        if own is None and self._rate is not None:
            return np.arange(self._ahead, self._ahead + n) / self._rate
        time = self._time(self._name(name)) if own is None else own
        if len(time) != n:
            raise InputError(
                f"{self._file.path}: channel '{name}': expected {len(time)} values, as many as times, got {n}"
            )
        return time

    def _time(self, name: str) -> FloatArray:
        """Return a channel of time [s], read once."""
        if name not in self._times:
            file = self._file
            unit = self._unit or file.units.get(name) or "s"
            if unit not in TIME_UNITS:
                raise InputError(
                    f"{file.path}: channel '{name}': unit: expected one of {', '.join(TIME_UNITS)}, got '{unit}'"
                )
            values = file.numbers(name)
            wrong = np.flatnonzero(~np.isfinite(values))
            if len(wrong):
                raise InputError(
                    f"{file.path}: channel '{name}', {file.place(int(wrong[0]))}: expected a time, got none"
                )
            time = values * (1.0 if name in file.notes else TIME_UNITS[unit])
            back = np.flatnonzero(np.diff(time) <= 0.0)
            if len(back):
                raise InputError(
                    f"{file.path}: channel '{name}', {file.place(int(back[0]) + 1)}: expected increasing times, "
                    f"got {time[back[0] + 1]:.9g} s after {time[back[0]]:.9g} s"
                )
            self._times[name] = time
        return self._times[name]

    def _name(self, channel: str) -> str:
        """Return the channel of time for a channel: the stated one, the one of its group, or the only one."""
        file = self._file
        if self._channel is not None:
            name = matched(file.path, "channel of time", self._channel, file.names)
            if name is None:
                near = suggestion(self._channel, file.names)
                raise InputError(
                    f"{file.path}: no channel '{self._channel}' of {self._stated}: time.channel, {near}"
                )
            return name
        own = file.time_of(channel)
        if own is not None:
            return own
        held = file.time_channels()
        if len(held) != 1:
            got = " and ".join(f"'{name}'" for name in held) or "none"
            way = (
                f"state [time] channel or rate_hz in {self._stated}" if self._stated else "state it by --channels"
            )
            raise InputError(f"{file.path}: channel of time: expected one, got {got}; {way}")
        return held[0]
