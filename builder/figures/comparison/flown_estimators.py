"""Errors of two estimators over one flight, with their bands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import blank_figure
from builder.figures.drawing.words import estimator_in_words, with_signs
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
