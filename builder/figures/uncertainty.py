"""Figures of the coefficients' uncertainty: its sources, correlation of errors, weight of the prior.

What the nonlinear estimator knows over the envelope, as maps over Mach number and total incidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing import (
    COLOUR_MAP,
    MARK,
    THIS_MAP,
    Area,
    ValuedFigure,
    blank_figure,
    cell,
    column,
    digits,
    mark,
    part_colours,
    with_signs,
)
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.gain import load_covariance
from strainfmu.linear.regularisation import LCurve

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

SIGNS = [with_signs(name) for name in COEFFICIENT_NAMES]
RULE_MARKS = ("*", "o", "s", "^", "D")


def coefficients(
    *,
    sources: Sequence[str],
    of_variance: FloatArray,
    std: FloatArray,
    limits: FloatArray,
    std_of_range: FloatArray,
    correlation: FloatArray,
) -> ValuedFigure:
    """Draw the sources of each coefficient's variance, its sigma over its range, and the errors' correlation.

    Parameters
    ----------
    sources : n names.
    of_variance : (n, 5) fraction of each source in the variance of each coefficient [1].
    std : (5,) sigma [1].
    limits : (5, 2) range of the snapshots [1].
    std_of_range : (5,) sigma over the width of the range [1]; infinite where there is no range.
    correlation : (5, 5) of the errors [1].
    """
    shown = ValuedFigure(blank_figure(10.0, 4.0))
    variances, ranges, matrix = shown.figure.subplots(1, 3, width_ratios=(1.2, 1.0, 1.1))
    below = np.zeros(5)
    place = np.arange(5)
    colours = part_colours(len(sources))
    for name, percent, colour in zip(sources, 100.0 * of_variance, colours, strict=True):
        variances.bar(place, percent, 0.7, bottom=below, label=name, color=colour)
        for k, coefficient in enumerate(COEFFICIENT_NAMES):
            alone = np.sqrt(0.01 * percent[k]) * std[k]
            lines = f"{coefficient}, {name}", f"{digits(percent[k])} % of the variance"
            text = "\n".join((*lines, f"sigma of it alone {digits(alone)}"))
            shown.annotate(cell(variances, k, below[k] + 0.5 * percent[k], 0.7, percent[k]), text=text)
        below += percent
    variances.set_xticks(place, SIGNS)
    variances.set_ylabel("fraction of the variance [%]")
    variances.set_ylim(0.0, 100.0)
    handles, labels = variances.get_legend_handles_labels()
    shown.figure.legend(handles, labels, fontsize=8, loc="outside upper left", ncols=5, frameon=False)
    finite = np.where(np.isfinite(std_of_range), 300.0 * std_of_range, np.nan)
    ranges.bar(place, finite, 0.7, color=THIS_MAP)
    ranges.set_xticks(place, SIGNS)
    ranges.set_ylabel("$3\\sigma$ over the range of the snapshots [%]")
    ranges.grid(axis="y", alpha=0.3)
    for k, coefficient in enumerate(COEFFICIENT_NAMES):
        low, high = map(digits, limits[k])
        text = (
            f"{coefficient}: sigma {digits(std[k])}, 3 sigma {digits(3.0 * std[k])}\n"
            f"{digits(finite[k])} % of the range {low} to {high}"
        )
        shown.annotate(column(ranges, float(k)), text=text)
    _draw_correlation(shown, matrix, correlation)
    return shown


def correlations(inverse_map: InverseMap) -> ValuedFigure:
    """Draw the correlation of the coefficients' errors."""
    covariance = load_covariance(inverse_map)[FIVE_LOADS, FIVE_LOADS]
    std = np.sqrt(np.diag(covariance))
    shown = ValuedFigure(blank_figure(4.4, 3.6))
    _draw_correlation(shown, shown.figure.subplots(), covariance / np.outer(std, std))
    shown.figure.suptitle("Correlation of the coefficients' errors [1]", fontsize=10)
    return shown


def _draw_correlation(shown: ValuedFigure, axis: Any, values: FloatArray) -> None:
    image = axis.imshow(values, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axis.set_xticks(np.arange(5), SIGNS, fontsize=8)
    axis.set_yticks(np.arange(5), SIGNS, fontsize=8)
    for (i, j), value in np.ndenumerate(values):
        colour = "white" if abs(value) > 0.6 else "black"
        axis.text(j, i, f"{round(value, 2) + 0.0:.2f}", ha="center", va="center", fontsize=8, color=colour)
        text = f"{COEFFICIENT_NAMES[i]} and {COEFFICIENT_NAMES[j]}: {digits(value)}"
        shown.annotate(cell(axis, j, i), text=text)
    shown.figure.colorbar(image, ax=axis, pad=0.02, label="correlation of errors [1]")


def eigenvalues(values: FloatArray, gamma: float, classes: Sequence[str] = ()) -> ValuedFigure:
    """Draw the decay of the Hessian's eigenvalues, gamma among them, and the filter factors.

    Parameters
    ----------
    classes : the main class of symmetry of each mode, where it is known.
    """
    shown = ValuedFigure(blank_figure(10.0, 3.6))
    decay, factors = shown.figure.subplots(1, 2, sharex=True)
    number = np.arange(1, len(values) + 1)
    above_round_off = values > 1e-16 * values[0]
    above = int(np.sum(values >= gamma))
    decay.semilogy(number[above_round_off], values[above_round_off], ".-", color=THIS_MAP, linewidth=0.8)
    decay.axhline(
        gamma, color="tab:red", linewidth=1.0, label=f"$\\gamma$ = {gamma:.4g}; {above} eigenvalues above"
    )
    decay.set_ylabel("eigenvalue [1]")
    decay.legend(fontsize=8)
    factor = values / (values + gamma)
    factors.bar(number, factor, color=THIS_MAP)
    factors.set_ylabel("filter factor: fraction determined by the data [1]")
    for axis in (decay, factors):
        axis.set_xlabel("mode of the prior-preconditioned Hessian")
        axis.grid(alpha=0.3)
    for k, value in enumerate(values):
        lines = (
            f"mode {k + 1}",
            *filter(None, classes[k : k + 1]),
            f"eigenvalue {digits(value)}",
            f"filter factor {digits(factor[k])}",
        )
        shown.annotate(*(column(axis, k + 1.0) for axis in (decay, factors)), text="\n".join(lines))
    return shown


def l_curve(curve: LCurve, gammas: Sequence[tuple[str, float]]) -> ValuedFigure:
    """Draw the L-curve and on it each of ``gammas`` with its name; those that agree lie on one another."""
    shown = ValuedFigure(blank_figure(8.0, 4.6))
    axis = shown.figure.subplots()
    axis.loglog(curve.residual_norm, curve.solution_norm, color="0.4", linewidth=1.0)
    for k, area in enumerate(_along(axis, curve.residual_norm, curve.solution_norm)):
        norms = f"residual {digits(curve.residual_norm[k])}, states {digits(curve.solution_norm[k])}"
        shown.annotate(area, text=f"gamma {digits(curve.gamma[k])}\n{norms}")
    order = np.log(curve.gamma)
    for i, (name, gamma) in enumerate([*gammas, ("corner of the L-curve", curve.corner)]):
        residual, states = (
            float(np.exp(np.interp(np.log(gamma), order, np.log(norm))))
            for norm in (curve.residual_norm, curve.solution_norm)
        )
        text = f"{name}: gamma {digits(gamma)}\nresidual {digits(residual)}, states {digits(states)}"
        shown.annotate(mark(axis, residual, states), text=text)
        axis.plot(
            residual,
            states,
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
    return shown


def _along(axis: Any, x: FloatArray, y: FloatArray) -> list[Area]:
    """Return an area about each point (n,) of a monotonic curve in logarithms.

    Areas meet halfway between neighbours. Each is padded across the curve alone: none covers a neighbour's point.
    """
    ends = [np.exp(_halfway(np.log(line))) for line in (x, y)]
    along_x, along_y = (np.abs(np.diff(np.log(line))) / max(np.ptp(np.log(line)), 1e-300) for line in ends)
    return [
        Area(axis, (x0, x1), (y0, y1), (MARK, 0.0) if steep else (0.0, MARK))
        for x0, x1, y0, y1, steep in zip(
            ends[0][:-1], ends[0][1:], ends[1][:-1], ends[1][1:], along_y > along_x, strict=True
        )
    ]


def _halfway(value: FloatArray) -> FloatArray:
    return np.concatenate([value[:1], 0.5 * (value[1:] + value[:-1]), value[-1:]])


COLUMNS = 5
"""Quantities side by side."""

HALF = 0.5
"""Part of the roll angles below which a quantity counts as not identified."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AccuracyMap:
    """The standard deviation of one quantity.

    Attributes
    ----------
    label : with its unit.
    std : (n, i, m) by navigation, incidence and Mach number.
    identified : (n, i, m) part of the roll angles at which it is identified; None where that is no question.
    """

    label: str
    std: FloatArray
    identified: FloatArray | None


def accuracy_maps(
    mach_number: FloatArray, incidence_deg: FloatArray, navigation: Sequence[str], maps: Sequence[AccuracyMap]
) -> ValuedFigure:
    """Draw a row of maps for each navigation, quantities in blocks; hatched where a quantity is not identified.

    The text of a flight state lists all quantities, at its cell in each map.

    Parameters
    ----------
    mach_number, incidence_deg : (m,) [1], (i,) [deg].
    """
    blocks = [maps[k : k + COLUMNS] for k in range(0, len(maps), COLUMNS)]
    shown = ValuedFigure(blank_figure(2.7 * min(COLUMNS, len(maps)), 3.0 * len(navigation) * len(blocks)))
    panels: list[list[Any]] = [[] for _ in navigation]
    parts = shown.figure.subfigures(len(blocks), 1, squeeze=False)[:, 0]
    for part, block in zip(parts, blocks, strict=True):
        axes = part.subplots(len(navigation), len(block), sharex=True, sharey=True, squeeze=False)
        for number, accuracy in enumerate(block):
            _draw_column(part, axes[:, number], mach_number, incidence_deg, accuracy)
        for row, known in enumerate(navigation):
            axes[row, 0].set_ylabel(f"{with_signs(known)}\ntotal incidence [deg]", fontsize=9)
            panels[row] += axes[row].tolist()
    width, height = mach_number[1] - mach_number[0], incidence_deg[1] - incidence_deg[0]
    for row, known in enumerate(navigation):
        for (i, incidence), (m, mach) in product(
            enumerate(incidence_deg.tolist()), enumerate(mach_number.tolist())
        ):
            lines = [f"M {digits(mach)}, incidence {digits(incidence)} deg, given {known}"]
            lines += [_sigma_text(accuracy, row, i, m) for accuracy in maps]
            areas = (cell(panel, mach, incidence, width, height) for panel in panels[row])
            shown.annotate(*areas, text="\n".join(lines))
    return shown


def _draw_column(
    part: SubFigure,
    panels: Sequence[Any],
    mach_number: FloatArray,
    incidence_deg: FloatArray,
    accuracy: AccuracyMap,
) -> None:
    """Draw one quantity, a panel for each navigation, with one scale of colours."""
    from matplotlib.ticker import MaxNLocator

    finite = accuracy.std[np.isfinite(accuracy.std)]
    for row, panel in enumerate(panels):
        image = panel.pcolormesh(
            mach_number,
            incidence_deg,
            accuracy.std[row],
            cmap=COLOUR_MAP,
            shading="nearest",
            vmin=0.0,
            vmax=float(finite.max(initial=0.0)) or 1.0,
            rasterized=True,
        )
        _hatch(panel, mach_number, incidence_deg, accuracy, row)
        panel.tick_params(labelsize=8)
    panels[0].set_title(with_signs(accuracy.label), fontsize=9)
    panels[-1].set_xlabel("Mach number [1]", fontsize=9)
    bar = part.colorbar(image, ax=panels, location="bottom", pad=0.02)
    bar.locator = MaxNLocator(4)
    bar.update_ticks()
    bar.ax.tick_params(labelsize=8)
    bar.set_label(f"$\\sigma$ of {with_signs(accuracy.label)}", fontsize=8)


def _hatch(
    panel: Any, mach_number: FloatArray, incidence_deg: FloatArray, accuracy: AccuracyMap, row: int
) -> None:
    from matplotlib.patches import Rectangle

    if accuracy.identified is None:
        return
    width, height = mach_number[1] - mach_number[0], incidence_deg[1] - incidence_deg[0]
    for i, m in np.argwhere(accuracy.identified[row] < HALF).tolist():
        corner = mach_number[m] - 0.5 * width, incidence_deg[i] - 0.5 * height
        panel.add_patch(Rectangle(corner, width, height, fill=False, hatch="////", linewidth=0.0))


def _sigma_text(accuracy: AccuracyMap, row: int, i: int, m: int) -> str:
    """Return a standard deviation, and where some roll angles do not identify the quantity, how many do."""
    text = f"sigma of {accuracy.label} {digits(accuracy.std[row, i, m])}"
    if accuracy.identified is None or accuracy.identified[row, i, m] == 1.0:
        return text
    return f"{text}, identified at {100.0 * accuracy.identified[row, i, m]:.0f} % of the roll angles"
