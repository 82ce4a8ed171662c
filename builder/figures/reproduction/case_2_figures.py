"""The source's figures of Case 2, and what the layout "45" changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from builder.figures.drawing.canvas import blank_figure
from builder.figures.reproduction.field_views import FRONT, SIDES, FieldRow, field_figure, pressure_rows
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Spectrum(NamedTuple):
    """Eigenvalues (k,) of one map, falling; with the published layout or with "45"."""

    label: str
    eigenvalues: FloatArray
    layout_45: bool


def eigenvalue_decay(spectra: Sequence[Spectrum], published_gamma: float) -> Figure:
    """Draw the eigenvalues of the prior-preconditioned Hessian of the data misfit."""
    figure = blank_figure(7.5, 4.6)
    axis = figure.subplots()
    for label, values, layout_45 in spectra:
        style = "x:" if layout_45 else "o-"
        axis.semilogy(np.arange(1, len(values) + 1), values, style, markersize=3, linewidth=0.8, label=label)
    axis.axhline(published_gamma, color="black", linewidth=0.8, linestyle="--")
    axis.text(30, 1.3 * published_gamma, "published gamma, $10^{1/2}$", fontsize=8)
    axis.set_xlabel("k")
    axis.set_ylabel("$\\lambda_k$ [1]")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=7)
    figure.suptitle("Eigenvalues of the prior-preconditioned data-misfit Hessian, 54 gauges")
    return figure


def eigenvectors(modes: Mapping[int, FloatArray], grid: SurfaceGrid) -> Figure:
    """Draw eigenvectors (n_p,), by number, from the side and from ahead."""
    rows = []
    for k, mode in modes.items():
        scale = float(np.percentile(np.abs(mode), 99.0))
        rows.append(FieldRow(title=f"mode {k}", field=mode / scale, low=-1.0, high=1.0, label="of 99th pct."))
    side = next(iter(SIDES.items()))
    return field_figure(
        rows,
        grid,
        {side[0]: side[1], "from ahead": FRONT},
        "Eigenvectors, quadratic hexahedra; arbitrary where eigenvalues are round-off",
    )


def field_comparison(
    fields: Mapping[str, FloatArray], error: FloatArray, grid: SurfaceGrid, side: tuple[str, float], title: str
) -> Figure:
    """Draw fields and the absolute error from a side and from ahead.

    Parameters
    ----------
    fields : (n_p,) [Pa] by title; the first sets the scale.
    error : (n_p,) of the estimate [Pa].
    side : name of the view and roll angle [rad] of the meridian that faces the reader.
    """
    return field_figure(pressure_rows(fields, error), grid, {side[0]: side[1], "from ahead": FRONT}, title)


class Draws(NamedTuple):
    """Relative errors (n,) [1] of one case, and both ends of the published range [%] if there is one."""

    label: str
    errors: FloatArray
    published: tuple[float, float] | None


def draw_ranges(panels: Mapping[str, Sequence[Draws]]) -> Figure:
    """Draw the field errors of the hundred draws and the published ranges, by title of the set-up."""
    figure = blank_figure(11.0, 4.4)
    axes = figure.subplots(1, len(panels), sharey=True)
    for axis, (title, examples) in zip(axes, panels.items(), strict=True):
        for column, case in enumerate(examples, start=1):
            axis.boxplot(
                100.0 * case.errors,
                positions=[column],
                widths=0.5,
                whis=(0, 100),
                medianprops={"color": "black"},
            )
            if case.published is not None:
                axis.fill_between([column - 0.4, column + 0.4], *case.published, color="tab:red", alpha=0.2)
        axis.set_xticks(range(1, len(examples) + 1), [case.label for case in examples], fontsize=6, rotation=20)
        axis.set_title(title, fontsize=8)
        axis.grid(alpha=0.3, axis="y")
    axes[0].set_ylabel("relative error of the field [%]")
    figure.suptitle("Field errors over 100 draws at the published gamma; red: published ranges")
    return figure


def noise_free_errors(
    pairs: Sequence[tuple[str, str]], field_error: FloatArray, odd_error: FloatArray, published: float
) -> Figure:
    """Draw the noise-free error for pairs of models, and how much of it the published layout cannot see.

    Parameters
    ----------
    pairs : n pairs of models: of the map, of the data.
    field_error, odd_error : (n,) error of the field and its part that is odd in y and in z [1].
    published : error of the field [%].
    """
    figure = blank_figure(9.0, 4.0)
    axis = figure.subplots()
    column = np.arange(len(pairs))
    axis.bar(column - 0.2, 100.0 * field_error, 0.4, label="error of the field")
    axis.bar(column + 0.2, 100.0 * odd_error, 0.4, label="of it, odd in y and in z")
    axis.axhline(published, color="tab:red", linestyle="--", label="published, 2.8 %")
    axis.set_yscale("log")
    axis.set_xticks(column, [f"map: {of_map}\ndata: {data}" for of_map, data in pairs], fontsize=6, rotation=15)
    axis.set_ylabel("% of |p|")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3, axis="y")
    figure.suptitle("M5 a6 b6 without noise, gamma 1e-6: which model the map is of, and which the data")
    return figure


def reading_ratios(ratios: Mapping[str, Sequence[float]], readings: Sequence[str], published: float) -> Figure:
    """Draw K1/K2 of the readings of the gauges' rows, by model."""
    figure = blank_figure(10.0, 4.2)
    axis = figure.subplots()
    for i, (model, ratio) in enumerate(ratios.items()):
        axis.bar(np.arange(len(readings)) + 0.35 * (i - 0.5), ratio, 0.35, label=model)
    axis.axhline(published, color="tab:red", label=f"published, {published:.2f}")
    axis.axhspan(0.8 * published, 1.2 * published, color="tab:red", alpha=0.1)
    axis.set_xticks(range(len(readings)), [reading.replace(", ", ",\n") for reading in readings], fontsize=6)
    axis.set_ylabel("K1/K2 [1]")
    axis.legend(fontsize=8)
    figure.suptitle(
        "Relative condition numbers by reading of the gauges' rows; shaded: 20 % round the published ratio"
    )
    return figure
