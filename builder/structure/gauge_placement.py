"""Placement of a vehicle file's gauge rows on the inner surface of the wall."""

from collections.abc import Sequence
from math import radians
from pathlib import Path

import numpy as np

from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.gauge_entries import GaugeLayoutEntry, GaugeRow
from builder.vehicle.gauges.layout import GaugeLayout, checked_layout, read_layout
from strainfmu.errors import InputError


def gauge_layout(entry: GaugeLayoutEntry, folder: Path, layout: str, mesh: MeridianMesh) -> GaugeLayout:
    """Return the gauges of an ``entry``, its rows on the inner surface of ``mesh``, its files in ``folder``.

    Raises
    ------
    InputError
        A station has no hollow behind it, or the layout's CSV file is missing or wrong.
    """
    if entry.file is not None:
        return read_layout(folder / entry.file)
    assert entry.rows is not None
    return layout_from_rows(entry.rows, mesh, f"gauges.layouts.{layout}")


def layout_from_rows(rows: Sequence[GaugeRow], mesh: MeridianMesh, where: str, first_row: int = 1) -> GaugeLayout:
    """Place rows on the inner surface: axial gauges along its meridian, hoop gauges across.

    ``where`` names the layout in messages, ``first_row`` is the number there of the first of ``rows``.

    Raises
    ------
    InputError
        A station has no hollow behind it.
    """
    inner = mesh.node[mesh.inner_edge.ravel(), 0]
    first, last = float(inner.min()), float(inner.max())
    names: list[str] = []
    position: list[list[float]] = []
    direction: list[list[float]] = []
    for number, row in enumerate(rows, start=first_row):
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
    return checked_layout(GaugeLayout(tuple(names), np.array(position), np.array(direction)), where)


def gauge_mesh(vehicle: Vehicle) -> MeridianMesh:
    """Return a coarse meridian mesh, on whose inner surface rows of gauges are placed."""
    try:
        return shell_mesh(vehicle.body(), wall_of(vehicle), 0.01 * vehicle.body().length)
    except InputError as error:
        raise InputError(f"structure: {error}") from error
