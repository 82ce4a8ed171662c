"""A proposed ground test: where its pads are, and what each case buys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from builder.calibration.plan.load_plan import LoadPlan
from builder.figures.drawing.canvas import blank_figure
from builder.structure.loads.applied import PadForce, PadPressure
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

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
