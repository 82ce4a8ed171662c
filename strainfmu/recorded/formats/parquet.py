"""Parquet files through pyarrow: units by metadata, or in brackets behind the names."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.errors import library
from strainfmu.recorded.names import name_and_unit
from strainfmu.recorded.table import (
    PIECE_ROWS,
    Column,
    Frame,
    Piece,
    Reading,
    Table,
    as_numbers,
    as_seconds,
    of_format,
)


def parquet_table(path: Path, reading: Reading, stack: ExitStack) -> Table:
    """Open a Parquet file; units by the metadata 'unit' of a column, or in brackets behind its name."""
    file = stack.enter_context(library("pyarrow.parquet", "pyarrow", "parquet").ParquetFile(path))
    schema, rows = file.schema_arrow, file.metadata.num_rows
    columns = tuple(_column(schema.field(i), reading) for i in range(len(schema.names)))

    def pieces(indices: Sequence[int], begin: int = 0) -> Iterator[Piece]:
        starts: list[np.datetime64] = []
        names = [schema.names[i] for i in indices]
        ends = np.cumsum([file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)])
        groups = [k for k, end in enumerate(ends.tolist()) if end > begin]
        end = int(ends[groups[0] - 1]) if groups and groups[0] else 0
        if groups and groups[0]:  # the first date of the file is the beginning of all its times
            groups.insert(0, 0)
            end -= int(ends[0])
        batches = file.iter_batches(PIECE_ROWS, row_groups=groups, columns=list(dict.fromkeys(names)))
        while True:
            with of_format(path, "a Parquet file"):
                batch = next(batches, None)
            if batch is None:
                return
            values = [
                as_numbers(path, columns[i], batch.column(name).to_numpy(zero_copy_only=False), starts)
                for i, name in zip(indices, names, strict=True)
            ]
            first, end = end, end + batch.num_rows
            skipped = min(max(begin - first, 0), batch.num_rows)
            if skipped < batch.num_rows:
                yield np.arange(first + skipped + 1, end + 1), [column[skipped:] for column in values], end

    return Table(path, (Frame(columns=columns, pieces=pieces, rows=rows, length=rows),))


def _column(field: Any, reading: Reading) -> Column:
    name, unit = name_and_unit(field.name, reading.is_known)
    stated = (field.metadata or {}).get(b"unit")
    dated = as_seconds(name) if "timestamp" in str(field.type) else ""
    return Column(
        name=name,
        unit=stated.decode("utf-8", "replace") if stated else unit,
        heading=field.name,
        dated=dated,
    )
