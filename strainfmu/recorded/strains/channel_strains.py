"""Recorded strains in the channels of measurement files: MF4, TDMS, MAT and Parquet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.errors import InputError
from strainfmu.recorded.channels.rasters import Channel, on_one_raster
from strainfmu.recorded.columns.column_names import Wanted, columns_to_read, quantity_of
from strainfmu.recorded.columns.columns import plan_columns
from strainfmu.recorded.columns.temperature_columns import sensor_of
from strainfmu.recorded.formats.channel_readers import open_channels
from strainfmu.recorded.formats.mdf_file import opened_mdf
from strainfmu.recorded.formats.tdms_file import opened_tdms
from strainfmu.recorded.strains.sample_blocks import StrainFile, column_file


@contextmanager
def mf4_strains(path: Path, wanted: Wanted) -> Iterator[StrainFile]:
    """Open an MF4 file; the rest as :func:`~strainfmu.recorded.strains.strain_files.open_strains`."""
    with opened_mdf(path) as file:
        if (
            all(name.startswith(("CAN_", "t", "T")) for name in file.channels_db)
            and "CAN_DataFrame" in file.channels_db
        ):
            raise InputError(f"{path}: holds CAN frames, and no channels of gauges: use 'strainfmu replay'")
        names = [name for name in file.channels_db if name.lower() not in ("time", "t", "timestamps")]
        read, _ = columns_to_read(path, names, wanted)
        signals = {}
        for name in (names[column] for column in read):
            if len(file.channels_db[name]) > 1:
                raise InputError(f"{path}: expected one channel '{name}', got {len(file.channels_db[name])}")
            signals[name] = file.get(name)
        if not signals:
            raise InputError(f"{path}: no channel of a gauge found, it holds {', '.join(names[:6])}")
        channels = {name: _channel(path, name, signal) for name, signal in signals.items()}
        strains = [
            name
            for name in channels
            if quantity_of(name, wanted.readings) not in wanted.flow and sensor_of(name, wanted.sensors) is None
        ]
        merged = on_one_raster(path, channels, strains)
        columns: dict[str, Any] = {"time": merged.time, **dict.fromkeys(names), **merged.values}
        units: dict[str, str | None] = {"time": "s", **{name: signal.unit for name, signal in signals.items()}}
        yield column_file(path, columns, units=units, wanted=wanted, notes=merged.notes)


def _channel(path: Path, name: str, signal: Any) -> Channel:
    """Return the numbers of a channel of asammdf."""
    try:
        return Channel(np.asarray(signal.timestamps, dtype=float), np.asarray(signal.samples, dtype=float))
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: channel '{name}': values that are no numbers") from error


@contextmanager
def channel_strains(path: Path, wanted: Wanted) -> Iterator[StrainFile]:
    """Open a MAT or Parquet file, whose channels share one channel of time."""
    with open_channels(path) as file:
        times = file.time_channels()
        plan = plan_columns(path, file.names, wanted, units=[file.units.get(name) for name in file.names])
        read = [file.names[column] for column in plan.columns]
        columns: dict[str, Any] = {name: file.numbers(name) if name in read else None for name in file.names}
        units: dict[str, str | None] = {name: file.units.get(name) for name in file.names}
        units |= dict.fromkeys(file.notes, "s")
        notes = tuple(file.notes[name] for name in times if name in file.notes)
        yield column_file(path, columns, units=units, wanted=wanted, notes=notes)


@contextmanager
def tdms_strains(path: Path, wanted: Wanted) -> Iterator[StrainFile]:
    """Open a TDMS file; the rest as :func:`~strainfmu.recorded.strains.strain_files.open_strains`."""
    with opened_tdms(path) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        columns: dict[str, Any] = {}
        units: dict[str, str | None] = {}
        for channel in channels:
            if channel.name in columns:
                raise InputError(f"{path}: expected one channel '{channel.name}', got two")
            columns[channel.name] = channel
            units[channel.name] = channel.properties.get("unit_string") or None
        if not any(name.lower() == "time" for name in columns):
            step = next((c.properties["wf_increment"] for c in channels if "wf_increment" in c.properties), None)
            if step is None:
                raise InputError(f"{path}: neither a channel 'time' nor the property 'wf_increment' found")
            columns["time"] = float(step) * np.arange(len(channels[0]))
            units["time"] = "s"
        yield column_file(path, columns, units=units, wanted=wanted)
