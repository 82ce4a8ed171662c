"""HDF5 files of anybody as channels: arrays, columns of matrices, fields of tables, MATLAB's matrices turned."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, matrix_columns
from strainfmu.recorded.formats.hdf5_file import opened_hdf5, reading


@contextmanager
def hdf5_channels(path: Path, _: Reading, is_matlab: bool = False) -> Iterator[ChannelFile]:
    """Open an HDF5 file: arrays, columns of matrices 'name[1]' .., fields of tables; MATLAB's turned."""
    kind = "a MAT file" if is_matlab else "an HDF5 file"
    with opened_hdf5(path, kind) as file:
        held: dict[str, Callable[[], Any]] = {}
        units: dict[str, str] = {}

        def add(at: str, item: Any) -> None:
            if not isinstance(item, h5py.Dataset) or at.startswith("#"):
                return
            name = at.replace("%2F", "/")
            if item.dtype.names:
                held.update({f"{name}/{f}": partial(_field, item, f) for f in item.dtype.names})
            elif item.ndim and _class(item) != "char":  # what are no numbers is refused where it is read
                turned = is_matlab and item.ndim == 2
                shape = item.shape[::-1] if turned else item.shape
                columns = matrix_columns(name, shape)
                for k, one in enumerate(columns):
                    held[one] = partial(_column, item, k, n=len(columns), is_turned=turned)
                    unit = next((_text(item.attrs[key]) for key in ("unit", "units") if key in item.attrs), "")
                    if unit:
                        units[one] = unit

        with reading(path, kind):
            file.visititems(add)
        yield ChannelFile(path=path, names=tuple(held), units=units, values=lambda name: held[name]())


def _field(item: h5py.Dataset, name: str) -> Any:
    """Return a field of a table."""
    return item[name]


def _column(item: h5py.Dataset, k: int, n: int, is_turned: bool) -> Any:
    """Return column k of an array of n columns."""
    if n == 1:
        return np.ravel(item[()])
    return item[k, :] if is_turned else item[:, k]


def _class(item: h5py.Dataset) -> str:
    return _text(item.attrs.get("MATLAB_class", ""))


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
