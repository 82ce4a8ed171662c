"""Figures of a campaign: pressure on the surface, along the body, and the forces it adds up to."""

from __future__ import annotations

from itertools import pairwise
from math import degrees
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from builder.aero.load_operator import coefficient_scale, load_operator_on
from builder.campaign.snapshots import Snapshots
from builder.figures.drawing import COLOUR_MAP, at_roll_angles, blank_figure, colour_ends, ends_beyond
from strainfmu.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MAX_LINES = 6
"""Total incidences drawn in one panel, at most."""
PARTS = 40
"""Parts of the length over which a running load is a mean."""
MIN_INCIDENCE = np.deg2rad(0.05)
"""Below it [rad] normal force is too small to have a centre."""


def surface_maps(snapshots: Snapshots) -> Figure:
    """Draw p/p_inf unrolled, station against roll angle from leeward: minimum and maximum a_T of up to three M."""
    figure = blank_figure(11.0, 7.5)
    machs = _spread(np.unique(snapshots.condition[:, 0]), 3)
    axes = figure.subplots(len(machs), 2, sharex=True, sharey=True, squeeze=False)
    incidence = snapshots.total_incidence
    for row, mach in zip(axes, machs, strict=True):
        at_mach = np.flatnonzero(snapshots.condition[:, 0] == mach)
        for axis, index in zip(
            row, (at_mach[incidence[at_mach].argmin()], at_mach[incidence[at_mach].argmax()]), strict=True
        ):
            image, extend = _draw_unrolled(axis, snapshots, int(index))
            figure.colorbar(image, ax=axis, label="$p/p_\\infty$ [1]", pad=0.01, extend=extend)
            axis.set_title(f"{snapshots.conditions()[index]}", fontsize=8)
        row[0].set_ylabel("roll from leeward [deg]")
    for axis in axes[-1]:
        axis.set_xlabel("station x from the nose tip [m]")
        axis.set_yticks([-180, -90, 0, 90, 180])
    figure.suptitle(f"Surface pressure, unrolled: {snapshots.vehicle}, engine {snapshots.engine}")
    return figure


def _draw_unrolled(axis: Any, snapshots: Snapshots, index: int) -> tuple[Any, str]:
    """Draw one snapshot over x and the roll angle from its leeward meridian.

    Returns what was drawn, and which end of its colours has values beyond it.
    """
    condition, grid = snapshots.conditions()[index], snapshots.grid
    ratio = snapshots.pressure[index] / condition.ambient_pressure
    ends = colour_ends(snapshots.surface, ratio)
    axis.set_ylim(-180.0, 180.0)
    if grid is not None:
        away = np.linspace(-180.0, 180.0, 181)
        requested = np.mod(np.radians(away) + condition.leeward_roll_angle, 2.0 * np.pi)
        shown = at_roll_angles(grid.as_map(ratio), grid.roll_angle, requested)
        image = axis.pcolormesh(grid.x, away, shown.T, shading="gouraud", cmap=COLOUR_MAP, rasterized=True, **ends)
        return image, ends_beyond(image, ratio)
    x, y, z = snapshots.point.T
    away = np.degrees(np.arctan2(y, z) - condition.leeward_roll_angle)
    corner = np.mod(away[snapshots.triangle] + 180.0, 360.0) - 180.0
    inside = np.ptp(corner, axis=1) < 180.0  # a triangle across the seam would span the whole width
    number = np.arange(3 * int(inside.sum())).reshape(-1, 3)
    at_corner = snapshots.triangle[inside].ravel()
    image = axis.tripcolor(
        x[at_corner],
        corner[inside].ravel(),
        number,
        ratio[at_corner],
        shading="gouraud",
        cmap=COLOUR_MAP,
        rasterized=True,
        **ends,
    )
    return image, ends_beyond(image, ratio)


def centre_lines(snapshots: Snapshots) -> Figure:
    """Draw Cp along the windward and the leeward meridian, one panel per Mach number, one colour per a_T."""
    from matplotlib import colormaps

    machs = np.unique(snapshots.condition[:, 0])
    figure = blank_figure(11.0, 1.2 + 2.4 * len(machs))
    axes = figure.subplots(len(machs), 1, sharex=True, squeeze=False)[:, 0]
    highest = max(degrees(snapshots.total_incidence.max()), 1e-9)
    for axis, mach in zip(axes, machs, strict=True):
        for index in _one_per_incidence(snapshots, mach):
            alpha = degrees(snapshots.total_incidence[index])
            colour = colormaps[COLOUR_MAP](0.9 * alpha / highest)
            for side, style in ((np.pi, "-"), (0.0, "--")):
                for number, (x, cp) in enumerate(centre_line(snapshots, int(index), side)):
                    label = f"{alpha:.3g} deg" if side and not number else None
                    axis.plot(x, cp, style, color=colour, linewidth=1.2, label=label)
        axis.set_title(f"M {mach:g}", fontsize=9, loc="left")
        axis.set_ylabel("$C_p$ [1]")
        axis.grid(alpha=0.3)
        axis.legend(
            title="total incidence", fontsize=8, title_fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5)
        )
    axes[-1].set_xlabel("station x from the nose tip [m]")
    figure.suptitle(f"Centre-line $C_p$, windward (solid) and leeward (dashed): {snapshots.vehicle}")
    return figure


def centre_line(snapshots: Snapshots, index: int, from_leeward: float) -> list[tuple[FloatArray, FloatArray]]:
    """Return (x [m], Cp) along the meridian ``from_leeward`` [rad] off leeward, one pair per smooth piece.

    On stations and roll angles it is interpolated round the body; on a free surface the mean of what nodes lie
    within 4 deg of the meridian, in 60 bins.
    """
    condition = snapshots.conditions()[index]
    scale = 0.7 * condition.mach_number**2
    cp = (snapshots.pressure[index] / condition.ambient_pressure - 1.0) / scale
    meridian = condition.leeward_roll_angle + from_leeward
    grid = snapshots.grid
    if grid is not None:
        requested = np.mod(np.array([meridian]), 2.0 * np.pi)
        line = at_roll_angles(grid.as_map(cp), grid.roll_angle, requested)[:, 0]
        joints = [0, *(np.flatnonzero(np.diff(grid.x) == 0.0) + 1), len(grid.x)]
        return [(grid.x[a:b], line[a:b]) for a, b in pairwise(joints)]
    x, y, z = snapshots.point.T
    away = np.abs(np.mod(np.arctan2(y, z) - meridian + np.pi, 2.0 * np.pi) - np.pi)
    near = (away < np.deg2rad(4.0)) & (np.hypot(y, z) > 0.0)
    bins = np.linspace(x.min(), x.max(), 61)
    count, _ = np.histogram(x[near], bins)
    total, _ = np.histogram(x[near], bins, weights=cp[near])
    hit = count > 0
    return [(0.5 * (bins[1:] + bins[:-1])[hit], total[hit] / count[hit])]


def force_curves(snapshots: Snapshots) -> Figure:
    """Draw the forces in the plane of incidence: C_N with its slope, C_A and the centre of pressure against a_T;
    C_A against M; and the normal force along the body at the largest a_T of each M."""
    figure = blank_figure(12.0, 9.0)
    axes = figure.subplots(3, 2)
    curves = normal, axial, _ = in_plane_forces(snapshots)
    for mach in np.unique(snapshots.condition[:, 0]):
        index = _one_per_incidence(snapshots, mach, limit=None)
        angle = np.degrees(snapshots.total_incidence[index])
        for axis, values in zip(axes[:, 0], curves, strict=True):
            axis.plot(angle, values[index], "o-", markersize=3, linewidth=1.0, label=f"M {mach:g}")
        inclined = np.flatnonzero(angle > np.degrees(MIN_INCIDENCE))
        if len(inclined):
            slope = normal[index[inclined[0]]] / angle[inclined[0]]
            axes[0, 0].get_lines()[-1].set_label(
                f"M {mach:g}, {slope:.3g} per deg at {angle[inclined[0]]:.3g} deg"
            )
        axes[1, 1].plot(*running_load(snapshots, int(index[-1])), label=f"M {mach:g}, {angle[-1]:.3g} deg")
    rounded = np.round(snapshots.total_incidence, 6)
    for incidence in _spread(np.unique(rounded), MAX_LINES):
        same_incidence = np.flatnonzero(rounded == incidence)
        mach, first = np.unique(snapshots.condition[same_incidence, 0], return_index=True)
        axes[0, 1].plot(
            mach, axial[same_incidence[first]], "o-", markersize=3, label=f"$a_T$ {np.degrees(incidence):.3g} deg"
        )
    labels = (
        ("total incidence $a_T$ [deg]", "normal force $C_N$ [1]"),
        ("Mach number [1]", "axial force $C_A$, fore-body [1]"),
        ("total incidence $a_T$ [deg]", "axial force $C_A$, fore-body [1]"),
        ("station x from the nose tip [m]", "running load $dC_N/dx$ [1/m]"),
        ("total incidence $a_T$ [deg]", "centre of pressure\n$x_{cp}$ from the nose tip [m]"),
    )
    axes[2, 1].set_axis_off()
    for axis, (across, up) in zip(axes.flat, labels, strict=False):
        axis.set_xlabel(across)
        axis.set_ylabel(up)
        axis.grid(alpha=0.3)
    axes[0, 1].margins(y=0.25)  # room for its legend above the lines
    for axis, columns in ((axes[0, 0], 1), (axes[0, 1], 3), (axes[1, 1], 1)):
        axis.legend(fontsize=8, loc="upper left", ncols=columns)
    figure.suptitle(f"Forces in the plane of incidence: {snapshots.vehicle}, engine {snapshots.engine}")
    return figure


def running_load(snapshots: Snapshots, index: int) -> tuple[FloatArray, FloatArray]:
    """Return stations [m] and dC_N/dx [1/m] towards leeward of one snapshot, means over 40 parts of the length."""
    condition = snapshots.conditions()[index]
    reference = snapshots.reference_quantities
    loads = load_operator_on(snapshots.grid or snapshots.surface, reference.moment_station)
    wind = condition.leeward_roll_angle
    per_pressure = np.cos(wind) * loads[1] + np.sin(wind) * loads[2]
    net = snapshots.pressure[index] - snapshots.internal_pressure[index]
    station, number = np.unique(snapshots.point[:, 0], return_inverse=True)
    of_station = np.bincount(number, weights=per_pressure * net)
    ahead = np.cumsum(of_station) - 0.5 * of_station
    ahead[[0, -1]] = 0.0, of_station.sum()
    edge = np.linspace(station[0], station[-1], PARTS + 1)
    scale = coefficient_scale(condition.dynamic_pressure, reference)[1]
    return 0.5 * (edge[1:] + edge[:-1]), scale * np.diff(np.interp(edge, station, ahead)) / np.diff(edge)


def in_plane_forces(snapshots: Snapshots) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return C_N towards leeward, C_A, and the centre of pressure [m] (NaN without incidence), each (N,).

    The centre is where the normal force alone has the pitching moment of all pressures, axial ones included:
    x_cp = x_ref - L M_P/C_N.
    """
    leeward = np.array([c.leeward_roll_angle for c in snapshots.conditions()])
    axial, up, starboard, pitch, yaw = snapshots.coefficients().T
    normal = up * np.cos(leeward) + starboard * np.sin(leeward)
    moment = pitch * np.cos(leeward) + yaw * np.sin(leeward)
    reference = snapshots.reference_quantities
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = reference.moment_station - reference.length * moment / normal
    known = (snapshots.total_incidence > MIN_INCIDENCE) & (np.abs(normal) > 1e-9)
    return normal, axial, np.where(known, centre, np.nan)


def _one_per_incidence(snapshots: Snapshots, mach: float, limit: int | None = MAX_LINES) -> NDArray[np.intp]:
    """Return one snapshot of each total incidence at ``mach``, ascending; at most ``limit``, evenly spread."""
    at_mach = np.flatnonzero(snapshots.condition[:, 0] == mach)
    _, first = np.unique(np.round(snapshots.total_incidence[at_mach], 6), return_index=True)
    chosen = at_mach[first]
    return chosen if limit is None else _spread(chosen, limit)


def _spread(values: NDArray[Any], limit: int) -> NDArray[Any]:
    """Return at most ``limit`` of the values, first and last among them."""
    if len(values) <= limit:
        return values
    return values[np.round(np.linspace(0, len(values) - 1, limit)).astype(int)]
