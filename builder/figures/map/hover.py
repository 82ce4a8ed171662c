"""Figures of a build report that show their values; their stills are in :mod:`builder.figures.map.stills`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from builder.aero.surface.mesh import SurfaceMesh
from builder.figures.drawing.colours import part_colours
from builder.figures.drawing.hover import (
    BLUE,
    COLOUR_SCALE,
    GREY,
    ORANGE,
    RED,
    HoverFigure,
    axis,
    choice,
    hover_figure,
    numbers,
    words,
)
from builder.figures.drawing.unrolled import roll_degrees
from builder.figures.map.hover_gauges import ROLL_AXIS, STATION_AXIS, gauge_places, gauge_symbols
from builder.figures.map.stills import MIN_SHOWN, MODES_DRAWN, NO_STATE, OF_STATE
from builder.inverse.cases.regularisation import LCurve
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap

STATIONS, ROLLS = 100, 49
"""Points of an unrolled field."""

NAMES = list(COEFFICIENT_NAMES)


def unrolled_pressure(
    surface: SurfaceMesh, *, removed: FloatArray, mean: FloatArray, std: FloatArray, inverse_map: InverseMap
) -> HoverFigure:
    """Return the unrolled body with the value of the closest node at each point.

    Parameters
    ----------
    surface : the pressure nodes.
    removed : (n_p,) fraction of the variance that the data remove [1]; NaN where there is none.
    mean, std : (n_p,) mean and standard deviation of the pressure that the map models [Pa].
    inverse_map : its gauges are drawn.
    """
    x, roll, node = _closest_nodes(surface)
    fields = np.stack([100.0 * removed, 1e-3 * mean, 1e-3 * std], axis=-1)[node]
    titles = ("variance removed [%]", "mean pressure [kPa]", "standard deviation [kPa]")
    limits: list[dict[str, float]] = [{"zmin": 0.0, "zmax": 100.0}, {}, {}]
    along = {"x": numbers(x), "y": numbers(roll)}
    traces: list[dict[str, Any]] = [
        {
            "type": "heatmap",
            **along,
            "z": numbers(fields[..., k]),
            "colorscale": COLOUR_SCALE,
            "colorbar": {"title": {"text": titles[k], "side": "right"}},
            "hoverinfo": "skip",
            "visible": k == 0,
            **limits[k],
        }
        for k in range(3)
    ]
    every = {
        "type": "heatmap",
        **along,
        "z": [[0] * len(x)] * len(roll),
        "opacity": 0.0,
        "showscale": False,
        "customdata": numbers(fields),
        "hovertemplate": "x %{x} m, roll %{y} deg<br>variance removed %{customdata[0]} %<br>mean %{customdata[1]} "
        "kPa<br>standard deviation %{customdata[2]} kPa<extra></extra>",
    }
    at, texts = gauge_places(inverse_map)
    gauges = {
        "type": "scatter",
        "mode": "markers",
        **at,
        "text": texts,
        "hovertemplate": "%{text}<extra></extra>",
        "marker": {"symbol": gauge_symbols(inverse_map), "color": "white", "size": 7, "line": {"width": 1}},
    }
    shown = [{"visible": [k == 0, k == 1, k == 2, True, True]} for k in range(3)]
    return hover_figure(
        [*traces, every, gauges],
        430,
        xaxis=STATION_AXIS,
        yaxis=ROLL_AXIS,
        showlegend=False,
        margin={"l": 60, "r": 20, "t": 60, "b": 50},
        updatemenus=[choice(titles, shown)],
    )


def _closest_nodes(surface: SurfaceMesh) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return stations [m], roll angles [deg] and, for each pair of them (n_roll, n_x), the closest node."""
    point = surface.point
    radius = np.hypot(point[:, 1], point[:, 2])
    per_degree = max(float(radius.mean()), 1e-9) * np.pi / 180.0
    x, roll = np.linspace(point[:, 0].min(), point[:, 0].max(), STATIONS), np.linspace(0.0, 360.0, ROLLS)
    angle = roll_degrees(point)
    nodes = np.concatenate(
        [np.column_stack([point[:, 0], per_degree * (angle + turn)]) for turn in (-360.0, 0.0, 360.0)]
    )
    wanted = np.stack(np.meshgrid(x, per_degree * roll), axis=-1)
    _, index = cKDTree(nodes).query(wanted)
    return x, roll, np.asarray(index % len(point), dtype=np.int64)


def modes(
    *, of_variance: FloatArray, removed: FloatArray, removed_at_best: FloatArray, is_state: BoolArray
) -> HoverFigure:
    """Return the first modes: fraction of the variance, and what is left of it; see the still."""
    count = min(MODES_DRAWN, len(of_variance))
    number, percent = list(range(1, count + 1)), 100.0 * of_variance[:count]

    def left(fraction: FloatArray) -> Any:
        return numbers(np.maximum(percent * (1.0 - fraction[:count]), MIN_SHOWN))

    held = numbers(np.column_stack([percent, 100.0 * removed[:count], 100.0 * removed_at_best[:count]]))
    states = ["state of the map" if one else "no state" for one in is_state[:count]]
    template = (
        "mode %{x}, %{hovertext}<br>%{customdata[0]} % of the variance<br>"
        "removed by this map %{customdata[1]} %<br>at best %{customdata[2]} %<extra></extra>"
    )
    common = {"x": number, "customdata": held, "hovertext": states, "hovertemplate": template}
    line = {"mode": "markers", "type": "scatter"}
    return hover_figure(
        [
            {
                "type": "bar",
                "y": numbers(np.maximum(percent, MIN_SHOWN)),
                "name": "of the snapshots, states darker",
                "marker": {"color": [OF_STATE if one else NO_STATE for one in is_state[:count]]},
                **common,
            },
            {
                **line,
                "y": left(removed),
                "name": "left by this map",
                "marker": {"color": BLUE, "size": 9},
                **common,
            },
            {
                **line,
                "y": left(removed_at_best),
                "name": "left by the best map",
                "marker": {"color": ORANGE, "size": 14, "symbol": "line-ew-open", "line": {"width": 3}},
                **common,
            },
        ],
        380,
        xaxis=axis("POD mode", dtick=1),
        yaxis=axis("fraction of the variance [%]", type="log", exponentformat="power"),
    )


def singular_values(values: FloatArray) -> HoverFigure:
    """Return the singular values of Z_p [um/m per kPa rms] by their number, with their ratio to the largest."""
    above = values[values > 0.0]
    return hover_figure(
        [
            {
                "type": "scatter",
                "mode": "lines+markers",
                "x": list(range(1, len(above) + 1)),
                "y": numbers(above),
                "customdata": numbers(above / above[:1]),
                "line": {"color": BLUE, "width": 1},
                "hovertemplate": "number %{x}<br>%{y} um/m per kPa rms<br>%{customdata} of the largest"
                "<extra></extra>",
            }
        ],
        340,
        xaxis=axis("number"),
        yaxis=axis("singular value [um/m per kPa rms]", type="log", exponentformat="power"),
    )


def coefficients(
    *,
    sources: Sequence[str],
    of_variance: FloatArray,
    std: FloatArray,
    limits: FloatArray,
    std_of_range: FloatArray,
    correlation: FloatArray,
) -> HoverFigure:
    """Return the sources of each coefficient's variance, 3 sigma over its range, and the errors' correlation.

    Parameters
    ----------
    sources : n names.
    of_variance : (n, 5) fraction of each source in the variance of each coefficient [1].
    std : (5,) sigma [1].
    limits : (5, 2) range of the snapshots [1].
    std_of_range : (5,) sigma over the width of the range [1].
    correlation : (5, 5) of the errors [1].
    """
    alone, colours = np.sqrt(of_variance) * std, part_colours(len(sources))
    bars: list[dict[str, Any]] = [
        {
            "type": "bar",
            "name": name,
            "x": NAMES,
            "y": numbers(100.0 * of_variance[k]),
            "marker": {"color": colours[k]},
            "customdata": numbers(alone[k]),
            "hovertemplate": "%{x}, %{fullData.name}<br>%{y} % of the variance<br>sigma of it alone %{customdata}"
            "<extra></extra>",
        }
        for k, name in enumerate(words(sources))
    ]
    ranges = {
        "type": "bar",
        "x": NAMES,
        "y": numbers(300.0 * std_of_range),
        "xaxis": "x2",
        "yaxis": "y2",
        "showlegend": False,
        "marker": {"color": BLUE},
        "customdata": numbers(np.column_stack([std, 3.0 * std, limits])),
        "hovertemplate": "%{x}: sigma %{customdata[0]}, 3 sigma %{customdata[1]}<br>%{y} % of the range "
        "%{customdata[2]} to %{customdata[3]}<extra></extra>",
    }
    matrix = {
        "type": "heatmap",
        "x": NAMES,
        "y": NAMES,
        "z": numbers(correlation),
        "xaxis": "x3",
        "yaxis": "y3",
        "zmin": -1.0,
        "zmax": 1.0,
        "colorscale": "RdBu",
        "colorbar": {"title": {"text": "correlation of errors [1]", "side": "right"}},
        "hovertemplate": "%{x} and %{y}: %{z}<extra></extra>",
    }
    return hover_figure(
        [*bars, ranges, matrix],
        380,
        barmode="stack",
        xaxis=axis("", domain=[0.0, 0.32]),
        yaxis=axis("fraction of the variance [%]"),
        xaxis2=axis("", domain=[0.43, 0.65], anchor="y2"),
        yaxis2=axis("3 sigma over the range [%]", anchor="x2"),
        xaxis3=axis("", domain=[0.74, 1.0], anchor="y3"),
        yaxis3=axis("", anchor="x3", autorange="reversed"),
    )


def eigenvalues(values: FloatArray, gamma: float, classes: Sequence[str]) -> HoverFigure:
    """Return the Hessian's eigenvalues with gamma, and the filter factors; ``classes`` names each mode's."""
    number = list(range(1, len(values) + 1))
    above = np.where(values > 1e-16 * values[0], values, np.nan)
    held = numbers(np.column_stack([values, values / (values + gamma)]))
    common: dict[str, Any] = {
        "x": number,
        "customdata": held,
        "hovertext": list(classes),
        "hovertemplate": "mode %{x}<br>%{hovertext}<br>eigenvalue %{customdata[0]}<br>"
        "filter factor %{customdata[1]}<extra></extra>",
        "showlegend": False,
    }
    line = {
        "mode": "lines",
        "x": [1, len(values)],
        "y": numbers([gamma, gamma]),
        "line": {"color": RED, "width": 1},
    }
    return hover_figure(
        [
            {"type": "scatter", "mode": "lines+markers", "y": numbers(above), "marker": {"color": BLUE}, **common},
            {"type": "scatter", "name": f"gamma = {gamma:.4g}", "hoverinfo": "name", **line},
            {
                "type": "bar",
                "y": numbers(values / (values + gamma)),
                "xaxis": "x2",
                "yaxis": "y2",
                "marker": {"color": BLUE},
                **common,
            },
        ],
        380,
        xaxis=axis("mode", domain=[0.0, 0.44]),
        yaxis=axis("eigenvalue [1]", type="log", exponentformat="power"),
        xaxis2=axis("mode", domain=[0.58, 1.0], anchor="y2"),
        yaxis2=axis("filter factor [1]", anchor="x2"),
    )


def l_curve(curve: LCurve, gammas: Sequence[tuple[str, float]]) -> HoverFigure:
    """Return the L-curve, gamma at each of its points, and on it each of ``gammas`` with its name."""
    traces: list[dict[str, Any]] = [
        {
            "type": "scatter",
            "mode": "lines",
            "x": numbers(curve.residual_norm),
            "y": numbers(curve.solution_norm),
            "customdata": numbers(curve.gamma),
            "line": {"color": GREY},
            "name": "L-curve",
            "hovertemplate": "gamma %{customdata}<br>residual %{x}, states %{y}<extra></extra>",
        }
    ]
    order = np.log(curve.gamma)
    for name, gamma in [*gammas, ("corner of the L-curve", curve.corner)]:
        at = [
            np.exp(np.interp(np.log(gamma), order, np.log(norm)))
            for norm in (curve.residual_norm, curve.solution_norm)
        ]
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "x": numbers(at[:1]),
                "y": numbers(at[1:]),
                "name": f"{name}: {gamma:.3g}",
                "marker": {"size": 11, "symbol": "circle-open", "line": {"width": 2}},
                "hovertemplate": f"{name}: gamma {gamma:.4g}<br>residual %{{x}}, states %{{y}}<extra></extra>",
            }
        )
    return hover_figure(
        traces,
        430,
        xaxis=axis("norm of the whitened residual [1]", type="log"),
        yaxis=axis("norm of the states [1]", type="log"),
    )
