"""Accuracy against the number of gauges: the placement, the layout in use, QR and evenly spread rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import blank_figure
from builder.placement.curves import NOISES, Curves
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("tab:cyan", "tab:blue", "tab:purple")


def placement_figure(curves: Curves, title: str) -> Figure:
    """Draw sigma of each coefficient, relative to the layout in use, against the number of gauges."""
    figure = blank_figure(13.0, 3.9)
    axes = figure.subplots(1, len(COEFFICIENT_NAMES), sharey=True)
    for number, (axis, name) in enumerate(zip(axes, COEFFICIENT_NAMES, strict=True)):
        _one(axis, curves, number)
        axis.set_title(f"${name}$", fontsize=10)
        axis.set_xlabel("number of gauges [1]")
    axes[0].set_ylabel("sigma relative to the layout in use [1]")
    axes[0].legend(fontsize=7)
    figure.suptitle(f"Accuracy against the number of gauges: {title}")
    return figure


def _one(axis: Any, curves: Curves, number: int) -> None:
    counts = curves.counts
    for noise, colour, placed in zip(NOISES, COLOURS, curves.placed, strict=True):
        label = "placed" if noise == 1.0 else f"placed, noise times {noise:g}"
        style = "-" if noise == 1.0 else "--"
        axis.plot(counts, placed[:, number], style, color=colour, marker="o", markersize=3, label=label)
    axis.plot(counts, curves.qr[:, number], color="tab:orange", marker="s", markersize=3, label="pivoted QR")
    axis.plot(
        counts, curves.even[:, number], color="tab:gray", marker="^", markersize=3, label="evenly spread rows"
    )
    axis.plot([curves.own_count], [1.0], "*", color="black", markersize=9, label=curves.own_name)
    axis.set_xscale("log")
    axis.set_xticks(counts, [str(one) for one in counts], fontsize=7)
    axis.minorticks_off()
    axis.set_ylim(0.0, max(1.8, 1.1 * float(np.nanmax(curves.placed[:, 0]))))
    axis.grid(alpha=0.3)
