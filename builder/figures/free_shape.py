"""A vehicle of any shape: its surface from above, from the side and obliquely, with pressure and gauges."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.figures.canvas import COLOUR_MAP, blank_figure
from strainfmu.arrays import FloatArray
from strainfmu.estimator.inverse_map import InverseMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GAUGE_COLOUR = "#c02020"
SHOWN_SHARE = 0.98
"""Of the area, whose pressures the colours tell apart; higher ones, as at the edges of fins, have one colour."""


def shape_with_gauges(snapshots: Snapshots, inverse_map: InverseMap, title: str) -> Figure:
    """Draw p/p_inf of the snapshot of greatest incidence on the surface, seen from three sides, and the gauges."""
    row = int(np.argmax(snapshots.total_incidence))
    condition = snapshots.conditions()[row]
    ratio = snapshots.pressure[row] / condition.ambient_pressure
    position = inverse_map.gauge_position
    from matplotlib.collections import PolyCollection

    triangle, area = snapshots.triangle, snapshots.surface.area
    mean = ratio[triangle].mean(axis=1)
    rising = np.argsort(mean)
    below = np.searchsorted(np.cumsum(area[rising]), SHOWN_SHARE * area.sum())
    highest = float(mean[rising[min(int(below), len(mean) - 1)]])
    figure = blank_figure(8.0, 7.0)
    axes = figure.subplots(3, 1)
    oblique = _turned(np.deg2rad(30.0), np.deg2rad(25.0))
    for ax, view, name in (
        (axes[0], np.eye(3)[[0, 1, 2]], "from above"),
        (axes[1], np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), "from starboard"),
        (axes[2], oblique, "obliquely"),
    ):
        seen = snapshots.point @ view.T
        order = np.argsort(seen[triangle, 2].mean(axis=1))
        patches = PolyCollection(
            list(seen[triangle[order], :2]), array=mean[order], cmap=COLOUR_MAP, edgecolors="face"
        )
        patches.set_clim(float(mean.min()), highest)
        patches.set_linewidth(0.2)
        ax.add_collection(patches)
        spots = position @ view.T
        ax.plot(spots[:, 0], spots[:, 1], "o", color=GAUGE_COLOUR, markersize=3.0, label="gauges (seen through)")
        ax.autoscale_view()
        ax.set_aspect("equal")
        ax.set_title(name, fontsize="small")
        ax.set_xlabel("x [m]" if view is not oblique else "")
        figure.colorbar(patches, ax=ax, label="p/p_inf", extend="max")
    axes[0].legend(loc="upper left", fontsize="small")
    named = zip(snapshots.parameter_names, condition.parameters, strict=True)
    further = "".join(f", {name} {value:g}" for name, value in named)
    figure.suptitle(f"{title}: {replace(condition, parameters=())}{further}", fontsize="medium")
    return figure


def _turned(yaw: float, pitch: float) -> FloatArray:
    """Return the matrix (3, 3) of a view turned about z and then tilted."""
    c, s, d, e = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    about_z = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, e, d], [0.0, -d, e]])
    return np.asarray(tilt @ about_z)
