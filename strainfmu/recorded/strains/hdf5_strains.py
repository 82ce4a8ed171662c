"""Recorded strains in HDF5 files: arrays, or the columns of a recorded system simulation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.signal_names import STRAIN, TEMPERATURE
from strainfmu.recorded.columns.column_names import Wanted, columns_to_read, excluded_gauges, quantity_of
from strainfmu.recorded.columns.columns import (
    ColumnPlan,
    StrainBlock,
    flow_factor,
    passes_over,
    refuse_lone_deviations,
    strain_factor,
    time_factor,
)
from strainfmu.recorded.columns.flight_pressure import pressure_sources
from strainfmu.recorded.columns.temperature_columns import TemperatureColumn, kelvin
from strainfmu.recorded.formats.hdf5_file import opened_hdf5, reading
from strainfmu.recorded.strains.sample_blocks import BLOCK_ROWS, SampleBlocks, StrainFile, column_file

_SLASH = "%2F"
_ARRAYS = (STRAIN, "time", "gauge_names")


@contextmanager
def hdf5_strains(path: Path, wanted: Wanted) -> Iterator[StrainFile]:
    """Open an HDF5 file; the rest as :func:`~strainfmu.recorded.strains.strain_files.open_strains`."""
    with opened_hdf5(path) as file:
        with reading(path):
            if "signals" in file:
                columns, units = _recorded_columns(path, file)
                opened = column_file(path, columns, units=units, wanted=wanted)
            else:
                opened = _hdf5_arrays(path, file, wanted)
        yield opened


def _recorded_columns(path: Path, file: h5py.File) -> tuple[dict[str, Any], dict[str, str | None]]:
    """Return data sets and units of a recorded system simulation."""
    signals = file["signals"]
    if not isinstance(signals, h5py.Group):
        raise InputError(f"{path}: 'signals': expected a group of data sets, got a data set")
    # By names: a loop over items that a damaged file ends keeps the lock of h5py as long as its traceback lives.
    found = {name: file.get(name) for name in list(file) if name not in ("signals", "step_cost")}
    found |= {name.replace(_SLASH, "/"): signals.get(name) for name in list(signals)}
    columns = {name: item if _is_column(item) else None for name, item in found.items()}
    return columns, {name: _unit(path, name, item) for name, item in columns.items() if item is not None}


def _is_column(item: Any) -> bool:
    return isinstance(item, h5py.Dataset) and item.ndim == 1 and item.dtype.kind in "fiub"


def _hdf5_arrays(path: Path, file: h5py.File, wanted: Wanted) -> StrainFile:
    """Read ``strain`` (n, n_d), ``time`` (n,), the flow, each a number or (n,), and ``temperature`` (n, n_t)."""
    readings = [name for name in file if quantity_of(name, wanted.readings) in wanted.readings]
    known = (*_ARRAYS, *((TEMPERATURE,) if wanted.sensors else ()), *wanted.flow, *readings)
    read, unused = columns_to_read(path, list(file), wanted, known=known)
    names = [list(file)[column] for column in read]
    fixed = wanted.fixed_pressure
    found = _data_sets(path, names, wanted)
    held = {name: found[name] for name in found if not passes_over(name, list(found), wanted)}
    is_known = fixed is not None or (wanted.computes_pressure and pressure_sources(held))
    is_needed = wanted.needs_pressure and not is_known
    needed = (STRAIN, "time", DYNAMIC_PRESSURE) if is_needed else (STRAIN, "time")
    for name in dict.fromkeys((*needed, *held.values())):
        if name not in names or not isinstance(file[name], h5py.Dataset):
            hint = f"; or state {wanted.pressure_option}" if name == DYNAMIC_PRESSURE else ""
            raise InputError(f"{path}: no data set '{name}' found, it holds {', '.join(file) or 'nothing'}{hint}")
    flow = [file[name] for name in held.values()]
    _check_shapes(path, file, n_d=len(wanted.gauge_names), held=list(held.values()))
    if "gauge_names" in names:
        _check_gauge_order(path, file, wanted.gauge_names)
    n_d, strain, time = len(wanted.gauge_names), file[STRAIN], file["time"]
    warm = file[TEMPERATURE] if TEMPERATURE in names else None
    first = 1 + n_d + len(held)
    refuse_lone_deviations(path, held, wanted)
    excluded = excluded_gauges(path, wanted)
    plan = ColumnPlan(
        path=path,
        names=("time", *(f"strain, {gauge}" for gauge in wanted.gauge_names), *held.values(), *wanted.sensors),
        time=0,
        time_factor=time_factor(path, "time", _unit(path, "time", time)),
        strain=tuple(None if one in excluded else i for i, one in enumerate(wanted.gauge_names, start=1)),
        strain_factor=np.full(n_d, strain_factor(path, STRAIN, _unit(path, STRAIN, strain))),
        flow={
            quantity: (column, flow_factor(path, name, quantity, _unit(path, name, file[name]), wanted.readings))
            for column, (quantity, name) in enumerate(held.items(), start=n_d + 1)
        },
        fixed_pressure=float("nan") if fixed is None else fixed,
        unused=(*unused, *(found[name] for name in found if name not in held)),
        reference=wanted.reference,
        temperature=_sensors(path, warm, first, len(wanted.sensors), len(time)),
        sensors=wanted.sensors,
        readings=tuple(wanted.readings),
        navigates=wanted.navigates,
    )
    remarks = list[str]()
    samples = SampleBlocks(plan, remarks)
    blocks = _hdf5_blocks(plan, samples, time, strain=strain, flow=flow, warm=warm)
    return StrainFile(len(time), blocks, plan, remarks=remarks)


def _data_sets(path: Path, names: list[str], wanted: Wanted) -> dict[str, str]:
    """Return the data set of each quantity of the flow, of auxiliary sensors under any of its names."""
    found: dict[str, str] = {}
    for name in names:
        reading = quantity_of(name, wanted.readings)
        quantity = reading if reading in wanted.readings else name
        if quantity in found:
            raise InputError(
                f"{path}: expected one data set for {quantity}, got 2: '{found[quantity]}' and '{name}'"
            )
        if quantity in wanted.flow:
            found[quantity] = name
    return {name: found[name] for name in wanted.flow if name in found}


def _sensors(path: Path, warm: Any, first: int, n_t: int, n: int) -> tuple[TemperatureColumn | None, ...]:
    """Return the columns of temperatures, from ``first`` on, of the data set ``warm``; None of none."""
    if warm is None:
        return (None,) * n_t
    if not isinstance(warm, h5py.Dataset) or warm.shape != (n, n_t) or warm.dtype.kind not in "fiu":
        got = getattr(warm, "shape", "a group")
        raise InputError(f"{path}: data set '{TEMPERATURE}': expected numbers of shape {(n, n_t)}, got {got}")
    factor, offset = kelvin(path, TEMPERATURE, _unit(path, TEMPERATURE, warm))
    return tuple(TemperatureColumn(first + sensor, factor, offset) for sensor in range(n_t))


def _check_shapes(path: Path, file: h5py.File, n_d: int, held: list[str]) -> None:
    """Check types and shapes of ``strain``, ``time`` and the flow ``held``."""
    for name in (STRAIN, "time", *held):
        if file[name].dtype.kind not in "fiu":
            raise InputError(f"{path}: data set '{name}': expected numbers, got type {file[name].dtype}")
    strain, time = file[STRAIN], file["time"]
    if strain.ndim != 2 or strain.shape[1] != n_d:
        raise InputError(f"{path}: data set 'strain': expected shape (n, {n_d}), got {strain.shape}")
    if time.shape != strain.shape[:1]:
        raise InputError(f"{path}: data set 'time': expected shape {strain.shape[:1]}, got {time.shape}")
    for name in held:
        if file[name].shape not in ((), (1,), time.shape):
            raise InputError(
                f"{path}: data set '{name}': expected shape {time.shape} or one number, got {file[name].shape}"
            )


def _hdf5_blocks(
    plan: ColumnPlan, samples: SampleBlocks, time: Any, strain: Any, flow: list[Any], warm: Any
) -> Iterator[tuple[StrainBlock, int]]:
    kept = [gauge for gauge, column in enumerate(plan.strain) if column is not None]
    has_all = len(kept) == len(plan.strain)
    for first in range(0, len(time), BLOCK_ROWS):
        rows = slice(first, min(first + BLOCK_ROWS, len(time)))
        with reading(plan.path):
            readings = np.asarray(strain[rows], dtype=float)
            parts = [np.asarray(time[rows], dtype=float), readings if has_all else readings[:, kept]]
            for held in flow:
                value = held[rows] if held.shape == time.shape else np.ravel(held[()])[0]
                parts.append(np.broadcast_to(np.asarray(value, dtype=float), parts[0].shape))
            if warm is not None:
                parts.append(np.asarray(warm[rows], dtype=float))
        yield samples.block(np.column_stack(parts), np.arange(first + 1, rows.stop + 1)), rows.stop
    samples.finish()


def _check_gauge_order(path: Path, file: h5py.File, gauge_names: tuple[str, ...]) -> None:
    """Compare the file's names of gauges with the map's."""
    held = file["gauge_names"]
    if not isinstance(held, h5py.Dataset) or held.ndim != 1:
        raise InputError(f"{path}: 'gauge_names': expected a data set of {len(gauge_names)} names")
    found = [name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name) for name in held[()]]
    if tuple(found) != gauge_names:
        wrong = next((i for i, (a, b) in enumerate(zip(found, gauge_names, strict=False)) if a != b), len(found))
        raise InputError(
            f"{path}: data set 'gauge_names': entry {wrong + 1} is not the map's gauge {wrong + 1}; "
            f"expected the map's order, from '{gauge_names[0]}' on"
        )


def _unit(path: Path, name: str, item: Any) -> str | None:
    """Return the attribute ``unit`` of a data set, None if it has none."""
    unit = item.attrs.get("unit")
    if unit is None or isinstance(unit, str):
        return unit
    if isinstance(unit, bytes):
        return unit.decode("utf-8", "replace")
    raise InputError(f"{path}: '{name}': attribute unit: expected a text, got {str(unit)[:40]}")
