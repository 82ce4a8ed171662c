"""The columns of gauges in files of another structural code: which layouts they make up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from builder.structure.external.load_cases import strain_columns
from builder.structure.solid.gauge_layouts import is_displaced
from builder.structure.solid.gauge_rows import Gauges
from strainfmu.errors import InputError


def columns_found(
    path: Path, columns: Sequence[str], layouts: Mapping[str, Gauges], in_use: str
) -> dict[str, tuple[str, ...]]:
    """Return the columns of each layout that is there; displaced ones may be missing as a whole.

    Raises
    ------
    InputError
        A column is no gauge's, or one is missing; the message begins with ``path``.
    """
    wanted = strain_columns(layouts, in_use)
    known = {name for names in wanted.values() for name in names}
    for name in columns:
        if name not in known:
            raise InputError(f"{path}: expected columns of gauges of {in_use}, got '{name}'")
    found = {}
    for layout, names in wanted.items():
        missing = [name for name in names if name not in columns]
        if is_displaced(layout) and len(missing) == len(names):
            continue
        if missing:
            raise InputError(f"{path}: expected a column '{missing[0]}', got none ({len(missing)} missing)")
        found[layout] = names
    return found
