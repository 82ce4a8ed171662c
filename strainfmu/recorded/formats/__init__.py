"""Files of every recorder as tables: each format is one function of one file, and one line of :data:`FORMATS`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
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


@dataclass(frozen=True, kw_only=True)
class RecorderFormat:
    """A format of recordings.

    Attributes
    ----------
    suffixes : of its files, in small letters, where their first bytes are of no format.
    magic : what its files begin with, one of these.
    open : opens a file as a table.
    """

    suffixes: tuple[str, ...]
    magic: tuple[bytes, ...] = ()
    open: Callable[[Path, Reading], AbstractContextManager[Table]]


TEXT = RecorderFormat(suffixes=(".csv", ".txt", ".dat", ".tsv"), open=text_table)

FORMATS = (
    RecorderFormat(suffixes=(".mf4", ".mdf"), magic=MAGIC, open=mdf_table),
    TEXT,
    RecorderFormat(suffixes=(".mat",), magic=(b"MATLAB ",), open=mat_table),
    RecorderFormat(suffixes=(".h5", ".hdf5"), magic=(b"\x89HDF\r\n\x1a\n",), open=hdf5_table),
    RecorderFormat(suffixes=(".lvm",), magic=(BEGIN.encode(),), open=lvm_table),
    RecorderFormat(suffixes=(".parquet",), magic=(b"PAR1",), open=parquet_table),
    RecorderFormat(suffixes=(".tdms",), magic=(b"TDSm",), open=tdms_table),
    RecorderFormat(suffixes=(".uff", ".unv", ".uf58"), magic=(b"    -1\n", b"    -1\r\n"), open=uff_table),
)

SUFFIXES = tuple(dict.fromkeys(suffix for one in FORMATS for suffix in one.suffixes))
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
    by_magic = [one for one in FORMATS if one.magic and head.startswith(one.magic)]
    by_suffix = [one for one in FORMATS if suffix in one.suffixes]
    chosen = [*by_magic, *by_suffix, *([TEXT] if head and b"\x00" not in head else [])]
    if not chosen:
        raise InputError(f"{path}: expected one of {', '.join(SUFFIXES)}, got '{path.suffix}'")
    with chosen[0].open(path, reading) as table:
        yield table
