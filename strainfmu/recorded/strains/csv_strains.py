"""Recorded strains in CSV files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from strainfmu.recorded.columns.column_names import Wanted, is_read
from strainfmu.recorded.columns.columns import ColumnPlan, StrainBlock, plan_columns
from strainfmu.recorded.formats.csv_layout import csv_layout
from strainfmu.recorded.formats.csv_rows import RowReader, time_notes
from strainfmu.recorded.strains.sample_blocks import BLOCK_ROWS, StrainFile, checked_block


@contextmanager
def csv_strains(path: Path, wanted: Wanted) -> Iterator[StrainFile]:
    """Open a CSV file; the rest as :func:`~strainfmu.recorded.strains.strain_files.open_strains`."""
    layout = csv_layout(path, lambda name: is_read(name, wanted))
    plan = plan_columns(path, layout.headings, wanted, units=layout.units)
    reader = RowReader(
        path=path,
        layout=layout,
        names=plan.names,
        columns=plan.columns,
        time=plan.time,
        time_unit=plan.time_factor,
    )
    notes = time_notes(path, layout, names=plan.names, time=plan.time)
    yield StrainFile(path.stat().st_size, _csv_blocks(reader, plan), plan, notes)


def _csv_blocks(reader: RowReader, plan: ColumnPlan) -> Iterator[tuple[StrainBlock, int]]:
    """Yield blocks; rows are counted as lines of the file."""
    first, rows = 0, []
    # The last time of a block is kept, so that times are compared across blocks.
    last = -np.inf
    for line, numbers in reader.rows():
        first = first or line
        rows.append(numbers)
        if len(rows) == BLOCK_ROWS:
            block, last = checked_block(plan, np.array(rows), first_row=first, last=last)
            yield block, reader.done
            first, rows = 0, []
    if rows:
        yield checked_block(plan, np.array(rows), first_row=first, last=last)[0], plan.path.stat().st_size
