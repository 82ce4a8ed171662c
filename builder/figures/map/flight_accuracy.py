"""What the nonlinear estimator knows over the envelope, as maps over Mach number and total incidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import COLOUR_MAP, blank_figure
from builder.figures.drawing.hover import COLOUR_SCALE, HoverFigure, axis, choice, hover_figure, numbers
from builder.figures.drawing.words import with_signs
from strainfmu.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    on_page : whether the still shows it, too.
    """

    label: str
    std: FloatArray
    identified: FloatArray | None
    on_page: bool


def accuracy_maps(
    mach_number: FloatArray, incidence_deg: FloatArray, navigation: Sequence[str], maps: Sequence[AccuracyMap]
) -> Figure:
    """Draw a row of maps for each navigation; hatched where a quantity is not identified.

    Parameters
    ----------
    mach_number, incidence_deg : (m,) [1], (i,) [deg].
    """
    from matplotlib.ticker import MaxNLocator

    shown = [one for one in maps if one.on_page]
    figure = blank_figure(2.7 * len(shown), 2.6 * len(navigation))
    axes = figure.subplots(len(navigation), len(shown), sharex=True, sharey=True, squeeze=False)
    for column, one in enumerate(shown):
        finite = one.std[np.isfinite(one.std)]
        for row, known in enumerate(navigation):
            panel = axes[row, column]
            drawn = panel.pcolormesh(
                mach_number,
                incidence_deg,
                one.std[row],
                cmap=COLOUR_MAP,
                shading="nearest",
                vmin=0.0,
                vmax=float(finite.max(initial=0.0)) or 1.0,
            )
            _hatch(panel, mach_number, incidence_deg, one, row)
            if row == 0:
                panel.set_title(with_signs(one.label), fontsize=9)
            if column == 0:
                panel.set_ylabel(f"{with_signs(known)}\ntotal incidence [deg]", fontsize=9)
            if row == len(navigation) - 1:
                panel.set_xlabel("Mach number [1]", fontsize=9)
            panel.tick_params(labelsize=8)
        bar = figure.colorbar(drawn, ax=axes[:, column], location="bottom", pad=0.02)
        bar.locator = MaxNLocator(4)
        bar.update_ticks()
        bar.ax.tick_params(labelsize=8)
        bar.set_label(f"$\\sigma$ of {with_signs(one.label)}", fontsize=8)
    return figure


def _hatch(panel: Any, mach_number: FloatArray, incidence_deg: FloatArray, one: AccuracyMap, row: int) -> None:
    from matplotlib.patches import Rectangle

    if one.identified is None:
        return
    width, height = mach_number[1] - mach_number[0], incidence_deg[1] - incidence_deg[0]
    for i, m in np.argwhere(one.identified[row] < HALF).tolist():
        corner = mach_number[m] - 0.5 * width, incidence_deg[i] - 0.5 * height
        panel.add_patch(Rectangle(corner, width, height, fill=False, hatch="////", linewidth=0.0))


def hover_accuracy_maps(
    mach_number: FloatArray, incidence_deg: FloatArray, navigation: Sequence[str], maps: Sequence[AccuracyMap]
) -> HoverFigure:
    """Return one map at a time, chosen by quantity and navigation; arguments as of :func:`accuracy_maps`."""
    chosen = [(f"{one.label}, {known}", one, row) for one in maps for row, known in enumerate(navigation)]
    traces = [
        {
            "type": "heatmap",
            "x": numbers(mach_number),
            "y": numbers(incidence_deg),
            "z": numbers(one.std[row]),
            "customdata": _identified(one, row),
            "colorscale": COLOUR_SCALE,
            "colorbar": {"title": {"text": f"sigma: {one.label}", "side": "right"}},
            "hovertemplate": "M %{x}, incidence %{y} deg<br>sigma %{z}%{customdata}<extra></extra>",
            "visible": number == 0,
        }
        for number, (_, one, row) in enumerate(chosen)
    ]
    shown = [{"visible": [k == number for k in range(len(chosen))]} for number in range(len(chosen))]
    return hover_figure(
        traces,
        430,
        xaxis=axis("Mach number [1]"),
        yaxis=axis("total incidence [deg]"),
        margin={"l": 60, "r": 20, "t": 60, "b": 50},
        updatemenus=[choice([label for label, _, _ in chosen], shown)],
    )


def _identified(one: AccuracyMap, row: int) -> list[list[str]]:
    """Return what the pointer says beside each deviation."""
    if one.identified is None:
        return [[""] * one.std.shape[2]] * one.std.shape[1]
    return [
        ["" if part == 1.0 else f"<br>identified at {100.0 * part:.0f} % of the roll angles" for part in parts]
        for parts in one.identified[row].tolist()
    ]
