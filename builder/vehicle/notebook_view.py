"""A vehicle as HTML for notebooks: a table of its main entries and the meridian with the gauges in use."""

from collections.abc import Iterable
from html import escape
from pathlib import Path

import numpy as np

from builder.vehicle.gauges.gauge_entries import Gauges
from builder.vehicle.gauges.layout import read_layout
from builder.vehicle.map_options import MapEntry, Noise
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

WIDTH, MARGIN = 480.0, 8.0
"""Size of the drawing and the space around it [px]."""
MERIDIAN_POINTS = 60


def vehicle_html(
    name: str, entries: Iterable[tuple[str, str]], body: BodyOfRevolution, stations: FloatArray | None
) -> str:
    """Return a drawing and a table in HTML; all text is escaped.

    Parameters
    ----------
    entries : what stands in the table, and its value with unit.
    stations : (n_d, 2) station [m] and roll angle [rad] of the gauges in use; None draws none.
    """
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(what)}</th><td style="text-align:left">{escape(value)}</td></tr>'
        for what, value in entries
    )
    return f"<div><strong>{escape(name)}</strong><br>{_meridian_svg(body, stations)}<table>{rows}</table></div>"


def noise_in_words(noise: Noise) -> str:
    """Return the gauges' noise with its unit."""
    if noise.percent_of_median_strain is not None:
        return f"{noise.percent_of_median_strain:.4g} % of the median strain"
    if noise.std_um_per_m is not None:
        return f"{noise.std_um_per_m:.4g} um/m per gauge"
    if noise.std_of_gauges_um_per_m is not None:
        return f"{range_in_words(noise.std_of_gauges_um_per_m)} um/m, one value per gauge"
    return f"covariance of {noise.covariance_file}"


def map_in_words(entry: MapEntry) -> str:
    """Return case and modes of the map."""
    if entry.case == 1:
        return f"Case 1, {entry.modes} POD modes"
    modes = "all snapshots" if entry.prior_modes is None else f"{entry.prior_modes} POD modes"
    return f"Case 2, prior of {modes}, gamma {entry.gamma}"


def range_in_words(values: list[float]) -> str:
    """Return the ends of a list of numbers."""
    low, high = min(values), max(values)
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"


def stations_in_use(gauges: Gauges, folder: Path) -> FloatArray | None:
    """Return (n_d, 2) station [m] and roll angle [rad] of the gauges in use, None if their file is unreadable."""
    entry = gauges.layouts[gauges.layout]
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
        position = read_layout(folder / entry.file).position
    except InputError:
        return None
    return np.column_stack([position[:, 0], np.arctan2(position[:, 1], position[:, 2])])


def _meridian_svg(body: BodyOfRevolution, stations: FloatArray | None) -> str:
    """Draw the body from starboard, nose to the left, z up, with the gauges in use at their height."""
    ends = [segment.end_x for segment in body.segments]
    x = np.unique(np.concatenate([np.linspace(0.0, body.length, MERIDIAN_POINTS), ends]))
    radius = body.radius(x)
    scale = (WIDTH - 2.0 * MARGIN) / body.length
    axis = MARGIN + scale * float(radius.max())
    outline = [
        f"{MARGIN + scale * a:.1f},{axis - scale * b:.1f}"
        for a, b in zip(np.append(x, x[::-1]), np.append(radius, -radius[::-1]), strict=True)
    ]
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
