"""Readers of recorded strains: CSV, HDF5, MAT, MF4, Parquet and TDMS as blocks of samples in SI units."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.recorded.channels.channel_entries import load_channels
from strainfmu.recorded.columns.column_names import Wanted
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.strains.channel_strains import channel_strains, mf4_strains, tdms_strains
from strainfmu.recorded.strains.csv_strains import csv_strains
from strainfmu.recorded.strains.hdf5_strains import hdf5_strains
from strainfmu.recorded.strains.mapped_strains import mapped_strains
from strainfmu.recorded.strains.sample_blocks import StrainFile

TABLE_SUFFIXES = (".csv", ".txt", ".h5", ".hdf5", ".mat", ".mf4", ".parquet", ".tdms")


@contextmanager
def open_strains(path: Path, wanted: Wanted, channels: Path | None = None) -> Iterator[StrainFile]:
    """Open recorded strains for reading block by block; ``channels`` tells which channel is which gauge.

    Raises
    ------
    InputError
        The file is missing, damaged or of another kind, holds no sample, or a column, a unit, a shape or a number
        is wrong.
    StrainfmuError
        The reader of its kind is not installed.
    """
    readers = {
        ".csv": csv_strains,
        ".txt": csv_strains,
        ".h5": hdf5_strains,
        ".hdf5": hdf5_strains,
        ".mat": channel_strains,
        ".mf4": mf4_strains,
        ".parquet": channel_strains,
        ".tdms": tdms_strains,
    }
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: expected one of {', '.join(TABLE_SUFFIXES)}, got '{path.suffix}'")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    mapping = None if channels is None else load_channels(channels)
    with reader(path, wanted) if mapping is None else mapped_strains(path, wanted, mapping) as opened:
        notes = (*opened.notes, *opened.plan.notes)
        yield StrainFile(opened.length, _not_empty(path, opened.blocks), opened.plan, notes)


def _not_empty(path: Path, blocks: Iterator[tuple[StrainBlock, int]]) -> Iterator[tuple[StrainBlock, int]]:
    """Yield ``blocks``; refuse a file without any, which usually is an export that failed."""
    first = next(blocks, None)
    if first is None:
        raise InputError(f"{path}: no samples found")
    yield first
    yield from blocks
