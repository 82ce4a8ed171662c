"""Check of the figures of the gallery: every point is inside its axes, every state of health is that of the data.

A fault ends the build of the site, as an example that fails does.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from sphinx_gallery.scrapers import matplotlib_scraper

from strainfmu.estimator.health import HealthState

_STATE = re.compile(rf"\b({'|'.join(state.name for state in HealthState)})\b")


class GalleryFault(Exception):
    """A figure that misleads its reader."""


def checked_figures(block: Any, block_vars: dict[str, Any], gallery_conf: Any) -> str:
    """Return what sphinx-gallery shows of the figures of a block, once they are checked.

    Raises
    ------
    GalleryFault
        A figure hides data, or names another state of health than its results have.
    """
    for number in plt.get_fignums():
        found = list(figure_faults(plt.figure(number), block_vars["example_globals"]))
        if found:
            raise GalleryFault(f"{block_vars['src_file']}: figure {number}: {'; '.join(found)}")
    return str(matplotlib_scraper(block, block_vars, gallery_conf))


def figure_faults(figure: Figure, results: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is wrong with ``figure`` of an example whose variables are ``results``, in words."""
    figure.canvas.draw()
    for number, axis in enumerate(figure.axes, start=1):
        hidden = points_outside(axis)
        if hidden:
            yield f"axes {number}: {hidden} points of its lines are outside"
    named = {name for text in figure.findobj(Text) for name in _STATE.findall(text.get_text())}
    met = states_met(results)
    if named and named != met:
        yield f"health is {', '.join(sorted(met))}, the figure says {', '.join(sorted(named))}"


def points_outside(axis: Axes) -> int:
    """Return how many points of lines in units of the data are outside the limits of ``axis``."""
    count = 0
    for line in axis.get_lines():
        if line.get_transform() != axis.transData or not line.get_visible():
            continue
        x, y = np.ma.filled(np.ma.asarray(line.get_xydata(), dtype=float), np.nan).T
        outside = np.zeros(len(x), dtype=bool)
        for values, limits in ((x, axis.get_xlim()), (y, axis.get_ylim())):
            low, high = sorted(limits)
            slack = 1e-9 * (high - low)
            outside |= (values < low - slack) | (values > high + slack)
        count += int(np.sum(outside & np.isfinite(x) & np.isfinite(y)))
    return count


def states_met(results: Mapping[str, Any]) -> set[str]:
    """Return the names of the states of health in the results of FMUs among ``results``."""
    tables = [one for one in results.values() if isinstance(one, np.ndarray) and one.dtype.names]
    columns = [one["health.state"] for one in tables if "health.state" in (one.dtype.names or ())]
    return {HealthState(int(value)).name for column in columns for value in np.unique(column)}
