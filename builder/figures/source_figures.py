"""The source's figures of both cases, and what the layout "45" changes. Case 1 has a panel per set-up.

A field on a body of revolution is shown as the source does: from the side, from leeward, from ahead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from builder.figures.drawing import COLOUR_MAP, blank_figure
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


def reference_and_estimate(reference: FloatArray, estimate: FloatArray, grid: SurfaceGrid, title: str) -> Figure:
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


MAX_STATIONS = 160
"""Stations drawn along the body, at most."""

FRONT = "front"
STARBOARD = "from starboard (+y)"
SIDES = {STARBOARD: 0.5 * np.pi, "from port (-y)": 1.5 * np.pi}
"""Roll angle [rad] of the meridian that faces the reader, of the two views onto the xz-plane."""

COLOUR_PERCENTILE = 99.0
"""Percentile at which colours end: at the nose pressure is far higher, as the source notes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldRow:
    """One row of a figure.

    Attributes
    ----------
    title : name of the field.
    field : (n_p,).
    low, high : ends of the colours.
    label : of the colour bar, with unit.
    """

    title: str
    field: FloatArray
    low: float
    high: float
    label: str


def pressure_rows(named: Mapping[str, FloatArray], error: FloatArray) -> list[FieldRow]:
    """Return rows of pressures (n_p,) [Pa] on one scale, and one of the absolute ``error`` on its own; in kPa."""
    first = next(iter(named.values()))
    high = 1e-3 * float(np.percentile(first, COLOUR_PERCENTILE))
    rows = [
        FieldRow(title=title, field=1e-3 * field, low=0.0, high=high, label="p [kPa]")
        for title, field in named.items()
    ]
    size = np.abs(error)
    end = 1e-3 * float(np.percentile(size, COLOUR_PERCENTILE))
    return [*rows, FieldRow(title="absolute error", field=1e-3 * size, low=0.0, high=end, label="kPa")]


def field_figure(rows: list[FieldRow], grid: SurfaceGrid, views: dict[str, float | str], title: str) -> Figure:
    """Draw each row in every view: a roll angle [rad] that faces the reader, or :data:`FRONT`."""
    height = 0.7 + 1.6 * len(rows)
    figure = blank_figure(10.0, height)
    figure.set_layout_engine(None)  # fixed margins take half the time
    figure.subplots_adjust(0.06, 0.45 / height, 0.93, 1.0 - 0.55 / height, 0.16, 0.55)
    widths = [*(1.0 if view == FRONT else 2.6 for view in views.values()), 0.06]
    axes = figure.subplots(len(rows), len(widths), width_ratios=widths, squeeze=False)
    for line, row in zip(axes, rows, strict=True):
        for axis, (name, view) in zip(line[:-1], views.items(), strict=True):
            image = _draw_front(axis, row, grid) if isinstance(view, str) else _draw_side(axis, row, grid, view)
            axis.set_title(f"{row.title}, {name}", fontsize=8)
            axis.tick_params(labelsize=6)
        figure.colorbar(image, cax=line[-1], label=row.label)
    figure.suptitle(title, fontsize=10)
    return figure


def _thinned(row: FieldRow, grid: SurfaceGrid) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return stations (n,), radii (n,) and values (n, n_roll) of few enough stations to be drawn."""
    chosen = np.unique(np.linspace(0, len(grid.x) - 1, MAX_STATIONS).astype(int))
    return grid.x[chosen], grid.radius[chosen], grid.as_map(row.field)[chosen]


def _draw_side(axis: Any, row: FieldRow, grid: SurfaceGrid, facing: float) -> Any:
    """Draw the half that faces the reader; with the nose to the left a roll angle of ``facing`` + 90 deg is up.

    From starboard the nose is to the right, so that +z is up there too.
    """
    x, radius, values = _thinned(row, grid)
    n = grid.n_roll
    around = round(facing / (2.0 * np.pi) * n) + np.arange(-(n // 4), n // 4 + 1)
    away = 2.0 * np.pi * around / n - facing
    turned = bool(np.isclose(facing, SIDES[STARBOARD]))
    across = (-1e3 if turned else 1e3) * np.outer(radius, np.sin(away))
    shown = values[:, around % n]
    colour = 0.25 * (shown[1:, 1:] + shown[:-1, 1:] + shown[1:, :-1] + shown[:-1, :-1])
    along = np.repeat(x[:, None], len(around), axis=1)
    axis.set_xlim((x[-1], 0.0) if turned else (0.0, x[-1]))
    axis.set_ylim(-1.05e3 * radius.max(), 1.05e3 * radius.max())
    axis.set_xlabel("x [m]", fontsize=6)
    axis.set_ylabel("across [mm]", fontsize=6)
    return axis.pcolormesh(along, across, colour, vmin=row.low, vmax=row.high, cmap=COLOUR_MAP, rasterized=True)


def _draw_front(axis: Any, row: FieldRow, grid: SurfaceGrid) -> Any:
    """Draw the body from ahead of its nose: starboard is on the left."""
    _, radius, values = _thinned(row, grid)
    roll = 2.0 * np.pi * (np.arange(grid.n_roll + 1) - 0.5) / grid.n_roll
    y, z = 1e3 * np.outer(radius, np.sin(roll)), 1e3 * np.outer(radius, np.cos(roll))
    image = axis.pcolormesh(
        y, z, 0.5 * (values[1:] + values[:-1]), vmin=row.low, vmax=row.high, cmap=COLOUR_MAP, rasterized=True
    )
    axis.set_aspect("equal")
    axis.invert_xaxis()
    axis.set_xlabel("y [mm]", fontsize=6)
    axis.set_ylabel("z [mm]", fontsize=6)
    return image


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
