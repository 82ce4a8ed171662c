"""The formats of recordings, one entry each: a new one is its reader, in a file of its own, and a line here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading
from strainfmu.recorded.formats.csv_file import csv_channels
from strainfmu.recorded.formats.hdf5_channels import hdf5_channels
from strainfmu.recorded.formats.lvm_file import lvm_channels
from strainfmu.recorded.formats.mat_file import mat_channels
from strainfmu.recorded.formats.mdf_file import is_mdf, mdf_channels
from strainfmu.recorded.formats.parquet_file import parquet_channels
from strainfmu.recorded.formats.tdms_file import tdms_channels
from strainfmu.recorded.formats.uff_file import uff_channels


@dataclass(frozen=True, kw_only=True)
class RecorderFormat:
    """A format of recordings.

    Attributes
    ----------
    suffixes : of its files, in small letters.
    open : returns a file of this format as channels: their names, units, values and times.
    begins : whether the first bytes of a file are of this format; the first format that says so has it.
    """

    suffixes: tuple[str, ...]
    open: Callable[[Path, Reading], AbstractContextManager[ChannelFile]]
    begins: Callable[[bytes], bool] = lambda _: True


FORMATS = (
    RecorderFormat(suffixes=(".mf4", ".mdf", ".dat"), open=mdf_channels, begins=is_mdf),
    RecorderFormat(suffixes=(".csv", ".txt", ".dat"), open=csv_channels),
    RecorderFormat(suffixes=(".h5", ".hdf5"), open=hdf5_channels),
    RecorderFormat(suffixes=(".lvm",), open=lvm_channels),
    RecorderFormat(suffixes=(".mat",), open=mat_channels),
    RecorderFormat(suffixes=(".parquet",), open=parquet_channels),
    RecorderFormat(suffixes=(".tdms",), open=tdms_channels),
    RecorderFormat(suffixes=(".uff", ".unv", ".uf58"), open=uff_channels),
)

SUFFIXES = tuple(dict.fromkeys(suffix for one in FORMATS for suffix in one.suffixes))
"""Of all formats."""

_HEAD = 4096
"""Bytes that distinguish formats of one suffix."""


def format_of(path: Path) -> RecorderFormat:
    """Return the format of a file, by its suffix, of several by its first bytes.

    Raises
    ------
    InputError
        The file is missing, or of none of the formats.
    """
    found = [one for one in FORMATS if path.suffix.lower() in one.suffixes]
    if not found:
        raise InputError(f"{path}: expected one of {', '.join(SUFFIXES)}, got '{path.suffix}'")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
    return next((one for one in found if one.begins(head)), found[-1])


@contextmanager
def open_channels(path: Path, reading: Reading) -> Iterator[ChannelFile]:
    """Open a recording as channels.

    Raises
    ------
    InputError
        The file is missing, damaged or of another kind.
    StrainfmuError
        The reader of its kind is not installed.
    """
    with format_of(path).open(path, reading) as opened:
        yield opened
