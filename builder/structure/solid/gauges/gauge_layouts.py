"""Gauge layouts of a vehicle file for the solid model, which also takes outer gauges and gauge lengths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.gauge_placement import gauge_layout, layout_from_rows
from builder.structure.solid.gauges.gauge_rows import Gauges, gauges_at, joined_gauges
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, INTERNAL
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.entries import GaugeRow
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.shape.geometry import BodyOfRevolution

SURFACE = {"inner": INTERNAL, "outer": EXTERNAL}


def solid_gauges(vehicle: Vehicle, layout: str, mesh: MeridianMesh) -> Gauges:
    """Return a layout of the vehicle file.

    Rows on the outer surface lie at the stations given, as those on the inner one; their names end in ``_outer``.

    Parameters
    ----------
    vehicle, layout : the file and the name of the layout.
    mesh : a meridian mesh of the wall, on whose inner surface rows are placed.

    Raises
    ------
    InputError
        A station has no hollow behind it, a name occurs twice, or the layout's CSV file is missing or wrong.
    """
    entry = vehicle.gauges.layouts[layout]
    if entry.rows is None:
        found = gauge_layout(vehicle, layout, mesh)
        surface = SURFACE[entry.surface or "inner"]
        return gauges_at(found.position, found.direction, found.names, 1e-3 * (entry.length_mm or 0.0), surface)
    where, body = f"gauges.layouts.{layout}", vehicle.body()
    rows = enumerate(entry.rows, start=1)
    return joined_gauges([_row(row, layout_from_rows([row], mesh, where, n), body) for n, row in rows], where)


def _row(row: GaugeRow, found: GaugeLayout, body: BodyOfRevolution) -> Gauges:
    if row.surface == "outer":
        found = _on_outer_surface(found, body)
    return gauges_at(found.position, found.direction, found.names, 1e-3 * row.length_mm, SURFACE[row.surface])


def _on_outer_surface(found: GaugeLayout, body: BodyOfRevolution) -> GaugeLayout:
    """Move gauges outwards at their stations; axial ones lie along the outer meridian."""
    x = found.position[:, 0]
    roll = np.arctan2(found.position[:, 1], found.position[:, 2])
    outwards = np.column_stack([0.0 * x, np.sin(roll), np.cos(roll)])
    angle = body.angle(x)[:, None]
    along = np.cos(angle) * np.array([1.0, 0.0, 0.0]) + np.sin(angle) * outwards
    is_hoop = np.array([name.startswith("hoop") for name in found.names])[:, None]
    return replace(
        found,
        names=tuple(f"{name}_outer" for name in found.names),
        position=x[:, None] * np.array([1.0, 0.0, 0.0]) + body.radius(x)[:, None] * outwards,
        direction=np.where(is_hoop, found.direction, along),
    )
