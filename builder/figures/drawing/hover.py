"""Figures that show their values under the pointer, as data of plotly.js: JSON alone, no package draws them.

A figure is ``{"data": [traces], "layout": {..}}`` as https://plotly.com/javascript/reference describes it. plotly
reads tags in texts: names that a user gave are escaped.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

HoverFigure = dict[str, Any]

DIGITS = 4
"""Significant digits of the numbers of a figure."""

BLUE, ORANGE, GREY, RED = "#1f77b4", "#ff7f0e", "#999999", "#d62728"
COLOUR_SCALE = "Viridis"


def numbers(values: ArrayLike) -> Any:
    """Return values of any shape as nested lists of rounded numbers; None where one is not finite."""
    array = np.asarray(values, dtype=float)
    if array.ndim == 0:
        return float(f"{array:.{DIGITS}g}") if np.isfinite(array) else None
    return [numbers(one) for one in array]


def words(names: Sequence[str]) -> list[str]:
    """Return names as plain text for plotly."""
    return [escape(name, quote=False) for name in names]


def axis(title: str, **options: Any) -> dict[str, Any]:
    """Return an axis with its title."""
    return {"title": {"text": title}, "automargin": True, "gridcolor": "#dddddd", "zeroline": False, **options}


def hover_figure(traces: list[dict[str, Any]], height: int, **layout: Any) -> HoverFigure:
    """Return a figure of ``height`` [px], as wide as the page."""
    common = {
        "height": height,
        "margin": {"l": 60, "r": 20, "t": 30, "b": 50},
        "font": {"size": 12},
        "plot_bgcolor": "#ffffff",
        "legend": {"orientation": "h", "x": 0.0, "y": 1.0, "yanchor": "bottom"},
        "hoverlabel": {"align": "left"},
    }
    return {"data": traces, "layout": {**common, **layout}}


def choice(labels: Sequence[str], changes: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return a list to choose what a figure shows; ``changes`` are arguments of plotly's ``restyle``."""
    options = [
        {"label": label, "method": "restyle", "args": [change]}
        for label, change in zip(labels, changes, strict=True)
    ]
    # Above the axes, at the left.
    place = {"x": 0.0, "xanchor": "left", "y": 1.03, "yanchor": "bottom"}
    return {"buttons": options, "showactive": True, **place}
