"""MF4 files as asammdf itself writes them: channels of several rasters, and logs of a CAN bus."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.can.frame import Frame

_FRAME = np.dtype(
    [
        ("CAN_DataFrame.BusChannel", "<u1"),
        ("CAN_DataFrame.ID", "<u4"),
        ("CAN_DataFrame.IDE", "<u1"),
        ("CAN_DataFrame.DLC", "<u1"),
        ("CAN_DataFrame.DataLength", "<u1"),
        ("CAN_DataFrame.DataBytes", "(64,)u1"),
        ("CAN_DataFrame.Dir", "<u1"),
        ("CAN_DataFrame.EDL", "<u1"),
        ("CAN_DataFrame.BRS", "<u1"),
    ]
)


def write_channels(path: Path, groups: Sequence[tuple[np.ndarray, Mapping[str, np.ndarray]]], units: Any) -> Path:
    """Write one channel group per raster: (n,) times [s] and (n,) values by channel; ``units`` by channel."""
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        for time, channels in groups:
            file.append([Signal(v, time, name=name, unit=units[name]) for name, v in channels.items()])
        file.save(path)
    return path


def write_bus_log(path: Path, frames: Sequence[tuple[Frame, bool]], is_marked: bool = True) -> Path:
    """Write frames and whether they were received; their times are seconds since 1970.

    ``is_marked`` False leaves out that the channel group holds events of a bus.
    """
    from asammdf import MDF, Signal
    from asammdf.blocks.source_utils import Source

    records = np.zeros(len(frames), dtype=_FRAME)
    for record, (frame, is_received) in zip(records, frames, strict=True):
        record["CAN_DataFrame.ID"], record["CAN_DataFrame.IDE"] = frame.identifier, frame.is_extended
        record["CAN_DataFrame.DataLength"] = record["CAN_DataFrame.DLC"] = len(frame.data)
        record["CAN_DataFrame.DataBytes"][: len(frame.data)] = np.frombuffer(frame.data, dtype=np.uint8)
        record["CAN_DataFrame.Dir"] = not is_received
        record["CAN_DataFrame.EDL"], record["CAN_DataFrame.BRS"] = frame.is_fd, frame.bitrate_switch
    start = np.floor(frames[0][0].time)
    times = np.array([frame.time - start for frame, _ in frames])
    source = Source("bus", "bus", "", Source.SOURCE_BUS, Source.BUS_TYPE_CAN) if is_marked else None
    with MDF(version="4.10") as file:
        file.start_time = datetime.fromtimestamp(start)
        file.append(Signal(records, times, name="CAN_DataFrame", source=source))
        file.save(path)
    return path
