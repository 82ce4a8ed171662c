"""Figures of a structure: mesh and gauges, strain patterns of pressure, observability of the layouts."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing import COLOUR_MAP, blank_figure, draw_strokes, gauge_kinds, roll_degrees
from builder.structure.observability import (
    SYMMETRIES,
    THRESHOLD,
    SmoothResponse,
    angle_from_meridian,
    direction_names,
    symmetry_responses,
    wave_names,
    wave_response,
)
from builder.structure.structure_file import Structure
from strainfmu.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SIGNED_COLOUR_MAP = "RdBu_r"
MICROSTRAIN_PER_KPA = 1e9
"""From strain per pressure [1/Pa] to um/m per kPa."""
MAX_EDGES = 100_000
"""Edges drawn of the unrolled mesh; a finer one is drawn up to some roll angle only."""
CLOSE_UP = 0.06
"""Length shown in the close-up of the mesh, over the length of the body."""
PATTERN_POSITIONS = (0.15, 0.5, 0.85)
"""Which gauges of a direction have their patterns drawn: fractions of their number, from the nose."""
HEAT_MAP_RANGE = 1e3


def mesh_and_gauges(structure: Structure) -> Figure:
    """Draw the surface that takes the pressure and each layout on it; close to a gauge, and from behind."""
    layouts = structure.layouts
    figure = blank_figure(12.0, max(5.0, 1.0 + 2.6 * len(layouts)))
    columns = figure.add_gridspec(1, 2, width_ratios=(2.4, 1.0))
    rows, side = columns[0].subgridspec(len(layouts), 1), columns[1].subgridspec(2, 1)
    close, end_view = figure.add_subplot(side[0]), figure.add_subplot(side[1])
    edge = _unrolled_edges(structure)
    limit = 360.0 if len(edge) <= MAX_EDGES else float(np.sort(edge[:, :, 1].max(axis=1))[MAX_EDGES])
    side_view: Any = None
    for row, layout in enumerate(layouts):
        side_view = figure.add_subplot(rows[row], sharex=side_view)
        _draw_layout(side_view, structure, layout, edge[edge[:, :, 1].max(axis=1) <= limit])
    side_view.set_xlabel("station x from the nose tip [m]")
    distinct = distinct_gauges(structure)
    x = structure.gauge_position[distinct, 0]
    _draw_close_up(close, structure, int(distinct[np.abs(x - structure.point[:, 0].mean()).argmin()]))
    _draw_from_behind(end_view, structure, distinct)
    part = "" if limit == 360.0 else f", drawn up to roll angle {limit:.0f} deg"
    figure.suptitle(
        f"Surface under pressure, {len(structure.point)} nodes{part}, and strain gauges: {structure.vehicle}, "
        f"{structure.model.replace('_', ' ')}",
        fontsize=11,
    )
    return figure


def distinct_gauges(structure: Structure) -> IntArray:
    """Return one gauge of each position and direction: layouts may share gauges."""
    where = np.round(np.hstack([structure.gauge_position, structure.gauge_direction]), 6)
    _, first = np.unique(where, axis=0, return_index=True)
    chosen: IntArray = np.sort(first)
    return chosen


def _edges(triangle: IntArray) -> IntArray:
    """Return (n, 2) nodes of the edges of triangles, each edge once."""
    pairs = np.concatenate([triangle[:, [0, 1]], triangle[:, [1, 2]], triangle[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _unrolled_edges(structure: Structure) -> FloatArray:
    """Return (n, 2, 2) x [m] and roll angle [deg] of both ends of each edge; across the seam from below 360."""
    point = structure.point[_edges(structure.triangle)]
    roll = roll_degrees(point)
    across = np.ptp(roll, axis=1) > 180.0
    roll[across] = np.where(roll[across] < 180.0, 360.0, roll[across])
    return np.stack([point[..., 0], roll], axis=-1)


def _draw_edges(axis: Any, edge: FloatArray) -> None:
    from matplotlib.collections import LineCollection

    axis.add_collection(LineCollection(list(edge), colors="0.6", linewidths=0.3, zorder=0, rasterized=True))


def _draw_layout(axis: Any, structure: Structure, layout: str, edge: FloatArray) -> None:
    """Draw a layout over the unrolled mesh; a mark lies along the gauge's direction."""
    _draw_edges(axis, edge)
    gauges = structure.gauges_of(layout)
    draw_strokes(axis, structure.gauge_position[gauges], structure.gauge_direction[gauges], 13.0)
    axis.set_xlim(structure.point[:, 0].min(), structure.point[:, 0].max())
    axis.set_ylim(-20.0, 360.0)
    axis.set_yticks([0, 90, 180, 270, 360])
    axis.set_ylabel("roll angle from +z\ntowards +y [deg]")
    axis.set_title(f"{layout}: {len(gauges)} gauges", fontsize=9, loc="left")
    axis.legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 0.99), borderpad=0.2, frameon=False, ncols=3)


def _draw_close_up(axis: Any, structure: Structure, gauge: int) -> None:
    """Draw the mesh about one gauge, to scale along and round the body."""
    centre = structure.gauge_position[gauge]
    half = 0.5 * CLOSE_UP * float(np.ptp(structure.point[:, 0]))
    point = structure.point[_edges(structure.triangle)]
    near = (np.abs(point[..., 0] - centre[0]) < 2.0 * half).all(axis=1)
    away = np.radians(roll_degrees(point[near]) - roll_degrees(centre[None]))
    away = np.mod(away + np.pi, 2.0 * np.pi) - np.pi
    flat = 1e3 * np.stack([point[near, :, 0], np.hypot(point[near, :, 1], point[near, :, 2]) * away], axis=-1)
    _draw_edges(axis, flat[np.abs(away).max(axis=1) < 0.5 * np.pi])
    unit = structure.gauge_direction[gauge : gauge + 1]
    angle = degrees(angle_from_meridian(centre[None], unit)[0])
    axis.plot(1e3 * centre[0], 0.0, marker=(2, 2, angle - 90.0), markersize=16, markeredgewidth=2.5, color="black")
    axis.set_xlim(1e3 * (centre[0] - half), 1e3 * (centre[0] + half))
    axis.set_ylim(-1e3 * half, 1e3 * half)
    axis.set_aspect("equal")
    axis.set_xlabel("station x [mm]")
    axis.set_ylabel("along the circumference [mm]")
    axis.set_title(f"about {structure.gauge_names[gauge]}", fontsize=9)


def _draw_from_behind(axis: Any, structure: Structure, gauges: IntArray) -> None:
    """Draw gauges over the rim of the surface's aft end, looking forward."""
    edge = structure.point[_edges(structure.triangle)]
    last = structure.point[:, 0].max()
    rim = (edge[..., 0] > last - 1e-6 * np.ptp(structure.point[:, 0])).all(axis=1)
    _draw_edges(axis, 1e3 * edge[rim][:, :, 1:])
    position = structure.gauge_position[gauges]
    axis.plot(1e3 * position[:, 1], 1e3 * position[:, 2], ".", color="black", markersize=4)
    reach = 1.08e3 * np.abs(structure.point[:, 1:]).max()
    axis.set_xlim(-reach, reach)
    axis.set_ylim(-reach, reach)
    axis.set_aspect("equal")
    axis.set_xlabel("y, starboard [mm]")
    axis.set_ylabel("z, up [mm]")
    axis.set_title("gauges of all layouts from behind", fontsize=9)


def strain_patterns(structure: Structure, response: SmoothResponse) -> Figure:
    """Draw the strain of a few gauges per pressure at each point: Z_p per area; a cross marks the gauge."""
    chosen = pattern_gauges(structure)
    figure = blank_figure(12.0, 1.0 + 2.5 * len(chosen))
    axes = figure.subplots(len(chosen), max(map(len, chosen)), sharex=True, sharey=True, squeeze=False)
    x = np.linspace(*response.x_range, 241)
    roll = np.linspace(0.0, 360.0, 181)
    names = direction_names(structure.gauge_position, structure.gauge_direction)
    for row, gauges in zip(axes, chosen, strict=True):
        influence = MICROSTRAIN_PER_KPA * response.at_gauges(gauges).influence(x, np.radians(roll))
        for axis, gauge, values in zip(row, gauges.tolist(), influence, strict=False):
            largest = float(np.abs(values).max())
            image = axis.pcolormesh(
                x,
                roll,
                values.T,
                shading="gouraud",
                cmap=SIGNED_COLOUR_MAP,
                vmin=-largest,
                vmax=largest,
                rasterized=True,
            )
            position = structure.gauge_position[gauge]
            phi = float(roll_degrees(position[None])[0])
            axis.plot(position[0], phi, "x", color="black", markersize=8, markeredgewidth=1.5, clip_on=False)
            axis.set_title(
                f"{structure.gauge_names[gauge]}: {names[gauge]}, x {position[0]:.3g} m, {phi:.4g} deg", fontsize=8
            )
            figure.colorbar(image, ax=axis, pad=0.01)
        row[0].set_ylabel("roll angle [deg]")
        for axis in row[len(gauges) :]:
            axis.set_visible(False)
    axes[0, 0].set_yticks([0, 90, 180, 270, 360])
    for axis in axes[-1]:
        axis.set_xlabel("station x from the nose tip [m]")
    figure.suptitle(
        "Strain per pressure at each point, per area [(um/m)/(kPa m$^2$)], over smooth pressures: "
        f"{structure.vehicle}",
        fontsize=11,
    )
    return figure


def pattern_gauges(structure: Structure) -> list[IntArray]:
    """Return per kind (axial, hoop, inclined) a few gauges spread from nose to base, nearest to 180 deg."""
    distinct = distinct_gauges(structure)
    kinds = gauge_kinds(structure.gauge_position[distinct], structure.gauge_direction[distinct])
    groups = []
    for chosen in kinds.values():
        alike = distinct[chosen]
        station = np.round(structure.gauge_position[alike, 0], 6)
        away = np.abs(roll_degrees(structure.gauge_position[alike]) - 180.0)
        stations, first = np.unique(station[np.lexsort((away, station))], return_index=True)
        number = np.unique([int(fraction * len(stations)) for fraction in PATTERN_POSITIONS])
        groups.append(alike[np.lexsort((away, station))][first[number]])
    return groups


def waves(structure: Structure, response: SmoothResponse) -> Figure:
    """Draw the response of each gauge to each wave round the axis, one heat map per layout, one scale."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    layouts = structure.layouts
    most_gauges = max(len(structure.gauges_of(layout)) for layout in layouts)
    figure = blank_figure(1.0 + 5.0 * len(layouts), max(4.5, 2.0 + 0.13 * min(most_gauges, 80)))
    axes = figure.subplots(1, len(layouts), squeeze=False)[0]
    strongest = MICROSTRAIN_PER_KPA * wave_response(response).max()
    labels = wave_names(int(response.harmonic.max()))
    image: Any = None
    for axis, layout in zip(axes, layouts, strict=True):
        gauges = structure.gauges_of(layout)
        values = MICROSTRAIN_PER_KPA * wave_response(response.at_gauges(gauges))
        image = axis.imshow(
            np.maximum(values, 1e-30),
            norm=LogNorm(strongest / HEAT_MAP_RANGE, strongest),
            cmap=colormaps[COLOUR_MAP].with_extremes(under="white"),
            aspect="auto",
            interpolation="nearest",
        )
        every = -(-len(gauges) // 80)
        axis.set_yticks(
            range(0, len(gauges), every), [structure.gauge_names[g] for g in gauges[::every]], fontsize=6
        )
        axis.set_xticks(range(len(labels)), labels, rotation=90, fontsize=7)
        axis.set_xlabel("wave round the axis: cos(m phi), sin(m phi)")
        axis.set_title(layout, fontsize=9)
    figure.colorbar(image, ax=list(axes), extend="min", pad=0.01, label="maximum |strain| [um/m per kPa rms]")
    figure.suptitle(f"Response of each gauge per harmonic of the pressure: {structure.vehicle}", fontsize=11)
    return figure


def singular_values(structure: Structure, response: SmoothResponse) -> Figure:
    """Draw how singular values of Z_p decay, and the maximum of each symmetry class, per layout."""
    figure = blank_figure(12.0, 4.8)
    decay, classes = figure.subplots(1, 2)
    layouts = structure.layouts
    width = 0.8 / len(layouts)
    responses = {layout: symmetry_responses(response.at_gauges(structure.gauges_of(layout))) for layout in layouts}
    strongest = MICROSTRAIN_PER_KPA * max(strain.norm for per_class in responses.values() for strain in per_class)
    floor = 0.1 * THRESHOLD * strongest
    for number, layout in enumerate(layouts):
        values = MICROSTRAIN_PER_KPA * response.at_gauges(structure.gauges_of(layout)).singular_values()
        decay.semilogy(
            np.arange(1, len(values) + 1), values, ".-", color=f"C{number}", linewidth=1.0, label=layout
        )
        places = np.arange(len(SYMMETRIES)) + (number - 0.5 * (len(layouts) - 1)) * width
        norms = np.array([MICROSTRAIN_PER_KPA * strain.norm for strain in responses[layout]])
        classes.bar(
            places, np.maximum(norms, floor) - floor, 0.9 * width, bottom=floor, color=f"C{number}", label=layout
        )
        for x, strain in zip(places, responses[layout], strict=True):
            if strain.blind:
                classes.text(
                    x,
                    1.3 * max(MICROSTRAIN_PER_KPA * strain.norm, floor),
                    "blind",
                    rotation=90,
                    ha="center",
                    va="bottom",
                    fontsize=8,
                )
    decay.set_xlabel("number [1]")
    decay.set_ylabel("singular value of $Z_p$ [um/m per kPa rms]")
    degree, harmonic = int(response.degree.max()), int(response.harmonic.max())
    decay.set_title(f"over smooth pressures: degree {degree} in x, {harmonic} harmonics", fontsize=9)
    decay.grid(alpha=0.3)
    decay.legend(fontsize=8)
    classes.set_yscale("log")
    classes.set_ylim(floor, 3.0 * strongest)
    classes.set_xticks(range(len(SYMMETRIES)), [str(kind).replace(", ", ",\n") for kind in SYMMETRIES], fontsize=8)
    classes.set_ylabel("maximum singular value [um/m per kPa rms]")
    classes.set_title(
        "per symmetry of the pressure about y = 0 and z = 0\n"
        f"blind: below {100.0 * THRESHOLD:g} % of the layout's maximum",
        fontsize=9,
    )
    classes.grid(axis="y", alpha=0.3)
    figure.suptitle(f"What the gauges observe: {structure.vehicle}", fontsize=11)
    return figure
