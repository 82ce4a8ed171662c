"""Recorded strains in channels that the gauges name: read in pieces, or brought to one raster."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.recorded.channels.rasters import Channel, on_one_raster
from strainfmu.recorded.columns.column_names import Wanted, columns_to_read, is_read, quantity_of
from strainfmu.recorded.columns.columns import StrainBlock, plan_columns
from strainfmu.recorded.columns.temperature_columns import sensor_of
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, Rows
from strainfmu.recorded.formats.registry import open_channels
from strainfmu.recorded.strains.channel_clock import ChannelClock
from strainfmu.recorded.strains.sample_blocks import BLOCK_ROWS, SampleBlocks, StrainFile, column_file


@contextmanager
def channel_strains(path: Path, wanted: Wanted) -> Iterator[StrainFile]:
    """Open a recording; the rest as :func:`~strainfmu.recorded.strains.strain_files.open_strains`."""
    reading = Reading(is_known=lambda name: is_read(name, wanted), date_order=wanted.date_order)
    with open_channels(path, reading) as file:
        yield _of_columns(file, wanted) if file.rows is None else _of_rows(file, wanted)


def _of_rows(file: ChannelFile, wanted: Wanted) -> StrainFile:
    """Return the samples of a text, read in pieces."""
    assert file.rows is not None
    units = {**file.units, **dict.fromkeys(file.notes, "s")}
    headings = file.headings or file.names
    plan = plan_columns(file.path, headings, wanted, units=[units.get(name) for name in file.names])
    plan = replace(plan, counted="line")
    rows = file.rows([file.names[column] for column in plan.columns])
    note = file.notes.get(file.names[plan.time])
    notes = (*file.remarks, *((note,) if note else ()))
    file.remarks.clear()  # what follows is known when the samples have been read
    return StrainFile(file.length, _row_blocks(rows, SampleBlocks(plan, file.remarks)), plan, notes, file.remarks)


def _row_blocks(pieces: Iterator[Rows], samples: SampleBlocks) -> Iterator[tuple[StrainBlock, int]]:
    """Yield blocks of at most BLOCK_ROWS samples."""
    done = 0
    for piece in pieces:
        n = len(piece.lines)
        for first in range(0, n, BLOCK_ROWS):
            rows = slice(first, min(first + BLOCK_ROWS, n))
            yield samples.block(piece.values[rows], piece.lines[rows]), done + (piece.done - done) * rows.stop // n
        done = piece.done
    samples.finish()


def _of_columns(file: ChannelFile, wanted: Wanted) -> StrainFile:
    """Return the samples of channels that are read one by one, channels of several rates on one raster."""
    path, times = file.path, file.time_channels()
    names = [name for name in file.names if name not in times]
    shown = {name: file.own_names.get(name, name) for name in file.names}
    columns, _ = columns_to_read(path, [shown[name] for name in names], wanted)
    read = [names[column] for column in columns]
    if not read:
        raise InputError(f"{path}: no channel of a gauge found, it holds {', '.join(file.names[:6]) or 'none'}")
    for name in read:
        if sum(shown[one] == shown[name] for one in read) > 1:
            raise InputError(f"{path}: expected one channel '{shown[name]}', got two")
    clock = ChannelClock(file)
    values = {name: file.series(name) for name in read}
    at = {name: clock.of(name, len(values[name])) for name in read}
    notes = (*file.remarks, *clock.notes)
    units = {shown[name]: file.units.get(name) for name in names}
    others = dict.fromkeys(shown[name] for name in names if name not in values)
    if len({id(time) for time in at.values()}) == 1:
        time = shown[clock.used[0]] if clock.used else "time"
        held: dict[str, Any] = {time: at[read[0]], **others, **{shown[name]: values[name] for name in read}}
        return column_file(
            path, held, units={**units, time: "s"}, wanted=wanted, notes=(*file.remarks, *clock.notes)
        )
    of_channels = {shown[name]: Channel(at[name], file.numbers(name)) for name in read}
    return _of_rasters(path, of_channels, others, units, wanted, notes)


def _of_rasters(
    path: Path,
    channels: Mapping[str, Channel],
    others: Mapping[str, FloatArray | None],
    units: Mapping[str, str | None],
    wanted: Wanted,
    notes: tuple[str, ...],
) -> StrainFile:
    """Return the samples of channels on the raster of most gauges."""
    strains = [
        name
        for name in channels
        if quantity_of(name, wanted.readings) not in wanted.flow and sensor_of(name, wanted.sensors) is None
    ]
    merged = on_one_raster(path, channels, strains)
    columns = {"time": merged.time, **others, **merged.values}
    return column_file(path, columns, units={**units, "time": "s"}, wanted=wanted, notes=(*notes, *merged.notes))
