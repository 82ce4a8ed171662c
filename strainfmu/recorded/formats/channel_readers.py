"""Recordings of every format as sets of channels: CSV, MF4, TDMS, HDF5, MAT and Parquet."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.columns.column_names import TIME_NAMES, split_heading
from strainfmu.recorded.formats.channel_file import ChannelFile, dated, matrix_columns, seconds_of, unique_names
from strainfmu.recorded.formats.csv_layout import ALL_UNITS, NUMBER, csv_layout
from strainfmu.recorded.formats.csv_rows import RowReader, iso_time, time_notes
from strainfmu.recorded.formats.hdf5_file import opened_hdf5, reading
from strainfmu.recorded.formats.mdf_file import opened_mdf
from strainfmu.recorded.formats.name_match import plain_name
from strainfmu.recorded.formats.tdms_file import opened_tdms


def name_and_unit(heading: str) -> tuple[str, str | None]:
    """Return name and unit of a heading; brackets that hold no unit belong to the name."""
    name, unit = split_heading(heading)
    return (name, unit) if unit in ALL_UNITS else (heading.strip(), None)


@contextmanager
def csv_channels(path: Path, stated: Collection[str]) -> Iterator[ChannelFile]:
    """Open a CSV file; ``stated`` are the plain names of channels that tell its headings."""
    known = {*stated, *TIME_NAMES}

    def is_known(name: str) -> bool:
        return plain_name(name) in known

    layout = csv_layout(path, is_known)
    parts = [name_and_unit(heading) for heading in layout.headings]
    names = [name for name, _ in parts]
    units = [unit if layout.units is None else layout.units[i] for i, (_, unit) in enumerate(parts)]
    times = [i for i, name in enumerate(names) if plain_name(name) in known and _is_iso(layout.first_row, i)]

    @cache
    def table() -> FloatArray:
        numeric = [i for i, name in enumerate(names) if plain_name(name) in known]
        held = np.full((0, len(names)), np.nan)
        if numeric:
            reader = RowReader(
                path=path, layout=layout, names=names, columns=numeric, time=times[0] if times else -1
            )
            rows = [numbers for _, numbers in reader.rows()]
            held = np.full((len(rows), len(names)), np.nan)
            held[:, numeric] = np.array(rows).reshape(len(rows), len(numeric))
        return held

    yield ChannelFile(
        path=path,
        names=tuple(names),
        units={name: unit for name, unit in zip(names, units, strict=True) if unit},
        values=lambda name: table()[:, names.index(name)],
        notes={names[i]: note for i in times for note in time_notes(path, layout, names=names, time=i)},
    )


def _is_iso(row: tuple[str, ...], column: int) -> bool:
    text = row[column].strip() if column < len(row) else ""
    return NUMBER.fullmatch(text) is None and iso_time(text) is not None


@contextmanager
def mf4_channels(path: Path, stated: Collection[str]) -> Iterator[ChannelFile]:
    """Open an MF4 file, whose channels have times themselves."""
    with opened_mdf(path) as file:
        names = [name for name in file.channels_db if plain_name(name) not in TIME_NAMES]

        def signal(name: str) -> Any:
            if len(file.channels_db[name]) > 1:
                raise InputError(f"{path}: expected one channel '{name}', got {len(file.channels_db[name])}")
            return file.get(name)

        kept = [
            name for name in names if plain_name(name.rpartition("/")[2]) in stated or plain_name(name) in stated
        ]
        units = {name: str(signal(name).unit) for name in kept if len(file.channels_db[name]) == 1}
        yield ChannelFile(
            path=path,
            names=tuple(names),
            units={name: unit for name, unit in units.items() if unit},
            values=lambda name: signal(name).samples,
            clock=lambda name: np.asarray(signal(name).timestamps, dtype=float),
        )


@contextmanager
def tdms_channels(path: Path, stated: Collection[str]) -> Iterator[ChannelFile]:
    """Open a TDMS file; times of a channel are its group's channel of time, or those of its waveform."""
    with opened_tdms(path) as file:
        channels = {f"{group.name}/{one.name}": one for group in file.groups() for one in group.channels()}
        starts = [
            one.properties["wf_start_time"] for one in channels.values() if "wf_start_time" in one.properties
        ]
        times = {name: one for name, one in channels.items() if plain_name(one.name) in TIME_NAMES}

        def numbers(name: str) -> Any:
            held = channels[name][:]
            return seconds_of(held) if held.dtype.kind == "M" else held

        def time_of(name: str) -> str | None:
            group = channels[name].group_name
            return next((at for at, time in times.items() if time.group_name == group), None)

        def clock(name: str) -> FloatArray | None:
            channel = channels[name]
            if time_of(name) is not None or "wf_increment" not in channel.properties:
                return None
            start = channel.properties.get("wf_start_time")
            ahead = 0.0 if start is None or not starts else float((start - min(starts)) / np.timedelta64(1, "s"))
            offset = ahead + float(channel.properties.get("wf_start_offset", 0.0))
            return np.asarray(offset + float(channel.properties["wf_increment"]) * np.arange(len(channel)))

        yield ChannelFile(
            path=path,
            names=unique_names(path, list(channels)),
            notes={name: dated(path, name) for name, one in times.items() if one.dtype.kind == "M"},
            units={
                name: u for name, one in channels.items() if (u := str(one.properties.get("unit_string") or ""))
            },
            values=numbers,
            clock=clock,
            time_of=time_of,
        )


@contextmanager
def hdf5_channels(path: Path, stated: Collection[str], is_matlab: bool = False) -> Iterator[ChannelFile]:
    """Open an HDF5 file: arrays, columns of matrices 'name[1]' .., fields of tables; MATLAB's turned."""
    kind = "a MAT file" if is_matlab else "an HDF5 file"
    with opened_hdf5(path, kind) as file:
        held: dict[str, Callable[[], Any]] = {}
        units: dict[str, str] = {}

        def add(at: str, item: Any) -> None:
            if not isinstance(item, h5py.Dataset) or at.startswith("#"):
                return
            name = at.replace("%2F", "/")
            if item.dtype.names:
                held.update({f"{name}/{f}": partial(_field, item, f) for f in item.dtype.names})
            elif item.ndim and _class(item) != "char":  # what are no numbers is refused where it is read
                turned = is_matlab and item.ndim == 2
                shape = item.shape[::-1] if turned else item.shape
                columns = matrix_columns(name, shape)
                for k, one in enumerate(columns):
                    held[one] = partial(_column, item, k, n=len(columns), is_turned=turned)
                    unit = next((_text(item.attrs[key]) for key in ("unit", "units") if key in item.attrs), "")
                    if unit:
                        units[one] = unit

        with reading(path, kind):
            file.visititems(add)
        yield ChannelFile(path=path, names=tuple(held), units=units, values=lambda name: held[name]())


def _field(item: h5py.Dataset, name: str) -> Any:
    """Return a field of a table."""
    return item[name]


def _column(item: h5py.Dataset, k: int, n: int, is_turned: bool) -> Any:
    """Return column k of an array of n columns."""
    if n == 1:
        return np.ravel(item[()])
    return item[k, :] if is_turned else item[:, k]


def _class(item: h5py.Dataset) -> str:
    return _text(item.attrs.get("MATLAB_class", ""))


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


@contextmanager
def mat_channels(path: Path, stated: Collection[str]) -> Iterator[ChannelFile]:
    """Open a MAT file: version 7.3 through h5py, older ones through scipy; fields of structures 'name.field'."""
    if h5py.is_hdf5(path):
        with path.open("rb") as stream:
            is_matlab = stream.read(6) == b"MATLAB"
        with hdf5_channels(path, stated, is_matlab=is_matlab) as found:
            yield found
        return
    try:
        from scipy.io import loadmat
    except ImportError as error:
        raise StrainfmuError("scipy is not installed: pip install 'strainfmu[mat]'") from error
    try:
        entries = loadmat(path, simplify_cells=True)
    except Exception as error:  # scipy raises whatever its parsers do
        raise InputError(f"{path}: damaged, or not a MAT file") from error
    held: dict[str, Any] = {}
    for name, value in entries.items():
        if not name.startswith("__"):
            _add_entry(held, name, value)
    yield ChannelFile(path=path, names=tuple(held), values=lambda name: held[name])


def _add_entry(held: dict[str, Any], name: str, value: Any) -> None:
    """Add the channels of a variable of a MAT file to ``held``."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _add_entry(held, f"{name}.{key}", inner)
        return
    array = np.asarray(value)
    if array.ndim and array.size != 1:  # what are no numbers is refused where it is read
        columns = matrix_columns(name, array.shape)
        values = [np.ravel(array)] if len(columns) == 1 else list(array.T)
        held.update(zip(columns, values, strict=False))


@contextmanager
def parquet_channels(path: Path, stated: Collection[str]) -> Iterator[ChannelFile]:
    """Open a Parquet file; units by the metadata 'unit' of a column, or in brackets behind its name."""
    try:
        import pyarrow.parquet as parquet
    except ImportError as error:
        raise StrainfmuError("pyarrow is not installed: pip install 'strainfmu[parquet]'") from error
    try:
        file = parquet.ParquetFile(path)
        schema = file.schema_arrow
    except Exception as error:  # pyarrow raises errors of several kinds
        raise InputError(f"{path}: damaged, or not a Parquet file") from error
    with file:
        parts = {name: name_and_unit(name) for name in unique_names(path, schema.names)}
        column = {name: heading for heading, (name, _) in parts.items()}
        if len(column) < len(parts):
            raise InputError(f"{path}: expected one column of each name, got {', '.join(parts)}")
        units = {name: unit for name, unit in parts.values() if unit}
        for heading, (name, _) in parts.items():
            own = (schema.field(heading).metadata or {}).get(b"unit")
            if own:
                units[name] = own.decode("utf-8", "replace")

        def numbers(name: str) -> Any:
            values = file.read(columns=[column[name]]).column(0).to_numpy()
            return seconds_of(values) if values.dtype.kind == "M" else values

        is_dated = {name: "timestamp" in str(schema.field(heading).type) for name, heading in column.items()}
        notes = {name: dated(path, name) for name, held in is_dated.items() if held}
        yield ChannelFile(path=path, names=tuple(column), units=units, values=numbers, notes=notes)


CHANNEL_READERS = {
    ".csv": csv_channels,
    ".txt": csv_channels,
    ".h5": hdf5_channels,
    ".hdf5": hdf5_channels,
    ".mat": mat_channels,
    ".mf4": mf4_channels,
    ".parquet": parquet_channels,
    ".tdms": tdms_channels,
}
"""Reader of each kind of file."""


@contextmanager
def open_channels(path: Path, stated: Collection[str] = ()) -> Iterator[ChannelFile]:
    """Open a recording as channels.

    Parameters
    ----------
    stated : plain names of the channels that are to be read.

    Raises
    ------
    InputError
        The file is missing, damaged or of another kind.
    StrainfmuError
        The reader of its kind is not installed.
    """
    reader = CHANNEL_READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: expected one of {', '.join(CHANNEL_READERS)}, got '{path.suffix}'")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with reader(path, stated) as opened:
        yield opened
