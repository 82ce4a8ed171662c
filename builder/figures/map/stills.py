"""Figures of a build report; those of gauges and eigenvalues need a map alone."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.figures.drawing.canvas import COLOUR_MAP, blank_figure
from builder.figures.drawing.colours import part_colours
from builder.figures.drawing.gauge_marks import KIND_MARKERS, KIND_OFFSETS, kind_label, kinds_of_map, shown_bias
from builder.figures.drawing.unrolled import roll_degrees, unrolled_triangles
from builder.figures.drawing.words import with_signs
from builder.inverse.cases.regularisation import LCurve
from builder.structure.observability import SYMMETRIES
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.gain import load_covariance

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SIGNS = [with_signs(name) for name in COEFFICIENT_NAMES]
MODES_DRAWN = 20
MAX_LABELS = 30
MIN_SHOWN = 1e-4
"""Fraction of the variance, in per cent, at which a logarithmic axis ends."""
THIS_MAP, AT_BEST, SNAPSHOTS = "tab:blue", "tab:orange", "0.6"
OF_STATE, NO_STATE = "#999999", "#dddddd"
RULE_MARKS = ("*", "o", "s", "^", "D")


def classes(
    *,
    of_snapshots: FloatArray,
    of_kept_modes: FloatArray,
    removed: FloatArray,
    removed_at_best: FloatArray,
    blind: Collection[int],
) -> Figure:
    """Draw the fraction of the snapshots in each class of symmetry, and how much of it the data remove.

    Parameters
    ----------
    of_snapshots, of_kept_modes : (4,) fraction of the variance in each class [1].
    removed, removed_at_best : (4,) fraction of the class's variance that this map, the best one removes [1].
    blind : indices of the classes that no gauge responds to.
    """
    figure = blank_figure(10.0, 3.4)
    held, known = figure.subplots(1, 2, sharey=True)
    row = np.arange(len(SYMMETRIES))
    held.barh(row - 0.2, 100.0 * of_snapshots, 0.38, color=SNAPSHOTS, label="snapshots")
    held.barh(row + 0.2, 100.0 * of_kept_modes, 0.38, color="0.3", label="kept modes")
    held.set_xlabel("fraction of the variance [%]")
    held.set_yticks(row, [str(one) for one in SYMMETRIES])
    held.invert_yaxis()
    known.barh(row - 0.2, 100.0 * removed, 0.38, color=THIS_MAP, label="this map")
    known.barh(row + 0.2, 100.0 * removed_at_best, 0.38, color=AT_BEST, label="best linear map")
    known.set_xlabel("variance removed by the data [%]")
    known.set_xlim(min(0.0, 100.0 * float(np.nanmin(removed, initial=0.0))), 100.0)
    for i in blind:
        words = "blind: known only by correlation"
        known.text(2.0, i, words, fontsize=8, va="center", bbox={"facecolor": "white", "edgecolor": "tab:red"})
    for axis in (held, known):
        axis.grid(axis="x", alpha=0.3)
        axis.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    return figure


def modes(
    *, of_variance: FloatArray, removed: FloatArray, removed_at_best: FloatArray, is_state: BoolArray
) -> Figure:
    """Draw the first modes: their fraction of the variance, and what is left of it.

    Parameters
    ----------
    of_variance : (k,) fraction of the snapshots' variance in each mode [1].
    removed, removed_at_best : (k,) fraction of the mode's variance that this map, the best linear map removes [1].
    is_state : (k,) whether each is a state of the map.
    """
    count = min(MODES_DRAWN, len(of_variance))
    figure = blank_figure(10.0, 3.6)
    axis = figure.subplots()
    number, percent = np.arange(1, count + 1), 100.0 * of_variance[:count]
    left = np.maximum(percent * (1.0 - removed[:count]), MIN_SHOWN)
    best = np.maximum(percent * (1.0 - removed_at_best[:count]), MIN_SHOWN)
    for shown, colour, label in (
        (is_state[:count], OF_STATE, "of the snapshots, states"),
        (~is_state[:count], NO_STATE, "of the snapshots, no states"),
    ):
        axis.bar(number[shown], np.maximum(percent[shown], MIN_SHOWN), 0.8, color=colour, label=label)
    axis.plot(number, left, "o", color=THIS_MAP, label="left by this map")
    axis.plot(number, best, "_", color=AT_BEST, markersize=14, markeredgewidth=2.5, label="left by the best map")
    axis.set_yscale("log")
    axis.set_ylim(MIN_SHOWN, 200.0)
    axis.set_xticks(number)
    axis.set_xlabel("POD mode")
    axis.set_ylabel("fraction of the variance [%]")
    axis.grid(axis="y", alpha=0.3)
    axis.legend(fontsize=8, ncols=4, loc="upper right")
    return figure


def singular_values(values: FloatArray) -> Figure:
    """Draw the singular values of Z_p [um/m per kPa rms] by their number; those that are 0 are left out."""
    figure = blank_figure(10.0, 3.2)
    axis = figure.subplots()
    above = values[values > 0.0]
    axis.semilogy(np.arange(1, len(above) + 1), above, ".-", color=THIS_MAP, linewidth=0.8)
    axis.set_xlabel("number")
    axis.set_ylabel("singular value\n[um/m per kPa rms]")
    axis.grid(alpha=0.3)
    return figure


def known_pressure(surface: SurfaceMesh, removed: FloatArray, inverse_map: InverseMap) -> Figure:
    """Draw the unrolled body: how much of the pressure's variance the data remove, and the gauges.

    Parameters
    ----------
    surface : the pressure nodes.
    removed : (n_p,) fraction of the variance removed at each node [1]; NaN where there is none.
    inverse_map : its gauges are drawn.
    """
    figure = blank_figure(10.0, 3.8)
    axis: Any = figure.subplots()
    shown = np.nan_to_num(np.clip(100.0 * removed, 0.0, 100.0))
    point, roll, triangle, shown = unrolled_triangles(surface, shown)
    drawn = axis.tripcolor(
        point[:, 0],
        roll,
        triangle,
        shown,
        shading="gouraud",
        cmap=COLOUR_MAP,
        vmin=0.0,
        vmax=100.0,
        rasterized=True,
    )
    _draw_gauges(axis, inverse_map, None)
    axis.legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 0.99), frameon=False, ncols=3)
    figure.colorbar(drawn, ax=axis, pad=0.01, label="variance removed [%]")
    axis.set_xlabel("station x from the nose tip [m]")
    return figure


def coefficients(
    *,
    sources: Sequence[str],
    of_variance: FloatArray,
    std_of_range: FloatArray,
    correlation: FloatArray,
) -> Figure:
    """Draw the sources of each coefficient's variance, its sigma over its range, and the errors' correlation.

    Parameters
    ----------
    sources : n names.
    of_variance : (n, 5) fraction of each source in the variance of each coefficient [1].
    std_of_range : (5,) sigma over the width of the range [1]; infinite where there is no range.
    correlation : (5, 5) of the errors [1].
    """
    figure = blank_figure(10.0, 3.6)
    variances, ranges, matrix = figure.subplots(1, 3, width_ratios=(1.2, 1.0, 1.1))
    below = np.zeros(5)
    column = np.arange(5)
    colours = part_colours(len(sources))
    for name, percent, colour in zip(sources, 100.0 * of_variance, colours, strict=True):
        variances.bar(column, percent, 0.7, bottom=below, label=name, color=colour)
        below += percent
    variances.set_xticks(column, SIGNS)
    variances.set_ylabel("fraction of the variance [%]")
    variances.set_ylim(0.0, 100.0 + 12.0 * len(sources))
    variances.legend(fontsize=8, loc="upper left")
    finite = np.where(np.isfinite(std_of_range), 300.0 * std_of_range, np.nan)
    ranges.bar(column, finite, 0.7, color=THIS_MAP)
    ranges.set_xticks(column, SIGNS)
    ranges.set_ylabel("$3\\sigma$ over the range of the snapshots [%]")
    ranges.grid(axis="y", alpha=0.3)
    _draw_correlation(figure, matrix, correlation)
    return figure


def correlations(inverse_map: InverseMap) -> Figure:
    """Draw the correlation of the coefficients' errors."""
    covariance = load_covariance(inverse_map)[FIVE_LOADS, FIVE_LOADS]
    std = np.sqrt(np.diag(covariance))
    figure = blank_figure(4.4, 3.6)
    _draw_correlation(figure, figure.subplots(), covariance / np.outer(std, std))
    figure.suptitle("Correlation of the coefficients' errors [1]", fontsize=10)
    return figure


def _draw_correlation(figure: Figure, axis: Any, values: FloatArray) -> None:
    drawn = axis.imshow(values, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axis.set_xticks(np.arange(5), SIGNS, fontsize=8)
    axis.set_yticks(np.arange(5), SIGNS, fontsize=8)
    for (i, j), value in np.ndenumerate(values):
        colour = "white" if abs(value) > 0.6 else "black"
        axis.text(j, i, f"{round(value, 2) + 0.0:.2f}", ha="center", va="center", fontsize=8, color=colour)
    figure.colorbar(drawn, ax=axis, pad=0.02, label="correlation of errors [1]")


def gauge_loss(inverse_map: InverseMap, *, growth: FloatArray, detectable_bias: FloatArray) -> Figure:
    """Draw, at each gauge of the unrolled body, how much its loss raises each sigma, and the detectable bias.

    Parameters
    ----------
    growth : (n_d, 5) sigma of each load without the gauge over sigma with all [1].
    detectable_bias : (n_d,) [m/m].
    """
    from matplotlib.collections import PathCollection

    figure = blank_figure(11.0, 7.5)
    axes = figure.subplots(3, 2, sharex=True, sharey=True)
    for i, axis in enumerate(axes.flat):
        if i < len(COEFFICIENT_NAMES):
            numbers, label = 100.0 * (growth[:, i] - 1.0), "$\\sigma$ grows [%]"
            axis.set_title(f"{SIGNS[i]}, gauge lost", fontsize=9)
        else:
            numbers, label = shown_bias(inverse_map, detectable_bias)
            axis.set_title("minimum detectable bias", fontsize=9)
        drawn = _draw_gauges(axis, inverse_map, numbers)
        figure.colorbar(drawn, ax=axis, pad=0.01, label=label)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    legend = figure.legend(handles, labels, fontsize=8, loc="outside upper right", frameon=False, ncols=3)
    for handle in legend.legend_handles:  # its colour would be that of one gauge's number
        if isinstance(handle, PathCollection):
            handle.set_array(None)
            handle.set_facecolor("white")
    for axis in axes[-1]:
        axis.set_xlabel("station x from the nose tip [m]")
    return figure


def pair_loss(inverse_map: InverseMap, *, growth: FloatArray, pairs: IntArray, pair_growth: FloatArray) -> Figure:
    """Draw the growth of the sigma that the loss of two gauges raises most.

    Parameters
    ----------
    growth : (n_d, 5) sigma of each load without the gauge over sigma with all [1].
    pairs, pair_growth : (n, 2) pairs of gauges and (n, 5) the same with both lost.
    """
    from matplotlib.colors import LogNorm

    n = inverse_map.n_gauges
    grown = np.zeros((n, n))
    i, j = pairs.T
    grown[i, j] = grown[j, i] = 100.0 * (pair_growth.max(axis=1) - 1.0)
    grown[np.arange(n), np.arange(n)] = 100.0 * (growth.max(axis=1) - 1.0)
    finite = grown[np.isfinite(grown)]
    largest = max(float(finite.max(initial=0.0)), 1.0)
    figure = blank_figure(8.0, 7.0)
    axis = figure.subplots()
    colours = LogNorm(largest / 1e3, largest)
    shown = np.where(np.isfinite(grown), np.maximum(grown, largest / 1e3), np.nan)
    axis.set_facecolor("black")  # where the gauges left do not identify the state
    drawn = axis.imshow(shown, norm=colours, cmap=COLOUR_MAP, interpolation="nearest")
    every = -(-n // MAX_LABELS)
    ticks = np.arange(0, n, every)
    names = [inverse_map.gauge_names[k] for k in ticks]
    axis.set_xticks(ticks, names, rotation=90, fontsize=7)
    axis.set_yticks(ticks, names, fontsize=7)
    figure.colorbar(drawn, ax=axis, pad=0.01, label="largest growth of a $\\sigma$ [%]; diagonal: one gauge lost")
    return figure


def eigenvalues(values: FloatArray, gamma: float) -> Figure:
    """Draw the decay of the Hessian's eigenvalues, gamma among them, and the filter factors."""
    figure = blank_figure(10.0, 3.6)
    decay, factors = figure.subplots(1, 2, sharex=True)
    number = np.arange(1, len(values) + 1)
    above_round_off = values > 1e-16 * values[0]
    above = int(np.sum(values >= gamma))
    decay.semilogy(number[above_round_off], values[above_round_off], ".-", color=THIS_MAP, linewidth=0.8)
    decay.axhline(
        gamma, color="tab:red", linewidth=1.0, label=f"$\\gamma$ = {gamma:.4g}; {above} eigenvalues above"
    )
    decay.set_ylabel("eigenvalue [1]")
    decay.legend(fontsize=8)
    factors.bar(number, values / (values + gamma), color=THIS_MAP)
    factors.set_ylabel("filter factor: fraction determined by the data [1]")
    for axis in (decay, factors):
        axis.set_xlabel("mode of the prior-preconditioned Hessian")
        axis.grid(alpha=0.3)
    return figure


def l_curve(curve: LCurve, gammas: Sequence[tuple[str, float]]) -> Figure:
    """Draw the L-curve and on it each of ``gammas`` with its name; those that agree lie on one another."""
    figure = blank_figure(8.0, 4.6)
    axis = figure.subplots()
    axis.loglog(curve.residual_norm, curve.solution_norm, color="0.4", linewidth=1.0)
    order = np.log(curve.gamma)
    for i, (name, gamma) in enumerate([*gammas, ("corner of the L-curve", curve.corner)]):
        at = [
            np.exp(np.interp(np.log(gamma), order, np.log(norm)))
            for norm in (curve.residual_norm, curve.solution_norm)
        ]
        axis.plot(
            *at,
            linestyle="none",
            marker=RULE_MARKS[i] if i < len(RULE_MARKS) else "x",
            markersize=13 - 1.5 * min(i, 5),
            fillstyle="none",
            markeredgewidth=1.6,
            color=f"C{i}",
            label=f"{name}: {gamma:.3g}",
        )
    axis.set_xlabel("norm of the whitened residual [1]")
    axis.set_ylabel("norm of the states [1]")
    axis.grid(alpha=0.3, which="both")
    axis.legend(title="$\\gamma$", fontsize=8)
    return figure


def _draw_gauges(axis: Any, inverse_map: InverseMap, numbers: FloatArray | None) -> Any:
    """Draw the gauges on an unrolled body, coloured by ``numbers`` or hollow; black where a number is infinite."""
    position = inverse_map.gauge_position
    direction, roll = inverse_map.gauge_direction, roll_degrees(position)
    finite = np.ones(len(roll), dtype=bool) if numbers is None else np.isfinite(numbers)
    drawn: Any = None
    for kind, chosen in kinds_of_map(inverse_map).items():
        marker, label = KIND_MARKERS[kind], kind_label(kind, position[chosen], direction[chosen])
        at = position[:, 0], roll + KIND_OFFSETS[kind]
        if numbers is None:
            axis.plot(
                at[0][chosen],
                at[1][chosen],
                marker,
                color="white",
                markeredgecolor="black",
                markersize=5,
                label=label,
            )
            continue
        low, high = _limits(numbers[finite])
        here = chosen & finite
        drawn = axis.scatter(
            at[0][here],
            at[1][here],
            c=numbers[here],
            marker=marker,
            s=42,
            cmap=COLOUR_MAP,
            vmin=low,
            vmax=high,
            edgecolors="0.3",
            linewidths=0.5,
            label=label,
        )
        axis.scatter(at[0][chosen & ~finite], at[1][chosen & ~finite], c="black", marker=marker, s=60)
    axis.set_ylim(-25.0, 370.0)
    axis.set_yticks([0, 90, 180, 270, 360])
    axis.set_ylabel("roll angle [deg]")
    return drawn


def _limits(numbers: FloatArray) -> tuple[float, float]:
    low, high = min(0.0, float(numbers.min(initial=0.0))), float(numbers.max(initial=0.0))
    return low, high if high > low else low + 1.0
