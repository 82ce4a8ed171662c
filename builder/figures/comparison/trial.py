"""Figure of a trial: per case what the samples are, with statistical errors, and the error of each load over
sigma."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import blank_figure
from builder.figures.drawing.words import with_signs
from builder.trial.run import FILTER
from builder.trial.score import LIMITS, MISSED, NONE, OK
from builder.trial.table import TITLES, in_order, loads_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTS = {
    "right_ok": ("right, not flagged", "#9ecae1"),
    "right_flagged": ("right, flagged", "#fdae6b"),
    "wrong_flagged": ("wrong, flagged", "#bdbdbd"),
    "undetected": ("undetected: wrong, not flagged", "#d7301f"),
    "no_estimate": ("no estimate", "#f0f0f0"),
}
"""Label and colour of each part of the samples."""

LABELS = (
    "samples [%]; right of the bars the undetected ones",
    "rms error over stated sigma",
    "rms error [1]",
)
"""Of the panels."""

ROW = 0.22
"""Height of a row [in]."""


def trial_figure(rows: Sequence[Mapping[str, Any]], title: str) -> Figure:
    """Draw the rows of a trial class by class: bars of the samples' parts, and next to them rms z of each load."""
    table = [dict(row) for row in rows]
    groups = in_order(table)
    loads = {key: {row["load"]: row for row in rows} for key, rows in loads_of(table).items()}
    several = len({row["estimator"] for row in table} - {FILTER}) > 1
    sizes = [len(group) for group in groups.values()]
    figure = blank_figure(13.0, 1.8 + ROW * (sum(sizes) + 3 * len(sizes)))
    widths = [3, 2, 2] if several else [3, 2]
    panels = figure.subplots(
        len(groups),
        len(widths),
        sharex="col",
        squeeze=False,
        width_ratios=widths,
        height_ratios=[n + 1 for n in sizes],
    )
    names = list(dict.fromkeys(name for of_case in loads.values() for name in of_case))
    for (bars, sigmas, *errors), (name, group) in zip(panels, groups.items(), strict=True):
        place = np.arange(len(group))
        start = np.zeros(len(group))
        for part, (label, colour) in PARTS.items():
            share = np.array([row[f"{part}_percent"] for row in group])
            bars.barh(place, share, left=start, color=colour, label=label, height=0.8)
            start = start + share
            if part == "undetected":
                error = [row["undetected_percent_error"] for row in group]
                shown = share > 0.0
                bars.errorbar(
                    start[shown], place[shown], xerr=np.array(error)[shown], fmt="none", ecolor="k", lw=0.8
                )
        for y, row in enumerate(group):
            percent = f"{row['undetected_percent']:.1f}"
            text = (
                f"{percent if percent != '0.0' else ''} {'' if row['verdict'] in (OK, NONE) else row['verdict']}"
            )
            colour = "#d7301f" if row["verdict"] == MISSED else "k"
            bars.text(101.0, y, text, va="center", fontsize=7, clip_on=False, color=colour)
        labels = [row["case"] + (f" ({row['estimator']})" if several else "") for row in group]
        bars.set_yticks(place, [with_signs(label) for label in labels], fontsize=7)
        bars.set_xlim(0.0, 100.0)
        bars.set_title(TITLES[name], fontsize=9, loc="left")
        of_group = [loads[row["case"], row["estimator"]] for row in group]
        for number, load in enumerate(names):
            for axis, column in zip((sigmas, *errors), ("rms_z", "rms"), strict=False):
                value = [of_case[load][column] if load in of_case else np.nan for of_case in of_group]
                axis.plot(value, place, "o", ms=3.0, color=f"C{number}", label=load)
        for axis in (sigmas, *errors):
            axis.set_yticks([])
            axis.set_xscale("log")
        sigmas.axvline(1.0, color="k", lw=0.5)
        for limit in (entry for entry in LIMITS[name] if entry.column == "rms_z"):
            sigmas.axvspan(limit.low, limit.high, color="#c7e9c0", alpha=0.5)
            sigmas.set_title("sigma too wide", fontsize=8, loc="left")
            sigmas.set_title("too narrow", fontsize=8, loc="right")
        for axis in (bars, sigmas, *errors):
            axis.set_ylim(len(group) - 0.5, -0.5)
    for axis, label in zip(panels[-1], LABELS, strict=False):
        axis.set_xlabel(label)
    of_bars, of_loads = (panels[0, column].get_legend_handles_labels() for column in (0, 1))
    figure.legend(*of_bars, loc="outside lower left", ncols=5, fontsize=8)
    figure.legend(*of_loads, loc="outside lower right", ncols=7, fontsize=8)
    figure.suptitle(f"What the map notices: {title}")
    return figure
