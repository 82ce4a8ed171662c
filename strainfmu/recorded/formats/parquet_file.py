"""Parquet files through pyarrow: units by metadata, or in brackets behind the names."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.columns.column_names import name_and_unit
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, dated, seconds_of, unique_names


@contextmanager
def parquet_channels(path: Path, reading: Reading) -> Iterator[ChannelFile]:
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
