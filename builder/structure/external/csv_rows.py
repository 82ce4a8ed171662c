"""Header and rows of a CSV file of another structural code's tables, with their line numbers."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from strainfmu.errors import InputError


def csv_rows(path: Path) -> tuple[list[str], Sequence[tuple[int, list[str]]]]:
    """Return the header, empty for an empty file, and the rows with their line numbers; empty lines are left out.

    Raises
    ------
    InputError
        The file is missing or not a CSV file, or a row is not as long as the header.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            lines = [(n, [cell.strip() for cell in row]) for n, row in enumerate(csv.reader(stream), 1) if row]
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a CSV file: {error}") from error
    if not lines:
        return [], []
    (_, header), *rows = lines
    for line, row in rows:
        if len(row) != len(header):
            raise InputError(f"{path}, line {line}: expected {len(header)} values, got {len(row)}")
    return header, rows
