"""HDF5 files of anybody, opened after a look that a damaged one cannot turn into a hang or a crash.

HDF5 reads some damaged heaps for ever, and crashes on others. So everything but the numbers is read once in a
child process.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any

import h5py

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.formats.first_look import reads_well

_LARGEST_TEXT = 1_000_000
"""Entries of a data set of texts beyond which they are not looked at."""


@contextmanager
def opened_hdf5(path: Path, kind: str = "an HDF5 file") -> Iterator[h5py.File]:
    """Open an HDF5 file for reading, which is to be done within :func:`reading`.

    Raises
    ------
    InputError
        It is damaged, or not ``kind``.
    """
    with reading(path, kind):
        if not reads_well(path, lambda: _read_structure(path)):
            raise InputError(f"{path}: damaged, or not {kind}")
        with h5py.File(path, "r") as file:
            row_size = max(_row_sizes(file), default=0)
        file = h5py.File(path, "r", rdcc_nbytes=row_size)
    with file:
        yield file


@contextmanager
def reading(path: Path, kind: str = "an HDF5 file") -> Iterator[None]:
    """Turn every error except this package's own into one line; for what does nothing but read.

    Raises
    ------
    InputError
        The file is damaged, or not ``kind``.
    """
    try:
        yield
    except StrainfmuError:
        raise
    except Exception as error:  # h5py raises what its own and HDF5's parsers do
        raise InputError(f"{path}: damaged, or not {kind}") from error


def _read_structure(path: Path) -> None:
    """Read all of a file but its numbers."""
    with h5py.File(path, "r") as file:
        _read(file)
        file.visititems(lambda _, item: _read(item))


def _row_sizes(file: h5py.File) -> list[int]:
    """Return the bytes of the chunks that hold a row of each data set in chunks.

    A file that is read from row to row needs no larger cache of chunks. By default HDF5 retains 1 to 8 MiB of each
    data set, so that memory grows with the length of the file up to there.
    """
    sizes = list[int]()

    def visit(_: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.chunks:
            across = [-(-n // chunk) * chunk for n, chunk in zip(item.shape[1:], item.chunks[1:], strict=True)]
            sizes.append(item.dtype.itemsize * item.chunks[0] * prod(across))

    file.visititems(visit)
    return sizes


def _read(item: Any) -> None:
    """Read the attributes of an item, and its values if they are texts."""
    for name in item.attrs:
        item.attrs[name]
    if isinstance(item, h5py.Dataset) and item.dtype.kind not in "fiub" and item.size <= _LARGEST_TEXT:
        item[()]
