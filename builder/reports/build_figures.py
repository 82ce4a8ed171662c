"""Figures of a build report (matplotlib, without a display); those of gauges and eigenvalues need a map alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from builder.aero.surface_mesh import SurfaceMesh
from builder.figures.pressure import COLOUR_MAP, blank_figure
from builder.reports.build_report import BuildReport
from builder.reports.gamma_choice import GammaChoice
from builder.reports.gauge_value import GaugeValue
from builder.structure.observability import SYMMETRIES, angle_from_meridian
from strainfmu.arrays import FloatArray
from strainfmu.estimator.inverse_map import COEFFICIENT_NAMES, InverseMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MODES_DRAWN = 20
MOST_LABELS = 30
LEAST_SHOWN = 1e-4
"""Of the variance, in per cent: where a logarithmic axis ends."""
THIS_MAP, AT_BEST, SNAPSHOTS = "tab:blue", "tab:orange", "0.6"
RULE_MARKS = ("*", "o", "s", "^", "D")


def classes(report: BuildReport) -> Figure:
    """Draw how much of the snapshots each class of symmetry is, and how much of it the data remove."""
    sight = report.sight
    figure = blank_figure(10.0, 3.4)
    share, removed = figure.subplots(1, 2, sharey=True)
    place = np.arange(len(SYMMETRIES))
    share.barh(place - 0.2, 100.0 * sight.class_share, 0.38, color=SNAPSHOTS, label="snapshots")
    share.barh(place + 0.2, 100.0 * sight.class_share_of_kept, 0.38, color="0.3", label="kept modes")
    share.set_xlabel("share of the variance [%]")
    share.set_yticks(place, [str(one) for one in SYMMETRIES])
    share.invert_yaxis()
    removed.barh(place - 0.2, 100.0 * sight.class_removed, 0.38, color=THIS_MAP, label="this map")
    removed.barh(place + 0.2, 100.0 * sight.class_removed_at_best, 0.38, color=AT_BEST, label="best linear map")
    removed.set_xlabel("variance removed by the data [%]")
    removed.set_xlim(min(0.0, 100.0 * float(np.nanmin(sight.class_removed, initial=0.0))), 100.0)
    for i in report.blind_classes:
        words = "blind: known only by what flies with it"
        removed.text(2.0, i, words, fontsize=8, va="center", bbox={"facecolor": "white", "edgecolor": "tab:red"})
    for axis in (share, removed):
        axis.grid(axis="x", alpha=0.3)
        axis.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    return figure


def modes(report: BuildReport) -> Figure:
    """Draw the first modes: their share of the variance, and what is left of it."""
    sight = report.sight
    count = min(MODES_DRAWN, len(sight.mode_std))
    figure = blank_figure(10.0, 3.6)
    axis = figure.subplots()
    number, share = np.arange(1, count + 1), 100.0 * sight.mode_share[:count]
    left = np.maximum(share * (1.0 - sight.mode_removed[:count]), LEAST_SHOWN)
    best = np.maximum(share * (1.0 - sight.mode_removed_at_best[:count]), LEAST_SHOWN)
    axis.bar(number, np.maximum(share, LEAST_SHOWN), 0.8, color="0.8", label="of the snapshots")
    axis.plot(number, left, "o", color=THIS_MAP, label="left by this map")
    axis.plot(number, best, "_", color=AT_BEST, markersize=14, markeredgewidth=2.5, label="left by the best one")
    if sight.n_kept < count:
        axis.axvline(sight.n_kept + 0.5, color="black", linestyle="--", linewidth=0.8)
        axis.text(sight.n_kept + 0.6, axis.get_ylim()[1], "cut off", fontsize=8, va="top")
    axis.set_yscale("log")
    axis.set_ylim(LEAST_SHOWN, 200.0)
    axis.set_xticks(number)
    axis.set_xlabel("POD mode")
    axis.set_ylabel("share of all variance [%]")
    axis.grid(axis="y", alpha=0.3)
    axis.legend(fontsize=8, ncols=3, loc="upper right")
    return figure


def known_pressure(report: BuildReport) -> Figure:
    """Draw the unrolled body: the share of the pressure's variance that the data remove, and the gauges."""
    figure = blank_figure(10.0, 3.8)
    axis: Any = figure.subplots()
    shown = np.nan_to_num(np.clip(100.0 * report.sight.node_removed, 0.0, 100.0))
    point, roll, triangle, shown = _unrolled(report.surface, shown)
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
    _draw_gauges(axis, report.inverse_map, None)
    figure.colorbar(drawn, ax=axis, pad=0.01, label="variance removed [%]")
    axis.set_xlabel("station x from the nose tip [m]")
    return figure


def coefficients(report: BuildReport) -> Figure:
    """Draw where each coefficient's variance comes from, its sigma over its range, and the errors' correlation."""
    found = report.coefficients
    figure = blank_figure(10.0, 3.6)
    causes, ranges, correlation = figure.subplots(1, 3, width_ratios=(1.2, 1.0, 1.1))
    below = np.zeros(5)
    place = np.arange(5)
    for name, share in zip(found.names, 100.0 * found.variance / found.std**2, strict=True):
        causes.bar(place, share, 0.7, bottom=below, label=name)
        below += share
    causes.set_xticks(place, COEFFICIENT_NAMES)
    causes.set_ylabel("share of the variance [%]")
    causes.set_ylim(0.0, 100.0 + 12.0 * len(found.names))
    causes.legend(fontsize=8, loc="upper left")
    finite = np.where(np.isfinite(found.std_of_range), 300.0 * found.std_of_range, np.nan)
    ranges.bar(place, finite, 0.7, color=THIS_MAP)
    ranges.set_xticks(place, COEFFICIENT_NAMES)
    ranges.set_ylabel("3 sigma over the range of the snapshots [%]")
    ranges.grid(axis="y", alpha=0.3)
    _draw_correlation(figure, correlation, found.correlation)
    return figure


def correlations(inverse_map: InverseMap) -> Figure:
    """Draw the correlation of the coefficients' errors."""
    std = np.sqrt(np.diag(inverse_map.load_covariance))
    figure = blank_figure(4.4, 3.6)
    _draw_correlation(figure, figure.subplots(), inverse_map.load_covariance / np.outer(std, std))
    figure.suptitle("Correlation of the coefficients' errors [1]", fontsize=10)
    return figure


def _draw_correlation(figure: Figure, axis: Any, values: FloatArray) -> None:
    drawn = axis.imshow(values, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    place = np.arange(5)
    axis.set_xticks(place, COEFFICIENT_NAMES, fontsize=8)
    axis.set_yticks(place, COEFFICIENT_NAMES, fontsize=8)
    for (i, j), value in np.ndenumerate(values):
        colour = "white" if abs(value) > 0.6 else "black"
        axis.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=8, color=colour)
    figure.colorbar(drawn, ax=axis, pad=0.02, label="correlation of errors [1]")


def gauge_loss(inverse_map: InverseMap, value: GaugeValue) -> Figure:
    """Draw, at each gauge of the unrolled body, by how much its loss raises each sigma; and the bias noticed."""
    figure = blank_figure(11.0, 7.5)
    axes = figure.subplots(3, 2, sharex=True, sharey=True)
    for i, axis in enumerate(axes.flat):
        if i < len(COEFFICIENT_NAMES):
            numbers, label = 100.0 * (value.growth[:, i] - 1.0), "sigma grows [%]"
            axis.set_title(f"{COEFFICIENT_NAMES[i]}, gauge lost", fontsize=9)
        else:
            numbers, label = 1e6 * value.detectable_bias, "bias [um/m]"
            axis.set_title("least bias that is noticed", fontsize=9)
        drawn = _draw_gauges(axis, inverse_map, numbers)
        figure.colorbar(drawn, ax=axis, pad=0.01, label=label)
    for axis in axes[-1]:
        axis.set_xlabel("station x from the nose tip [m]")
    return figure


def pair_loss(inverse_map: InverseMap, value: GaugeValue) -> Figure:
    """Draw by how much the loss of two gauges raises the sigma that it raises most."""
    from matplotlib.colors import LogNorm

    n = inverse_map.n_gauges
    grown = np.zeros((n, n))
    i, j = value.pairs.T
    grown[i, j] = grown[j, i] = 100.0 * (value.pair_growth.max(axis=1) - 1.0)
    grown[np.arange(n), np.arange(n)] = 100.0 * (value.growth.max(axis=1) - 1.0)
    finite = grown[np.isfinite(grown)]
    most = max(float(finite.max(initial=0.0)), 1.0)
    figure = blank_figure(8.0, 7.0)
    axis = figure.subplots()
    colours = LogNorm(most / 1e3, most)
    shown = np.where(np.isfinite(grown), np.maximum(grown, most / 1e3), np.nan)
    axis.set_facecolor("black")  # where the gauges left do not identify the state
    drawn = axis.imshow(shown, norm=colours, cmap=COLOUR_MAP, interpolation="nearest")
    every = -(-n // MOST_LABELS)
    ticks = np.arange(0, n, every)
    names = [inverse_map.gauge_names[k] for k in ticks]
    axis.set_xticks(ticks, names, rotation=90, fontsize=7)
    axis.set_yticks(ticks, names, fontsize=7)
    figure.colorbar(drawn, ax=axis, pad=0.01, label="largest growth of a sigma [%]; diagonal: one gauge lost")
    return figure


def eigenvalues(values: FloatArray, gamma: float) -> Figure:
    """Draw the decay of the Hessian's eigenvalues, gamma among them, and the filter factors."""
    figure = blank_figure(10.0, 3.6)
    decay, factors = figure.subplots(1, 2, sharex=True)
    number = np.arange(1, len(values) + 1)
    seen = values > 1e-16 * values[0]
    above = int(np.sum(values >= gamma))
    decay.semilogy(number[seen], values[seen], ".-", color=THIS_MAP, linewidth=0.8)
    decay.axhline(gamma, color="tab:red", linewidth=1.0, label=f"gamma = {gamma:.4g}; {above} eigenvalues above")
    decay.set_ylabel("eigenvalue [1]")
    decay.legend(fontsize=8)
    factors.bar(number, values / (values + gamma), color=THIS_MAP)
    factors.set_ylabel("filter factor: part decided by the data [1]")
    for axis in (decay, factors):
        axis.set_xlabel("mode of the prior-preconditioned Hessian")
        axis.grid(alpha=0.3)
    return figure


def l_curve(choice: GammaChoice) -> Figure:
    """Draw the L-curve with the gamma of every rule; those that agree lie on one another."""
    figure = blank_figure(8.0, 4.6)
    axis = figure.subplots()
    curve = choice.curve
    axis.loglog(curve.residual_norm, curve.solution_norm, color="0.4", linewidth=1.0)
    order = np.log(curve.gamma)
    found = [one for one in choice.rules if one.gamma is not None]
    marks = [(one.rule.replace("_", " "), float(one.gamma)) for one in found if one.gamma is not None]
    for i, (name, gamma) in enumerate([*marks, ("corner of the L-curve", curve.corner)]):
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
    axis.legend(title="gamma", fontsize=8)
    return figure


def _draw_gauges(axis: Any, inverse_map: InverseMap, numbers: FloatArray | None) -> Any:
    """Draw the gauges on an unrolled body, coloured by ``numbers`` or hollow; black where a number is infinite."""
    position = inverse_map.gauge_position
    roll = _roll_degrees(position)
    hoop = np.abs(angle_from_meridian(position, inverse_map.gauge_direction)) > 0.25 * np.pi
    finite = np.ones(len(roll), dtype=bool) if numbers is None else np.isfinite(numbers)
    drawn: Any = None
    for chosen, marker, label in ((~hoop, "o", "axial"), (hoop, "s", "hoop")):
        # Gauges at one place would hide each other.
        at = position[:, 0], roll + np.where(hoop, 9.0, -9.0)
        if numbers is None:
            axis.plot(at[0][chosen], at[1][chosen], marker, color="white", markeredgecolor="black", markersize=5)
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


def _roll_degrees(point: FloatArray) -> FloatArray:
    roll = np.degrees(np.arctan2(point[:, 1], point[:, 2])) % 360.0
    return np.where(roll > 360.0 - 1e-9, 0.0, roll)


def _unrolled(
    surface: SurfaceMesh, values: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.int64], FloatArray]:
    """Return points, roll angles [deg], triangles and values of a surface cut open at 0 deg.

    Triangles across the cut get nodes of their own beyond 360 deg. Nodes on the axis have no roll angle; their
    triangles are left out.
    """
    point, roll, triangle = surface.point, _roll_degrees(surface.point), surface.triangle
    off_axis = np.hypot(point[:, 1], point[:, 2]) > 1e-9 * float(np.ptp(point[:, 0]))
    triangle = triangle[off_axis[triangle].all(axis=1)]
    across = np.ptp(roll[triangle], axis=1) > 180.0
    corner = triangle[across].ravel()
    beyond = np.where(roll[corner] < 180.0, roll[corner] + 360.0, roll[corner])
    added = len(point) + np.arange(len(corner)).reshape(-1, 3)
    return (
        np.concatenate([point, point[corner]]),
        np.concatenate([roll, beyond]),
        np.concatenate([triangle[~across], added]),
        np.concatenate([values, values[corner]]),
    )
