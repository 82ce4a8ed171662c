"""Accuracy of a placement and of other layouts: against gauges, noise, position and flush ports."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing import blank_figure
from builder.placement.curves import EVEN, PLACED, QR, Curves, Sweep
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLES = {
    PLACED: {"color": "tab:blue", "marker": "o"},
    QR: {"color": "tab:orange", "marker": "s"},
    EVEN: {"color": "tab:gray", "marker": "^"},
}
IN_USE = {"color": "black", "marker": "*"}


def placement_figure(curves: Curves, title: str) -> Figure:
    """Draw sigma of each coefficient, relative to the layout in use: a row for each quantity that is changed."""
    n_rows = 1 + len(curves.sweeps)
    figure = blank_figure(13.0, 1.0 + 2.6 * n_rows)
    axes = figure.subplots(n_rows, len(COEFFICIENT_NAMES), sharey="row", squeeze=False)
    for number, name in enumerate(COEFFICIENT_NAMES):
        _counts(axes[0, number], curves, number)
        axes[0, number].set_title(f"${name}$", fontsize=10)
        for axis, sweep in zip(axes[1:, number], curves.sweeps, strict=True):
            _sweep(axis, sweep, number)
    for row in axes:
        row[0].set_ylabel("sigma / layout in use [1]", fontsize=8)
        row[0].legend(fontsize=6)
    figure.suptitle(f"Sigma of the coefficients: {title}")
    return figure


def _counts(axis: Any, curves: Curves, number: int) -> None:
    for name, sigma in ((PLACED, curves.placed), (QR, curves.qr), (EVEN, curves.even)):
        axis.plot(curves.counts, sigma[:, number], markersize=3, label=name, **STYLES[name])
    axis.plot(curves.counts, curves.lost[:, number], ":", color="tab:blue", label="placed, worst loss of one")
    axis.plot([curves.own_count], [1.0], "*", color="black", markersize=9, label=curves.own_name)
    axis.set_xscale("log")
    axis.set_xticks(curves.counts, [str(count) for count in curves.counts], fontsize=7)
    axis.minorticks_off()
    axis.set_xlabel("gauges [1]", fontsize=8)
    axis.set_ylim(*_limits((curves.placed, curves.lost)))
    axis.grid(alpha=0.3)


def _sweep(axis: Any, sweep: Sweep, number: int) -> None:
    for name, sigma in sweep.sigmas.items():
        axis.plot(sweep.values, sigma[:, number], markersize=4, label=name, **STYLES.get(name, IN_USE))
    axis.set_xticks(sweep.values, [f"{value:g}" for value in sweep.values], fontsize=7)
    axis.set_xlabel(sweep.label, fontsize=8)
    axis.set_ylim(*_limits(tuple(sweep.sigmas.values())))
    axis.grid(alpha=0.3)


def _limits(sigmas: tuple[FloatArray, ...]) -> tuple[float, float]:
    """Return the range of an axis that all of ``sigmas`` and the layout in use, 1, are in."""
    low, high = (float(limit([limit(sigma) for sigma in sigmas])) for limit in (np.nanmin, np.nanmax))
    low, high = min(low, 1.0), max(high, 1.0)
    return low - 0.08 * (high - low), high + 0.08 * (high - low)
