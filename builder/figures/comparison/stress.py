"""Figure of the stress test: per kind of error the samples that are right, detected and undetected."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import blank_figure
from builder.figures.drawing.words import with_signs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLES = {
    "within": "Within envelope and twice the stated sizes: sigma must hold it",
    "outside": "Beyond: health must show it, or the estimate be right",
    "unobservable": "Unobservable: another flight has the same strain",
}
COLOURS = {"right, health OK": "#9ecae1", "detected": "#bdbdbd", "undetected: wrong, health OK": "#d7301f"}
ROW = 0.21
"""Height of a row [in]."""


def by_class(entries: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Return the entries of ``stress.json`` by class, the most undetected and detected ones first."""

    def rank(entry: dict[str, Any]) -> tuple[float, float]:
        return -round(entry["undetected_percent"], 1), -round(entry["detected_percent"])

    groups = {name: sorted((one for one in entries if one["class"] == name), key=rank) for name in TITLES}
    return {name: found for name, found in groups.items() if found}


def stress_figure(entries: Sequence[dict[str, Any]], title: str) -> Figure:
    """Draw the entries of ``stress.json`` as bars, class by class."""
    groups = by_class(entries)
    sizes = [len(found) for found in groups.values()]
    figure = blank_figure(10.0, 1.6 + ROW * (sum(sizes) + 3 * len(sizes)))
    panels = figure.subplots(len(groups), 1, sharex=True, squeeze=False, height_ratios=[n + 1 for n in sizes])[
        :, 0
    ]
    for axis, (name, found) in zip(panels, groups.items(), strict=True):
        place = np.arange(len(found))
        flagged = np.array([one["detected_percent"] for one in found])
        silent = np.array([one["undetected_percent"] for one in found])
        start = np.zeros(len(found))
        parts = zip(COLOURS.items(), (100.0 - flagged - silent, flagged, silent), strict=True)
        for (label, colour), share in parts:
            axis.barh(place, share, left=start, color=colour, label=label, height=0.8)
            start = start + share
        for y, one in enumerate(found):
            text = f"{one['undetected_percent']:.1f}{'  target missed' if one['missed'] else ''}"
            axis.text(101.0, y, text, va="center", fontsize=7, clip_on=False)
        axis.set_yticks(place, [with_signs(f"{one['error']}, {one['size']}") for one in found], fontsize=7)
        axis.set_ylim(len(found) - 0.5, -0.5)
        axis.set_xlim(0.0, 100.0)
        axis.set_title(TITLES[name], fontsize=9, loc="left")
    panels[-1].set_xlabel("samples [%]; right of the bars the undetected ones")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    figure.suptitle(f"What the map notices: {title}")
    return figure
