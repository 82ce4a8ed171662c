"""Figures of what the gauges observe: classes of symmetry, the unrolled body, POD modes, singular values."""

from collections.abc import Collection
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from builder.aero.surface.mesh import SurfaceMesh
from builder.figures.drawing import (
    AT_BEST,
    COLOUR_MAP,
    ENDS,
    THIS_MAP,
    Area,
    ValuedFigure,
    blank_figure,
    cell,
    colour_ends,
    column,
    digits,
    ends_beyond,
    roll_degrees,
    unrolled_triangles,
)
from builder.figures.gauge_figures import draw_gauges, gauge_areas, gauge_texts
from builder.structure.observability import SYMMETRIES
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.map.inverse_map import InverseMap

STATIONS, ROLLS = 50, 36
"""Cells of an unrolled body that show values."""
MODES_DRAWN = 20
MIN_SHOWN = 1e-4
"""Fraction of the variance, in per cent, at which a logarithmic axis ends."""
SNAPSHOTS = "0.6"
OF_STATE, NO_STATE = "#999999", "#dddddd"


def classes(
    *,
    of_snapshots: FloatArray,
    of_kept_modes: FloatArray,
    removed: FloatArray,
    removed_at_best: FloatArray,
    blind: Collection[int],
) -> ValuedFigure:
    """Draw the fraction of the snapshots in each class of symmetry, and how much of it the data remove.

    Parameters
    ----------
    of_snapshots, of_kept_modes : (4,) fraction of the variance in each class [1].
    removed, removed_at_best : (4,) fraction of the class's variance that this map, the best one removes [1].
    blind : indices of the classes that no gauge responds to.
    """
    shown = ValuedFigure(blank_figure(10.0, 3.4))
    fractions, known = shown.figure.subplots(1, 2, sharey=True)
    row = np.arange(len(SYMMETRIES))
    fractions.barh(row - 0.2, 100.0 * of_snapshots, 0.38, color=SNAPSHOTS, label="snapshots")
    fractions.barh(row + 0.2, 100.0 * of_kept_modes, 0.38, color="0.3", label="kept modes")
    fractions.set_xlabel("fraction of the variance [%]")
    fractions.set_yticks(row, [str(symmetry) for symmetry in SYMMETRIES])
    fractions.invert_yaxis()
    known.barh(row - 0.2, 100.0 * removed, 0.38, color=THIS_MAP, label="this map")
    known.barh(row + 0.2, 100.0 * removed_at_best, 0.38, color=AT_BEST, label="best linear map")
    known.set_xlabel("variance removed by the data [%]")
    known.set_xlim(min(0.0, 100.0 * float(np.nanmin(removed, initial=0.0))), 100.0)
    for i in blind:
        words = "blind: known only by correlation"
        known.text(2.0, i, words, fontsize=8, va="center", bbox={"facecolor": "white", "edgecolor": "tab:red"})
    for axis in (fractions, known):
        axis.grid(axis="x", alpha=0.3)
        axis.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    for i, symmetry in enumerate(SYMMETRIES):
        text = (
            f"{symmetry}\n{digits(100.0 * of_snapshots[i])} % of the snapshots' variance\n"
            f"{digits(100.0 * of_kept_modes[i])} % of the kept modes' variance\n"
            f"removed by this map {digits(100.0 * removed[i])} %\nat best {digits(100.0 * removed_at_best[i])} %"
        )
        shown.annotate(*(Area(axis, ENDS, (i - 0.5, i + 0.5)) for axis in (fractions, known)), text=text)
    return shown


def unrolled_pressure(
    surface: SurfaceMesh, *, removed: FloatArray | None, mean: FloatArray, std: FloatArray, inverse_map: InverseMap
) -> ValuedFigure:
    """Draw the unrolled body: variance that the data remove, mean and spread of the pressure, and the gauges.

    Cells show the values of the node closest to their middle.

    Parameters
    ----------
    surface : the pressure nodes.
    removed : (n_p,) fraction of the variance that the data remove [1], NaN where there is none; None if not known.
    mean, std : (n_p,) mean and standard deviation of the pressure that the map models [Pa].
    inverse_map : its gauges are drawn.
    """
    fields: list[tuple[FloatArray, str, dict[str, float] | None]] = [
        (1e-3 * mean, "mean pressure [kPa]", None),
        (1e-3 * std, "standard deviation [kPa]", None),
    ]
    if removed is not None:
        percent = np.nan_to_num(np.clip(100.0 * removed, 0.0, 100.0))
        fields.insert(0, (percent, "variance removed [%]", {"vmin": 0.0, "vmax": 100.0}))
    shown = ValuedFigure(blank_figure(10.0, 0.5 + 2.7 * len(fields)))
    panels = list(shown.figure.subplots(len(fields), 1, sharex=True))
    for panel, (values, label, ends) in zip(panels, fields, strict=True):
        point, roll, triangle, nodes = unrolled_triangles(surface, values)
        image = panel.tripcolor(
            point[:, 0],
            roll,
            triangle,
            nodes,
            shading="gouraud",
            cmap=COLOUR_MAP,
            rasterized=True,
            **(ends or colour_ends(surface, values)),
        )
        draw_gauges(panel, inverse_map, None)
        shown.figure.colorbar(image, ax=panel, pad=0.01, label=label, extend=ends_beyond(image, values))
    panels[0].legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 0.99), frameon=False, ncols=3)
    panels[-1].set_xlabel("station x from the nose tip [m]")
    x, roll_angle, node = _closest_nodes(surface)
    width, height = float(np.ptp(surface.point[:, 0])) / STATIONS, 360.0 / ROLLS
    for (station, angle), k in zip(product(x.tolist(), roll_angle.tolist()), node.ravel().tolist(), strict=True):
        part = "" if removed is None else f"variance removed {digits(100.0 * removed[k])} %\n"
        text = (
            f"x {digits(station)} m, roll {digits(angle)} deg\n{part}"
            f"mean {digits(1e-3 * mean[k])} kPa\nstandard deviation {digits(1e-3 * std[k])} kPa"
        )
        shown.annotate(*(cell(panel, station, angle, width, height) for panel in panels), text=text)
    for areas, text in zip(gauge_areas(panels, inverse_map), gauge_texts(inverse_map), strict=True):
        shown.annotate(*areas, text=text)
    return shown


def _closest_nodes(surface: SurfaceMesh) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return stations [m] and roll angles [deg] of the cells' middles, and (n_x, n_roll) the closest nodes."""
    point = surface.point
    radius = np.hypot(point[:, 1], point[:, 2])
    per_degree = max(float(radius.mean()), 1e-9) * np.pi / 180.0
    first, length = point[:, 0].min(), np.ptp(point[:, 0])
    x = first + length * (np.arange(STATIONS) + 0.5) / STATIONS
    roll = 360.0 * (np.arange(ROLLS) + 0.5) / ROLLS
    angle = roll_degrees(point)
    nodes = np.concatenate(
        [np.column_stack([point[:, 0], per_degree * (angle + turn)]) for turn in (-360.0, 0.0, 360.0)]
    )
    wanted = np.stack(np.meshgrid(x, per_degree * roll, indexing="ij"), axis=-1)
    _, index = cKDTree(nodes).query(wanted)
    return x, roll, np.asarray(index % len(point), dtype=np.int64)


def modes(
    *, of_variance: FloatArray, removed: FloatArray, removed_at_best: FloatArray, is_state: BoolArray
) -> ValuedFigure:
    """Draw the first modes: their fraction of the variance, and what is left of it.

    Parameters
    ----------
    of_variance : (k,) fraction of the snapshots' variance in each mode [1].
    removed, removed_at_best : (k,) fraction of the mode's variance that this map, the best linear map removes [1].
    is_state : (k,) whether each is a state of the map.
    """
    count = min(MODES_DRAWN, len(of_variance))
    shown = ValuedFigure(blank_figure(10.0, 3.6))
    axis = shown.figure.subplots()
    number, percent = np.arange(1, count + 1), 100.0 * of_variance[:count]
    remaining = np.maximum(percent * (1.0 - removed[:count]), MIN_SHOWN)
    best = np.maximum(percent * (1.0 - removed_at_best[:count]), MIN_SHOWN)
    for chosen, colour, label in (
        (is_state[:count], OF_STATE, "of the snapshots, states"),
        (~is_state[:count], NO_STATE, "of the snapshots, no states"),
    ):
        axis.bar(number[chosen], np.maximum(percent[chosen], MIN_SHOWN), 0.8, color=colour, label=label)
    axis.plot(number, remaining, "o", color=THIS_MAP, label="left by this map")
    axis.plot(number, best, "_", color=AT_BEST, markersize=14, markeredgewidth=2.5, label="left by the best map")
    axis.set_yscale("log")
    axis.set_ylim(MIN_SHOWN, 200.0)
    axis.set_xticks(number)
    axis.set_xlabel("POD mode")
    axis.set_ylabel("fraction of the variance [%]")
    axis.grid(axis="y", alpha=0.3)
    axis.legend(fontsize=8, ncols=4, loc="upper right")
    for k in range(count):
        text = (
            f"mode {k + 1}, {'state of the map' if is_state[k] else 'no state'}\n"
            f"{digits(percent[k])} % of the variance\nremoved by this map {digits(100.0 * removed[k])} %\n"
            f"at best {digits(100.0 * removed_at_best[k])} %"
        )
        shown.annotate(column(axis, k + 1.0), text=text)
    return shown


def singular_values(values: FloatArray) -> ValuedFigure:
    """Draw the singular values of Z_p [um/m per kPa rms] by their number; those that are 0 are left out."""
    shown = ValuedFigure(blank_figure(10.0, 3.2))
    axis = shown.figure.subplots()
    above = values[values > 0.0]
    axis.semilogy(np.arange(1, len(above) + 1), above, ".-", color=THIS_MAP, linewidth=0.8)
    axis.set_xlabel("number")
    axis.set_ylabel("singular value\n[um/m per kPa rms]")
    axis.grid(alpha=0.3)
    for number, value in enumerate(above, start=1):
        text = f"number {number}\n{digits(value)} um/m per kPa rms\n{digits(value / above[0])} of the largest"
        shown.annotate(column(axis, float(number)), text=text)
    return shown
