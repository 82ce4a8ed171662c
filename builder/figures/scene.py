"""The vehicle in three dimensions: its surface with values at the nodes, and gauges as bars on the outside.

A vehicle of any shape: its surface from above, from the side and obliquely, with pressure and gauges.

A scene as a still: two oblique views with light and shadow, drawn from back to front without any display.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.aero.surface.closest_points import closest_points
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots
from builder.figures.drawing import COLOUR_MAP, blank_figure, colour_ends, ends_beyond, gauge_kinds, with_signs
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
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


MARK_LENGTH = 0.02
"""Of a bar, over the vehicle's extent; a quarter as wide, a tenth as high."""
EXCLUDED = "excluded"
STATE_COLOURS = {
    "axial": (0.12, 0.47, 0.71),
    "hoop": (0.84, 0.15, 0.16),
    "inclined": (0.17, 0.63, 0.17),
    EXCLUDED: (0.0, 0.0, 0.0),
}
"""Red, green and blue of each state of a gauge [1], as matplotlib's tab:blue, tab:red, tab:green and black."""

BOX = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
"""Corners of a box of size 1."""
BOX_SIDES: IntArray = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], dtype=np.int64
)
"""Its sides, anticlockwise seen from outside."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """What is shown.

    Attributes
    ----------
    title : in words.
    surface : the outer surface, body axes [m].
    values : (n,) at its nodes.
    label : what they are, with their unit.
    gauge_names : n_g names.
    states : n_g kinds of gauge, or :data:`EXCLUDED`.
    frame : (n_g, 3, 3) rows along each gauge's bar, across it and outwards, as long as the bar is [m].
    place : (n_g, 3) middle of each bar [m].
    """

    title: str
    surface: SurfaceMesh
    values: FloatArray
    label: str
    gauge_names: tuple[str, ...]
    states: tuple[str, ...]
    frame: FloatArray
    place: FloatArray

    @property
    def bar_points(self) -> FloatArray:
        """(n_g, 8, 3) corners of the bars [m]."""
        return self.place[:, None] + np.einsum("pi,gij->gpj", BOX, self.frame)

    def with_bars(self) -> tuple[SurfaceMesh, FloatArray, FloatArray]:
        """Return surface and bars in one mesh, (n,) values, NaN at bars, and (n,) number of the gauge, else -1."""
        n_g, first = len(self.gauge_names), self.surface.n_nodes
        triangle = np.concatenate([BOX_SIDES[:, [0, 1, 2]], BOX_SIDES[:, [0, 2, 3]]])
        bars = first + 8 * np.arange(n_g)[:, None, None] + triangle
        mesh = SurfaceMesh(
            np.concatenate([self.surface.point, self.bar_points.reshape(-1, 3)]),
            np.concatenate([self.surface.triangle, bars.reshape(-1, 3)]),
        )
        values = np.concatenate([self.values, np.full(8 * n_g, np.nan)])
        return mesh, values, np.concatenate([np.full(first, -1.0), np.repeat(np.arange(n_g, dtype=float), 8)])


def scene_of(
    surface: SurfaceMesh,
    values: FloatArray,
    label: str,
    inverse_map: InverseMap,
    title: str,
    excluded: Collection[str] = (),
) -> Scene:
    """Return the scene of a surface with the strain gauges of a map; other sensors are left out.

    Raises
    ------
    InputError
        ``excluded`` names no gauge of the map.
    """
    shown = inverse_map.sensors.is_strain
    names = tuple(name for name, is_shown in zip(inverse_map.gauge_names, shown, strict=True) if is_shown)
    for name in excluded:
        if name not in names:
            raise InputError(f"excluded: expected gauges of the map, {names[0]} and so on, got '{name}'")
    position, direction = inverse_map.gauge_position[shown], inverse_map.gauge_direction[shown]
    states = np.full(len(names), EXCLUDED, dtype=object)
    for kind, chosen in gauge_kinds(position, direction).items():
        states[chosen] = kind
    states[[name in excluded for name in names]] = EXCLUDED
    foot, frame = _bars(surface, position, direction)
    return Scene(
        title=title,
        surface=surface,
        values=values,
        label=label,
        gauge_names=names,
        states=tuple(states.tolist()),
        frame=frame,
        place=foot,
    )


def scene_of_snapshot(
    snapshots: Snapshots,
    inverse_map: InverseMap,
    title: str,
    row: int | None = None,
    excluded: Collection[str] = (),
) -> Scene:
    """Return the scene of p/p_inf of one snapshot, by default of largest incidence.

    Raises
    ------
    InputError
        There is no such snapshot, it is of another vehicle than the map, or ``excluded`` names no gauge.
    """
    of_map, of_flow = (inverse_map.reference_area, inverse_map.reference_length), snapshots.reference[:2]
    if not np.allclose(of_flow, of_map, rtol=1e-6, atol=0.0):
        raise InputError(
            f"snapshots: expected flows of the map's vehicle, with reference area {of_map[0]:.6g} m2 and length "
            f"{of_map[1]:.6g} m, got {of_flow[0]:.6g} m2 and {of_flow[1]:.6g} m"
        )
    count = len(snapshots.pressure)
    chosen = int(np.argmax(snapshots.total_incidence)) if row is None else row
    if not 0 <= chosen < count:
        raise InputError(f"case: expected 1 to {count}, got {chosen + 1}")
    condition = snapshots.conditions()[chosen]
    ratio = snapshots.pressure[chosen] / condition.ambient_pressure
    named = zip(snapshots.parameter_names, condition.parameters, strict=True)
    values = "".join(f", {name} {value:g}" for name, value in named)
    text = f"{title}: {replace(condition, parameters=())}{values}"
    return scene_of(snapshots.surface, ratio, "p/p_inf [1]", inverse_map, text, excluded)


def _bars(surface: SurfaceMesh, position: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return middles (n_g, 3) of bars on the surface at the points closest to the gauges, and their frames."""
    extent = float(np.ptp(surface.point, axis=0).max())
    closest = closest_points(surface, position, np.zeros_like(position))
    corner = surface.triangle[closest.triangle]
    foot = np.einsum("gk,gki->gi", closest.weight, surface.point[corner])
    outward = surface.vector_area[closest.triangle]
    outward = outward / np.linalg.norm(outward, axis=1, keepdims=True)
    along = direction - np.einsum("gi,gi->g", direction, outward)[:, None] * outward
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    length = MARK_LENGTH * extent
    frame = np.stack([along, 0.25 * np.cross(outward, along), 0.1 * outward], axis=1) * length
    return foot + 0.5 * frame[:, 2], frame


OBLIQUE_VIEWS = (
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
    projected = [(scene.surface.point - scene.surface.point.mean(axis=0)) @ view.T for _, view in OBLIQUE_VIEWS]
    wide = max(float(np.ptp(points[:, 0])) for points in projected)
    tall = [max(float(np.ptp(points[:, 1])), 0.15 * wide) for points in projected]
    figure = blank_figure(9.0, min(12.0, 1.6 + 8.0 * sum(tall) / wide))
    axes = figure.subplots(len(OBLIQUE_VIEWS), 1, height_ratios=tall)
    for axis, (name, view) in zip(axes, OBLIQUE_VIEWS, strict=True):
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
    triangles, slack = point[surface.triangle], 1e-3 * float(np.ptp(point[:, 2]))
    low, high = triangles[:, :, :2].min(axis=1), triangles[:, :, :2].max(axis=1)
    sides, paints = [], []
    for g in np.flatnonzero(facing):
        middle = corners[g].mean(axis=0)
        about = ((low <= middle[:2]) & (high >= middle[:2])).all(axis=1)
        if _covered(triangles[about], middle, slack):
            continue
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


def _covered(triangles: FloatArray, place: FloatArray, slack: float) -> bool:
    """Return whether one of ``triangles`` (n, 3, 3) lies between ``place`` (3,) and the viewer, by more than
    ``slack``; axes of the picture [m]."""
    corner, next_corner = np.roll(triangles, -1, axis=1), np.roll(triangles, -2, axis=1)
    side, away = next_corner[:, :, :2] - corner[:, :, :2], place[:2] - corner[:, :, :2]
    weight = side[:, :, 0] * away[:, :, 1] - side[:, :, 1] * away[:, :, 0]
    total = weight.sum(axis=1)
    inside = ((weight >= 0.0).all(axis=1) | (weight <= 0.0).all(axis=1)) & (total != 0.0)
    depth = np.sum(weight * triangles[:, :, 2], axis=1)[inside] / total[inside]
    return bool((depth > place[2] + slack).any())


def _legend(axis: Any, scene: Scene) -> None:
    from matplotlib.patches import Patch

    handles = [
        Patch(color=STATE_COLOURS[state], label=f"{state}, {scene.states.count(state)}")
        for state in STATE_COLOURS
        if state in scene.states
    ]
    axis.legend(handles=handles, loc="lower left", fontsize="small", title="gauges", title_fontsize="small")
