"""Files of estimates: names and units of their columns, and writers of CSV, HDF5, Parquet and MF4.

A file is written in parts and appears when it is complete.
"""

from __future__ import annotations

import csv
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from itertools import chain
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, library
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, SAMPLE_INPUTS
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.other_loads import SIGMA, is_column
from strainfmu.files import GuardedFile, whole_file, writing
from strainfmu.recorded.estimators import (
    COEFFICIENT_COLUMNS,
    HEALTH_COLUMNS,
    LOAD_COLUMNS,
    RESIDUAL,
    RESIDUAL_LIMIT,
    Column,
)

SCHEMA = "strainfmu.estimates"
SCHEMA_VERSION = 3
FORMS = ("plain", "all")

ESTIMATE_COLUMNS: tuple[Column, ...] = (
    ("time", "s"),
    *LOAD_COLUMNS,
    *COEFFICIENT_COLUMNS,
    (DYNAMIC_PRESSURE, "Pa"),
    *HEALTH_COLUMNS[:3],
)
"""Columns of every output: name and unit."""

SUSPECTS_COLUMN, FAULTS_COLUMN = "suspect_gauges", "strain_faults"
"""Columns of text: names of the suspects with a semicolon between them; why strains were left out, ``held`` or
``zero`` of all gauges, else the names of gauges."""

HEALTH_COLUMN = "health"
"""Column of text of the plain form: the name of the state; empty for a sample that an FMU refused."""

_AIR_DATA = "air_data."
_ANGLES = ("air_data.angle_of_attack", "air_data.sideslip_angle")
_FLOW_UNITS = {quantity.name: quantity.unit for quantity in SAMPLE_INPUTS[1:]}
_SLASH = "%2F"

_CHUNK_ROWS, _COLLECTED_ROWS = 4096, 16384
"""Rows of a chunk in HDF5, and rows that are written at once: each call costs as much as thousands of rows."""

_CHUNK_BYTES = 16 * _CHUNK_ROWS
"""Of a column of text, the larger kind. HDF5 retains the last chunk of each column, and would 8 MiB by default."""

_LONGEST_TEXT = 250
"""Characters of a text in MF4, whose records have one length."""


# --- columns -----------------------------------------------------------------------------------------------------


def output_columns(stated: Sequence[str], others: Sequence[Column]) -> tuple[Column, ...]:
    """Return names and units of all columns, with ``stated`` quantities of the flow, ``others`` behind them."""
    flow = ((name, unit) for name, unit in _FLOW_UNITS.items() if name in stated)
    return (*ESTIMATE_COLUMNS, *HEALTH_COLUMNS[3:], *flow, *others)


def plain_columns(columns: Sequence[Column]) -> dict[str, Column]:
    """Return the plain form of ``columns``, by the names there: time, loads, angles in degrees, and residuals.

    Names stay, but for angles of the air data, which lose their prefix.
    """
    loads = {"time", *(name for name, _ in (*LOAD_COLUMNS, *COEFFICIENT_COLUMNS))}
    plain = dict[str, Column]()
    for name, unit in columns:
        if name.removeprefix(SIGMA) in _ANGLES:
            plain[name] = name.replace(_AIR_DATA, "", 1), "deg"
        elif name in loads or is_column(name) or name.startswith((RESIDUAL, RESIDUAL_LIMIT)):
            plain[name] = name, unit
    return plain


def health_words(states: FloatArray) -> list[str]:
    """Return the name of each state, "" of a sample that an FMU refused."""
    names = {float(state): state.name for state in HealthState}
    return [names.get(state, "") for state in states.tolist()]


# --- estimates ---------------------------------------------------------------------------------------------------


class EstimateWriter(ABC):
    """Writes blocks of rows to a file: columns of numbers, then columns of text.

    ``path`` is the file that messages name. Rows are collected until there are ``least`` of them.
    """

    least = _COLLECTED_ROWS

    def __init__(
        self,
        path: Path,
        temporary: Path,
        columns: Sequence[Column],
        text_columns: Sequence[str],
        attributes: Mapping[str, float],
    ) -> None:
        self.path, self.columns, self.text_columns = path, tuple(columns), tuple(text_columns)
        self.rows = 0
        self._collected: list[list[Sequence[Any] | FloatArray]] = []
        self._open(temporary, {"schema": SCHEMA, "schema_version": SCHEMA_VERSION, **attributes})

    def write(self, columns: Iterable[FloatArray], texts: Mapping[str, Sequence[str]] | None = None) -> None:
        """Append n rows: the ``columns`` (n,) in their units, and n texts of each text column.

        Raises
        ------
        StrainfmuError
            The file cannot be written.
        """
        self._collected.append([*columns, *((texts or {})[name] for name in self.text_columns)])
        if sum(len(part[0]) for part in self._collected) >= self.least:
            with writing(self.path):
                self._flush()

    def _flush(self) -> None:
        """Write the rows that are collected."""
        if self._collected:
            parts = [*zip(*self._collected, strict=True)]
            self._collected, n = [], len(self.columns)
            values = [np.concatenate(of_column) for of_column in parts[:n]]
            self._append(values, [[*chain(*of_column)] for of_column in parts[n:]])
            self.rows += len(values[0])

    def finish(self) -> None:
        """Write what is missing and bring all to the disk; raises OSError if it cannot."""
        self._flush()
        self._finish()

    @abstractmethod
    def _open(self, temporary: Path, attributes: Mapping[str, Any]) -> None:
        """Begin the file."""

    @abstractmethod
    def _append(self, values: list[FloatArray], texts: list[list[str]]) -> None:
        """Append the values of each column behind :attr:`rows` rows, and the texts of each text column."""

    @abstractmethod
    def _finish(self) -> None:
        """End the file and bring it to the disk."""

    @abstractmethod
    def close(self) -> None:
        """Close the file, in order or not."""


class _StreamWriter(EstimateWriter):
    """Writes to a stream of Python."""

    _stream: IO[Any]

    def _finish(self) -> None:
        self._stream.flush()
        os.fsync(self._stream.fileno())

    def close(self) -> None:
        with suppress(OSError):  # what is missing does not fit either: finish() has raised, or never came
            self._stream.close()


class _CsvWriter(_StreamWriter):
    least = 1

    def _open(self, temporary: Path, attributes: Mapping[str, Any]) -> None:
        self._stream = temporary.open("w", newline="", encoding="utf-8")
        self._writer = csv.writer(self._stream, lineterminator="\n")
        self._writer.writerow([*(f"{name} [{unit}]" for name, unit in self.columns), *self.text_columns])

    def _append(self, values: list[FloatArray], texts: list[list[str]]) -> None:
        self._writer.writerows(zip(*(column.tolist() for column in values), *texts, strict=True))


class _ParquetWriter(_StreamWriter):
    """Units are the metadata ``unit`` of each column."""

    def _open(self, temporary: Path, attributes: Mapping[str, Any]) -> None:
        parquet, arrow = (library(name, "pyarrow", "parquet") for name in ("pyarrow.parquet", "pyarrow"))
        fields = [arrow.field(name, arrow.float64(), metadata={"unit": unit}) for name, unit in self.columns]
        fields += [arrow.field(name, arrow.string()) for name in self.text_columns]
        schema = arrow.schema(fields, metadata={name: str(value) for name, value in attributes.items()})
        self._table = partial(arrow.table, schema=schema)
        self._stream = temporary.open("wb")
        self._writer = parquet.ParquetWriter(self._stream, schema)

    def _append(self, values: list[FloatArray], texts: list[list[str]]) -> None:
        self._writer.write_table(self._table([*values, *texts]))

    def _finish(self) -> None:
        self._writer.close()
        super()._finish()


class _Hdf5Writer(EstimateWriter):
    def _open(self, temporary: Path, attributes: Mapping[str, Any]) -> None:
        self._guarded = GuardedFile(temporary)
        self._file = h5py.File(self._guarded, "w", rdcc_nbytes=_CHUNK_BYTES)
        self._file.attrs.update(attributes)
        self._sets = [self._data_set(name, "f8") for name, _ in self.columns]
        for item, (_, unit) in zip(self._sets, self.columns, strict=True):
            item.attrs["unit"] = unit
        self._sets += [self._data_set(name, h5py.string_dtype()) for name in self.text_columns]

    def _data_set(self, name: str, kind: object) -> h5py.Dataset:
        # A slash, which names of gauges may hold, would begin a group.
        return self._file.create_dataset(
            name.replace("/", _SLASH), (0,), maxshape=(None,), dtype=kind, chunks=(_CHUNK_ROWS,)
        )

    def _append(self, values: list[FloatArray], texts: list[list[str]]) -> None:
        """Append rows; a text that was never written reads as an empty one."""
        end = self.rows + len(values[0])
        for item, of_column in zip(self._sets, (*values, *texts), strict=True):
            item.resize((end,))
            if not isinstance(of_column, list) or any(of_column):
                item[self.rows :] = of_column
        self._guarded.raise_error()

    def _finish(self) -> None:
        self._file.close()
        self._guarded.sync()

    def close(self) -> None:
        self._file.close()
        self._guarded.close()


class _Mf4Writer(EstimateWriter):
    """One channel group whose times are the column ``time``; a longer text ends on two points."""

    def _open(self, temporary: Path, attributes: Mapping[str, Any]) -> None:
        asammdf = library("asammdf", "asammdf", "mf4")
        self._signal, self._temporary = asammdf.Signal, temporary
        temporary.touch()  # what cannot be written is refused before the work
        self._file = asammdf.MDF(version="4.10")
        self._file.header.comment = "; ".join(f"{name} = {value}" for name, value in attributes.items())

    def _append(self, values: list[FloatArray], texts: list[list[str]]) -> None:
        columns = [*values, *(_fixed(of_column) for of_column in texts)]
        if self.rows:
            self._file.extend(0, [(column, None) for column in columns])
            return
        names = [*self.columns[1:], *((name, "") for name in self.text_columns)]
        signals = [
            self._signal(column, values[0], name=name, unit=unit, encoding="utf-8")
            for column, (name, unit) in zip(columns[1:], names, strict=True)
        ]
        self._file.append(signals, comment="strainfmu", common_timebase=True)

    def _finish(self) -> None:
        self._file.save(self._temporary, overwrite=True)

    def close(self) -> None:
        self._file.close()


def _fixed(texts: Sequence[str]) -> Any:
    """Return texts of one length in bytes."""
    cut = [text if len(text) <= _LONGEST_TEXT else f"{text[: _LONGEST_TEXT - 2]}.." for text in texts]
    return np.array([text.encode() for text in cut], dtype=f"S{_LONGEST_TEXT}")


_WRITERS: dict[str, type[EstimateWriter]] = {
    ".csv": _CsvWriter,
    **dict.fromkeys((".h5", ".hdf5"), _Hdf5Writer),
    ".parquet": _ParquetWriter,
    ".mf4": _Mf4Writer,
}
OUTPUT_SUFFIXES = tuple(_WRITERS)


def check_output(path: Path) -> None:
    """Refuse an output of another kind before any work begins.

    Raises
    ------
    InputError
        No writer has its suffix.
    """
    if path.suffix.lower() not in OUTPUT_SUFFIXES:
        raise InputError(f"{path}: expected one of {', '.join(OUTPUT_SUFFIXES)}, got '{path.suffix}'")


@contextmanager
def estimate_writer(
    path: Path,
    columns: Sequence[Column] = ESTIMATE_COLUMNS,
    text_columns: Sequence[str] = (),
    attributes: Mapping[str, float] | None = None,
) -> Iterator[EstimateWriter]:
    """Open an output; it is renamed into place at the end, and removed if there was an error.

    ``attributes`` say how the estimates were made; CSV has no room for them.

    Raises
    ------
    InputError
        No writer has its suffix.
    StrainfmuError
        It cannot be written, or the library that writes it is missing; an earlier file remains unchanged.
    """
    check_output(path)
    kind = _WRITERS[path.suffix.lower()]
    with whole_file(path, lambda temporary: kind(path, temporary, columns, text_columns, attributes or {})) as one:
        yield one
