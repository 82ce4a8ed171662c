"""Figure of a trade study: small multiples of the error of each coefficient over one entry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import blank_figure
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
