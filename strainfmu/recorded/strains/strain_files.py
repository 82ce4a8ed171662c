"""Readers of recorded strains: CSV, HDF5, MAT, MF4, Parquet and TDMS as blocks of samples in SI units."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.recorded.channels.channel_entries import load_channels
from strainfmu.recorded.columns.column_names import Wanted
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.formats.hdf5_channels import hdf5_channels
from strainfmu.recorded.formats.registry import format_of
from strainfmu.recorded.strains.channel_strains import channel_strains
from strainfmu.recorded.strains.hdf5_strains import hdf5_strains
from strainfmu.recorded.strains.mapped_strains import mapped_strains
from strainfmu.recorded.strains.sample_blocks import StrainFile


@contextmanager
def open_strains(path: Path, wanted: Wanted, channels: Path | None = None) -> Iterator[StrainFile]:
    """Open recorded strains for reading block by block; ``channels`` states which channel is which gauge.

    Raises
    ------
    InputError
        The file is missing, damaged or of another kind, holds no sample, or a column, a unit, a shape or a number
        is wrong.
    StrainfmuError
        The reader of its kind is not installed.
    """
    is_hdf5 = hdf5_channels is format_of(path).open  # arrays and recorded simulations, layouts of this product
    mapping = None if channels is None else load_channels(channels)
    reader = hdf5_strains if is_hdf5 else channel_strains
    with reader(path, wanted) if mapping is None else mapped_strains(path, wanted, mapping) as opened:
        notes = (*opened.notes, *opened.plan.notes)
        yield StrainFile(opened.length, _not_empty(path, opened.blocks), opened.plan, notes, opened.remarks)


def _not_empty(path: Path, blocks: Iterator[tuple[StrainBlock, int]]) -> Iterator[tuple[StrainBlock, int]]:
    """Yield ``blocks``; refuse a file without any, which usually is an export that failed."""
    first = next(blocks, None)
    if first is None:
        raise InputError(f"{path}: no samples found")
    yield first
    yield from blocks
