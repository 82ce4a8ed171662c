"""A vehicle as HTML for notebooks: a table of its main entries and the meridian with the gauges in use."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from builder.vehicle.gauges.layout import read_layout
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

if TYPE_CHECKING:
    from builder.vehicle.file import Vehicle

WIDTH, MARGIN = 480.0, 8.0
"""Size of the drawing and the space around it [px]."""
MERIDIAN_POINTS = 60


def vehicle_html(vehicle: Vehicle) -> str:
    """Return a drawing and a table in HTML; all text is escaped."""
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(what)}</th><td style="text-align:left">{escape(value)}</td></tr>'
        for what, value in _entries(vehicle)
    )
    return f"<div><strong>{escape(vehicle.name)}</strong><br>{_meridian_svg(vehicle)}<table>{rows}</table></div>"


def _entries(vehicle: Vehicle) -> list[tuple[str, str]]:
    """Return what the table holds: entry, value with unit."""
    body, wall, air = vehicle.body(), vehicle.structure, vehicle.conditions
    stations = _gauge_stations(vehicle)
    number = "gauges" if stations is None else f"{len(stations)} gauges"
    conditions = len(vehicle.flight_conditions())
    return [
        ("length", f"{body.length:.4g} m"),
        ("base diameter", f"{2.0 * body.base_radius:.4g} m"),
        ("wall", f"{wall.wall_thickness_mm:.4g} mm, E = {vehicle.material.youngs_modulus_GPa:.4g} GPa"),
        ("structure", f"{wall.model} model, {wall.support}"),
        ("gauges", f"{number}, layout {vehicle.gauges.layout} of {', '.join(vehicle.gauges.layouts)}"),
        (
            "conditions",
            f"{conditions}: M {_range(air.mach_number)}, angle of attack {_range(air.angle_of_attack_deg)} deg, "
            f"sideslip angle {_range(air.sideslip_angle_deg)} deg, altitude {_range(air.altitudes_km)} km",
        ),
        ("engine", vehicle.aerodynamics.engine),
        ("noise", _noise(vehicle)),
        ("map", _map(vehicle)),
    ]


def _noise(vehicle: Vehicle) -> str:
    noise = vehicle.noise
    if noise.percent_of_median_strain is not None:
        return f"{noise.percent_of_median_strain:.4g} % of the median strain"
    if noise.std_um_per_m is not None:
        return f"{noise.std_um_per_m:.4g} um/m per gauge"
    if noise.std_of_gauges_um_per_m is not None:
        return f"{_range(noise.std_of_gauges_um_per_m)} um/m, one value per gauge"
    return f"covariance of {noise.covariance_file}"


def _map(vehicle: Vehicle) -> str:
    entry = vehicle.map
    if entry.case == 1:
        return f"Case 1, {entry.modes} POD modes"
    modes = "all snapshots" if entry.prior_modes is None else f"{entry.prior_modes} POD modes"
    return f"Case 2, prior of {modes}, gamma {entry.gamma}"


def _range(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"


def _gauge_stations(vehicle: Vehicle) -> FloatArray | None:
    """Return (n_d, 2) station [m] and roll angle [rad] of the gauges in use, None if their file is unreadable."""
    entry = vehicle.gauges.layouts[vehicle.gauges.layout]
    if entry.rows is not None:
        return np.array(
            [
                (x, np.radians(row.roll_angle_deg))
                for row in entry.rows
                for _ in row.directions
                for x in row.stations
            ]
        )
    assert entry.file is not None
    try:
        position = read_layout(vehicle.beside(entry.file)).position
    except InputError:
        return None
    return np.column_stack([position[:, 0], np.arctan2(position[:, 1], position[:, 2])])


def _meridian_svg(vehicle: Vehicle) -> str:
    """Draw the body from starboard, nose to the left, z up, with the gauges in use at their height."""
    body = vehicle.body()
    ends = [segment.end_x for segment in body.segments]
    x = np.unique(np.concatenate([np.linspace(0.0, body.length, MERIDIAN_POINTS), ends]))
    radius = body.radius(x)
    scale = (WIDTH - 2.0 * MARGIN) / body.length
    axis = MARGIN + scale * float(radius.max())
    outline = [
        f"{MARGIN + scale * a:.1f},{axis - scale * b:.1f}"
        for a, b in zip(np.append(x, x[::-1]), np.append(radius, -radius[::-1]), strict=True)
    ]
    stations = _gauge_stations(vehicle)
    height = np.empty((0, 2)) if stations is None else _inside(stations, body.length)
    dots = "".join(
        f'<circle cx="{MARGIN + scale * a:.1f}" cy="{axis - scale * b * float(body.radius(a)):.1f}" r="2.5"/>'
        for a, b in np.unique(np.round(height, 9), axis=0)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH:.0f}" height="{2.0 * axis:.0f}" role="img" '
        f'aria-label="side view with gauges"><polygon points="{" ".join(outline)}" fill="none" stroke="#555"/>'
        f'<g fill="#c30">{dots}</g></svg>'
    )


def _inside(stations: FloatArray, length: float) -> FloatArray:
    """Return (n, 2) station [m] and height over radius of the gauges on the body."""
    on_body = stations[(stations[:, 0] >= 0.0) & (stations[:, 0] <= length)]
    return np.column_stack([on_body[:, 0], np.cos(on_body[:, 1])])
