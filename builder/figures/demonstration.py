"""Figures of the demonstration: pressure, gauges, and coefficients estimated in flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.figures.drawing import COLOUR_MAP, at_roll_angles, blank_figure, draw_strokes
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.cosim.systems.recording import Recording
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import ROLLING
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.interface.fmi_variables import COEFFICIENTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


COEFFICIENT_TITLES = {
    name: f"{label} ${name}$ [1]"
    for name, label in (
        *zip(COEFFICIENTS, (load.label for load in LOADS.values()), strict=True),
        (ROLLING, "Rolling moment"),
    )
}


def three_conditions(snapshots: Snapshots) -> list[int]:
    """Return the snapshots of lowest, middle and highest total incidence."""
    order = np.argsort([c.total_incidence for c in snapshots.conditions()], kind="stable")
    return [int(order[0]), int(order[len(order) // 2]), int(order[-1])]


def pressure_on_body(snapshots: Snapshots, surface: SurfaceGrid, title: str) -> Figure:
    """Draw p/p_inf on the body for three conditions, from leeward and from windward, each with its own colours."""
    figure = blank_figure(11.0, 6.0)
    axes = figure.subplots(3, 2, sharex=True, sharey=True)
    conditions = snapshots.conditions()
    for row, index in zip(axes, three_conditions(snapshots), strict=True):
        condition = conditions[index]
        at_nodes = snapshots.pressure[index] / condition.ambient_pressure
        ratio = surface.as_map(at_nodes)
        for axis, side, towards in zip(row, ("leeward", "windward"), (0.0, np.pi), strict=True):
            image = _draw_body(axis, ratio, surface, condition.leeward_roll_angle + towards)
            axis.set_title(f"{condition}, from {side}", fontsize=8)
            figure.colorbar(image, ax=axis, label="$p/p_\\infty$ [1]", pad=0.01)
        row[0].set_ylabel("across [mm]")
    for axis in axes[-1]:
        axis.set_xlabel("station x from the nose tip [m]")
    figure.suptitle(f"Surface pressure on the body: {title}")
    return figure


def _draw_body(axis: Any, ratio: FloatArray, surface: SurfaceGrid, facing: float) -> Any:
    """Draw (n_x, n_roll) values on the body as seen onto the meridian at roll angle ``facing`` [rad]."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 61)
    shown = at_roll_angles(ratio, surface.roll_angle, np.mod(angle + facing, 2.0 * np.pi))
    across = 1e3 * np.outer(surface.radius, np.sin(angle))
    along = np.repeat(surface.x[:, None], len(angle), axis=1)
    return axis.pcolormesh(
        along,
        across,
        shown,
        shading="gouraud",
        cmap=COLOUR_MAP,
        rasterized=True,
    )


def gauges(inverse_map: InverseMap, surface: SurfaceGrid) -> Figure:
    """Draw position and direction of the strain gauges: unrolled, and seen from behind."""
    n = inverse_map.n_strain_gauges
    figure = blank_figure(10.0, 4.2)
    unrolled, end_view = figure.subplots(1, 2, width_ratios=(3, 1))
    position, direction = inverse_map.gauge_position[:n], inverse_map.gauge_direction[:n]
    draw_strokes(unrolled, position, direction, 14.0)
    unrolled.set_xlim(0.0, surface.x[-1])
    unrolled.set_ylim(-20.0, 420.0)
    unrolled.set_yticks([0, 90, 180, 270, 360])
    unrolled.set_xlabel("station x from the nose tip [m]")
    unrolled.set_ylabel("roll angle from +z towards +y [deg]")
    unrolled.legend(loc="upper center", ncols=3)
    unrolled.grid(alpha=0.3)
    circle = np.linspace(0.0, 2.0 * np.pi, 200)
    end_view.plot(
        1e3 * surface.radius[-1] * np.sin(circle), 1e3 * surface.radius[-1] * np.cos(circle), color="grey"
    )
    end_view.plot(1e3 * position[:, 1], 1e3 * position[:, 2], ".", color="black")
    end_view.set_aspect("equal")
    end_view.set_xlabel("y, starboard [mm]")
    end_view.set_ylabel("z, up [mm]")
    end_view.set_title("seen from behind, looking forward", fontsize=9)
    figure.suptitle(f"{n} strain gauges on the inner surface: {inverse_map.vehicle}")
    return figure


def overview(
    snapshots: Snapshots, surface: SurfaceGrid, inverse_map: InverseMap, recording: Recording, title: str
) -> Figure:
    """Draw load and gauges on the body, their strain, and two coefficients that were estimated from it."""
    figure = blank_figure(10.0, 8.0)
    body, strain, *panels = figure.subplots(4, 1, height_ratios=(1.1, 1.0, 1.0, 1.0))
    index = three_conditions(snapshots)[1]
    condition = snapshots.conditions()[index]
    at_nodes = snapshots.pressure[index] / condition.ambient_pressure
    facing = condition.leeward_roll_angle + np.pi
    image = _draw_body(body, surface.as_map(at_nodes), surface, facing)
    figure.colorbar(image, ax=body, label="$p/p_\\infty$ [1]", pad=0.01)
    position = inverse_map.gauge_position
    away = np.arctan2(position[:, 1], position[:, 2]) - facing
    front = np.cos(away) > -1e-6  # with those on the outline
    radius = np.hypot(position[:, 1], position[:, 2])
    body.plot(
        position[front, 0],
        1e3 * (radius * np.sin(away))[front],
        "o",
        color="white",
        markeredgecolor="black",
        markersize=4,
        label="strain gauges on the inner surface",
    )
    body.set_ylim(*(np.array([-1.05e3, 1.05e3]) * surface.radius.max()))
    body.legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.2, frameon=False)
    body.set_title(f"Air load: {condition}, seen from windward", fontsize=9, loc="left")
    body.set_xlabel("station x from the nose tip [m]")
    body.set_ylabel("across [mm]")
    _draw_strain(strain, recording, inverse_map)
    for axis, name in zip(panels, ("C_N", "C_Y"), strict=True):
        _draw_coefficient(axis, recording, name)
    for axis in (strain, panels[0]):
        axis.sharex(panels[1])
    panels[1].legend(ncols=3, fontsize=8, loc="lower right")
    panels[1].set_xlabel("time [s]")
    figure.suptitle(f"From strain to air loads: {title}")
    return figure


def _draw_strain(axis: Any, recording: Recording, inverse_map: InverseMap) -> None:
    """Draw the readings of all strain gauges over time, coloured by the station of the gauge."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    station = inverse_map.gauge_position[: inverse_map.n_strain_gauges, 0]
    colours = ScalarMappable(Normalize(station.min(), station.max()), COLOUR_MAP)
    for gauge, x in enumerate(station, start=1):
        axis.plot(
            recording.time, 1e6 * recording[f"plant.strain[{gauge}]"], color=colours.to_rgba(x), linewidth=0.5
        )
    axis.figure.colorbar(colours, ax=axis, label="station x [m]", pad=0.01)
    axis.set_title(f"Strain of {len(station)} gauges, with noise [$\\mu$m/m]", fontsize=9, loc="left")
    axis.grid(alpha=0.3)


def _draw_coefficient(axis: Any, recording: Recording, name: str) -> None:
    """Draw one coefficient over time: truth, estimate and its band of 3 sigma."""
    time, truth, estimate = recording.time, recording[f"plant.{name}"], recording[f"estimator.{name}"]
    sigma = recording[f"estimator.sigma.{name}"]
    axis.fill_between(
        time,
        estimate - 3.0 * sigma,
        estimate + 3.0 * sigma,
        color="tab:blue",
        alpha=0.2,
        linewidth=0,
        label="estimate $\\pm 3\\sigma$",
    )
    axis.plot(time, estimate, color="tab:blue", linewidth=0.6, label="estimate")
    axis.plot(time, truth, color="black", linewidth=1.0, label="truth")
    axis.set_title(COEFFICIENT_TITLES[name], fontsize=9, loc="left")
    axis.grid(alpha=0.3)


def coefficients(recording: Recording, title: str) -> Figure:
    """Draw estimated and true coefficients over time with bands of 3 sigma, and the health chi-square."""
    names = [name for name in COEFFICIENT_TITLES if f"plant.{name}" in recording.names]
    figure = blank_figure(10.0, 1.0 + 2.0 * len(names))
    axes = figure.subplots(len(names) + 1, 1, sharex=True)
    for axis, name in zip(axes, names, strict=False):
        _draw_coefficient(axis, recording, name)
    axes[0].legend(ncols=3, fontsize=8, loc="upper right")
    health = axes[-1]
    health.plot(recording.time, recording["estimator.health.chi_square"], color="tab:green", linewidth=0.6)
    limit = recording["estimator.health.chi_square_limit"]
    health.plot(recording.time, limit, color="tab:red", linewidth=0.8, label="alarm level")
    health.set_title("Chi-square of the residual [1]", fontsize=9, loc="left")
    health.legend(fontsize=8, loc="upper right")
    health.grid(alpha=0.3)
    health.set_xlabel("time [s]")
    figure.suptitle(f"Coefficients estimated by the FMU from noisy strain, against truth: {title}")
    return figure
