"""The vehicle in three dimensions: its surface with values at the nodes, and gauges as bars on the outside."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from builder.aero.surface.closest_points import closest_points
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots
from builder.figures.drawing.gauge_marks import gauge_kinds
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap

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
