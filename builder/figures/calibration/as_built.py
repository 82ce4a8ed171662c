"""A vehicle as built in flight: errors of its map before the ground test, after it, and if all were known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from builder.figures.drawing.canvas import blank_figure
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = {"before": "tab:red", "exact": "0.45", "after": "tab:blue"}
"""In the order of drawing."""


def as_built_figure(time: FloatArray, flown: Mapping[str, tuple[FloatArray, FloatArray]], title: str) -> Figure:
    """Draw the errors of each coefficient over ``time`` (n,) [s], map by map, and their rms next to it.

    ``flown`` are errors and standard deviations (n, 5) of the coefficients [1], by the name of the map.
    """
    figure = blank_figure(11.0, 9.0)
    axes = figure.subplots(len(COEFFICIENT_NAMES), 2, sharex="col", width_ratios=[4.0, 1.0], squeeze=False)
    for i, name in enumerate(COEFFICIENT_NAMES):
        over_time, bars = axes[i]
        rms = []
        for label, color in COLORS.items():
            error, std = (part[:, i] for part in flown[label])
            rms.append(float(np.sqrt(np.nanmean(error**2))))
            if label == "after":
                over_time.fill_between(
                    time, -3.0 * std, 3.0 * std, color=color, alpha=0.15, linewidth=0, label="after $3\\sigma$"
                )
            over_time.plot(time, error, color=color, linewidth=0.4, label=label)
        over_time.set_title(f"Error of ${name}$ [1]", fontsize=9, loc="left")
        over_time.grid(alpha=0.3)
        bars.bar(list(COLORS), rms, color=list(COLORS.values()))
        bars.set_title("rms [1]", fontsize=9, loc="left")
        bars.grid(alpha=0.3, axis="y")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), ncols=4, fontsize=8, loc="outside lower center")
    axes[-1, 0].set_xlabel("time [s]")
    figure.suptitle(f"Map before the ground test, after it, and exact: {title}")
    return figure
