"""Writers of estimates, block by block as CSV or HDF5; the file appears when it is complete."""

from __future__ import annotations

import csv
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.interface.health_names import CHI_SQUARE, STATE
from strainfmu.recorded.output.guarded_file import GuardedFile
from strainfmu.recorded.output.whole_file import whole_file, writing

SCHEMA = "strainfmu.estimates"
SCHEMA_VERSION = 2
OUTPUT_SUFFIXES = (".csv", ".h5", ".hdf5")

ESTIMATE_COLUMNS = (
    ("time", "s"),
    *((name, "1") for name in COEFFICIENT_NAMES),
    *((f"sigma.{name}", "1") for name in COEFFICIENT_NAMES),
    (DYNAMIC_PRESSURE, "Pa"),
    (CHI_SQUARE, "1"),
    (STATE, "1"),
    ("gauges_used", "1"),
)
"""Columns of every output: name and unit."""

_SLASH = "%2F"

_CHUNK_ROWS, _HELD_ROWS = 4096, 16384
"""Rows of a chunk in HDF5, and rows that are written at once: each call costs as much as thousands of rows."""
_CHUNK_BYTES = 16 * _CHUNK_ROWS
"""Of a column of text, the larger kind. HDF5 retains the last chunk of each column, and would 8 MiB by default."""


class EstimateWriter(ABC):
    """Writes blocks of rows to a file: columns of numbers, then columns of text.

    ``path`` is the file that messages name.
    """

    def __init__(self, path: Path, columns: Sequence[tuple[str, str]], text_columns: Sequence[str]) -> None:
        self.path, self.columns, self.text_columns = path, tuple(columns), tuple(text_columns)
        self.rows = 0

    def write(self, rows: FloatArray, texts: Mapping[str, Sequence[str]] | None = None) -> None:
        """Append ``rows`` (n, n_c), n_c columns in their units, and n texts of each text column.

        Raises
        ------
        StrainfmuError
            The file cannot be written.
        """
        self.rows += len(rows)
        held = texts or {}
        with writing(self.path):
            self._append(np.atleast_2d(rows), [held[name] for name in self.text_columns])

    @abstractmethod
    def _append(self, rows: FloatArray, texts: list[Sequence[str]]) -> None:
        """Append ``rows`` (n, n_c), which ``rows`` counts already, and the texts of each text column.

        Raises
        ------
        OSError
            The file cannot be written.
        """

    @abstractmethod
    def describe(self, attributes: Mapping[str, float]) -> None:
        """Write the ``attributes`` of the whole file, if its kind has any."""

    @abstractmethod
    def finish(self) -> None:
        """Write what is left and bring all to the disk; raises OSError if it cannot."""

    @abstractmethod
    def close(self) -> None:
        """Close the file, in order or not."""


class _CsvWriter(EstimateWriter):
    def __init__(
        self, path: Path, temporary: Path, columns: Sequence[tuple[str, str]], text_columns: Sequence[str]
    ) -> None:
        super().__init__(path, columns, text_columns)
        self._stream = temporary.open("w", newline="", encoding="utf-8")
        self._writer = csv.writer(self._stream, lineterminator="\n")
        self._writer.writerow([*(f"{name} [{unit}]" for name, unit in columns), *text_columns])

    def _append(self, rows: FloatArray, texts: list[Sequence[str]]) -> None:
        if texts:
            self._writer.writerows([*row, *held] for row, *held in zip(rows.tolist(), *texts, strict=True))
        else:
            self._writer.writerows(rows.tolist())

    def describe(self, attributes: Mapping[str, float]) -> None:
        return  # CSV has no attributes

    def finish(self) -> None:
        self._stream.flush()
        os.fsync(self._stream.fileno())

    def close(self) -> None:
        with suppress(OSError):  # what is left does not fit either: finish() has raised, or never came
            self._stream.close()


class _Hdf5Writer(EstimateWriter):
    def __init__(
        self, path: Path, temporary: Path, columns: Sequence[tuple[str, str]], text_columns: Sequence[str]
    ) -> None:
        super().__init__(path, columns, text_columns)
        self._guarded = GuardedFile(temporary)
        self._file = h5py.File(self._guarded, "w", rdcc_nbytes=_CHUNK_BYTES)
        self._file.attrs["schema"], self._file.attrs["schema_version"] = SCHEMA, SCHEMA_VERSION
        self._sets = [self._data_set(name, "f8") for name, _ in columns]
        for item, (_, unit) in zip(self._sets, columns, strict=True):
            item.attrs["unit"] = unit
        self._texts = [self._data_set(name, h5py.string_dtype()) for name in text_columns]
        self._held: list[tuple[FloatArray, list[Sequence[str]]]] = []
        self._written = 0

    def describe(self, attributes: Mapping[str, float]) -> None:
        self._file.attrs.update(attributes)

    def _data_set(self, name: str, kind: object) -> h5py.Dataset:
        # A slash, which names of gauges may hold, would begin a group.
        return self._file.create_dataset(
            name.replace("/", _SLASH), (0,), maxshape=(None,), dtype=kind, chunks=(_CHUNK_ROWS,)
        )

    def _append(self, rows: FloatArray, texts: list[Sequence[str]]) -> None:
        self._held.append((rows, texts))
        if self.rows - self._written >= _HELD_ROWS:
            self._flush()

    def _flush(self) -> None:
        """Write the rows that are held; a text that was never written reads as an empty one."""
        if self._held:
            columns = np.ascontiguousarray(np.concatenate([rows for rows, _ in self._held]).T)
            texts = [
                [text for _, held in self._held for text in held[column]] for column in range(len(self._texts))
            ]
            for item, values in zip((*self._sets, *self._texts), (*columns, *texts), strict=True):
                item.resize((self.rows,))
                if not isinstance(values, list) or any(values):
                    item[self._written :] = values
            self._held, self._written = [], self.rows
        self._guarded.raise_error()

    def finish(self) -> None:
        self._flush()
        self._file.close()
        self._guarded.sync()

    def close(self) -> None:
        self._file.close()
        self._guarded.close()


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
def estimate_writer(
    path: Path,
    columns: Sequence[tuple[str, str]] = ESTIMATE_COLUMNS,
    text_columns: Sequence[str] = (),
    attributes: Mapping[str, float] | None = None,
) -> Iterator[EstimateWriter]:
    """Open an output; it is renamed into place at the end, and removed if there was an error.

    ``attributes`` say how the estimates were made. HDF5 holds them as attributes of the file, CSV has no room for
    them.

    Raises
    ------
    InputError
        It is neither CSV nor HDF5.
    StrainfmuError
        It cannot be written; an earlier file remains unchanged.
    """
    check_output(path)
    kind = _CsvWriter if path.suffix.lower() == ".csv" else _Hdf5Writer

    def opened(temporary: Path) -> EstimateWriter:
        return kind(path, temporary, columns=columns, text_columns=text_columns)

    with whole_file(path, opened) as writer:
        writer.describe(attributes or {})
        yield writer
