"""The source's figures of Case 1, one panel per set-up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.pressure import blank_figure
from builder.reproduce.case_2 import COEFFICIENTS
from builder.reproduce.protocol import EXAMPLES
from builder.reproduce.published import PUBLISHED
from builder.reproduce.setups import TITLES
from builder.reproduce.studies import Studies
from builder.reproduce.views import SIDES, field_figure, pressure_rows
from builder.vehicle.geometry import SurfaceGrid

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BOX = {"showfliers": False, "whis": (0.5, 99.5), "widths": 0.3, "patch_artist": True}
"""Whiskers hold 99 % of the samples."""
COLOURS = {1: "tab:orange", 2: "tab:blue"}


def pod_differences(studies: Studies) -> Figure:
    """Draw the normalised differences of the POD coefficients with 3 sigma marks."""
    figure = blank_figure(11.0, 4.4)
    axes = figure.subplots(1, len(TITLES), sharey=True)
    for axis, (key, title) in zip(axes, TITLES.items(), strict=True):
        for number in (1, 2):
            study = studies.case_1[f"{key}-{number}"]
            place = np.arange(1, study.pod_error.shape[1] + 1) + (0.2 if number == 2 else -0.2)
            _boxes(axis, 100.0 * study.pod_error, place, number)
            for sign, marker in ((1.0, "v"), (-1.0, "^")):
                axis.plot(place, 100.0 * sign * study.pod_bound, marker, color="black", markersize=4)
        _finish(axis, title, [f"$q_{i}$" for i in range(1, 6)])
    axes[0].set_ylabel("normalised difference [% of the range]")
    axes[0].legend(handles=_handles(), fontsize=7, loc="upper left")
    figure.suptitle(
        "Estimated POD coefficients; triangles: 3 sigma of the noise alone; whiskers: 99 % of the samples"
    )
    return figure


def reconstruction_errors(studies: Studies) -> Figure:
    """Draw the relative errors of the reconstructed fields, with the published medians."""
    figure = blank_figure(9.0, 4.2)
    axes = figure.subplots(1, len(TITLES), sharey=True)
    for axis, (key, title) in zip(axes, TITLES.items(), strict=True):
        for number in (1, 2):
            study = studies.case_1[f"{key}-{number}"]
            _boxes(axis, 100.0 * study.field_error[:, None], np.array([float(number)]), number)
            published = PUBLISHED[f"field_{number}"].low
            axis.plot([number - 0.35, number + 0.35], [published, published], "--", color="tab:red")
        _finish(axis, title, ["Configuration 1", "Configuration 2"])
    axes[0].set_ylabel("relative error of the field [%]")
    figure.suptitle("Reconstructed pressure; dashed: published medians; whiskers: 99 % of the samples")
    return figure


def coefficient_differences(studies: Studies) -> Figure:
    """Draw the normalised differences of the force and moment coefficients, Configuration 2."""
    figure = blank_figure(11.0, 4.2)
    axes = figure.subplots(1, len(TITLES), sharey=True)
    for axis, (key, title) in zip(axes, TITLES.items(), strict=True):
        study = studies.case_1[f"{key}-2"]
        _boxes(axis, 100.0 * study.coefficient_error, np.arange(1.0, 6.0), 2)
        _finish(axis, title, [f"${name[0]}_{name[2]}$" for name in COEFFICIENTS])
    axes[0].set_ylabel("normalised difference [%]")
    figure.suptitle(
        "Force and moment coefficients (p - p_internal), Configuration 2; whiskers: 99 % of the samples"
    )
    return figure


def field_comparison(studies: Studies, setup: str, example: str, number: int, grid: SurfaceGrid) -> Figure:
    """Draw reference, estimate of median error and absolute error of one example from both sides."""
    found = studies.examples[f"{setup}-{example}"]
    rows = pressure_rows(
        {"reference": found.reference, "estimate": found.estimate}, found.estimate - found.reference
    )
    title = f"{EXAMPLES[example]}, Configuration {number}, {TITLES[setup]}: error {100.0 * found.shown:.1f} %"
    return field_figure(rows, grid, dict(SIDES), title)


def _boxes(axis: Any, values: Any, place: Any, number: int) -> None:
    drawn = axis.boxplot(values, positions=place, medianprops={"color": "black"}, **BOX)
    for box in drawn["boxes"]:
        box.set(facecolor=COLOURS[number], alpha=0.7)


def _finish(axis: Any, title: str, names: list[str]) -> None:
    axis.set_xticks(np.arange(1, len(names) + 1), names, fontsize=8)
    axis.set_title(title, fontsize=8)
    axis.axhline(0.0, color="grey", linewidth=0.5)
    axis.grid(alpha=0.3, axis="y")


def _handles() -> list[Any]:
    from matplotlib.patches import Patch

    return [Patch(facecolor=colour, alpha=0.7, label=f"Configuration {n}") for n, colour in COLOURS.items()]
