"""Figure of a comparison of estimators: errors, coverage and field error, with either kind of error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import blank_figure
from builder.figures.drawing.words import estimator_in_words, with_signs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#9ecae1", "#3182bd", "#d7301f", "#756bb1", "#c7e9c0", "#74c476", "#238b45", "#fdae6b")
TITLES = {"gauge noise": "Gauge noise alone", "hardware": "Errors of the hardware drawn"}


def compare_figure(entries: Sequence[Mapping[str, Any]], title: str) -> Figure:
    """Draw entries of ``compare.json``, one per estimator and kind of error."""
    groups = {errors: [one for one in entries if one["errors"] == errors] for errors in TITLES}
    figure = blank_figure(12.0, 10.0)
    panels = figure.subplots(3, len(groups), squeeze=False)
    for column, (errors, found) in enumerate(groups.items()):
        rms, coverage, field = panels[:, column]
        _bars(rms, found, "rms")
        rms.set_yscale("log")
        least = min((value for one in found for value in one["rms"].values() if value), default=1e-6)
        rms.set_ylim(bottom=0.5 * least)
        rms.set_ylabel("rms error [1]")
        rms.set_title(TITLES[errors])
        _bars(coverage, found, "coverage_percent")
        coverage.axhline(99.0, color="k", lw=0.8, ls="--")
        coverage.set_ylim(50.0, 101.0)
        coverage.set_ylabel("truth inside $3\\sigma$ [%]")
        _distribution(field, found)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
    figure.suptitle(f"Estimators on the same readings: {title}")
    return figure


def _bars(axis: Axes, entries: Sequence[Mapping[str, Any]], key: str) -> None:
    width = 0.8 / max(len(entries), 1)
    for number, (one, colour) in enumerate(zip(entries, COLOURS, strict=False)):
        names = list(one[key])
        value = np.array([np.nan if one[key][name] is None else one[key][name] for name in names])
        at = np.arange(len(names)) + (number + 0.5) * width - 0.4
        axis.bar(at, value, width=width, color=colour, label=estimator_in_words(one["estimator"]))
        axis.set_xticks(np.arange(len(names)), [with_signs(name) for name in names])


def _distribution(axis: Axes, entries: Sequence[Mapping[str, Any]]) -> None:
    for one, colour in zip(entries, COLOURS, strict=False):
        percentiles = one["field_percentiles_percent"]
        if percentiles is not None:
            axis.plot(percentiles, np.linspace(0.0, 100.0, len(percentiles)), color=colour, lw=1.5)
    axis.set_xscale("log")
    axis.set_xlabel("error of the pressure field [% of its norm]")
    axis.set_ylabel("samples below it [%]")
    axis.grid(alpha=0.3)
