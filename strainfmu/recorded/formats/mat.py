"""MAT files: version 7.3 through h5py, older ones through scipy."""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.errors import library
from strainfmu.first_look import reads_well
from strainfmu.recorded.formats.hdf5 import hdf5_table
from strainfmu.recorded.table import Column, Reading, Table, constant, matrix_columns, table_of


def mat_table(path: Path, reading: Reading, stack: ExitStack) -> Table:
    """Open a MAT file: version 7.3 through h5py, older ones through scipy; fields of structures 'name.field'."""
    if h5py.is_hdf5(path):
        with path.open("rb") as stream:
            is_matlab = stream.read(6) == b"MATLAB"
        return hdf5_table(path, reading, stack, is_matlab=is_matlab)
    loadmat = library("scipy.io", "scipy", "mat").loadmat
    # scipy's parser, compiled, ends the process by some damaged files.
    if not reads_well(path, lambda: loadmat(path, simplify_cells=True)):
        raise ValueError
    entries = loadmat(path, simplify_cells=True)
    variables = {name: value for name, value in entries.items() if not name.startswith("__")}
    return table_of(path, list(_columns(variables, (), reading)), reading)


def _columns(entries: Mapping[str, Any], group: tuple[str, ...], reading: Reading) -> Iterator[Column]:
    """Yield the columns of the variables of a file, or of the fields of a structure."""
    for name, value in entries.items():
        if isinstance(value, dict):
            yield from _columns(value, (*group, name), reading)
            continue
        array = np.asarray(value)
        if array.size == 1 and array.dtype.kind in "fiub":
            if reading.is_known(name):
                full = ".".join((*group, name))
                yield Column(name=name, group=group, full=full, read=constant(array.ravel()))
        elif array.ndim and array.size != 1:  # what are no numbers is refused where it is read
            names = matrix_columns(name, array.shape)
            for of_column, values in zip(names, [np.ravel(array)] if len(names) == 1 else array.T, strict=False):
                full = ".".join((*group, of_column))
                yield Column(name=of_column, group=group, full=full, rows=len(values), read=values.__getitem__)
