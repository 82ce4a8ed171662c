"""Recorded strains in CSV files."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import numpy as np

from strainfmu.errors import InputError
from strainfmu.recorded.column_names import Wanted
from strainfmu.recorded.columns import ColumnPlan, StrainBlock, plan_columns
from strainfmu.recorded.sample_blocks import BLOCK_ROWS, StrainFile, checked_block

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?nan", re.IGNORECASE)
"""A number in a cell: ASCII digits and a decimal point, or NaN. float() accepts more, such as 1_0 for 10."""


@contextmanager
def csv_strains(path: Path, wanted: Wanted) -> Iterator[StrainFile]:
    """Open a CSV file; parameters and errors as of :func:`~strainfmu.recorded.strain_files.open_strains`."""
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        sample = stream.readline()
        delimiter = max(",;\t", key=sample.count)
        headings = next(csv.reader([sample], delimiter=delimiter), [])
        while headings and not headings[-1].strip():
            headings.pop()  # what stands below is refused unless it is empty too
        if not headings:
            raise InputError(f"{path}: no headings found in the first line")
        plan = plan_columns(path, headings, wanted)
        blocks = _csv_blocks(path, stream, delimiter=delimiter, plan=plan, done=len(sample))
        yield StrainFile(path.stat().st_size, blocks, plan)


def _csv_blocks(
    path: Path, stream: TextIO, delimiter: str, plan: ColumnPlan, done: int
) -> Iterator[tuple[StrainBlock, int]]:
    """Yield blocks; rows are counted as lines of the file, the headings being the first."""
    line, first, rows = 1, 2, []

    def counted() -> Iterator[str]:
        nonlocal done
        for text in stream:
            done += len(text)
            yield text

    # The last time of a block is kept, so that times are compared across blocks.
    last = -np.inf
    for cells in _rows(path, counted(), delimiter):
        line += 1
        if not cells:
            continue
        rows.append(_numbers(path, cells, plan=plan, line=line))
        if len(rows) == BLOCK_ROWS:
            block, last = checked_block(plan, np.array(rows), first_row=first, last=last)
            yield block, done
            first, rows = line + 1, []
    if rows:
        yield checked_block(plan, np.array(rows), first_row=first, last=last)[0], done


def _rows(path: Path, lines: Iterator[str], delimiter: str) -> Iterator[list[str]]:
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        yield from reader
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num + 1}: {error}") from error


def _numbers(path: Path, cells: Sequence[str], plan: ColumnPlan, line: int) -> list[float]:
    """Return the cells in use as numbers; an empty cell is no value."""
    # A surplus cell shifts all after it, as a decimal comma between commas does.
    if max(plan.columns) >= len(cells) or any(cell.strip() for cell in cells[len(plan.names) :]):
        raise InputError(f"{path}: line {line}: expected {len(plan.names)} cells, got {len(cells)}")
    numbers = []
    for column in plan.columns:
        text = cells[column].strip()
        if text and _NUMBER.fullmatch(text) is None:
            raise InputError(
                f"{path}: line {line}, column '{plan.names[column]}': expected a number, got '{text[:40]}'"
            )
        numbers.append(float(text) if text else float("nan"))
    return numbers
