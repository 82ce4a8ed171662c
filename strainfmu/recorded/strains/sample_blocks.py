"""An open file of recorded strains: blocks of samples, with times that increase from block to block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.recorded.columns.column_names import Wanted
from strainfmu.recorded.columns.columns import ColumnPlan, StrainBlock, plan_columns

BLOCK_ROWS = 2000
"""Samples in one block."""


@dataclass(frozen=True, eq=False)
class StrainFile:
    """An open file: length, in any unit; blocks with the position that each reaches in it; columns; notes."""

    length: int
    blocks: Iterator[tuple[StrainBlock, int]]
    plan: ColumnPlan
    notes: tuple[str, ...] = ()


def checked_block(plan: ColumnPlan, table: FloatArray, first_row: int, last: float) -> tuple[StrainBlock, float]:
    """Return a block and its last time; times must go on from ``last`` [s]."""
    block = plan.block(table, first_row)
    if block.time[0] <= last:
        raise InputError(
            f"{plan.path}: column '{plan.names[plan.time]}', row {first_row}: expected increasing times, "
            f"got {block.time[0]:.9g} s after {last:.9g} s"
        )
    return block, float(block.time[-1])


def column_file(
    path: Path,
    columns: dict[str, Any],
    units: dict[str, str | None],
    wanted: Wanted,
    notes: tuple[str, ...] = (),
) -> StrainFile:
    """Read columns that a library provides one by one; all must have the same length."""
    names = list(columns)
    plan = plan_columns(path, names, wanted, units=[units.get(name) for name in names])
    used = [names[index] for index in plan.columns]
    for name in used:
        if columns[name] is None:
            raise InputError(f"{path}: '{name}': expected one number a sample")
    n = len(columns[used[0]])
    for name in used:
        if len(columns[name]) != n:
            raise InputError(f"{path}: '{name}': expected {n} values, got {len(columns[name])}")

    def blocks() -> Iterator[tuple[StrainBlock, int]]:
        last = -np.inf
        for first in range(0, n, BLOCK_ROWS):
            rows = slice(first, min(first + BLOCK_ROWS, n))
            try:
                table = np.column_stack([np.asarray(columns[name][rows], dtype=float) for name in used])
            except (TypeError, ValueError) as error:
                raise InputError(f"{path}: rows {first + 1} to {rows.stop}: values that are no numbers") from error
            except Exception as error:  # the libraries of the formats raise whatever their parsers do
                raise InputError(f"{path}: rows {first + 1} to {rows.stop}: damaged, cannot be read") from error
            block, last = checked_block(plan, table, first_row=first + 1, last=last)
            yield block, rows.stop

    return StrainFile(n, blocks(), plan, notes)
