"""TDMS files read with npTDMS, in pieces; a damaged one is one line and no more."""

import logging
from collections.abc import Hashable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.errors import library
from strainfmu.recorded.names import time_rank
from strainfmu.recorded.table import Column, Reading, Table, as_seconds, table_of


def tdms_table(path: Path, reading: Reading, stack: ExitStack) -> Table:
    """Open a TDMS file; times of a channel are its group's column of times, or the times of its waveform."""
    nptdms = library("nptdms", "npTDMS", "tdms")
    nptdms.log.log_manager.set_level(logging.CRITICAL + 1)  # it warns of a damaged file on standard error
    file = stack.enter_context(nptdms.TdmsFile.open(str(path)))
    channels = [channel for group in file.groups() for channel in group.channels()]
    timed = {(channel.group_name, len(channel)) for channel in channels if time_rank(channel.name) is not None}
    starts = [channel.properties.get("wf_start_time") for channel in channels]
    first = min((start for start in starts if start is not None), default=None)
    columns = []
    for channel in channels:
        is_dated, has_times = channel.dtype.kind == "M", (channel.group_name, len(channel)) in timed
        columns.append(
            Column(
                name=channel.name,
                unit="s" if is_dated else str(channel.properties.get("unit_string") or "") or None,
                group=(channel.group_name,),
                dated=as_seconds(f"{channel.group_name}/{channel.name}") if is_dated else "",
                rows=len(channel),
                read=channel.__getitem__,
                clock=None if has_times else _waveform(channel, first),
            )
        )
    return table_of(path, columns, reading)


def _waveform(channel: Any, first: Any) -> tuple[Hashable, Any] | None:
    """Return the times of a channel by its waveform's start, offset and increment; None without a waveform."""
    if "wf_increment" not in channel.properties:
        return None
    start = channel.properties.get("wf_start_time")
    ahead = 0.0 if start is None else float((start - first) / np.timedelta64(1, "s"))
    offset = ahead + float(channel.properties.get("wf_start_offset", 0.0))
    step = float(channel.properties["wf_increment"])
    return (offset, step), lambda rows: offset + step * np.arange(rows.start, rows.stop)
