"""Figure of a trade study: small multiples of the error of each coefficient over one entry.

Figure of a trial: per case what the samples are, with statistical errors, and the error of each load over
sigma.

Errors of two estimators over one flight, with their bands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing import blank_figure, estimator_in_words, with_signs
from builder.trial.run import FILTER
from builder.trial.score import LIMITS, MISSED, NONE, OK
from builder.trial.table import TITLES, in_order, loads_of
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = ("tab:blue", "tab:orange")


def estimator_errors(
    time: FloatArray,
    errors: Mapping[str, tuple[FloatArray, FloatArray]],
    angles: tuple[FloatArray, FloatArray] | None,
    title: str,
) -> Figure:
    """Draw the errors of each coefficient over ``time`` (n,) [s] with bands of 3 sigma, estimator by estimator.

    Parameters
    ----------
    errors : by estimator, errors (n, 5) and standard deviations (n, 5) of the coefficients [1].
    angles : errors (n, 2) and standard deviations (n, 2) of angle of attack and sideslip [rad]; None for none.
    """
    rows = len(COEFFICIENT_NAMES) + (angles is not None)
    figure = blank_figure(10.0, 1.9 * rows)
    axes = figure.subplots(rows, 1, sharex=True)
    for i, (axis, name) in enumerate(zip(axes, COEFFICIENT_NAMES, strict=False)):
        for color, (label, (error, std)) in zip(COLORS, errors.items(), strict=False):
            _band(axis, time, error=error[:, i], std=std[:, i], color=color, label=estimator_in_words(label))
        axis.set_title(f"Error of {with_signs(name)} [1]", fontsize=9, loc="left")
    axes[0].legend(ncols=4, fontsize=8, loc="upper right")
    if angles is not None:
        for color, label, i in (("tab:orange", "angle of attack", 0), ("tab:green", "sideslip", 1)):
            error, std = (np.degrees(part[:, i]) for part in angles)
            _band(axes[-1], time, error=error, std=std, color=color, label=label)
        axes[-1].set_title("Error of the angles by the nonlinear estimator [deg]", fontsize=9, loc="left")
        axes[-1].legend(ncols=4, fontsize=8, loc="upper right")
    axes[-1].set_xlabel("time [s]")
    figure.suptitle(f"Linear and nonlinear estimator on the same strains: {title}")
    return figure


def _band(axis: Any, time: FloatArray, *, error: FloatArray, std: FloatArray, color: str, label: str) -> None:
    axis.fill_between(
        time, -3.0 * std, 3.0 * std, color=color, alpha=0.15, linewidth=0, label=f"{label} $3\\sigma$"
    )
    axis.plot(time, error, color=color, linewidth=0.6, label=label)
    axis.grid(alpha=0.3)


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
            bars.text(101.0, y, text, va="center", fontsize=7, clip_on=False, color=_colour(row))
        labels = [row["case"] + (f" ({row['estimator']})" if several else "") for row in group]
        bars.set_yticks(place, [with_signs(label) for label in labels], fontsize=7)
        for label, row in zip(bars.get_yticklabels(), group, strict=True):
            label.set_color(_colour(row))
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
        if name == "alone":
            sigmas.set_title("sigma includes errors that are not drawn here", fontsize=8, loc="left")
        for axis in (bars, sigmas, *errors):
            axis.set_ylim(len(group) - 0.5, -0.5)
    for axis, label in zip(panels[-1], LABELS, strict=False):
        axis.set_xlabel(label)
    of_bars, of_loads = (panels[0, column].get_legend_handles_labels() for column in (0, 1))
    figure.legend(*of_bars, loc="outside lower left", ncols=5, fontsize=8)
    figure.legend(*of_loads, loc="outside lower right", ncols=7, fontsize=8)
    figure.suptitle(f"What the map notices: {title}")
    return figure


def _colour(row: Mapping[str, Any]) -> str:
    """Return the colour of the words on a case: red where it is missed."""
    return "#d7301f" if row["verdict"] == MISSED else "k"


MOST_LINES = 10
"""Lines that have a colour of their own; a study with more shows the table's first."""


def along(rows: Sequence[dict[str, Any]], entries: Sequence[str]) -> str:
    """Return the entry that the figure runs along: the numeric one with the most values, the first of such."""
    counts = {
        name: len({row[name] for row in rows})
        for name in entries
        if all(isinstance(row[name], int | float) and not isinstance(row[name], bool) for row in rows)
    }
    return max(counts, key=lambda name: counts[name]) if counts else entries[0]


def trade_study_figure(rows: Sequence[dict[str, Any]], entries: Sequence[str]) -> Figure:
    """Draw rms error and mean standard deviation of each coefficient; a line for each choice of other entries.

    ``rows`` are of each design and load.
    """
    over = along(rows, entries)
    varied = [name for name in entries if name != over and len({str(row[name]) for row in rows}) > 1]
    lines: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        label = ", ".join(f"{name.rpartition('.')[2]} {row[name]}" for name in varied)
        lines.setdefault(label, []).append(row)
    shown = dict(list(lines.items())[:MOST_LINES])
    figure = blank_figure(11.0, 3.6 if len(shown) < 5 else 4.4)
    panels = figure.subplots(1, len(COEFFICIENT_NAMES))
    is_number = all(isinstance(row[over], int | float) for row in rows)
    words = list(dict.fromkeys(str(row[over]) for row in rows))
    for axis, name in zip(panels, COEFFICIENT_NAMES, strict=True):
        for number, (label, rows_shown) in enumerate(shown.items()):
            of_load = [row for row in rows_shown if row["load"] == name]
            x = [row[over] if is_number else words.index(str(row[over])) for row in of_load]
            order = np.argsort(x)
            colour = f"C{number}"
            for quantity, style in (("rms", "-o"), ("sigma", "--")):
                y = [row[quantity] for row in of_load]
                text = label if quantity == "rms" else None
                axis.plot(np.array(x)[order], np.array(y)[order], style, color=colour, label=text, markersize=3.0)
        if not is_number:
            axis.set_xticks(range(len(words)), words)
        axis.set_ylim(bottom=0.0)
        axis.set_title(name, fontsize=9)
        axis.tick_params(labelsize=7)
        axis.set_xlabel(over.rpartition(".")[2], fontsize=7)
    panels[0].set_ylabel("rms error (line), mean 1 sigma (dashed) [1]", fontsize=8)
    if len(shown) > 1:
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(shown), 4), fontsize=7)
    more = f"; {len(lines) - len(shown)} more in the table" if len(lines) > len(shown) else ""
    figure.suptitle(f"Trade study over {over}{more}", fontsize=10)
    return figure
