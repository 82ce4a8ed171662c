"""Writers of estimates, row by row as CSV or HDF5; the file appears when it is complete."""

from __future__ import annotations

import csv
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.inverse_map import COEFFICIENT_NAMES

SCHEMA = "strainfmu.estimates"
SCHEMA_VERSION = 1
OUTPUT_SUFFIXES = (".csv", ".h5", ".hdf5")

ESTIMATE_COLUMNS = (
    ("time", "s"),
    *((name, "1") for name in COEFFICIENT_NAMES),
    *((f"sigma.{name}", "1") for name in COEFFICIENT_NAMES),
    ("dynamic_pressure", "Pa"),
    ("health.chi_square", "1"),
    ("health.state", "1"),
    ("gauges_used", "1"),
)
"""Columns of every output: name and unit."""


class EstimateWriter(ABC):
    """Writes rows to a file."""

    def __init__(self, columns: Sequence[tuple[str, str]]) -> None:
        self.columns = tuple(columns)
        self.rows = 0

    def write(self, rows: FloatArray) -> None:
        """Append ``rows`` (n, n_c), n_c columns in their units."""
        self.rows += len(rows)
        self._append(np.atleast_2d(rows))

    @abstractmethod
    def _append(self, rows: FloatArray) -> None:
        """Append ``rows`` (n, n_c), which ``rows`` counts already."""


class _CsvWriter(EstimateWriter):
    def __init__(self, stream: TextIO, columns: Sequence[tuple[str, str]]) -> None:
        super().__init__(columns)
        self._writer = csv.writer(stream, lineterminator="\n")
        self._writer.writerow([f"{name} [{unit}]" for name, unit in columns])

    def _append(self, rows: FloatArray) -> None:
        self._writer.writerows(rows.tolist())


class _Hdf5Writer(EstimateWriter):
    def __init__(self, file: h5py.File, columns: Sequence[tuple[str, str]]) -> None:
        super().__init__(columns)
        file.attrs["schema"], file.attrs["schema_version"] = SCHEMA, SCHEMA_VERSION
        self._sets = []
        for name, unit in columns:
            item = file.create_dataset(name, (0,), maxshape=(None,), dtype="f8", chunks=(4096,))
            item.attrs["unit"] = unit
            self._sets.append(item)

    def _append(self, rows: FloatArray) -> None:
        for item, column in zip(self._sets, rows.T, strict=True):
            item.resize((self.rows,))
            item[self.rows - len(rows) :] = column


def check_output(path: Path) -> None:
    """Refuse an output of another kind before any work begins.

    Raises
    ------
    InputError
        It is neither CSV nor HDF5.
    """
    if path.suffix.lower() not in OUTPUT_SUFFIXES:
        raise InputError(f"{path}: expected one of {', '.join(OUTPUT_SUFFIXES)}, got '{path.suffix}'")


@contextmanager
def estimate_writer(path: Path, columns: Sequence[tuple[str, str]] = ESTIMATE_COLUMNS) -> Iterator[EstimateWriter]:
    """Open an output; it is renamed into place at the end, and removed if there was an error.

    Raises
    ------
    InputError
        It is neither CSV nor HDF5.
    StrainfmuError
        It cannot be written; an earlier file remains unchanged.
    """
    check_output(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix.lower() == ".csv":
            with temporary.open("w", newline="", encoding="utf-8") as stream:
                yield _CsvWriter(stream, columns)
        else:
            with h5py.File(temporary, "w") as file:
                yield _Hdf5Writer(file, columns)
        os.replace(temporary, path)
    except OSError as error:
        raise StrainfmuError(f"{path}: could not be written: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)
