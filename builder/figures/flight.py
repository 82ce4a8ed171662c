"""The figure of a closed-loop flight: angle of attack, coefficients with 3 sigma, health."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing import blank_figure, save
from strainfmu.cosim.scenario import Scenario
from strainfmu.cosim.systems.recording import Recording
from strainfmu.estimator.health import HealthState
from strainfmu.fmu.flight_export import ClosedLoopFlight

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def flight_figures(flown: ClosedLoopFlight, output: str | Path) -> list[Path]:
    """Draw every run of a closed-loop flight of :func:`strainfmu.fly` into a folder; return the files.

    Raises
    ------
    StrainfmuError
        matplotlib is not installed, or a file could not be written.
    """
    paths = [Path(output) / f"flight_{feedback}.png" for feedback in flown.recordings]
    for path, (feedback, recording) in zip(paths, flown.recordings.items(), strict=True):
        save(flight_figure(flown.scenario, recording, feedback), path, resolution=120)
    return paths


def flight_figure(scenario: Scenario, recording: Recording, feedback: str) -> Figure:
    """Return the figure of one run."""
    figure = blank_figure(9.0, 9.5)
    axes = figure.subplots(5, 1, sharex=True)
    figure.suptitle(f"{scenario.name}: feedback of {feedback}")
    _draw_angle(axes[0], recording)
    _draw_coefficient(axes[1], recording, "C_N")
    _draw_coefficient(axes[2], recording, "M_P")
    axes[3].plot(recording.time, 1e-3 * recording["autopilot.control_moment"], color="black", linewidth=0.8)
    axes[3].set_ylabel("control moment [kN m]")
    _draw_health(axes[4], recording)
    for axis in axes:
        for fault in scenario.faults:
            axis.axvline(fault.time, color="tab:red", linewidth=0.8, linestyle=":")
        axis.grid(alpha=0.3)
    axes[4].set_xlabel("time [s]")
    return figure


def _draw_angle(axis: Any, recording: Recording) -> None:
    signals = {
        "inferred": ("autopilot.estimated_angle_of_attack", "tab:blue", 0.5),
        "true": ("plant.angle_of_attack", "black", 1.2),
        "commanded": ("schedule.commanded_angle_of_attack", "tab:orange", 1.0),
    }
    for label, (name, colour, width) in signals.items():
        axis.plot(recording.time, np.degrees(recording[name]), color=colour, linewidth=width, label=label)
    axis.set_ylabel("angle of attack [deg]")
    axis.legend(loc="upper left", ncols=3, fontsize="small")


def _draw_coefficient(axis: Any, recording: Recording, name: str) -> None:
    """Draw estimate with its band of 3 sigma, and truth."""
    value, sigma = recording[f"estimator.{name}"], recording[f"estimator.sigma.{name}"]
    axis.fill_between(
        recording.time,
        value - 3.0 * sigma,
        value + 3.0 * sigma,
        color="tab:blue",
        alpha=0.25,
        linewidth=0.0,
        label="estimate, 3 sigma",
    )
    axis.plot(recording.time, recording[f"plant.{name}"], color="black", linewidth=1.0, label="true")
    axis.set_ylabel(f"{name} [1]")
    axis.legend(loc="upper left", ncols=2, fontsize="small")


def _draw_health(axis: Any, recording: Recording) -> None:
    axis.step(recording.time, recording["estimator.health.state"], where="post", color="tab:red", linewidth=0.9)
    axis.set_yticks(
        [int(state) for state in HealthState], [state.name for state in HealthState], fontsize="x-small"
    )
    axis.set_ylabel("health")
