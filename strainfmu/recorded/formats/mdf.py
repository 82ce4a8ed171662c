"""MDF files read with asammdf: a frame for each channel group; a damaged file is one line and no more."""

import gc
import logging
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.errors import InputError, library
from strainfmu.first_look import limited_memory, reads_well
from strainfmu.recorded.table import Column, Reading, Table, table_of

MAGIC = (b"MDF ", b"UnFinMF ")

_VIRTUAL = (3, 6)
"""Types of channels without a place in the records: virtual master, virtual data."""


def mdf_table(path: Path, reading: Reading, stack: ExitStack) -> Table:
    """Open an MDF file. A name that several groups have gets the group ahead: 'group[2]/name'.

    Of a file that ends early the whole rows are read.

    Raises
    ------
    InputError
        As :func:`opened_mdf`, or the file holds frames of a bus alone.
    """
    file = stack.enter_context(opened_mdf(path))
    places = file.channels_db
    if "CAN_DataFrame" in places and all(name.startswith(("CAN_", "t", "T")) for name in places):
        raise InputError(f"{path}: holds CAN frames, and no channels of gauges: use 'strainfmu replay'")
    remarks: list[str] = []
    for group in file.groups:
        _check_places(path, group)
    rows = [_rows(file, group, path, remarks) for group in range(len(file.groups))]
    columns = []
    for name, channels in places.items():
        channels = [(group, i) for group, i in channels if i != file.masters_db.get(group)]
        for group, i in channels:
            is_known = reading.is_known(name.rpartition("/")[2])
            unit = file.get_channel_unit(name, group=group, index=i) if is_known else None
            columns.append(
                Column(
                    name=name,
                    unit=str(unit) if unit else None,
                    group=(_group(file, group),) if len(channels) > 1 else (),
                    rows=rows[group],
                    read=partial(_samples, file, group, i),
                    clock=(("group", group), partial(_times, file, group)),
                )
            )
    return table_of(path, columns, reading, remarks)


def _check_places(path: Path, group: Any) -> None:
    """Refuse a channel that reaches beyond its records: asammdf's compiled reader would leave its memory."""
    record = group.channel_group
    bits = 8 * (record.samples_byte_nr + getattr(record, "invalidation_bytes_nr", 0))
    for channel in group.channels:
        if getattr(channel, "channel_type", 0) in _VIRTUAL:
            continue
        if hasattr(channel, "start_offset"):  # versions 2 and 3
            first = channel.start_offset + 8 * getattr(channel, "additional_byte_offset", 0)
        else:
            first = channel.bit_offset + 8 * channel.byte_offset
        if first + channel.bit_count > bits:
            raise InputError(f"{path}: damaged: channel '{channel.name}' reaches beyond its records")


def _group(file: Any, group: int) -> str:
    """Return the name of a channel group, its number from 1 where it has none of its own."""
    names = [str(getattr(candidate.channel_group, "acq_name", "") or "").strip() for candidate in file.groups]
    return names[group] if names[group] and names.count(names[group]) == 1 else f"group[{group + 1}]"


def _rows(file: Any, group: int, path: Path, remarks: list[str]) -> int:
    """Return the number of whole rows of a channel group; a remark says how many are missing."""
    stated = int(file.groups[group].channel_group.cycles_nr)
    if not stated:
        return 0
    try:
        if len(_times(file, group, slice(stated - 1, stated))) == 1:
            return stated
    except ValueError:
        pass
    rows = len(file.get_master(group))
    if rows < stated:
        remarks.append(f"{path}: ends early: {rows} of {stated} rows of {_group(file, group)} are read")
    return rows


def _times(file: Any, group: int, rows: slice) -> Any:
    return file.get_master(group, record_offset=rows.start, record_count=rows.stop - rows.start)


def _samples(file: Any, group: int, channel: int, rows: slice) -> Any:
    """Return the samples of a channel, NaN for those that the file calls invalid."""
    values, invalid = file.get(
        group=group,
        index=channel,
        samples_only=True,
        ignore_invalidation_bits=True,  # which are returned; otherwise these rows are missing
        record_offset=rows.start,
        record_count=rows.stop - rows.start,
    )
    if invalid is not None and values.dtype.kind in "fiub" and np.any(invalid):
        return np.where(np.asarray(invalid, dtype=bool), np.nan, values)
    return values


@contextmanager
def opened_mdf(path: Path) -> Iterator[Any]:
    """Open an MDF file; yield asammdf's object.

    Raises
    ------
    InputError
        The file is missing or damaged.
    StrainfmuError
        asammdf is not installed.
    """
    mdf = library("asammdf", "asammdf", "mf4").MDF
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    file = None
    if reads_well(path, lambda: mdf(str(path)).close()):
        with limited_memory(path):
            file = _opened(mdf, path)
    if file is None:
        kind = "MF4" if path.suffix.lower() == ".mf4" else "MDF"
        raise InputError(f"{path}: damaged, or not an {kind} file")
    with file:
        yield file


def _opened(mdf: Any, path: Path) -> Any:
    """Return asammdf's object, None if it cannot read the file.

    An object that was made in part fails in its destructor as well, which Python reports on standard error, as
    asammdf's log does what is damaged.
    """
    hook, log = sys.unraisablehook, logging.getLogger("asammdf")
    sys.unraisablehook, log.disabled = lambda _: None, True
    try:
        try:
            return mdf(str(path))
        except Exception:  # asammdf raises whatever its parsers do
            pass
        gc.collect()
        return None
    finally:
        sys.unraisablehook, log.disabled = hook, False
