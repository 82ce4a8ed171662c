"""The table that says which element of the Nastran model each gauge is: its side, its angle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from pathlib import Path

import numpy as np

from builder.structure.external.csv_rows import csv_rows
from builder.structure.external.strain_table import table_number
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.text_files import shown_columns

NEEDED = ("column", "element")
DIRECTION = ("direction_x", "direction_y", "direction_z")
COLUMNS = (*NEEDED, "node", "side", "angle_deg", *DIRECTION)


@dataclass(frozen=True, kw_only=True, eq=False)
class NastranPoint:
    """Where one gauge, or a part of it, is read.

    Attributes
    ----------
    column : name of the gauge's column.
    element, node : Nastran's numbers; without a node the element's centre.
    side : ``z1`` or ``z2`` of a plate, ``ply N`` of a laminate, empty elsewhere.
    angle : from the x axis of the plate's strain, or the ply's first axis, to the gauge about z [rad], or None.
    direction : (3,) in the axes in which a solid's strain is given, or None.
    body_direction : (3,) the gauge's own direction, body axes.
    """

    column: str
    element: int
    node: int | None
    side: str
    angle: float | None
    direction: FloatArray | None
    body_direction: FloatArray

    @property
    def ply(self) -> int | None:
        """Number of the ply, or None."""
        return int(self.side.split()[1]) if self.side.startswith("ply ") else None


def read_nastran_gauges(path: Path, directions: Mapping[str, FloatArray]) -> dict[str, list[NastranPoint]]:
    """Read the points of each gauge; several rows of one column are averaged.

    ``directions`` are the directions of the gauges that may be there, by their columns, body axes.

    Raises
    ------
    InputError
        The file is missing, or an entry is wrong; the message names line and column.
    """
    header, rows = csv_rows(path)
    for name in NEEDED:
        if name not in header:
            raise InputError(f"{path}: expected a column '{name}', got {shown_columns(header, COLUMNS)}")
    for name in header:
        if name not in COLUMNS:
            raise InputError(f"{path}: expected columns {', '.join(COLUMNS)}, got '{name}'")
    found: dict[str, list[NastranPoint]] = {}
    for line, row in rows:
        where = f"{path}, line {line}"
        point = _point(dict(zip(header, row, strict=True)), where, directions)
        found.setdefault(point.column, []).append(point)
    if not found:
        raise InputError(f"{path}: expected a row per gauge, got none")
    return found


def _point(cells: Mapping[str, str], where: str, directions: Mapping[str, FloatArray]) -> NastranPoint:
    column, side = cells["column"], " ".join(cells.get("side", "").lower().split())
    if column not in directions:
        raise InputError(f"{where}: column: expected a gauge of the vehicle file, got '{column}'")
    if side not in ("", "z1", "z2") and not (side.startswith("ply ") and side[4:].isdigit()):
        raise InputError(f"{where}: side: expected z1, z2, 'ply N' or nothing, got '{cells['side']}'")
    angle = cells.get("angle_deg", "")
    given = [cells.get(name, "") for name in DIRECTION]
    direction = None
    if any(given):
        direction = np.array(
            [table_number(text, f"{where}, {name}") for name, text in zip(DIRECTION, given, strict=True)]
        )
        if not np.any(direction):
            raise InputError(f"{where}: direction: expected a vector, got 0, 0, 0")
    return NastranPoint(
        column=column,
        element=_number(cells["element"], f"{where}, element"),
        node=_number(cells["node"], f"{where}, node") if cells.get("node") else None,
        side=side,
        angle=radians(table_number(angle, f"{where}, angle_deg")) if angle else None,
        direction=direction,
        body_direction=np.asarray(directions[column], dtype=float),
    )


def _number(text: str, where: str) -> int:
    if not text.isdigit() or int(text) == 0:
        raise InputError(f"{where}: expected a number of the Nastran model, got '{text}'")
    return int(text)
