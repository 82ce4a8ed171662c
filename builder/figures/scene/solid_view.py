"""A scene as a still: two oblique views with light and shadow, drawn from back to front without any display."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from builder.figures.drawing.canvas import COLOUR_MAP, blank_figure
from builder.figures.drawing.colours import colour_ends, ends_beyond
from builder.figures.drawing.words import with_signs
from builder.figures.scene.free_shape import turned
from builder.figures.scene.scene import BOX_SIDES, STATE_COLOURS, Scene
from strainfmu.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VIEWS = (
    ("from port, behind and above", turned(np.deg2rad(32.0), np.deg2rad(28.0))),
    ("from starboard, behind and below", turned(np.deg2rad(180.0 - 32.0), np.deg2rad(-28.0))),
)
"""Name, and rows that point right, up and at the viewer."""
_LIGHT = np.array([-0.35, 0.6, 0.72])
"""Where the light is from: left, above, ahead of the picture."""
_SHADE = 0.6
"""Brightness where no light falls."""
_INSIDE = 0.75
"""Grey of faces seen from inside an open end: the pressure acts on their other side."""


def solid_view(scene: Scene) -> Figure:
    """Draw the scene from two sides; gauges on the far side do not show."""
    projected = [(scene.surface.point - scene.surface.point.mean(axis=0)) @ view.T for _, view in VIEWS]
    wide = max(float(np.ptp(points[:, 0])) for points in projected)
    tall = [max(float(np.ptp(points[:, 1])), 0.15 * wide) for points in projected]
    figure = blank_figure(9.0, min(12.0, 1.6 + 8.0 * sum(tall) / wide))
    axes = figure.subplots(len(VIEWS), 1, height_ratios=tall)
    for axis, (name, view) in zip(axes, VIEWS, strict=True):
        colours = _draw(axis, scene, view)
        axis.autoscale_view()
        axis.set_aspect("equal")
        axis.set_axis_off()
        axis.set_title(name, fontsize="small", loc="left")
    figure.colorbar(
        colours, ax=axes, label=with_signs(scene.label), extend=ends_beyond(colours, scene.values), aspect=30
    )
    _legend(axes[0], scene)
    figure.suptitle(scene.title, fontsize="medium")
    return figure


def _draw(axis: Any, scene: Scene, view: FloatArray) -> Any:
    """Draw surface and bars as seen along the last row of ``view``; return what a colour bar describes."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import Normalize

    surface = scene.surface
    ends = colour_ends(surface, scene.values)
    colours = ScalarMappable(Normalize(ends["vmin"], ends["vmax"]), colormaps[COLOUR_MAP])
    mean = scene.values[surface.triangle].mean(axis=1)
    normal = surface.vector_area / np.maximum(surface.area, 1e-300)[:, None]
    point = surface.point @ view.T
    order = np.argsort(point[surface.triangle, 2].mean(axis=1))
    faces = point[surface.triangle[order], :2]
    to_viewer = normal[order] @ view.T
    is_outside = to_viewer[:, 2:] >= 0.0
    paint = _lit(np.where(is_outside, colours.to_rgba(mean)[order, :3], _INSIDE), to_viewer)
    axis.add_collection(PolyCollection(list(faces), facecolors=paint, edgecolors=paint, linewidths=0.3))
    corners = scene.bar_points @ view.T
    outward = scene.frame[:, 2] / np.linalg.norm(scene.frame[:, 2], axis=1, keepdims=True)
    facing = (outward @ view.T)[:, 2] > 0.05
    hidden = np.array(
        [facing[g] and _covered(point, surface.triangle, corners[g].mean(axis=0)) for g in range(len(facing))]
    )
    sides, paints = [], []
    for g in np.flatnonzero(facing & ~hidden):
        box = corners[g][BOX_SIDES]
        out = np.cross(box[:, 1] - box[:, 0], box[:, 2] - box[:, 0])
        out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)
        towards = out[:, 2] > 0.0
        sides += list(box[towards][:, :, :2])
        paints += list(_lit(np.tile(STATE_COLOURS[scene.states[g]], (int(towards.sum()), 1)), out[towards]))
    if sides:
        axis.add_collection(PolyCollection(sides, facecolors=paints, edgecolors="white", linewidths=0.15))
    return colours


def _lit(colour: FloatArray, normal: FloatArray) -> FloatArray:
    """Return colours (n, 3) in the light that falls on faces of unit normal (n, 3), axes of the picture."""
    facing = np.where(normal[:, 2:] < 0.0, -normal, normal)
    light = np.clip(facing @ (_LIGHT / np.linalg.norm(_LIGHT)), 0.0, 1.0)
    lit: FloatArray = np.asarray(colour) * (_SHADE + (1.0 - _SHADE) * light)[:, None]
    return lit


def _covered(point: FloatArray, triangle: Any, place: FloatArray) -> bool:
    """Return whether a triangle lies between ``at`` (3,) and the viewer, axes of the picture."""
    a, b, c = (point[triangle[:, k]] for k in range(3))

    def cross(p: FloatArray, q: FloatArray) -> FloatArray:
        side: FloatArray = (q[:, 0] - p[:, 0]) * (place[1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (place[0] - p[:, 0])
        return side

    u, v, w = cross(b, c), cross(c, a), cross(a, b)
    inside = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
    total = u + v + w
    inside &= np.abs(total) > 0.0
    if not inside.any():
        return False
    depth = (u * a[:, 2] + v * b[:, 2] + w * c[:, 2])[inside] / total[inside]
    return bool(depth.max() > place[2] + 1e-3 * float(np.ptp(point[:, 2])))


def _legend(axis: Any, scene: Scene) -> None:
    from matplotlib.patches import Patch

    handles = [
        Patch(color=STATE_COLOURS[state], label=f"{state}, {scene.states.count(state)}")
        for state in STATE_COLOURS
        if state in scene.states
    ]
    axis.legend(handles=handles, loc="lower left", fontsize="small", title="gauges", title_fontsize="small")
