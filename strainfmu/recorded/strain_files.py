"""Readers of recorded strains: CSV, HDF5, MF4 and TDMS as blocks of samples in SI units."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.columns import (
    ColumnPlan,
    StrainBlock,
    plan_columns,
    pressure_factor,
    strain_factor,
    time_factor,
)

BLOCK_ROWS = 2000
"""Samples in one block."""

TABLE_SUFFIXES = (".csv", ".h5", ".hdf5", ".mf4", ".tdms")
_SLASH = "%2F"
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?nan", re.IGNORECASE)
"""What a cell may hold: digits of ASCII and a decimal point, or NaN. float() takes more, as 1_0 for 10."""


@dataclass(frozen=True)
class StrainFile:
    """An open file: its length in ``unit`` for a progress bar, and blocks with how far into it each reaches."""

    length: int
    blocks: Iterator[tuple[StrainBlock, int]]


@contextmanager
def open_strains(
    path: Path, gauge_names: Sequence[str], dynamic_pressure: float | None = None
) -> Iterator[StrainFile]:
    """Open recorded strains for reading block by block.

    Parameters
    ----------
    gauge_names : n_d names, the order of the strains in the blocks.
    dynamic_pressure : q_inf of the whole file [Pa], None to take it from the file.

    Raises
    ------
    InputError
        The file is missing, damaged or of another kind, holds no sample, or a column, a unit, a shape or a number
        is wrong.
    StrainfmuError
        The reader of its kind is not installed.
    """
    readers = {".csv": _csv, ".h5": _hdf5, ".hdf5": _hdf5, ".mf4": _mf4, ".tdms": _tdms}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: '{path.suffix}' found, one of {', '.join(TABLE_SUFFIXES)} wanted")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with reader(path, tuple(gauge_names), dynamic_pressure) as opened:
        yield StrainFile(opened.length, _not_empty(path, opened.blocks))


def _not_empty(path: Path, blocks: Iterator[tuple[StrainBlock, int]]) -> Iterator[tuple[StrainBlock, int]]:
    """Give ``blocks`` on; refuse a file without any, which is most often an export that failed."""
    first = next(blocks, None)
    if first is None:
        raise InputError(f"{path}: no samples found")
    yield first
    yield from blocks


# --- CSV -------------------------------------------------------------------------------------------------------


@contextmanager
def _csv(path: Path, gauge_names: tuple[str, ...], fixed: float | None) -> Iterator[StrainFile]:
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        sample = stream.readline()
        delimiter = max(",;\t", key=sample.count)
        headings = next(csv.reader([sample], delimiter=delimiter), [])
        if not headings:
            raise InputError(f"{path}: no headings found in the first line")
        plan = plan_columns(path, headings, gauge_names, fixed)
        yield StrainFile(path.stat().st_size, _csv_blocks(path, stream, delimiter, plan, len(sample)))


def _csv_blocks(
    path: Path, stream: TextIO, delimiter: str, plan: ColumnPlan, done: int
) -> Iterator[tuple[StrainBlock, int]]:
    """Yield blocks; rows are counted as lines of the file are, the headings being the first."""
    line, first, rows = 1, 2, []

    def counted() -> Iterator[str]:
        nonlocal done
        for text in stream:
            done += len(text)
            yield text

    # One row of the block before goes on into the next, so that times are compared across blocks.
    last = -np.inf
    for cells in _rows(path, counted(), delimiter):
        line += 1
        if not cells:
            continue
        rows.append(_numbers(path, cells, plan, line))
        if len(rows) == BLOCK_ROWS:
            block, last = _checked(plan, np.array(rows), first, last)
            yield block, done
            first, rows = line + 1, []
    if rows:
        yield _checked(plan, np.array(rows), first, last)[0], done


def _rows(path: Path, lines: Iterator[str], delimiter: str) -> Iterator[list[str]]:
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        yield from reader
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num + 1}: {error}") from error


def _numbers(path: Path, cells: Sequence[str], plan: ColumnPlan, line: int) -> list[float]:
    """Return the cells in use as numbers; an empty cell is no value."""
    # A cell too many shifts all behind it, as a decimal comma between commas does.
    if max(plan.columns) >= len(cells) or any(cell.strip() for cell in cells[len(plan.names) :]):
        raise InputError(f"{path}: line {line}: {len(cells)} cells found, {len(plan.names)} wanted")
    numbers = []
    for column in plan.columns:
        text = cells[column].strip()
        if text and _NUMBER.fullmatch(text) is None:
            raise InputError(
                f"{path}: line {line}, column '{plan.names[column]}': '{text[:40]}' found, a number wanted"
            )
        numbers.append(float(text) if text else float("nan"))
    return numbers


def _checked(plan: ColumnPlan, table: FloatArray, first_row: int, last: float) -> tuple[StrainBlock, float]:
    """Return a block and its last time; times must go on from ``last`` [s]."""
    block = plan.block(table, first_row)
    if block.time[0] <= last:
        raise InputError(
            f"{plan.path}: column '{plan.names[plan.time]}', row {first_row}: {block.time[0]:.9g} s after "
            f"{last:.9g} s found, increasing times wanted"
        )
    return block, float(block.time[-1])


# --- HDF5 ------------------------------------------------------------------------------------------------------


@contextmanager
def _hdf5(path: Path, gauge_names: tuple[str, ...], fixed: float | None) -> Iterator[StrainFile]:
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise InputError(f"{path}: damaged, or not an HDF5 file") from error
    with file:
        if "signals" in file:
            yield _from_columns(path, *_recorded_columns(path, file), gauge_names, fixed)
            return
        yield _hdf5_arrays(path, file, gauge_names, fixed)


def _recorded_columns(path: Path, file: h5py.File) -> tuple[dict[str, Any], dict[str, str | None]]:
    """Return data sets and units of a recorded system simulation."""
    signals = file["signals"]
    if not isinstance(signals, h5py.Group):
        raise InputError(f"{path}: 'signals': a data set found, a group of them wanted")
    found = {"time": file.get("time"), **{name.replace(_SLASH, "/"): item for name, item in signals.items()}}
    columns = {name: item for name, item in found.items() if _is_column(item)}
    return columns, {name: _unit(path, name, item) for name, item in columns.items()}


def _is_column(item: Any) -> bool:
    return isinstance(item, h5py.Dataset) and item.ndim == 1 and item.dtype.kind in "fiub"


def _hdf5_arrays(path: Path, file: h5py.File, gauge_names: tuple[str, ...], fixed: float | None) -> StrainFile:
    """Read ``strain`` (n, n_d), ``time`` (n,) and ``dynamic_pressure``, a number or (n,)."""
    n_d = len(gauge_names)
    for name in ("strain", "time") if fixed is not None else ("strain", "time", "dynamic_pressure"):
        if not isinstance(file.get(name), h5py.Dataset):
            raise InputError(f"{path}: no data set '{name}' found, it holds {', '.join(file) or 'nothing'}")
        if file[name].dtype.kind not in "fiu":
            raise InputError(f"{path}: data set '{name}': type {file[name].dtype} found, numbers wanted")
    strain, time = file["strain"], file["time"]
    if strain.ndim != 2 or strain.shape[1] != n_d:
        raise InputError(f"{path}: data set 'strain': shape {strain.shape} found, (n, {n_d}) wanted")
    if time.shape != strain.shape[:1]:
        raise InputError(f"{path}: data set 'time': shape {time.shape} found, {strain.shape[:1]} wanted")
    held = None if fixed is not None else file["dynamic_pressure"]
    if held is not None and held.shape not in ((), (1,), time.shape):
        raise InputError(
            f"{path}: data set 'dynamic_pressure': shape {held.shape} found, {time.shape} or one wanted"
        )
    _check_gauge_order(path, file, gauge_names)
    plan = ColumnPlan(
        path,
        ("time", *(f"strain, {gauge}" for gauge in gauge_names), "dynamic_pressure"),
        0,
        time_factor(path, "time", _unit(path, "time", time)),
        tuple(range(1, n_d + 1)),
        np.full(n_d, strain_factor(path, "strain", _unit(path, "strain", strain))),
        None if held is None else n_d + 1,
        1.0 if held is None else pressure_factor(path, "dynamic_pressure", _unit(path, "dynamic_pressure", held)),
        float("nan") if fixed is None else fixed,
    )
    return StrainFile(len(time), _hdf5_blocks(plan, time, strain, held))


def _hdf5_blocks(plan: ColumnPlan, time: Any, strain: Any, held: Any) -> Iterator[tuple[StrainBlock, int]]:
    last = -np.inf
    for first in range(0, len(time), BLOCK_ROWS):
        rows = slice(first, min(first + BLOCK_ROWS, len(time)))
        parts = [np.asarray(time[rows], dtype=float), np.asarray(strain[rows], dtype=float)]
        if held is not None:
            value = held[rows] if held.shape == time.shape else np.ravel(held[()])[0]
            parts.append(np.broadcast_to(np.asarray(value, dtype=float), parts[0].shape))
        block, last = _checked(plan, np.column_stack(parts), first + 1, last)
        yield block, rows.stop


def _check_gauge_order(path: Path, file: h5py.File, gauge_names: tuple[str, ...]) -> None:
    """Where the file names its gauges, hold them against the map's."""
    if "gauge_names" not in file:
        return
    held = file["gauge_names"]
    if not isinstance(held, h5py.Dataset) or held.ndim != 1:
        raise InputError(f"{path}: 'gauge_names': a data set of {len(gauge_names)} names wanted")
    found = [name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name) for name in held[()]]
    if tuple(found) != gauge_names:
        wrong = next((i for i, (a, b) in enumerate(zip(found, gauge_names, strict=False)) if a != b), len(found))
        raise InputError(
            f"{path}: data set 'gauge_names': entry {wrong + 1} is not the map's gauge {wrong + 1}; "
            f"the map's order, from '{gauge_names[0]}' on, wanted"
        )


def _unit(path: Path, name: str, item: Any) -> str | None:
    """Return the attribute ``unit`` of a data set, None if it has none."""
    unit = item.attrs.get("unit")
    if unit is None or isinstance(unit, str):
        return unit
    if isinstance(unit, bytes):
        return unit.decode("utf-8", "replace")
    raise InputError(f"{path}: '{name}': attribute unit: {str(unit)[:40]} found, a text wanted")


# --- measurement files of other makers -------------------------------------------------------------------------


@contextmanager
def _mf4(path: Path, gauge_names: tuple[str, ...], fixed: float | None) -> Iterator[StrainFile]:
    try:
        from asammdf import MDF
    except ImportError as error:
        raise StrainfmuError("asammdf is not installed: pip install 'strainfmu[mf4]'") from error
    try:
        file = MDF(str(path))
    except Exception as error:  # asammdf raises whatever its parsers do
        raise InputError(f"{path}: damaged, or not an MF4 file") from error
    with file:
        names = [name for name in file.channels_db if name.lower() not in ("time", "t", "timestamps")]
        wanted = _wanted(names, gauge_names)
        signals = {}
        for name in wanted:
            if len(file.channels_db[name]) > 1:
                raise InputError(f"{path}: {len(file.channels_db[name])} channels '{name}' found, one wanted")
            signals[name] = file.get(name)
        if not signals:
            raise InputError(f"{path}: no channel of a gauge found, it holds {', '.join(names[:6])}")
        clock = next(iter(signals.values())).timestamps
        for name, signal in signals.items():
            if not np.array_equal(signal.timestamps, clock):
                raise InputError(
                    f"{path}: channel '{name}': other sample times than '{next(iter(signals))}' found"
                )
        columns = {"time": clock, **{name: signal.samples for name, signal in signals.items()}}
        units: dict[str, str | None] = {"time": "s", **{name: signal.unit for name, signal in signals.items()}}
        yield _from_columns(path, columns, units, gauge_names, fixed)


@contextmanager
def _tdms(path: Path, gauge_names: tuple[str, ...], fixed: float | None) -> Iterator[StrainFile]:
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise StrainfmuError("npTDMS is not installed: pip install 'strainfmu[tdms]'") from error
    try:
        file = TdmsFile.open(str(path))
    except Exception as error:  # npTDMS raises whatever its parsers do
        raise InputError(f"{path}: damaged, or not a TDMS file") from error
    with file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        columns: dict[str, Any] = {}
        units: dict[str, str | None] = {}
        for channel in channels:
            if channel.name in columns:
                raise InputError(f"{path}: two channels '{channel.name}' found, one wanted")
            columns[channel.name] = channel
            units[channel.name] = channel.properties.get("unit_string") or None
        if not any(name.lower() == "time" for name in columns):
            step = next((c.properties["wf_increment"] for c in channels if "wf_increment" in c.properties), None)
            if step is None:
                raise InputError(f"{path}: neither a channel 'time' nor the property 'wf_increment' found")
            columns["time"] = float(step) * np.arange(len(channels[0]))
            units["time"] = "s"
        yield _from_columns(path, columns, units, gauge_names, fixed)


def _wanted(names: Sequence[str], gauge_names: tuple[str, ...]) -> list[str]:
    """Return the names that may be of use, so that no other channel is read."""
    ends = {f"strain[{i}]" for i in range(1, len(gauge_names) + 1)} | {"dynamic_pressure"}
    return [name for name in names if name in gauge_names or name.rpartition(".")[2] in ends]


def _from_columns(
    path: Path,
    columns: dict[str, Any],
    units: dict[str, str | None],
    gauge_names: tuple[str, ...],
    fixed: float | None,
) -> StrainFile:
    """Read columns that a library gives one by one; all have the same length."""
    names = list(columns)
    plan = plan_columns(path, names, gauge_names, fixed, [units[name] for name in names])
    used = [names[place] for place in plan.columns]
    n = len(columns[used[0]])
    for name in used:
        if len(columns[name]) != n:
            raise InputError(f"{path}: '{name}': {len(columns[name])} values found, {n} wanted")

    def blocks() -> Iterator[tuple[StrainBlock, int]]:
        last = -np.inf
        for first in range(0, n, BLOCK_ROWS):
            rows = slice(first, min(first + BLOCK_ROWS, n))
            try:
                table = np.column_stack([np.asarray(columns[name][rows], dtype=float) for name in used])
            except (TypeError, ValueError) as error:
                raise InputError(f"{path}: rows {first + 1} to {rows.stop}: values that are no numbers") from error
            block, last = _checked(plan, table, first + 1, last)
            yield block, rows.stop

    return StrainFile(n, blocks())
