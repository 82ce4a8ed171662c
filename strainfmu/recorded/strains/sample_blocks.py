"""An open file of recorded strains: blocks of samples, with times that increase from block to block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.recorded.channels.rasters import LONGEST_GAP
from strainfmu.recorded.columns.column_names import Wanted
from strainfmu.recorded.columns.columns import ColumnPlan, StrainBlock, plan_columns

BLOCK_ROWS = 2000
"""Samples in one block."""


@dataclass(frozen=True, eq=False)
class StrainFile:
    """An open file: length, in any unit; blocks with the position that each reaches in it; columns; notes.

    ``remarks`` are lines for the user, complete when the blocks have been read.
    """

    length: int
    blocks: Iterator[tuple[StrainBlock, int]]
    plan: ColumnPlan
    notes: tuple[str, ...] = ()
    remarks: list[str] = field(default_factory=list)


class SampleBlocks:
    """Makes blocks of the successive samples of a file, whose times go on from block to block.

    Parameters
    ----------
    plan : its columns.
    remarks : takes a line on the gaps of the times, when the file has been read.
    """

    def __init__(self, plan: ColumnPlan, remarks: list[str]) -> None:
        self._plan, self._remarks = plan, remarks
        self._last, self._place = -np.inf, 0
        self._period = np.nan
        self._gaps, self._longest, self._behind = 0, 0.0, 0

    def block(self, table: FloatArray, places: IntArray) -> StrainBlock:
        """Return a block of (n, k) values at (n,) rows or lines of the file.

        Raises
        ------
        InputError
            As :meth:`ColumnPlan.block`, or the times do not go on.
        """
        plan = self._plan
        block = plan.block(table, places)
        if block.time[0] <= self._last:
            raise InputError(
                f"{plan.path}: column '{plan.names[plan.time]}', {plan.counted} {places[0]}: expected increasing "
                f"times, got {block.time[0]:.9g} s after {self._last:.9g} s"
            )
        self._find_gaps(block.time, places)
        self._last, self._place = float(block.time[-1]), int(places[-1])
        return block

    def _find_gaps(self, time: FloatArray, places: IntArray) -> None:
        """Count the times between samples that are much longer than between the first ones."""
        if np.isnan(self._period) and len(time) > 1:
            self._period = float(np.median(np.diff(time)))
        behind = np.append(self._place, places[:-1])
        steps = np.diff(time, prepend=self._last if np.isfinite(self._last) else time[0])
        gaps = np.flatnonzero(steps > LONGEST_GAP * self._period)
        if len(gaps):
            longest = int(gaps[np.argmax(steps[gaps])])
            if steps[longest] > self._longest:
                self._longest, self._behind = float(steps[longest]), int(behind[longest])
            self._gaps += len(gaps)

    def finish(self) -> None:
        """Say what gaps there were."""
        if self._gaps:
            plan = self._plan
            many = f"{self._gaps} gaps, the longest of" if self._gaps > 1 else "a gap of"
            self._remarks.append(
                f"{plan.path}: column '{plan.names[plan.time]}': {many} {self._longest:.6g} s behind "
                f"{plan.counted} {self._behind}; samples are {self._period:.6g} s apart"
            )


def column_file(
    path: Path,
    columns: dict[str, Any],
    units: dict[str, str | None],
    wanted: Wanted,
    notes: tuple[str, ...] = (),
    lines: IntArray | None = None,
    samples: SampleBlocks | None = None,
) -> StrainFile:
    """Read columns that a library provides one by one; all must have the same length.

    Parameters
    ----------
    lines : (n,) lines of a text in which the samples are.
    samples : makes the blocks of a file of which these are a piece; None where they are all.
    """
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

    if lines is not None and len(lines) == n:
        places, plan = lines, replace(plan, counted="line")
    else:
        places = np.arange(1, n + 1)
    remarks = list[str]()

    def blocks() -> Iterator[tuple[StrainBlock, int]]:
        made = samples or SampleBlocks(plan, remarks)
        for first in range(0, n, BLOCK_ROWS):
            rows = slice(first, min(first + BLOCK_ROWS, n))
            try:
                table = np.column_stack([np.asarray(columns[name][rows], dtype=float) for name in used])
            except (TypeError, ValueError) as error:
                raise InputError(f"{path}: rows {first + 1} to {rows.stop}: values that are no numbers") from error
            except Exception as error:  # the libraries of the formats raise whatever their parsers do
                raise InputError(f"{path}: rows {first + 1} to {rows.stop}: damaged, cannot be read") from error
            yield made.block(table, places[rows]), rows.stop
        if samples is None:
            made.finish()

    return StrainFile(n, blocks(), plan, notes, remarks)
