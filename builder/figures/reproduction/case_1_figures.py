"""The source's figures of Case 1, one panel per set-up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from builder.figures.drawing.canvas import blank_figure
from builder.figures.reproduction.field_views import SIDES, field_figure, pressure_rows
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BOX = {"showfliers": False, "whis": (0.5, 99.5), "widths": 0.3, "patch_artist": True}
"""Whiskers hold 99 % of the samples."""
COLOURS = {1: "tab:orange", 2: "tab:blue"}


class PodDifferences(NamedTuple):
    """Normalised differences of POD coefficients: (n, r) of every sample, (r,) 3 sigma of the noise alone [1]."""

    error: FloatArray
    bound: FloatArray


def pod_differences(panels: Mapping[str, Mapping[int, PodDifferences]]) -> Figure:
    """Draw the normalised differences of the POD coefficients with 3 sigma marks.

    ``panels`` holds them by title of the set-up and number of the configuration.
    """
    figure = blank_figure(11.0, 4.4)
    axes = figure.subplots(1, len(panels), sharey=True)
    for axis, (title, configurations) in zip(axes, panels.items(), strict=True):
        for number, (error, bound) in configurations.items():
            column = np.arange(1, error.shape[1] + 1) + (0.2 if number == 2 else -0.2)
            _boxes(axis, 100.0 * error, column, number)
            for sign, marker in ((1.0, "v"), (-1.0, "^")):
                axis.plot(column, 100.0 * sign * bound, marker, color="black", markersize=4)
        _finish(axis, title, [f"$q_{i}$" for i in range(1, 6)])
    axes[0].set_ylabel("normalised difference [% of the range]")
    axes[0].legend(handles=_handles(), fontsize=7, loc="upper left")
    figure.suptitle(
        "Estimated POD coefficients; triangles: 3 sigma of the noise alone; whiskers: 99 % of the samples"
    )
    return figure


def reconstruction_errors(
    panels: Mapping[str, Mapping[int, FloatArray]], published: Mapping[int, float | None]
) -> Figure:
    """Draw the relative errors of the reconstructed fields, with the published medians.

    Parameters
    ----------
    panels : (n,) errors of the samples [1] by title of the set-up and number of the configuration.
    published : median by number of the configuration [%].
    """
    figure = blank_figure(9.0, 4.2)
    axes = figure.subplots(1, len(panels), sharey=True)
    for axis, (title, configurations) in zip(axes, panels.items(), strict=True):
        for number, error in configurations.items():
            _boxes(axis, 100.0 * error[:, None], np.array([float(number)]), number)
            median = published[number]
            axis.plot([number - 0.35, number + 0.35], [median, median], "--", color="tab:red")
        _finish(axis, title, ["Configuration 1", "Configuration 2"])
    axes[0].set_ylabel("relative error of the field [%]")
    figure.suptitle("Reconstructed pressure; dashed: published medians; whiskers: 99 % of the samples")
    return figure


def coefficient_differences(panels: Mapping[str, FloatArray]) -> Figure:
    """Draw the normalised differences (n, 5) [1] of the force and moment coefficients, by title of the set-up."""
    figure = blank_figure(11.0, 4.2)
    axes = figure.subplots(1, len(panels), sharey=True)
    for axis, (title, error) in zip(axes, panels.items(), strict=True):
        _boxes(axis, 100.0 * error, np.arange(1.0, 6.0), 2)
        _finish(axis, title, [f"${name[0]}_{name[2]}$" for name in COEFFICIENT_NAMES])
    axes[0].set_ylabel("normalised difference [%]")
    figure.suptitle(
        "Force and moment coefficients (p - p_internal), Configuration 2; whiskers: 99 % of the samples"
    )
    return figure


def field_comparison(reference: FloatArray, estimate: FloatArray, grid: SurfaceGrid, title: str) -> Figure:
    """Draw the fields (n_p,) [Pa], reference and estimate, and the absolute error from both sides."""
    rows = pressure_rows({"reference": reference, "estimate": estimate}, estimate - reference)
    return field_figure(rows, grid, dict(SIDES), title)


def _boxes(axis: Any, values: Any, column: Any, number: int) -> None:
    boxes = axis.boxplot(values, positions=column, medianprops={"color": "black"}, **BOX)
    for box in boxes["boxes"]:
        box.set(facecolor=COLOURS[number], alpha=0.7)


def _finish(axis: Any, title: str, names: list[str]) -> None:
    axis.set_xticks(np.arange(1, len(names) + 1), names, fontsize=8)
    axis.set_title(title, fontsize=8)
    axis.axhline(0.0, color="grey", linewidth=0.5)
    axis.grid(alpha=0.3, axis="y")


def _handles() -> list[Any]:
    from matplotlib.patches import Patch

    return [Patch(facecolor=colour, alpha=0.7, label=f"Configuration {n}") for n, colour in COLOURS.items()]
