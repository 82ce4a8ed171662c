"""HDF5 files of anybody: arrays, columns of matrices, fields of tables, MATLAB's matrices turned.

HDF5 reads some damaged heaps for ever, and crashes on others. So everything but the numbers is read once in a
child process.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache, partial
from math import prod
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.first_look import reads_well
from strainfmu.recorded.table import Column, Reading, Table, constant, matrix_columns, table_of

_LARGEST_TEXT = 1_000_000
"""Entries of a data set of texts beyond which they are not looked at."""

_SIMULATION = ("signals",)
"""Group of a recorded system simulation, whose columns are as the others of the file."""

_NO_COLUMNS = ("step_cost",)
"""What such a file holds besides."""

_GAUGE_NAMES = "gauge_names"


def hdf5_table(path: Path, reading: Reading, stack: ExitStack, is_matlab: bool = False) -> Table:
    """Open an HDF5 file: arrays (n,), matrices as columns 'name[1]' .., fields of tables as 'table/field'.

    The columns of ``strain`` have the names in ``gauge_names``, where that is there. One number counts for all
    rows, if its name is known.
    """
    if not reads_well(path, lambda: _read_structure(path)):
        raise ValueError
    sizes = [0]
    with h5py.File(path, "r") as file:
        file.visititems(lambda _, item: sizes.append(_row_size(item)))
    file = stack.enter_context(h5py.File(path, "r", rdcc_nbytes=max(sizes)))
    return table_of(path, _named(path, file, [*_columns_of(path, file, (), reading, is_matlab)]), reading)


def _columns_of(
    path: Path, group: h5py.Group, around: tuple[str, ...], reading: Reading, is_matlab: bool
) -> Iterator[Column]:
    """Yield the columns of a group and of the groups in it, in their order."""
    # By names: a loop over items that a damaged file ends keeps the lock of h5py while its traceback lives.
    for key in list(group):
        item, name = group.get(key), key.replace("%2F", "/")
        if isinstance(item, h5py.Group) and key not in _NO_COLUMNS and not key.startswith("#"):
            inner = around if (*around, key) == _SIMULATION else (*around, key)
            yield from _columns_of(path, item, inner, reading, is_matlab)
        elif not isinstance(item, h5py.Dataset) or item.shape is None or (key == _GAUGE_NAMES and not around):
            continue
        elif item.dtype.names:
            for field in item.dtype.names:
                yield Column(name=field, group=(*around, name), rows=_rows(item.shape), read=_field(item, field))
        elif item.ndim == 0 and reading.is_known(name):
            yield Column(name=name, unit=_unit(path, item), group=around, read=constant(item[()]))
        elif _text(item.attrs.get("MATLAB_class", "")) != "char":  # what are no numbers is refused if read
            turned = is_matlab and item.ndim == 2
            shape = item.shape[::-1] if turned else item.shape
            names = matrix_columns(name, shape)
            for of_column, raw in zip(names, _columns(item, len(names), turned), strict=True):
                read = _unpacked(item, raw)
                yield Column(name=of_column, unit=_unit(path, item), group=around, rows=_rows(shape), read=read)


def _named(path: Path, file: h5py.File, columns: list[Column]) -> list[Column]:
    """Return the columns, of ``strain`` with the names of gauges that the file states."""
    item = file.get(_GAUGE_NAMES)
    if item is None or STRAIN not in file:
        return columns
    names = [_text(name) for name in np.ravel(item[()])] if isinstance(item, h5py.Dataset) else []
    places = [i for i, column in enumerate(columns) if column.name.partition("[")[0] == STRAIN]
    if len(names) != len(places):
        raise InputError(
            f"{path}: '{_GAUGE_NAMES}': expected a name of each of {len(places)} columns of '{STRAIN}', got "
            f"{len(names)}"
        )
    for i, name in zip(places, names, strict=True):
        columns[i] = replace(columns[i], name=name, full=name, group=(), heading=f"{STRAIN}, {name}")
    return columns


def _unit(path: Path, item: h5py.Dataset) -> str | None:
    """Return the attribute ``unit`` or ``units`` of a data set, None if it has none."""
    for key in ("unit", "units"):
        if key in item.attrs:
            stated, name = item.attrs[key], str(item.name).strip("/")
            units = {*map(_text, np.ravel(stated))} if np.asarray(stated).dtype.kind in "OSU" else set()
            if len(units) != 1:
                raise InputError(f"{path}: '{name}': attribute {key}: expected a text, got {str(stated)[:40]}")
            return units.pop() or None
    return None


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _rows(shape: tuple[int, ...]) -> int:
    return int(np.prod(shape)) if 1 in shape else shape[0]


def _field(item: h5py.Dataset, name: str) -> Callable[[slice], Any]:
    """Return what reads a field of a table."""
    return lambda rows: item[rows][name]


def _columns(item: h5py.Dataset, n: int, is_turned: bool) -> list[Callable[[slice], Any]]:
    """Return what reads each of the n columns of an array; columns of a matrix are read together."""
    if n == 1 and item.ndim == 1:
        return [lambda rows: item[rows]]
    if n == 1:
        return [lambda rows: np.ravel(item[:, rows] if item.shape[0] == 1 else item[rows])]

    @lru_cache(maxsize=1)
    def block(first: int, stop: int) -> Any:
        return item[:, first:stop].T if is_turned else item[first:stop]

    def column(k: int, rows: slice) -> Any:
        return block(rows.start, rows.stop)[:, k]

    return [partial(column, k) for k in range(n)]


def _unpacked(item: h5py.Dataset, read: Callable[[slice], Any]) -> Callable[[slice], Any]:
    """Return what reads a column that netCDF packs: NaN for its fill value, else factor times number plus offset.

    Source: netCDF Climate and Forecast Metadata Conventions, sections 2.5.1 and 8.1.
    """
    if not {"scale_factor", "add_offset", "_FillValue", "missing_value"} & {*item.attrs}:
        return read
    scale, offset = item.attrs.get("scale_factor", 1.0), item.attrs.get("add_offset", 0.0)
    missing = [np.ravel(item.attrs[key]) for key in ("_FillValue", "missing_value") if key in item.attrs]

    def unpacked(rows: slice) -> Any:
        values = np.asarray(read(rows))
        return np.where(np.isin(values, np.concatenate([[], *missing])), np.nan, scale * values + offset)

    return unpacked


def _read_structure(path: Path) -> None:
    """Read all of a file but its numbers."""
    with h5py.File(path, "r") as file:
        _read(file)
        file.visititems(lambda _, item: _read(item))


def _row_size(item: Any) -> int:
    """Return the bytes of the chunks that hold a row of a data set in chunks, 0 of another.

    A file that is read from row to row needs no larger cache of chunks. By default HDF5 retains 1 to 8 MiB of each
    data set, so that memory grows with the length of the file up to there.
    """
    if not isinstance(item, h5py.Dataset) or not item.chunks:
        return 0
    across = [-(-n // chunk) * chunk for n, chunk in zip(item.shape[1:], item.chunks[1:], strict=True)]
    return int(item.dtype.itemsize * item.chunks[0] * prod(across))


def _read(item: Any) -> None:
    """Read the attributes of an item, and its values if they are texts."""
    for name in item.attrs:
        item.attrs[name]
    if isinstance(item, h5py.Dataset) and item.dtype.kind not in "fiub" and item.size <= _LARGEST_TEXT:
        item[()]
