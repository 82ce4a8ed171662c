"""What the nonlinear estimator knows over the envelope, as maps over Mach number and total incidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import COLOUR_MAP, blank_figure
from builder.figures.drawing.values import ValuedFigure, cell, digits
from builder.figures.drawing.words import with_signs
from strainfmu.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

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
        for column, accuracy in enumerate(block):
            _draw_column(part, axes[:, column], mach_number, incidence_deg, accuracy)
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
