"""Files of every recorder as tables: each format is one function of one file, and one line of :data:`FORMATS`."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
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
from strainfmu.recorded.table import Reading, Table, of_format

Opener = Callable[[Path, Reading, ExitStack], Table]
"""Opens a file, and leaves to the stack what closes it; any error other than the package's means damage."""

TEXT = text_table, "a CSV file", (".csv", ".txt", ".dat", ".tsv"), ()

FORMATS: tuple[tuple[Opener, str, tuple[str, ...], tuple[bytes, ...]], ...] = (
    (mdf_table, "an MDF file", (".mf4", ".mdf"), MAGIC),
    TEXT,
    (mat_table, "a MAT file", (".mat",), (b"MATLAB ",)),
    (hdf5_table, "an HDF5 file", (".h5", ".hdf5"), (b"\x89HDF\r\n\x1a\n",)),
    (lvm_table, "a LabVIEW measurement file", (".lvm",), (BEGIN.encode(),)),
    (parquet_table, "a Parquet file", (".parquet",), (b"PAR1",)),
    (tdms_table, "a TDMS file", (".tdms",), (b"TDSm",)),
    (uff_table, "a universal file", (".uff", ".unv", ".uf58"), (b"    -1\n", b"    -1\r\n")),
)
"""Of each format what opens its files, its name, their suffixes in small letters, and their first bytes."""

SUFFIXES = tuple(suffix for *_, suffixes, _ in FORMATS for suffix in suffixes)
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
    if not path.is_file():
        raise InputError(f"{path}: {'expected a file, got a folder' if path.is_dir() else 'no such file'}")
    with path.open("rb") as stream:
        suffix, head = path.suffix.lower(), stream.read(_HEAD)
    chosen = [known for known in FORMATS if known[-1] and head.startswith(known[-1])]
    chosen += [known for known in FORMATS if suffix in known[-2]]
    chosen += [TEXT] if head and b"\x00" not in head else []
    if not chosen:
        raise InputError(f"{path}: expected one of {', '.join(SUFFIXES)}, got '{path.suffix}'")
    opens, kind, *_ = chosen[0]
    with ExitStack() as stack:
        with of_format(path, kind):
            table = opens(path, reading, stack)
        yield table
