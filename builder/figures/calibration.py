"""A ground test in figures: influence coefficients, residuals, unloading, check loads, sigmas, loads covered.

A vehicle as built in flight: errors of its map before the ground test, after it, and if all were known.

A proposed ground test: where its pads are, and what each case buys.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.calibration.estimate.check_loads import CheckLoad
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.ground_test_faults import load_shifts
from builder.calibration.estimate.load_steps import SteppedCase
from builder.calibration.estimate.regression import LoadEquation
from builder.calibration.ground_test.load_changes import cell_force
from builder.calibration.plan.load_plan import LoadPlan
from builder.calibration.plan.worth_of_test import WorthOfTest
from builder.figures.drawing import blank_figure
from builder.structure.as_built.as_built_structure import OF_MASS
from builder.structure.loads.applied import PadForce, PadPressure
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, LOAD_NAMES, LOAD_UNITS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKERS = ("o", "s", "^", "v", "D")


def load_plan_figure(plan: LoadPlan, title: str) -> Figure:
    """Draw the pads on the unrolled body and sigma of each coefficient over the number of cases."""
    figure = blank_figure(11.0, 4.6)
    left_axes, right_axes = figure.subplots(1, 2, width_ratios=[1.0, 1.1])
    _pads(left_axes, plan)
    _worth(right_axes, plan)
    figure.suptitle(f"Proposed load cases: {title}")
    return figure


def _pads(axis: Any, plan: LoadPlan) -> None:
    """Mark the pads, with their numbers in the order of the cases."""
    numbers: dict[tuple[float, float], list[str]] = {}
    for number, case in enumerate(plan.cases, start=1):
        for load in case.loads:
            if isinstance(load, PadForce | PadPressure):
                roll = float(np.rad2deg(load.roll_angle)) % 360.0
                numbers.setdefault((load.station, roll), []).append(str(number))
    for (station, roll), listed in numbers.items():
        axis.plot(station, roll, "s", color="tab:blue", markersize=11, alpha=0.35)
        axis.annotate(",".join(listed), (station, roll), ha="center", va="center", fontsize=8)
    axis.set(xlabel="station [m]", ylabel="roll angle from +z toward +y [deg]", ylim=(-20.0, 360.0))
    axis.set_yticks(range(0, 360, 45))
    axis.grid(alpha=0.3)
    axis.set_title("Pads, numbered by case", fontsize=9, loc="left")


def _worth(axis: Any, plan: LoadPlan) -> None:
    """Draw sigma over the sigma of a vehicle known exactly: as drawn, after the attitudes, after each case."""
    ratio = np.vstack([plan.before, plan.after_attitudes, plan.sigmas]) / plan.exact
    place = np.arange(-1, len(ratio) - 1)
    for i, name in enumerate(COEFFICIENT_NAMES):
        axis.plot(place, ratio[:, i], marker=MARKERS[i], markersize=4, label=f"${name}$")
    axis.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
    axis.set_yscale("log")
    axis.set_xticks(place, ["drawing", "weight" if plan.attitudes else "zeros", *map(str, place[2:])], fontsize=8)
    axis.tick_params(axis="x", labelrotation=45)
    axis.set(xlabel="cases applied")
    axis.grid(alpha=0.3, which="both")
    axis.legend(fontsize=8)
    axis.set_title("Sigma in flight over the sigma of a vehicle known exactly [1]", fontsize=9, loc="left")


COLORS = {"before": "tab:red", "exact": "0.45", "after": "tab:blue"}
"""In the order of drawing."""


def as_built_figure(time: FloatArray, flown: Mapping[str, tuple[FloatArray, FloatArray]], title: str) -> Figure:
    """Draw the errors of each coefficient over ``time`` (n,) [s], map by map, and their rms next to it.

    ``flown`` are errors and standard deviations (n, 5) of the coefficients [1], by the name of the map.
    """
    figure = blank_figure(11.0, 9.0)
    axes = figure.subplots(len(COEFFICIENT_NAMES), 2, sharex="col", width_ratios=[4.0, 1.0], squeeze=False)
    for i, name in enumerate(COEFFICIENT_NAMES):
        over_time, bars = axes[i]
        rms = []
        for label, color in COLORS.items():
            error, std = (part[:, i] for part in flown[label])
            rms.append(float(np.sqrt(np.nanmean(error**2))))
            if label == "after":
                over_time.fill_between(
                    time, -3.0 * std, 3.0 * std, color=color, alpha=0.15, linewidth=0, label="after $3\\sigma$"
                )
            over_time.plot(time, error, color=color, linewidth=0.4, label=label)
        over_time.set_title(f"Error of ${name}$ [1]", fontsize=9, loc="left")
        over_time.grid(alpha=0.3)
        bars.bar(list(COLORS), rms, color=list(COLORS.values()))
        bars.set_title("rms [1]", fontsize=9, loc="left")
        bars.grid(alpha=0.3, axis="y")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), ncols=4, fontsize=8, loc="outside lower center")
    axes[-1, 0].set_xlabel("time [s]")
    figure.suptitle(f"Map before the ground test, after it, and exact: {title}")
    return figure


DRAWING, CALIBRATED, EXACT = "tab:red", "tab:blue", "0.45"
"""Colours of the drawing, of the calibrated vehicle, and of one that is known exactly."""

LARGEST = 4.0
"""End of the colours of residuals, in standard deviations of the readings."""

STEPPED, LINES = 6, 4
"""Most cases with steps that are drawn, and gauges in each: the gauges of largest strain."""

WIDTH = 10.0
"""Of all figures [in]."""


def influence_coefficients(estimate: Estimate) -> list[tuple[str, FloatArray, FloatArray, FloatArray]]:
    """Return the cases of one force: name, and strain per force (n_d,) measured, by the drawing and as calibrated.

    Strain of own weight and zeros are taken off as estimated; all in m/m per N, NaN of readings that are not used.
    """
    model = estimate.model
    errors, test = model.errors(estimate.vector), model.test
    by_load = model.load_strains(estimate.parameters)
    by_drawing = model.load_strains(model.structure.exactly_built())
    rows = []
    for k, case in enumerate(test.cases):
        numbers = [n for n, (of_case, _) in enumerate(model.loads) if of_case == k]
        forces = [n for n in numbers if cell_force(model.loads[n][1].load) > 0.0]
        of_mass = [n for n in numbers if n not in forces]
        if len(forces) != 1 or not all(isinstance(model.loads[n][1].load, OF_MASS) for n in of_mass):
            continue
        force = cell_force(model.loads[forces[0]][1].load)
        rest = by_load[of_mass].sum(axis=0) + errors.zero[model.group_of_case[k]]
        use = estimate.used[k] | (case.check & estimate.used.any(axis=0))
        measured = np.where(use, case.reading - rest, np.nan) / force
        predicted = (estimate.after[k] - rest) / force
        rows.append((case.name, measured, by_drawing[forces[0]] / force, predicted))
    return rows


def influence_figure(estimate: Estimate) -> Figure | None:
    """Draw measured influence coefficients over those by the drawing and as calibrated; None without forces."""
    rows = influence_coefficients(estimate)
    if not rows:
        return None
    figure = blank_figure(WIDTH, 4.6)
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    scale = 1e9  # um/m per kN
    measured = scale * np.array([row[1] for row in rows])
    for axis, column, colour, title in (
        (axes[0], 2, DRAWING, "by the drawing"),
        (axes[1], 3, CALIBRATED, "as calibrated"),
    ):
        predicted = scale * np.array([row[column] for row in rows])
        axis.axline((0.0, 0.0), slope=1.0, color="0.6", linewidth=0.8)
        axis.plot(predicted.ravel(), measured.ravel(), ".", color=colour, markersize=4, alpha=0.6)
        rms = float(np.sqrt(np.nanmean((measured - predicted) ** 2)))
        axis.set_title(f"{title}: difference {rms:.3g} um/m per kN rms", fontsize=9, loc="left")
        axis.set_xlabel("predicted [um/m per kN]")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("measured [um/m per kN]")
    return figure


def residual_figure(estimate: Estimate) -> Figure:
    """Draw measured less predicted in standard deviations, case by case and gauge by gauge."""
    test, names = estimate.model.test, estimate.model.structure.gauges.names
    figure = blank_figure(WIDTH, 1.8 + 0.24 * len(test.cases))
    axis = figure.subplots()
    axis.set_facecolor("0.8")
    image = axis.imshow(estimate.residuals, aspect="auto", cmap="RdBu_r", vmin=-LARGEST, vmax=LARGEST)
    axis.set_yticks(range(len(test.cases)), [case.name for case in test.cases], fontsize=7)
    step = max(1, len(names) // 60)
    axis.set_xticks(range(0, len(names), step), names[::step], rotation=90, fontsize=6)
    figure.colorbar(image, ax=axis, label="sigma of the reading", pad=0.01, extend="both")
    return figure


def steps_figure(cases: Sequence[SteppedCase], names: Sequence[str]) -> Figure | None:
    """Draw strain over load, loading and unloading, of the gauges that strain most; None without steps."""
    shown = list(cases)[:STEPPED]
    if not shown:
        return None
    columns = min(3, len(shown))
    figure = blank_figure(WIDTH, 3.4 * -(-len(shown) // columns))
    axes = figure.subplots(-(-len(shown) // columns), columns, squeeze=False)
    for axis in axes.ravel()[len(shown) :]:
        axis.set_visible(False)
    for axis, case in zip(axes.ravel(), shown, strict=False):
        most = np.argsort(-np.nan_to_num(case.span))[:LINES]
        for k, gauge in enumerate(most.tolist()):
            up, colour = ~case.unloading, f"C{k}"
            turn = np.flatnonzero(up)[-1:]
            down = np.concatenate([turn, np.flatnonzero(~up)])
            change = 1e6 * (case.reading[:, gauge] - case.reading[0, gauge])
            axis.plot(100 * case.part[up], change[up], "o-", color=colour, markersize=4)
            axis.plot(
                100 * case.part[down],
                change[down],
                "s--",
                color=colour,
                markersize=3,
                label=names[gauge],
            )
        axis.set_title(case.name, fontsize=9, loc="left")
        axis.set(xlabel="load [%]", ylabel="change from the first reading [um/m]")
        axis.legend(fontsize=6)
        axis.grid(alpha=0.3)
    return figure


def check_figure(estimate: Estimate, checks: Sequence[CheckLoad], equations: Sequence[LoadEquation]) -> Figure:
    """Draw predicted over applied loads: of check loads, or else what the fitted readings say of each load."""
    figure = blank_figure(WIDTH, 4.2)
    left_axes, right_axes = figure.subplots(1, 2, width_ratios=[1.0, 1.3])
    if checks:
        _check_differences(left_axes, checks)
        _check_equations(right_axes, checks, equations)
    else:
        _fitted_loads(left_axes, estimate)
        right_axes.set_visible(False)
    return figure


def _check_differences(axis: Any, checks: Sequence[CheckLoad]) -> None:
    place = np.arange(len(checks))
    axis.errorbar(
        100 * np.array([check.difference for check in checks]),
        place,
        xerr=300 * np.array([check.std for check in checks]),
        fmt="o",
        color=CALIBRATED,
        capsize=3,
    )
    axis.axvline(0.0, color="0.6", linewidth=0.8)
    axis.set_yticks(place, [check.case for check in checks], fontsize=8)
    axis.set_ylim(len(checks) - 0.5, -0.5)
    axis.set(xlabel="predicted less applied [%], bars 3 sigma")
    axis.set_title("By the calibrated vehicle", fontsize=9, loc="left")
    axis.grid(alpha=0.3)


def _check_equations(axis: Any, checks: Sequence[CheckLoad], equations: Sequence[LoadEquation]) -> None:
    loads = np.array([check.loads for check in checks])
    by_equations = np.array([check.by_equations for check in checks])
    size = np.maximum(np.abs(loads).max(axis=0), 1e-12)
    axis.axline((0.0, 0.0), slope=1.0, color="0.6", linewidth=0.8)
    for k, (name, unit) in enumerate(zip(LOAD_NAMES, LOAD_UNITS, strict=True)):
        if size[k] <= 1e-9 * size.max() or not equations:
            continue
        label = f"{name.replace('_', ' ')}, 1 = {size[k]:.3g} {unit}"
        axis.plot(loads[:, k] / size[k], by_equations[:, k] / size[k], "osD^v"[k], label=label, markersize=5)
    axis.set(xlabel="applied [largest of the check loads]", ylabel="by the load equations")
    axis.set(xlim=(-1.15, 1.15))
    axis.set_title("By the regression load equations", fontsize=9, loc="left")
    axis.legend(fontsize=7)
    axis.grid(alpha=0.3)


def _fitted_loads(axis: Any, estimate: Estimate) -> None:
    shift, size = load_shifts(estimate)
    std = np.divide(np.abs(size), np.abs(shift), out=np.full(len(size), np.nan), where=shift != 0.0)
    shown = [n for n, (_, known) in enumerate(estimate.model.loads) if known.std > 0.0 and shift[n] != 0.0]
    place = np.arange(len(shown))
    axis.errorbar(100 * size[shown], place, xerr=300 * std[shown], fmt="o", color=CALIBRATED, capsize=3)
    axis.axvline(0.0, color="0.6", linewidth=0.8)
    names = [estimate.model.test.cases[estimate.model.loads[n][0]].name for n in shown]
    axis.set_yticks(place, names, fontsize=8)
    axis.set_ylim(len(shown) - 0.5, -0.5)
    axis.set(xlabel="load by the readings less applied [%], bars 3 sigma")
    axis.set_title("No check loads: the loads that were fitted", fontsize=9, loc="left")
    axis.grid(alpha=0.3)


def flight_figure(worth: WorthOfTest) -> Figure:
    """Draw sigma of every coefficient in flight before and after the test, and of a vehicle known exactly."""
    figure = blank_figure(WIDTH, 3.6)
    axis = figure.subplots()
    place = np.arange(len(COEFFICIENT_NAMES))
    bars = (
        ("by the drawing", worth.before, DRAWING),
        ("after the test", worth.after, CALIBRATED),
        ("vehicle known exactly", worth.exact, EXACT),
    )
    for k, (label, sigma, colour) in enumerate(bars):
        axis.bar(place + 0.27 * (k - 1), sigma, 0.26, color=colour, label=label)
    axis.set_xticks(place, [f"${name}$" for name in COEFFICIENT_NAMES])
    axis.set_yscale("log")
    axis.set(ylabel="sigma in flight [1]")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3, axis="y", which="both")
    return figure


def coverage_figure(worth: WorthOfTest, names: Sequence[str]) -> Figure:
    """Draw ranges of the five loads, and the largest strain of every gauge, in flight and in the test."""
    figure = blank_figure(WIDTH, 4.4)
    left_axes, right_axes = figure.subplots(1, 2, width_ratios=[1.0, 1.9])
    size = np.maximum(np.abs(worth.flight_loads).max(axis=0), 1e-12)
    for k, unit in enumerate(LOAD_UNITS):
        low, high = worth.flight_loads[:, k].min() / size[k], worth.flight_loads[:, k].max() / size[k]
        left_axes.barh(
            k, high - low, left=low, height=0.5, color=EXACT, alpha=0.5, label="in flight" if not k else None
        )
        ground = worth.ground_loads[:, k] / size[k]
        left_axes.plot(
            ground, np.full(len(ground), k), "|", color=CALIBRATED, markersize=14, label=None if k else "cases"
        )
        left_axes.text(1.0, k + 0.36, f"1 = {size[k]:.3g} {unit}", fontsize=7, ha="right", va="center")
    left_axes.set_yticks(range(5), [name.replace("_", " ") for name in LOAD_NAMES], fontsize=8)
    left_axes.set_ylim(4.6, -0.6)
    left_axes.set(xlabel="load over the largest in flight [1]")
    left_axes.legend(fontsize=7)
    left_axes.grid(alpha=0.3)
    place = np.arange(len(names))
    right_axes.bar(place, 1e6 * worth.flight_strain, color=EXACT, alpha=0.5, label="in flight")
    right_axes.plot(place, 1e6 * worth.ground_strain, "_", color=CALIBRATED, markersize=6, label="cases")
    step = max(1, len(names) // 60)
    right_axes.set_xticks(place[::step], names[::step], rotation=90, fontsize=6)
    right_axes.set_xlim(-1.0, len(names))
    right_axes.set(ylabel="largest strain [um/m]")
    right_axes.legend(fontsize=7)
    right_axes.grid(alpha=0.3, axis="y")
    return figure
