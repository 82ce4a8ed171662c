"""MAT files: version 7.3 through h5py, older ones through scipy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, matrix_columns
from strainfmu.recorded.formats.first_look import reads_well
from strainfmu.recorded.formats.hdf5_channels import hdf5_channels


@contextmanager
def mat_channels(path: Path, reading: Reading) -> Iterator[ChannelFile]:
    """Open a MAT file: version 7.3 through h5py, older ones through scipy; fields of structures 'name.field'."""
    if h5py.is_hdf5(path):
        with path.open("rb") as stream:
            is_matlab = stream.read(6) == b"MATLAB"
        with hdf5_channels(path, reading, is_matlab=is_matlab) as found:
            yield found
        return
    try:
        from scipy.io import loadmat
    except ImportError as error:
        raise StrainfmuError("scipy is not installed: pip install 'strainfmu[mat]'") from error
    try:
        # scipy's parser, compiled, ends the process by some damaged files.
        if not reads_well(path, lambda: loadmat(path, simplify_cells=True)):
            raise InputError(f"{path}: damaged, or not a MAT file")
        entries = loadmat(path, simplify_cells=True)
    except InputError:
        raise
    except Exception as error:  # scipy raises whatever its parsers do
        raise InputError(f"{path}: damaged, or not a MAT file") from error
    held: dict[str, Any] = {}
    for name, value in entries.items():
        if not name.startswith("__"):
            _add_entry(held, name, value)
    yield ChannelFile(path=path, names=tuple(held), values=lambda name: held[name])


def _add_entry(held: dict[str, Any], name: str, value: Any) -> None:
    """Add the channels of a variable of a MAT file to ``held``."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _add_entry(held, f"{name}.{key}", inner)
        return
    array = np.asarray(value)
    if array.ndim and array.size != 1:  # what are no numbers is refused where it is read
        columns = matrix_columns(name, array.shape)
        values = [np.ravel(array)] if len(columns) == 1 else list(array.T)
        held.update(zip(columns, values, strict=False))
