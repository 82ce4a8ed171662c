"""TDMS files read with npTDMS, in pieces; a damaged one is one line and no more."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.columns.column_names import TIME_NAMES
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, dated, seconds_of, unique_names
from strainfmu.recorded.formats.name_match import plain_name


@contextmanager
def tdms_channels(path: Path, reading: Reading) -> Iterator[ChannelFile]:
    """Open a TDMS file; times of a channel are its group's channel of time, or the times of its waveform."""
    with opened_tdms(path) as file:
        channels = {f"{group.name}/{one.name}": one for group in file.groups() for one in group.channels()}
        times = {name: one for name, one in channels.items() if plain_name(one.name) in TIME_NAMES}

        def numbers(name: str) -> Any:
            held = channels[name]
            return seconds_of(held[:]) if held.dtype.kind == "M" else held

        def time_of(name: str) -> str | None:
            group = channels[name].group_name
            return next((at for at, time in times.items() if time.group_name == group), None)

        waveforms = _Waveforms(channels)
        yield ChannelFile(
            path=path,
            names=unique_names(path, list(channels)),
            own_names={name: one.name for name, one in channels.items()},
            notes={name: dated(path, name) for name, one in times.items() if one.dtype.kind == "M"},
            units={
                name: u for name, one in channels.items() if (u := str(one.properties.get("unit_string") or ""))
            },
            values=numbers,
            clock=lambda name: None if time_of(name) is not None else waveforms.time(name),
            time_of=time_of,
        )


class _Waveforms:
    """The times of channels by their waveform's properties: start, offset and increment."""

    def __init__(self, channels: dict[str, Any]) -> None:
        self._channels = channels
        held = [one.properties for one in channels.values()]
        self._first = min((one["wf_start_time"] for one in held if "wf_start_time" in one), default=None)
        self._made: dict[tuple[float, float, int], FloatArray] = {}

    def time(self, name: str) -> FloatArray | None:
        """Return (n,) times [s] of a channel, one array for all that have the same; None without a waveform."""
        channel = self._channels[name]
        if "wf_increment" not in channel.properties:
            return None
        start = channel.properties.get("wf_start_time")
        ahead = 0.0 if start is None else float((start - self._first) / np.timedelta64(1, "s"))
        offset = ahead + float(channel.properties.get("wf_start_offset", 0.0))
        key = (offset, float(channel.properties["wf_increment"]), len(channel))
        if key not in self._made:
            self._made[key] = np.asarray(offset + key[1] * np.arange(key[2]))
        return self._made[key]


@contextmanager
def opened_tdms(path: Path) -> Iterator[Any]:
    """Open a TDMS file; yield npTDMS's object.

    Raises
    ------
    InputError
        The file is missing or damaged.
    StrainfmuError
        npTDMS is not installed.
    """
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise StrainfmuError("npTDMS is not installed: pip install 'strainfmu[tdms]'") from error
    try:
        file = TdmsFile.open(str(path))
    except Exception as error:  # npTDMS raises whatever its parsers do
        raise InputError(f"{path}: damaged, or not a TDMS file") from error
    with file:
        yield file
