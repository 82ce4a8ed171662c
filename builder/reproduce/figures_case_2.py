"""The source's figures of Case 2, and what the layout "45" changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from builder.figures.pressure import blank_figure
from builder.reproduce.protocol import DRAWN_MODES, EXAMPLES, PUBLISHED_GAMMA
from builder.reproduce.published import PUBLISHED
from builder.reproduce.setups import TITLES
from builder.reproduce.studies import FIELDS, Studies
from builder.reproduce.views import FRONT, SIDES, FieldRow, field_figure, pressure_rows
from builder.vehicle.geometry import SurfaceGrid

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def eigenvalue_decay(studies: Studies) -> Figure:
    """Draw the eigenvalues of the prior-preconditioned Hessian of the data misfit."""
    figure = blank_figure(7.5, 4.6)
    axis = figure.subplots()
    for key, title in TITLES.items():
        for suffix, style in (("", "o-"), ("-45", "x:")):
            values = studies.gamma[f"{key}{suffix}"].eigenvalues
            label = title if not suffix else f"{title}, layout '45'"
            axis.semilogy(np.arange(1, len(values) + 1), values, style, markersize=3, linewidth=0.8, label=label)
    axis.axhline(PUBLISHED_GAMMA, color="black", linewidth=0.8, linestyle="--")
    axis.text(30, 1.3 * PUBLISHED_GAMMA, "published gamma, $10^{1/2}$", fontsize=8)
    axis.set_xlabel("k")
    axis.set_ylabel("$\\lambda_k$ [1]")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=7)
    figure.suptitle("Eigenvalues of the prior-preconditioned data-misfit Hessian, 54 gauges")
    return figure


def eigenvectors(studies: Studies, grid: SurfaceGrid) -> Figure:
    """Draw modes 1, 3, 6, 23 and 53 from the side and from ahead."""
    rows = []
    for k, mode in zip(DRAWN_MODES, studies.modes.T, strict=True):
        scale = float(np.percentile(np.abs(mode), 99.0))
        rows.append(FieldRow(f"mode {k}", mode / scale, -1.0, 1.0, "of 99th pct."))
    side = next(iter(SIDES.items()))
    return field_figure(
        rows,
        grid,
        {side[0]: side[1], "from ahead": FRONT},
        "Eigenvectors, quadratic hexahedra; those of round-off eigenvalues are arbitrary",
    )


def field_comparison(studies: Studies, setup: str, what: str, n_modes: int, grid: SurfaceGrid) -> Figure:
    """Draw reference, projection, estimate of median error and absolute error, from a side and ahead."""
    found = studies.fields[f"{setup}-{what}"]
    condition = EXAMPLES[FIELDS[what][0]]
    rows = pressure_rows(
        {
            "reference": found.reference,
            f"projected, r = {n_modes}": found.projection,
            "estimate": found.estimate,
        },
        found.estimate - found.reference,
    )
    side: dict[str, float | str] = {"from leeward": condition.leeward_roll_angle % (2.0 * np.pi)}
    if what.startswith("off_set"):
        side = {"from port (-y)": SIDES["from port (-y)"]}
    title = f"{condition}, {TITLES[setup]}: error {100.0 * found.shown:.1f} %"
    return field_figure(rows, grid, {**side, "from ahead": FRONT}, title)


def draw_ranges(studies: Studies) -> Figure:
    """Draw the field errors of the hundred draws beside the published ranges, published layout and "45"."""
    shown = {
        "noisy": "M5 a6 b6, published layout",
        "noisy_45": "M5 a6 b6, layout '45'",
        "off_set": "M6 a0 b5, published layout",
        "off_set_45": "M6 a0 b5, layout '45'",
    }
    figure = blank_figure(11.0, 4.4)
    axes = figure.subplots(1, len(TITLES), sharey=True)
    for axis, (key, title) in zip(axes, TITLES.items(), strict=True):
        for place, what in enumerate(shown, start=1):
            errors = 100.0 * studies.fields[f"{key}-{what}"].errors
            axis.boxplot(errors, positions=[place], widths=0.5, whis=(0, 100), medianprops={"color": "black"})
            band = PUBLISHED.get(what)
            if band is not None and band.low is not None and band.high is not None:
                axis.fill_between([place - 0.4, place + 0.4], band.low, band.high, color="tab:red", alpha=0.2)
        axis.set_xticks(range(1, len(shown) + 1), list(shown.values()), fontsize=6, rotation=20)
        axis.set_title(title, fontsize=8)
        axis.grid(alpha=0.3, axis="y")
    axes[0].set_ylabel("relative error of the field [%]")
    figure.suptitle("Field errors over 100 draws at the published gamma; red: published ranges")
    return figure


def noise_free_errors(studies: Studies) -> Figure:
    """Draw the noise-free error for pairs of models, and how much of it the published layout cannot see."""
    figure = blank_figure(9.0, 4.0)
    axis = figure.subplots()
    rows = studies.measured.crime
    place = np.arange(len(rows))
    axis.bar(place - 0.2, [100.0 * row.field_error for row in rows], 0.4, label="error of the field")
    axis.bar(place + 0.2, [100.0 * row.odd_error for row in rows], 0.4, label="of it, odd in y and in z")
    axis.axhline(PUBLISHED["noise_free"].low or 0.0, color="tab:red", linestyle="--", label="published, 2.8 %")
    axis.set_yscale("log")
    axis.set_xticks(place, [f"map: {row.inversion}\ndata: {row.data}" for row in rows], fontsize=6, rotation=15)
    axis.set_ylabel("% of |p|")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3, axis="y")
    figure.suptitle("M5 a6 b6 without noise, gamma 1e-6: which model the map is of, and which the data")
    return figure


def reading_ratios(studies: Studies) -> Figure:
    """Draw K1/K2 of the eight readings of the gauges' rows, per model."""
    figure = blank_figure(10.0, 4.2)
    axis = figure.subplots()
    rows = studies.measured.readings
    models, readings = (list(dict.fromkeys(getattr(row, name) for row in rows)) for name in ("model", "reading"))
    for i, model in enumerate(models):
        ratio = [row.ratio for row in rows if row.model == model]
        axis.bar(np.arange(len(readings)) + 0.35 * (i - 0.5), ratio, 0.35, label=model)
    wanted = PUBLISHED["k_ratio"].low or 0.0
    axis.axhline(wanted, color="tab:red", label=f"published, {wanted:.2f}")
    axis.axhspan(0.8 * wanted, 1.2 * wanted, color="tab:red", alpha=0.1)
    axis.set_xticks(range(len(readings)), [one.replace(", ", ",\n") for one in readings], fontsize=6)
    axis.set_ylabel("K1/K2 [1]")
    axis.legend(fontsize=8)
    figure.suptitle(
        "Relative condition numbers by reading of the gauges' rows; shaded: 20 % round the published ratio"
    )
    return figure
