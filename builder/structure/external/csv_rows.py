"""Header and rows of a CSV file of another structural code's tables, with their line numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.text_files import MIB, read_csv

LARGEST_TABLE = 2048 * MIB
"""An influence matrix of 100,000 nodes and 50 gauges has 200 MiB."""


def csv_rows(path: Path) -> tuple[list[str], Sequence[tuple[int, list[str]]]]:
    """Return the header, empty for an empty file, and the rows with their line numbers; empty lines are left out.

    Raises
    ------
    InputError
        The file is missing or not a CSV file, or a row is not as long as the header.
    """
    lines = [(line, [cell.strip() for cell in row]) for line, row in read_csv(path, LARGEST_TABLE)]
    if not lines:
        return [], []
    (_, header), *rows = lines
    for line, row in rows:
        if len(row) != len(header):
            raise InputError(f"{path}, line {line}: expected {len(header)} values, got {len(row)}")
    return header, rows
