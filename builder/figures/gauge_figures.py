"""Figures of a map's gauges: their places on the unrolled body, cost of a loss, pairs of losses."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing import (
    COLOUR_MAP,
    KIND_MARKERS,
    KIND_OFFSETS,
    Area,
    ValuedFigure,
    blank_figure,
    cell,
    digits,
    kind_label,
    kinds_of_map,
    mark,
    roll_degrees,
    shown_bias,
    with_signs,
)
from builder.structure.observability import direction_names
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.map.sensors import shown_units

if TYPE_CHECKING:
    from collections.abc import Sequence

MAX_LABELS = 30
MAX_MARKS = 1000
"""Gauges up to which marks are lines; of more they are dots of a picture, which is written in less time."""
MAX_MATRIX = 120
"""Gauges up to which the matrix of pairs has texts: their number grows with the square."""


def gauge_loss(
    inverse_map: InverseMap, *, growth: FloatArray, detectable_bias: FloatArray, leverage: FloatArray
) -> ValuedFigure:
    """Draw, at each gauge of the unrolled body, how much its loss raises each sigma, and the detectable bias.

    Parameters
    ----------
    growth : (n_d, 5) sigma of each load without the gauge over sigma with all [1].
    detectable_bias : (n_d,) [m/m].
    leverage : (n_d,) [1].
    """
    from matplotlib.collections import PathCollection

    shown = ValuedFigure(blank_figure(11.0, 7.5))
    axes = shown.figure.subplots(3, 2, sharex=True, sharey=True)
    grown = 100.0 * (growth - 1.0)
    for i, axis in enumerate(axes.flat):
        if i < len(COEFFICIENT_NAMES):
            numbers, label = grown[:, i], "$\\sigma$ grows [%]"
            axis.set_title(f"{with_signs(COEFFICIENT_NAMES[i])}, gauge lost", fontsize=9)
        else:
            numbers, label = shown_bias(inverse_map, detectable_bias)
            axis.set_title("minimum detectable bias", fontsize=9)
        image = draw_gauges(axis, inverse_map, numbers)
        shown.figure.colorbar(image, ax=axis, pad=0.01, label=label)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    legend = shown.figure.legend(handles, labels, fontsize=8, loc="outside upper right", frameon=False, ncols=3)
    for handle in legend.legend_handles:  # otherwise coloured by one gauge's number
        if isinstance(handle, PathCollection):
            handle.set_array(None)
            handle.set_facecolor("white")
    for axis in axes[-1]:
        axis.set_xlabel("station x from the nose tip [m]")
    places, units = gauge_areas(list(axes.flat), inverse_map), shown_units(inverse_map.sensors)
    for k, (text, (factor, unit)) in enumerate(zip(gauge_texts(inverse_map), units, strict=True)):
        lost = [f"lost: {name} {_growth(value)}" for name, value in zip(COEFFICIENT_NAMES, grown[k], strict=True)]
        bias = f"detectable bias {factor * detectable_bias[k]:.3g} {unit}, leverage {leverage[k]:.3g}"
        shown.annotate(*places[k], text="\n".join((text, *lost, bias)))
    return shown


def _growth(percent: float) -> str:
    return f"+{percent:.3g} %" if np.isfinite(percent) else "not identified"


def pair_loss(
    inverse_map: InverseMap, *, growth: FloatArray, pairs: IntArray, pair_growth: FloatArray
) -> ValuedFigure:
    """Draw the growth of the sigma that the loss of two gauges raises most; cells of up to 120 gauges have texts.

    Parameters
    ----------
    growth : (n_d, 5) sigma of each load without the gauge over sigma with all [1].
    pairs, pair_growth : (n, 2) pairs of gauges and (n, 5) the same with both lost.
    """
    from matplotlib.colors import LogNorm

    gauges = np.unique(pairs) if len(pairs) else np.arange(inverse_map.n_gauges)
    n, names = len(gauges), [inverse_map.gauge_names[gauge] for gauge in gauges]
    grown = np.zeros((n, n))
    i, j = np.searchsorted(gauges, pairs).T
    grown[i, j] = grown[j, i] = 100.0 * (pair_growth.max(axis=1) - 1.0)
    grown[np.arange(n), np.arange(n)] = 100.0 * (growth[gauges].max(axis=1) - 1.0)
    finite = grown[np.isfinite(grown)]
    largest = max(float(finite.max(initial=0.0)), 1.0)
    shown = ValuedFigure(blank_figure(8.0, 7.0))
    axis = shown.figure.subplots()
    colours = LogNorm(largest / 1e3, largest)
    coloured = np.where(np.isfinite(grown), np.maximum(grown, largest / 1e3), np.nan)
    axis.set_facecolor("black")  # where the gauges left do not identify the state
    image = axis.imshow(coloured, norm=colours, cmap=COLOUR_MAP, interpolation="nearest")
    ticks = np.arange(0, n, -(-n // MAX_LABELS))
    axis.set_xticks(ticks, [names[k] for k in ticks], rotation=90, fontsize=7)
    axis.set_yticks(ticks, [names[k] for k in ticks], fontsize=7)
    label = "largest growth of a $\\sigma$ [%]; diagonal: one gauge lost"
    shown.figure.colorbar(image, ax=axis, pad=0.01, label=label)
    if n <= MAX_MATRIX:
        for first, second in combinations_with_replacement(range(n), 2):
            lost = names[first] if first == second else f"{names[first]} and {names[second]}"
            both = {(first, second), (second, first)}
            value = grown[first, second]
            growth_text = f"+{digits(value)} %" if np.isfinite(value) else "not identified"
            shown.annotate(*(cell(axis, *place) for place in sorted(both)), text=f"{lost} lost: {growth_text}")
    return shown


def draw_gauges(axis: Any, inverse_map: InverseMap, numbers: FloatArray | None) -> Any:
    """Draw the gauges on an unrolled body, coloured by ``numbers`` or hollow; black where a number is infinite."""
    position = inverse_map.gauge_position
    direction, roll = inverse_map.gauge_direction, roll_degrees(position)
    finite = np.ones(len(roll), dtype=bool) if numbers is None else np.isfinite(numbers)
    image: Any = None
    for kind, chosen in kinds_of_map(inverse_map).items():
        marker, label = KIND_MARKERS[kind], kind_label(kind, position[chosen], direction[chosen])
        place = position[:, 0], roll + KIND_OFFSETS[kind]
        if numbers is None:
            axis.plot(
                place[0][chosen],
                place[1][chosen],
                marker,
                color="white",
                markeredgecolor="black",
                markersize=5,
                label=label,
                rasterized=len(roll) > MAX_MARKS,
            )
            continue
        low, high = _limits(numbers[finite])
        with_number = chosen & finite
        image = axis.scatter(
            place[0][with_number],
            place[1][with_number],
            c=numbers[with_number],
            marker=marker,
            s=42,
            cmap=COLOUR_MAP,
            vmin=low,
            vmax=high,
            edgecolors="0.3",
            linewidths=0.5,
            label=label,
            rasterized=len(roll) > MAX_MARKS,
        )
        axis.scatter(place[0][chosen & ~finite], place[1][chosen & ~finite], c="black", marker=marker, s=60)
    axis.set_ylim(-25.0, 370.0)
    axis.set_yticks([0, 90, 180, 270, 360])
    axis.set_ylabel("roll angle [deg]")
    return image


def _limits(numbers: FloatArray) -> tuple[float, float]:
    low, high = min(0.0, float(numbers.min(initial=0.0))), float(numbers.max(initial=0.0))
    return low, high if high > low else low + 1.0


def gauge_areas(axes: Sequence[Any], inverse_map: InverseMap) -> list[list[Area]]:
    """Return, gauge by gauge, the squares about its marks on the unrolled bodies of ``axes``."""
    position, kinds = inverse_map.gauge_position, kinds_of_map(inverse_map)
    roll = roll_degrees(position)
    for kind, chosen in kinds.items():
        roll = roll + np.where(chosen, KIND_OFFSETS[kind], 0.0)
    return [[mark(axis, x, y) for axis in axes] for x, y in zip(position[:, 0], roll, strict=True)]


def gauge_texts(inverse_map: InverseMap) -> list[str]:
    """Return name, direction or kind, and place of each gauge."""
    position = inverse_map.gauge_position
    directions = direction_names(position, inverse_map.gauge_direction)
    n = inverse_map.n_strain_gauges
    directions[n:] = inverse_map.sensors.kind[n:]
    gauges = zip(inverse_map.gauge_names, directions, position[:, 0], roll_degrees(position), strict=True)
    return [f"{name}, {what}\nx {x:.4g} m, roll {roll:.4g} deg" for name, what, x, roll in gauges]
