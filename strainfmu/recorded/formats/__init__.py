"""Files of every recorder as tables: each format is one function of one file, and one line of :data:`FORMATS`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.recorded.formats.hdf5 import hdf5_table
from strainfmu.recorded.formats.lvm import BEGIN, lvm_table
from strainfmu.recorded.formats.mat import mat_table
from strainfmu.recorded.formats.mdf import MAGIC, mdf_table
from strainfmu.recorded.formats.parquet import parquet_table
from strainfmu.recorded.formats.tdms import tdms_table
from strainfmu.recorded.formats.text import text_table
from strainfmu.recorded.formats.uff import uff_table
from strainfmu.recorded.table import Reading, Table

Opener = Callable[[Path, Reading], AbstractContextManager[Table]]

FORMATS: tuple[tuple[Opener, tuple[str, ...], tuple[bytes, ...]], ...] = (
    (mdf_table, (".mf4", ".mdf"), MAGIC),
    (text_table, (".csv", ".txt", ".dat", ".tsv"), ()),
    (mat_table, (".mat",), (b"MATLAB ",)),
    (hdf5_table, (".h5", ".hdf5"), (b"\x89HDF\r\n\x1a\n",)),
    (lvm_table, (".lvm",), (BEGIN.encode(),)),
    (parquet_table, (".parquet",), (b"PAR1",)),
    (tdms_table, (".tdms",), (b"TDSm",)),
    (uff_table, (".uff", ".unv", ".uf58"), (b"    -1\n", b"    -1\r\n")),
)
"""Of each format what opens its files, their suffixes in small letters, and their first bytes, one of these."""

SUFFIXES = tuple(suffix for _, suffixes, _ in FORMATS for suffix in suffixes)
"""Of all formats."""

_HEAD = 4096
"""Bytes that show a format."""


@contextmanager
def open_table(path: Path, reading: Reading) -> Iterator[Table]:
    """Open a recording as a table: by its first bytes, else by its suffix; a text of any suffix is read as such.

    Raises
    ------
    InputError
        The file is missing, damaged or of another kind.
    StrainfmuError
        The reader of its kind is not installed.
    """
    suffix, head = path.suffix.lower(), b""
    if path.is_file():
        with path.open("rb") as stream:
            head = stream.read(_HEAD)
    elif suffix in SUFFIXES:
        raise InputError(f"{path}: no such file")
    chosen = [opens for opens, _, magic in FORMATS if magic and head.startswith(magic)]
    chosen += [opens for opens, suffixes, _ in FORMATS if suffix in suffixes]
    chosen += [text_table] if head and b"\x00" not in head else []
    if not chosen:
        raise InputError(f"{path}: expected one of {', '.join(SUFFIXES)}, got '{path.suffix}'")
    with chosen[0](path, reading) as table:
        yield table
