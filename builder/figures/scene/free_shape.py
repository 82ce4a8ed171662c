"""A vehicle of any shape: its surface from above, from the side and obliquely, with pressure and gauges."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.figures.drawing.canvas import COLOUR_MAP, blank_figure
from builder.figures.drawing.colours import colour_ends, ends_beyond
from builder.figures.drawing.words import with_signs
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GAUGE_COLOUR = "#c02020"


def turned(yaw: float, pitch: float) -> FloatArray:
    """Return the matrix (3, 3) of a view turned about z and then tilted."""
    c, s, d, e = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    about_z = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, e, d], [0.0, -d, e]])
    return np.asarray(tilt @ about_z)


VIEWS = (
    ("from above", np.eye(3), "y [m]"),
    ("from port", np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), "z [m]"),
    ("obliquely, from port, behind and above", turned(np.deg2rad(30.0), np.deg2rad(25.0)), ""),
)
"""Name, rows that point right, up and at the viewer, and the axis that points up."""


def shape_with_gauges(snapshots: Snapshots, inverse_map: InverseMap, title: str) -> Figure:
    """Draw p/p_inf of the snapshot of greatest incidence on the surface, seen from three sides, and the gauges."""
    row = int(np.argmax(snapshots.total_incidence))
    condition = snapshots.conditions()[row]
    ratio = snapshots.pressure[row] / condition.ambient_pressure
    position = inverse_map.gauge_position
    from matplotlib.collections import PolyCollection

    triangle, ends = snapshots.triangle, colour_ends(snapshots.surface, ratio)
    mean = ratio[triangle].mean(axis=1)
    projected = [snapshots.point @ view.T for _, view, _ in VIEWS]
    spans = [np.ptp(points[:, :2], axis=0) for points in projected]
    width = max(along for along, _ in spans)
    tall = [max(float(up), 0.1 * width) for _, up in spans]
    figure = blank_figure(8.0, min(12.0, 2.0 + 6.5 * sum(tall) / width))
    axes = figure.subplots(3, 1, height_ratios=tall)
    for ax, points, (name, view, upward) in zip(axes, projected, VIEWS, strict=True):
        order = np.argsort(points[triangle, 2].mean(axis=1))
        patches = PolyCollection(
            list(points[triangle[order], :2]), array=mean[order], cmap=COLOUR_MAP, edgecolors="face"
        )
        patches.set_clim(**ends)
        patches.set_linewidth(0.2)
        ax.add_collection(patches)
        spots = position @ view.T
        ax.plot(spots[:, 0], spots[:, 1], "o", color=GAUGE_COLOUR, markersize=3.0, label="gauges (seen through)")
        ax.autoscale_view()
        ax.set_aspect("equal")
        ax.set_anchor("W")
        ax.set_title(name, fontsize="small", loc="left")
        if upward:
            ax.set_xlabel("x [m]")
            ax.set_ylabel(upward)
        else:
            ax.set_axis_off()
    figure.colorbar(
        patches, ax=axes, label=with_signs("p/p_inf [1]"), extend=ends_beyond(patches, ratio), aspect=40
    )
    axes[0].legend(loc="upper left", fontsize="small")
    named = zip(snapshots.parameter_names, condition.parameters, strict=True)
    values = "".join(f", {name} {value:g}" for name, value in named)
    figure.suptitle(f"{title}: {replace(condition, parameters=())}{values}", fontsize="medium")
    return figure
