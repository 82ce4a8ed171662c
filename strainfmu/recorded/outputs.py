"""Files of estimates: names and units of their columns, and writers of CSV, HDF5, Parquet and MF4.

A file is written in parts and appears when it is complete.
"""

import csv
import os
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from itertools import chain
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, importable, library
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, SAMPLE_INPUTS
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.off_deadline import no_field
from strainfmu.estimator.other_loads import SIGMA, column_of, is_column
from strainfmu.files import GuardedFile, whole_file, writing
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.interface.health_names import (
    CHI_SQUARE,
    CHI_SQUARE_LIMIT,
    ENVELOPE_SCORE,
    LINEAR_LOADS,
    STATE,
    SUSPECTS,
    USABLE,
)
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX

SCHEMA = "strainfmu.estimates"
SCHEMA_VERSION = 3

Column = tuple[str, str]
"""Name and unit."""

LOAD_COLUMNS: tuple[Column, ...] = (
    *((name, load.unit.replace(".", " ")) for name, load in LOADS.items()),
    *((f"{SIGMA}{name}", load.unit.replace(".", " ")) for name, load in LOADS.items()),
)
"""Forces and moments about the reference point, and their standard deviations."""

COEFFICIENT_COLUMNS: tuple[Column, ...] = (
    *((name, "1") for name in COEFFICIENT_NAMES),
    *((f"{SIGMA}{name}", "1") for name in COEFFICIENT_NAMES),
)

RESIDUAL_LIMIT, RESIDUAL = "health.residual_limit", "residual."
ENVELOPE_SCORE_LIMIT = "health.envelope_score_limit"

HEALTH_COLUMNS: tuple[Column, ...] = tuple(
    (name, "1")
    for name in (
        *(CHI_SQUARE, STATE, "gauges_used", CHI_SQUARE_LIMIT, "health.degrees_of_freedom", SUSPECTS),
        *(ENVELOPE_SCORE, ENVELOPE_SCORE_LIMIT, USABLE),
    )
)

AIR_DATA, IDENTIFIED, USED = "air_data.", "identified.air_data.", "navigation_used."
"""Beginnings of columns; of the last ones, which say whether a quantity of navigation is used."""

ESTIMATE_COLUMNS: tuple[Column, ...] = (
    ("time", "s"),
    *LOAD_COLUMNS,
    *COEFFICIENT_COLUMNS,
    (DYNAMIC_PRESSURE, "Pa"),
    *HEALTH_COLUMNS[:3],
)
"""Columns of every output: name and unit."""

TEXTS = ("suspect_gauges", "strain_faults")
"""Columns of text: names of the suspects with a semicolon between them; why strains were left out, ``held`` or
``zero`` of all gauges, else the names of gauges."""

PLAIN_TEXTS = ("health",)
"""Columns of text of the plain form: the name of the state; empty for a sample that an FMU refused."""

_ANGLES = ("air_data.angle_of_attack", "air_data.sideslip_angle")
_FLOW_UNITS = {quantity.name: quantity.unit for quantity in SAMPLE_INPUTS[1:]}
_SLASH = "%2F"

_COLLECTED_ROWS = 32768
"""Rows that are written at once, or more."""

_GROUP_ROWS = 4 * _COLLECTED_ROWS
"""Rows of a row group in Parquet, whose description stays in memory until the file is complete."""

_RETAINED = 1 << 16
"""Bytes of each column that HDF5 may retain, less than a chunk, which is written whole; by default 8 MiB."""

_ROWS_BY_CSV = 8000
"""Rows of a CSV file in which the module csv takes less time than the import of pyarrow."""

_LONGEST_TEXT = 250
"""Characters of a text in MF4, whose records have one length."""


# --- columns -----------------------------------------------------------------------------------------------------


def output_columns(stated: Sequence[str], extra: Sequence[Column]) -> tuple[Column, ...]:
    """Return names and units of all columns: with ``stated`` quantities of the flow, and ``extra`` ones."""
    flow = ((name, unit) for name, unit in _FLOW_UNITS.items() if name in stated)
    return (*ESTIMATE_COLUMNS, *HEALTH_COLUMNS[3:], *flow, *extra)


def plain_columns(columns: Sequence[Column]) -> dict[str, Column]:
    """Return the plain form of ``columns``, by the names there: time, loads, angles in degrees, and residuals.

    Names stay, but for angles of the air data, which lose their prefix.
    """
    loads = {"time", *(name for name, _ in (*LOAD_COLUMNS, *COEFFICIENT_COLUMNS))}
    plain = dict[str, Column]()
    for name, unit in columns:
        if name.removeprefix(SIGMA) in _ANGLES:
            plain[name] = name.replace(AIR_DATA, "", 1), "deg"
        elif name in loads or is_column(name) or name.startswith((RESIDUAL, RESIDUAL_LIMIT)):
            plain[name] = name, unit
    return plain


def health_words(states: FloatArray) -> list[str]:
    """Return the name of each state, "" of a sample that an FMU refused."""
    names = {float(state): state.name for state in HealthState}
    return [names.get(state, "") for state in states.tolist()]


_OTHER_PREFIXES = (
    *(AIR_DATA, f"{SIGMA}{AIR_DATA}", IDENTIFIED, USED),
    *(LINEAR_LOADS, OUTSIDE_PREFIX),
)
"""What the names of such outputs begin with, but for loads behind the five."""


def other_outputs_of(outputs: Iterable[tuple[str, str]]) -> dict[str, Column]:
    """Return the columns of the others among ``outputs``, names and units, in the order of the columns of a map.

    Loads stand ahead of their standard deviations; air data have that order already.
    """
    extra = {
        name: (
            column_of(name) or ("linear_loads" if name == LINEAR_LOADS else name),
            unit.replace(".", " "),
        )
        for name, unit in outputs
        if column_of(name) or name.startswith(_OTHER_PREFIXES)
    }
    return dict(sorted(extra.items(), key=lambda item: bool(column_of(item[0])) and item[0].startswith(SIGMA)))


# --- files -------------------------------------------------------------------------------------------------------

Parts = Generator[None, Any, None]
"""A file that takes parts and ends with None; of estimates a part is the values of each column, then texts."""


class PartsWriter:
    """Writes parts to a file; ``path`` is the file that messages name.

    Of estimates ``rows_at_once`` or more are written in a call: each costs as much as thousands of rows, and the
    first ones are a chunk in HDF5. Behind ``numbers`` columns of numbers stand columns of text.
    """

    def __init__(self, path: Path, parts: Parts, numbers: int = 0, rows_at_once: int = 0) -> None:
        self.path, self._parts, self._numbers, self._at_once = path, parts, numbers, rows_at_once
        self._rows = list[Any]()
        next(parts)

    def write(self, part: Any) -> None:
        """Append a part.

        Raises
        ------
        StrainfmuError
            The file cannot be written.
        """
        with writing(self.path):
            if not self._at_once:
                self._parts.send(part)
                return
            self._rows.append(part)
            if sum(len(rows[0]) for rows in self._rows) >= self._at_once:
                self._send_rows()

    def _send_rows(self) -> None:
        n, columns = self._numbers, [*zip(*self._rows, strict=True)]
        self._rows.clear()
        self._parts.send([*map(np.concatenate, columns[:n]), *([*chain(*texts)] for texts in columns[n:])])

    def finish(self) -> None:
        """Write what is missing and bring all to the disk; raises OSError if it cannot."""
        if self._rows:
            self._send_rows()
        with suppress(StopIteration):
            self._parts.send(None)

    def close(self) -> None:
        """Close the file, in order or not."""
        with suppress(OSError):  # what is missing does not fit either: finish() has raised, or never came
            self._parts.close()


def _csv(temporary: Path, columns: Sequence[Column], texts: Sequence[str], attributes: Mapping[str, Any]) -> Parts:
    with temporary.open("w", newline="", encoding="utf-8") as stream:
        writer, n, rows = csv.writer(stream, lineterminator="\n"), len(columns), 0
        writer.writerow([*(f"{name} [{unit}]" for name, unit in columns), *texts])
        while (table := (yield)) is not None:
            rows += len(table[0])
            if rows > _ROWS_BY_CSV and (lines := _lines(table[:n], table[n:])) is not None:
                stream.write(lines)
            else:
                writer.writerows(zip(*(values.tolist() for values in table[:n]), *table[n:], strict=True))
        stream.flush()
        os.fsync(stream.fileno())


def _lines(numbers: Sequence[FloatArray], texts: Sequence[Sequence[str]]) -> str | None:
    """Return the lines of a table as csv writes them, by pyarrow in a fifth of the time; None without it, and of
    texts that need quotes.

    Both write the shortest decimals of a number. Arrow writes whole numbers without a point, and exponents of
    numbers below 1e-4 or from 1e10 on in another form: these are Python's.
    """
    arrow, compute = importable("pyarrow"), importable("pyarrow.compute")
    if arrow is None or compute is None:
        return None
    cells = list[Any]()
    for column in numbers:
        size = np.abs(column)
        is_other = (size < 1e-4) | (size >= 1e10) | (column == np.floor(column))
        of_python = arrow.array([repr(number) for number in column[is_other].tolist()], arrow.string())
        decimals = compute.cast(arrow.array(column), arrow.string())
        cells.append(compute.replace_with_mask(decimals, arrow.array(is_other), of_python))
    for column_of_texts in texts:
        cells.append(arrow.array(column_of_texts, arrow.string()))
        if compute.any(compute.match_substring_regex(cells[-1], '[",\r\n]')).as_py():
            return None
    rows = compute.binary_join_element_wise(*cells, ",")
    return "\n".join([*rows.to_pylist(), ""])


def _parquet(
    temporary: Path, columns: Sequence[Column], texts: Sequence[str], attributes: Mapping[str, Any]
) -> Parts:
    """Units are the metadata ``unit`` of each column. A dictionary of numbers that hardly repeat takes a third of
    the time of an estimate, and room."""
    parquet, arrow = (library(name, "pyarrow", "parquet") for name in ("pyarrow.parquet", "pyarrow"))
    fields = [arrow.field(name, arrow.float64(), metadata={"unit": unit}) for name, unit in columns]
    fields += [arrow.field(name, arrow.string()) for name in texts]
    schema = arrow.schema(fields, metadata={name: str(value) for name, value in attributes.items()})
    waiting: list[Any] = []
    with temporary.open("wb") as stream:
        writer = parquet.ParquetWriter(stream, schema, use_dictionary=list(texts))
        while (table := (yield)) is not None:
            waiting.append(arrow.table(table, schema=schema))
            if sum(part.num_rows for part in waiting) >= _GROUP_ROWS:
                writer.write_table(arrow.concat_tables(waiting))
                waiting.clear()
        if waiting:
            writer.write_table(arrow.concat_tables(waiting))
        writer.close()
        stream.flush()
        os.fsync(stream.fileno())


def _hdf5(
    temporary: Path, columns: Sequence[Column], texts: Sequence[str], attributes: Mapping[str, Any]
) -> Parts:
    """A slash, which names of gauges may hold, would begin a group; a text that was never written is empty."""
    guarded, rows = GuardedFile(temporary), 0
    try:
        with h5py.File(guarded, "w", rdcc_nbytes=_RETAINED) as file:
            file.attrs.update(attributes)
            table = yield
            chunk = 1 if table is None else len(table[0])
            layout = {"maxshape": (None,), "chunks": (chunk,)}

            def data_set(name: str, kind: object) -> h5py.Dataset:
                return file.create_dataset(name.replace("/", _SLASH), (0,), dtype=kind, **layout)

            items = [data_set(name, "f8") for name, _ in columns]
            for item, (_, unit) in zip(items, columns, strict=True):
                item.attrs["unit"] = unit
            items += [data_set(name, h5py.string_dtype()) for name in texts]
            while table is not None:
                end = rows + len(table[0])
                for item, values in zip(items, table, strict=True):
                    item.resize((end,))
                    if isinstance(values, list):
                        if texts_in := [row for row, text in enumerate(values) if text]:
                            first, behind = texts_in[0], texts_in[-1] + 1
                            item[rows + first : rows + behind] = values[first:behind]
                    elif len(values) == chunk and rows % chunk == 0:  # as it is, in a fifth of the time
                        item.id.write_direct_chunk((rows,), values)
                    else:
                        item[rows:] = values
                guarded.raise_error()
                rows, table = end, (yield)
        guarded.sync()
    finally:
        guarded.close()


def _mf4(temporary: Path, columns: Sequence[Column], texts: Sequence[str], attributes: Mapping[str, Any]) -> Parts:
    """One channel group whose times are the column ``time``; a longer text ends on two points."""
    asammdf, has_rows = library("asammdf", "asammdf", "mf4"), False
    temporary.touch()  # what cannot be written is refused before the work
    with asammdf.MDF(version="4.10") as file:
        file.header.comment = "; ".join(f"{name} = {value}" for name, value in attributes.items())
        while (table := (yield)) is not None:
            table = [_fixed(values) if isinstance(values, list) else values for values in table]
            if has_rows:
                file.extend(0, [(values, None) for values in table])
                continue
            names = [*columns[1:], *((name, "") for name in texts)]
            signals = [
                asammdf.Signal(values, table[0], name=name, unit=unit, encoding="utf-8")
                for values, (name, unit) in zip(table[1:], names, strict=True)
            ]
            file.append(signals, comment="strainfmu", common_timebase=True)
            has_rows = True
        file.save(temporary, overwrite=True)


def _fixed(texts: Sequence[str]) -> Any:
    """Return texts of one length in bytes."""
    cut = [text if len(text) <= _LONGEST_TEXT else f"{text[: _LONGEST_TEXT - 2]}.." for text in texts]
    return np.array([text.encode() for text in cut], dtype=f"S{_LONGEST_TEXT}")


_CONTAINERS = {".csv": _csv, ".h5": _hdf5, ".hdf5": _hdf5, ".parquet": _parquet, ".mf4": _mf4}
OUTPUT_SUFFIXES = tuple(_CONTAINERS)


def check_output(path: Path) -> None:
    """Refuse an output of another kind before any work begins.

    Raises
    ------
    InputError
        No writer has its suffix.
    """
    if path.suffix.lower() not in OUTPUT_SUFFIXES:
        raise InputError(f"{path}: expected one of {', '.join(OUTPUT_SUFFIXES)}, got '{path.suffix}'")


def estimate_writer(
    path: Path,
    columns: Sequence[Column] = ESTIMATE_COLUMNS,
    text_columns: Sequence[str] = (),
    attributes: Mapping[str, float] | None = None,
) -> AbstractContextManager[PartsWriter]:
    """Open an output, which takes rows: ``columns`` (n,) in their units, then n texts of each text column.

    It is renamed into place at the end, and removed if there was an error. ``attributes`` say how the estimates
    were made; CSV has no room for them.

    Raises
    ------
    StrainfmuError
        It cannot be written, or the library that writes it is missing; an earlier file remains unchanged.
    """
    suffix = path.suffix.lower()
    stated = {"schema": SCHEMA, "schema_version": SCHEMA_VERSION, **(attributes or {})}

    def opened(temporary: Path) -> PartsWriter:
        parts = _CONTAINERS[suffix](temporary, columns, text_columns, stated)
        return PartsWriter(path, parts, len(columns), 1 if suffix == ".csv" else _COLLECTED_ROWS)

    return whole_file(path, opened)


# --- pressure fields ---------------------------------------------------------------------------------------------

FIELD_SUFFIX = ".vtkhdf"
_TRIANGLE = 5
"""VTK_TRIANGLE."""

FIELD_ARRAYS = ("pressure", "sigma_pressure")
NET_FIELD_ARRAYS = ("net_pressure", "sigma_net_pressure")
"""Arrays of points [Pa]: absolute pressure, or p - p_inf, with its standard deviation."""


def check_field_output(path: Path, inverse_map: InverseMap | None, source: Path) -> None:
    """Refuse a series that cannot be written before any work begins.

    Raises
    ------
    InputError
        The suffix is another one, ``source`` is no map, or the map holds no pressure field.
    """
    if path.suffix.lower() != FIELD_SUFFIX:
        raise InputError(f"{path}: expected {FIELD_SUFFIX}, got '{path.suffix}'")
    if inverse_map is None:
        raise InputError(f"{source}: --field: expected an inverse map, got an FMU")
    manifold = inverse_map.manifold
    if not inverse_map.has_field or (manifold is not None and manifold.surface_field is None):
        raise InputError(f"{source}: --field: {no_field()}")


def field_series_writer(
    path: Path, inverse_map: InverseMap, every: int = 1
) -> AbstractContextManager[PartsWriter]:
    """Open a series of fields of every ``every``-th sample on the surface of ``inverse_map``.

    It takes times (n,) [s] and n estimates, is renamed into place at the end, and removed if there was an error.

    Raises
    ------
    StrainfmuError
        It cannot be written; an earlier file remains unchanged.
    """
    return whole_file(path, lambda temporary: PartsWriter(path, _fields(temporary, inverse_map, every)))


def _fields(temporary: Path, inverse_map: InverseMap, every: int) -> Parts:
    """One field after another in the VTKHDF layout."""
    point, triangle = inverse_map.point, inverse_map.triangle
    n, n_t, number, passed = len(point), len(triangle), 0, 0
    guarded = GuardedFile(temporary)
    try:
        with h5py.File(guarded, "w") as file:
            root = file.create_group("VTKHDF", track_order=True)
            root.attrs["Version"] = np.array([2, 0], dtype="i8")
            kind = b"UnstructuredGrid"
            root.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))
            counts = {"NumberOfPoints": n, "NumberOfCells": n_t, "NumberOfConnectivityIds": 3 * n_t}
            for name, value in counts.items():
                root.create_dataset(name, data=np.array([value], dtype="i8"))
            root.create_dataset("Points", data=point.astype("f4")).attrs["unit"] = "m"
            root.create_dataset("Connectivity", data=triangle.ravel().astype("i8"))
            root.create_dataset("Offsets", data=3 * np.arange(n_t + 1, dtype="i8"))
            root.create_dataset("Types", data=np.full(n_t, _TRIANGLE, dtype="u1"))
            data, steps = root.create_group("PointData"), root.create_group("Steps")
            layout: dict[str, Any] = {"shape": (0,), "maxshape": (None,), "dtype": "f4", "chunks": (n,)}
            is_net = inverse_map.field_is_net and inverse_map.manifold is None
            names = NET_FIELD_ARRAYS if is_net else FIELD_ARRAYS
            arrays = [data.create_dataset(name, **layout, compression="gzip", shuffle=True) for name in names]
            times = steps.create_dataset("Values", (0,), maxshape=(None,), dtype="f8", chunks=(1024,))
            for item, unit in zip((*arrays, times), ("Pa", "Pa", "s"), strict=True):
                item.attrs["unit"] = unit
            while (part := (yield)) is not None:
                time, estimates = part
                for row in range(-passed % every, len(time), every):
                    field = estimates[row].pressure()
                    for item, values in zip(arrays, (field.pressure, field.std), strict=True):
                        item.resize((n * (number + 1),))
                        item[n * number :] = values.astype("f4")
                    times.resize((number + 1,))
                    times[number] = time[row]
                    guarded.raise_error()
                    number += 1
                passed += len(time)
            steps.attrs["NSteps"] = number
            steps.create_dataset("NumberOfParts", data=np.ones(number, dtype="i8"))
            for name in ("PartOffsets", "PointOffsets"):
                steps.create_dataset(name, data=np.zeros(number, dtype="i8"))
            for name in ("CellOffsets", "ConnectivityIdOffsets"):
                steps.create_dataset(name, data=np.zeros((number, 1), dtype="i8"))
            offsets = steps.create_group("PointDataOffsets")
            for name in names:
                offsets.create_dataset(name, data=n * np.arange(number, dtype="i8"))
        guarded.sync()
    finally:
        guarded.close()
