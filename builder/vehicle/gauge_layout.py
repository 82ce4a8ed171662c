"""Gauge layouts of a vehicle file: names, positions and directions in body axes."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, radians
from pathlib import Path

import numpy as np

from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.vehicle.file import GaugeRow, Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

CSV_COLUMNS = ("name", "x_m", "y_m", "z_m", "direction_x", "direction_y", "direction_z")


@dataclass(frozen=True)
class GaugeLayout:
    """Gauges in body axes.

    Attributes
    ----------
    names : n_d unique names.
    position : (n_d, 3) [m], x aft, y starboard, z up.
    direction : (n_d, 3) measured direction, any length.
    """

    names: tuple[str, ...]
    position: FloatArray
    direction: FloatArray


def gauge_layout(vehicle: Vehicle, layout: str, mesh: MeridianMesh) -> GaugeLayout:
    """Return a layout of the vehicle file, its rows laid on the inner surface of ``mesh``.

    Raises
    ------
    InputError
        A station has no hollow behind it, or the layout's CSV file is missing or wrong.
    """
    entry = vehicle.gauges.layouts[layout]
    if entry.file is not None:
        return read_layout(vehicle.beside(entry.file))
    assert entry.rows is not None
    found = _layout_from_rows(entry.rows, mesh, f"gauges.layouts.{layout}")
    return found


def _layout_from_rows(rows: Sequence[GaugeRow], mesh: MeridianMesh, where: str) -> GaugeLayout:
    """Lay rows on the inner surface: axial gauges along its meridian, hoop gauges across."""
    inner = mesh.node[mesh.inner_edge.ravel(), 0]
    first, last = float(inner.min()), float(inner.max())
    names: list[str] = []
    position: list[list[float]] = []
    direction: list[list[float]] = []
    for number, row in enumerate(rows, start=1):
        phi = radians(row.roll_angle_deg)
        sine, cosine = np.sin(phi), np.cos(phi)
        for x in row.stations:
            if not first <= x <= last:
                raise InputError(
                    f"{where}.rows.{number}: station {x:g} m found, the inner surface reaches from "
                    f"{first:.4g} to {last:.4g} m"
                )
        points = inner_surface_points(mesh, np.array(row.stations))
        for kind in row.directions:
            for i, x in enumerate(row.stations):
                along_x, along_r = points.tangent[i]
                r = points.radius[i]
                names.append(f"{kind}_{row.roll_angle_deg:g}deg_{i + 1}")
                position.append([x, r * sine, r * cosine])
                direction.append(
                    [along_x, along_r * sine, along_r * cosine] if kind == "axial" else [0.0, cosine, -sine]
                )
    return _checked(GaugeLayout(tuple(names), np.array(position), np.array(direction)), where)


def read_layout(path: Path) -> GaugeLayout:
    """Read a layout from a CSV file with the header ``name,x_m,y_m,z_m,direction_x,direction_y,direction_z``.

    Raises
    ------
    InputError
        The file is missing, a column is missing or unknown, a number is none, or a name is there twice.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.DictReader(stream)
            header = tuple(reader.fieldnames or ())
            if sorted(header) != sorted(CSV_COLUMNS):
                raise InputError(f"{path}: columns {', '.join(header)} found, must be {', '.join(CSV_COLUMNS)}")
            rows = list(reader)
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    if not rows:
        raise InputError(f"{path}: holds no gauges")
    values = np.empty((len(rows), 6))
    for i, row in enumerate(rows):
        if None in row:
            raise InputError(f"{path}, line {i + 2}: more than {len(CSV_COLUMNS)} values found")
        for k, column in enumerate(CSV_COLUMNS[1:]):
            values[i, k] = _number(row[column], f"{path}, line {i + 2}, column {column}")
    layout = GaugeLayout(tuple(row["name"] for row in rows), values[:, :3], values[:, 3:])
    return _checked(layout, str(path))


def _number(text: str | None, where: str) -> float:
    try:
        value = float(text or "")
    except ValueError as error:
        raise InputError(f"{where}: '{text}' found, must be a number") from error
    if not isfinite(value):
        raise InputError(f"{where}: '{text}' found, must be finite")
    return value


def _checked(layout: GaugeLayout, where: str) -> GaugeLayout:
    """Refuse two gauges of one name."""
    seen: set[str] = set()
    for name in layout.names:
        if not name.isprintable():
            raise InputError(f"{where}: gauge name {name!r} found, must be printable text on one line")
        if not name or name in seen:
            raise InputError(f"{where}: gauge name '{name}' is {'there twice' if name else 'empty'}")
        seen.add(name)
    return layout
