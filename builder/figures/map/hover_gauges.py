"""Figures of a build report that show the values of each gauge: places, cost of a loss, pairs of losses."""

from __future__ import annotations

from typing import Any

import numpy as np

from builder.figures.drawing.gauge_marks import KIND_OFFSETS, SENSOR, kinds_of_map, shown_bias
from builder.figures.drawing.hover import COLOUR_SCALE, HoverFigure, axis, choice, hover_figure, numbers, words
from builder.figures.drawing.unrolled import roll_degrees
from builder.structure.observability import direction_names
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.map.sensors import shown_units

MAX_MATRIX = 120
"""Gauges up to which the matrix of pairs is drawn: its size grows with their square."""

ROLL_AXIS = axis("roll angle [deg]", range=[-25.0, 370.0], tickvals=[0, 90, 180, 270, 360])
STATION_AXIS = axis("station x from the nose tip [m]")
NAMES = list(COEFFICIENT_NAMES)
SYMBOLS = {"axial": "circle", "hoop": "square", "inclined": "diamond", SENSOR: "triangle-up"}
"""Symbol of the marks of each kind of gauge, as :data:`~builder.figures.drawing.gauge_marks.KIND_MARKERS`."""


def gauge_values(
    inverse_map: InverseMap, *, growth: FloatArray, detectable_bias: FloatArray, leverage: FloatArray
) -> HoverFigure:
    """Return the gauges on the unrolled body, coloured by the cost of their loss; all values at each gauge.

    Parameters
    ----------
    growth : (n_d, 5) sigma of each load without the gauge over sigma with all [1].
    detectable_bias : (n_d,) [m/m].
    leverage : (n_d,) [1].
    """
    at, texts = gauge_places(inverse_map)
    grown = 100.0 * (growth - 1.0)
    bias, of_bias = shown_bias(inverse_map, detectable_bias)
    columns = [*grown.T, bias]
    labels = [*(f"lost: sigma of {name} grows [%]" for name in NAMES), f"detectable {of_bias}"]
    units = shown_units(inverse_map.sensors)
    details = [
        "<br>".join(
            (
                text,
                *(f"lost: {name} {_growth(value)}" for name, value in zip(NAMES, row, strict=True)),
                f"detectable bias {factor * one:.3g} {unit}, leverage {share:.3g}",
            )
        )
        for text, row, one, share, (factor, unit) in zip(
            texts, grown, detectable_bias, leverage, units, strict=True
        )
    ]
    # Where the others identify nothing without a gauge, its colour is the last one.
    colours = [
        numbers(np.where(np.isfinite(one), one, np.max(one, where=np.isfinite(one), initial=0.0)))
        for one in columns
    ]
    scales = [
        {"marker.color": [colours[k]], "marker.colorbar.title.text": label} for k, label in enumerate(labels)
    ]
    return hover_figure(
        [
            {
                "type": "scatter",
                "mode": "markers",
                **at,
                "text": details,
                "hovertemplate": "%{text}<extra></extra>",
                "marker": {
                    "symbol": gauge_symbols(inverse_map),
                    "size": 13,
                    "color": colours[0],
                    "colorscale": COLOUR_SCALE,
                    "line": {
                        "width": numbers(np.where(np.isfinite(grown).all(axis=1), 0.5, 4.0)),
                        "color": "black",
                    },
                    "colorbar": {"title": {"text": labels[0], "side": "right"}},
                },
            }
        ],
        470,
        xaxis=STATION_AXIS,
        yaxis=ROLL_AXIS,
        margin={"l": 60, "r": 20, "t": 60, "b": 50},
        updatemenus=[choice(labels, scales)],
    )


def _growth(percent: float) -> str:
    return f"+{percent:.3g} %" if np.isfinite(percent) else "not identified"


def pair_loss(
    inverse_map: InverseMap, *, growth: FloatArray, pairs: IntArray, pair_growth: FloatArray
) -> HoverFigure | None:
    """Return the largest growth of a sigma by the loss of two gauges; None with more than 120 gauges."""
    n = inverse_map.n_gauges
    if n > MAX_MATRIX:
        return None
    grown = np.zeros((n, n))
    i, j = pairs.T
    grown[i, j] = grown[j, i] = 100.0 * (pair_growth.max(axis=1) - 1.0)
    grown[np.arange(n), np.arange(n)] = 100.0 * (growth.max(axis=1) - 1.0)
    largest = max(float(grown[np.isfinite(grown)].max(initial=0.0)), 1.0)
    names = words(inverse_map.gauge_names)
    shown = np.log10(np.clip(grown, 1e-3 * largest, largest))
    ticks = np.arange(np.ceil(np.log10(1e-3 * largest)), np.log10(largest))
    return hover_figure(
        [
            {
                "type": "heatmap",
                "x": names,
                "y": names,
                "z": numbers(shown),
                "customdata": numbers(grown),
                "colorscale": COLOUR_SCALE,
                "colorbar": {
                    "title": {"text": "largest growth of a sigma [%]", "side": "right"},
                    "tickvals": numbers(ticks),
                    "ticktext": [f"{10.0**tick:g}" for tick in ticks],
                },
                "hovertemplate": "%{x} and %{y} lost: +%{customdata} %<extra></extra>",
            }
        ],
        680,
        xaxis={"automargin": True, "tickangle": -90, "type": "category"},
        yaxis={"automargin": True, "autorange": "reversed", "type": "category"},
    )


def gauge_places(inverse_map: InverseMap) -> tuple[dict[str, Any], list[str]]:
    """Return x and y of the gauges' marks, and name, direction or kind, and place of each as text."""
    position = inverse_map.gauge_position
    roll = roll_degrees(position)
    names = direction_names(position, inverse_map.gauge_direction)
    n = inverse_map.n_strain_gauges
    names[n:] = inverse_map.sensors.kind[n:]
    offset = [KIND_OFFSETS[kind] for kind in _kinds(inverse_map)]
    texts = [
        f"{name}, {direction}<br>x {at:.4g} m, roll {angle:.4g} deg"
        for name, direction, at, angle in zip(
            words(inverse_map.gauge_names), names, position[:, 0], roll, strict=True
        )
    ]
    return {"x": numbers(position[:, 0]), "y": numbers(roll + offset)}, texts


def gauge_symbols(inverse_map: InverseMap) -> list[str]:
    """Return the mark's symbol of each gauge: that of its kind."""
    return [SYMBOLS[kind] for kind in _kinds(inverse_map)]


def _kinds(inverse_map: InverseMap) -> list[str]:
    """Return the kind of each gauge."""
    kinds = kinds_of_map(inverse_map)
    return [next(kind for kind, of in kinds.items() if of[i]) for i in range(inverse_map.n_gauges)]
