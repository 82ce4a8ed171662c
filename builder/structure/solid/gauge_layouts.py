"""Gauge layouts of a vehicle file for the solid model, which also takes outer gauges and gauge lengths.

Layouts of gauges that are moved or turned a little: their strain shows the effect of placement errors.

The rows of moved gauges are further right-hand sides of the one factorisation, so they cost little.

Gauges on a surface of any mesh: by position, by station and roll angle, by node or by element.
"""

from dataclasses import replace
from functools import cached_property
from math import cos, radians, sin

import numpy as np

from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.gauge_placement import gauge_layout, layout_from_rows
from builder.structure.solid.elements import CurvedFacets, FootPoint, foot_point
from builder.structure.solid.gauge_rows import Gauges, gauges_at, gauges_of_layout
from builder.structure.solid.nodal_loads import triangulated_surface
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SolidMesh
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.gauge_entries import GaugeRow
from builder.vehicle.gauges.layout import GaugeLayout, TableGauge, read_gauge_table
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

SURFACE = {"inner": INTERNAL, "outer": EXTERNAL}


def solid_gauges(vehicle: Vehicle, layout: str, mesh: MeridianMesh) -> Gauges:
    """Return a layout of the vehicle file.

    Rows on the outer surface lie at the stations given, as those on the inner one; their names end in ``_outer``.

    Parameters
    ----------
    vehicle, layout : the file and the name of the layout.
    mesh : a meridian mesh of the wall, on whose inner surface rows are placed.
    """
    entry = vehicle.gauges.layouts[layout]
    if entry.rows is None:
        placed = gauge_layout(entry, vehicle.beside(""), layout, mesh)
        surface = SURFACE[entry.surface or "inner"]
        return gauges_at(placed.position, placed.direction, placed.names, 1e-3 * (entry.length_mm or 0.0), surface)
    where, body = f"gauges.layouts.{layout}", vehicle.body()
    rows = enumerate(entry.rows, start=1)
    return gauges_of_layout(
        [_body_row(row, layout_from_rows([row], mesh, where, n), body) for n, row in rows], where
    )


def _body_row(row: GaugeRow, layout: GaugeLayout, body: BodyOfRevolution) -> Gauges:
    if row.surface == "outer":
        layout = _on_outer_surface(layout, body)
    return gauges_at(layout.position, layout.direction, layout.names, 1e-3 * row.length_mm, SURFACE[row.surface])


def _on_outer_surface(layout: GaugeLayout, body: BodyOfRevolution) -> GaugeLayout:
    """Move gauges outwards at their stations; axial ones lie along the outer meridian."""
    x = layout.position[:, 0]
    roll = np.arctan2(layout.position[:, 1], layout.position[:, 2])
    outwards = np.column_stack([0.0 * x, np.sin(roll), np.cos(roll)])
    angle = body.angle(x)[:, None]
    along = np.cos(angle) * np.array([1.0, 0.0, 0.0]) + np.sin(angle) * outwards
    is_hoop = np.array([name.startswith("hoop") for name in layout.names])[:, None]
    return replace(
        layout,
        names=tuple(f"{name}_outer" for name in layout.names),
        position=x[:, None] * np.array([1.0, 0.0, 0.0]) + body.radius(x)[:, None] * outwards,
        direction=np.where(is_hoop, layout.direction, along),
    )


STEP = 1e-3
"""How far gauges are moved along the surface [m]."""

AFT, FORE, AROUND, BACK = "moved aft", "moved fore", "moved around", "moved back"
TURNED_AROUND, TURNED_BACK = "turned around", "turned back"

DISPLACED = (AFT, FORE, AROUND, BACK, TURNED_AROUND, TURNED_BACK)


def displaced_name(layout: str, how: str) -> str:
    """Return the name of ``layout`` displaced, ``how`` being one of the six ways."""
    return f"{layout} ({how})"


def is_displaced(name: str) -> bool:
    """Return whether a layout's name is one of :func:`displaced_name`."""
    return any(name.endswith(f" ({how})") for how in DISPLACED)


def displaced_gauges(layout: str, gauges: Gauges, body: BodyOfRevolution) -> dict[str, Gauges]:
    """Return ``gauges`` of ``layout``, by name, moved by 1 mm four ways and turned by 45 degrees two ways.

    Aft is along the meridian, around is with the roll angle; directions keep their angle to the meridian. Turning
    is from the meridian towards the roll angle. As strain goes with twice the angle, e(45 deg) - e(-45 deg) is
    exactly its derivative by the angle, where the gauge has no length.
    """
    x, radius = gauges.position[:, 0], np.hypot(gauges.position[:, 1], gauges.position[:, 2])
    roll = np.arctan2(gauges.position[:, 1], gauges.position[:, 2])
    angle, zero = body.angle(x), np.zeros(len(x))
    aft = np.column_stack([np.cos(angle), np.sin(angle) * np.sin(roll), np.sin(angle) * np.cos(roll)])
    around = np.column_stack([zero, np.cos(roll), -np.sin(roll)])
    rolled = {AROUND: _rolled(gauges, STEP / radius), BACK: _rolled(gauges, -STEP / radius)}
    by_name = {displaced_name(layout, how): gauges for how, gauges in rolled.items()}
    return displaced_on_surface(layout, gauges, aft, around) | by_name


def displaced_on_surface(layout: str, gauges: Gauges, aft: FloatArray, around: FloatArray) -> dict[str, Gauges]:
    """Return ``gauges`` displaced as by :func:`displaced_gauges`, on any surface.

    ``aft`` and ``around`` (n, 3) are unit vectors in the surface, along x and towards the roll angle.
    """
    steps = {AFT: STEP * aft, FORE: -STEP * aft, AROUND: STEP * around, BACK: -STEP * around}
    moved = {how: replace(gauges, position=gauges.position + step) for how, step in steps.items()}
    turned = {
        TURNED_AROUND: _turned(gauges, aft, around, 1.0),
        TURNED_BACK: _turned(gauges, aft, around, -1.0),
    }
    return {displaced_name(layout, how): displaced for how, displaced in (moved | turned).items()}


def _rolled(gauges: Gauges, angle: FloatArray) -> Gauges:
    """Return the gauges rolled by their ``angle`` (n,) [rad] round the axis, from +z towards +y."""
    c, s = np.cos(angle), np.sin(angle)

    def turn(vector: FloatArray) -> FloatArray:
        x, y, z = vector.T
        return np.column_stack([x, c * y + s * z, c * z - s * y])

    return replace(gauges, position=turn(gauges.position), direction=turn(gauges.direction))


def _turned(gauges: Gauges, aft: FloatArray, around: FloatArray, sign: float) -> Gauges:
    """Return the gauges with directions turned by 45 degrees in the plane of ``aft`` and ``around`` (n, 3)."""
    along = np.sum(gauges.direction * aft, axis=1, keepdims=True)
    across = np.sum(gauges.direction * around, axis=1, keepdims=True)
    return replace(gauges, direction=(along - sign * across) * aft + (sign * along + across) * around)


LEAST_IN_SURFACE = 0.5
"""Share of a direction's length that must lie in the surface."""
SMALLEST_TANGENT = 0.05
"""Length of the x axis' part in the surface below which there is no x tangent to count an angle from."""


class GaugeSurface:
    """One surface of a mesh, for placing gauges on it."""

    def __init__(self, mesh: SolidMesh, name: str) -> None:
        self.mesh, self.name = mesh, name
        self._facet = mesh.named_surface(name)
        self._curved = CurvedFacets(mesh.element_type, mesh.node[self._facet])

    @cached_property
    def _corners(self) -> FloatArray:
        surface = triangulated_surface(self.mesh, self.name)
        return surface.point[surface.triangle]

    def foot(self, point: FloatArray) -> FootPoint:
        """Return the closest point of the surface."""
        return foot_point(self._curved, point)

    def axes(self, foot: FootPoint, where: str) -> tuple[FloatArray, FloatArray]:
        """Return unit vectors (3,) in the surface: along x, and across it towards increasing roll angle."""
        outward = foot.normal if self.name == EXTERNAL else -foot.normal
        along = np.array([1.0, 0.0, 0.0]) - outward[0] * outward
        size = float(np.linalg.norm(along))
        if size < SMALLEST_TANGENT:
            raise InputError(
                f"{where}: expected a direction as a vector where the surface stands across x, got an angle"
            )
        along /= size
        return along, np.cross(outward, along)

    def at_roll_angle(self, x: float, roll_angle: float, where: str) -> FootPoint:
        """Return the point seen from the axis at ``x`` [m], ``roll_angle`` [rad]; outside the outermost."""
        ray = np.array([0.0, sin(roll_angle), cos(roll_angle)])
        a, b, c = (self._corners[:, k] for k in range(3))
        u, v, normal = b - a, c - a, np.cross(b - a, c - a)
        start = np.array([x, 0.0, 0.0])
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.einsum("ni,ni->n", a - start, normal) / (normal @ ray)
            point = start + t[:, None] * ray
            square = np.einsum("ni,ni->n", normal, normal)
            p = np.einsum("ni,ni->n", np.cross(point - a, v), normal) / square
            q = np.einsum("ni,ni->n", np.cross(u, point - a), normal) / square
            hit = (p >= -1e-9) & (q >= -1e-9) & (p + q <= 1.0 + 1e-9) & (t > 0.0)
        if not hit.any():
            raise InputError(
                f"{where}: expected a station with the {self.name} surface under it, got x = {x:g} m, roll angle "
                f"{np.rad2deg(roll_angle):g} deg"
            )
        distance = float(t[hit].max() if self.name == EXTERNAL else t[hit].min())
        return self.foot(start + distance * ray)


def free_gauges(vehicle: Vehicle, layout: str, mesh: SolidMesh) -> Gauges:
    """Return a layout of the vehicle file on the surfaces of ``mesh``."""
    entry = vehicle.gauges.layouts[layout]
    where = f"gauges.layouts.{layout}"
    if entry.rows is not None:
        wheres = [f"{where}.rows.{i}" for i in range(1, len(entry.rows) + 1)]
        surfaces = {
            row.surface: _surface_of(mesh, row.surface, where_row)
            for row, where_row in zip(entry.rows, wheres, strict=True)
        }
        parts = [
            _mesh_row(row, surfaces[row.surface], where_row)
            for row, where_row in zip(entry.rows, wheres, strict=True)
        ]
        return gauges_of_layout(parts, where)
    assert entry.file is not None
    surface = _surface_of(mesh, entry.surface or "inner", where)
    table = read_gauge_table(vehicle.beside(entry.file))
    placed = [_table_gauge(gauge, surface, 1e-3 * entry.largest_distance_mm) for gauge in table]
    position, direction = (np.array(part) for part in zip(*placed, strict=True))
    length = 1e-3 * (entry.length_mm or 0.0)
    return gauges_at(position, direction, [gauge.name for gauge in table], length, surface.name)


def _surface_of(mesh: SolidMesh, side: str, where: str) -> GaugeSurface:
    """Return the surface on a side of the wall; a body without a cavity has the outer one alone."""
    if side == "inner" and INTERNAL not in mesh.surface:
        raise InputError(f"{where}.surface: expected 'outer' on a mesh without a cavity, got 'inner'")
    return GaugeSurface(mesh, SURFACE[side])


def surface_axes(mesh: SolidMesh, gauges: Gauges) -> tuple[FloatArray, FloatArray]:
    """Return the unit vectors (n, 3) along x and across it in the surface under each gauge."""
    surfaces = {name: GaugeSurface(mesh, name) for name in set(gauges.surface)}
    axes = [
        surfaces[gauges.surface[i]].axes(surfaces[gauges.surface[i]].foot(gauges.position[i]), gauges.name[i])
        for i in range(len(gauges.name))
    ]
    return np.array([along for along, _ in axes]), np.array([across for _, across in axes])


def _mesh_row(row: GaugeRow, surface: GaugeSurface, where: str) -> Gauges:
    """Place a row: axial gauges along the x tangent, hoop gauges across it."""
    feet = [surface.at_roll_angle(x, radians(row.roll_angle_deg), where) for x in row.stations]
    end = "_outer" if row.surface == "outer" else ""
    name, position, direction = [], [], []
    for kind in row.directions:
        for number, foot in enumerate(feet, start=1):
            along, across = surface.axes(foot, where)
            name.append(f"{kind}_{row.roll_angle_deg:g}deg_{number}{end}")
            position.append(foot.point)
            direction.append(along if kind == "axial" else across)
    return gauges_at(np.array(position), np.array(direction), name, 1e-3 * row.length_mm, surface.name)


def _table_gauge(gauge: TableGauge, surface: GaugeSurface, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Return position and direction (3,) of a gauge of a table, on the surface."""
    where, place = f"{gauge.where}, gauge '{gauge.name}'", gauge.place
    if "roll_angle_deg" in place:
        foot = surface.at_roll_angle(place["x_m"], radians(place["roll_angle_deg"]), where)
    else:
        foot = surface.foot(_point(place, surface, where))
        distance = float(np.linalg.norm(foot.offset))
        if distance > tolerance:
            _refuse_far(foot, surface, tolerance, where)
    if "angle_deg" in gauge.direction:
        angle = radians(gauge.direction["angle_deg"])
        along, across = surface.axes(foot, where)
        return foot.point, cos(angle) * along + sin(angle) * across
    vector = np.array(list(gauge.direction.values()))
    flat = vector - (vector @ foot.normal) * foot.normal
    if np.linalg.norm(flat) <= LEAST_IN_SURFACE * np.linalg.norm(vector):
        raise InputError(f"{where}: expected a direction along the surface, got one across it")
    return foot.point, flat / np.linalg.norm(flat)


def _point(place: dict[str, float], surface: GaugeSurface, where: str) -> FloatArray:
    """Return the position (3,) [m] that a table gives."""
    mesh = surface.mesh
    if "x_m" in place:
        return np.array([place["x_m"], place["y_m"], place["z_m"]])
    kind, count = ("node", mesh.n_nodes) if "node" in place else ("element", len(mesh.element))
    number = place[kind]
    if number != int(number) or not 1 <= number <= count:
        raise InputError(f"{where}: {kind}: expected a whole number, 1 .. {count}, got {number:g}")
    if kind == "node":
        return np.asarray(mesh.node[int(number) - 1])
    facet = surface.mesh.named_surface(surface.name)
    faces = np.isin(facet, mesh.element[int(number) - 1]).all(axis=1)
    if not faces.any():
        raise InputError(f"{where}: element: expected one with a face on surface '{surface.name}', got {number:g}")
    return np.asarray(mesh.node[facet[np.flatnonzero(faces)[0]]].mean(axis=0))


def _refuse_far(foot: FootPoint, surface: GaugeSurface, tolerance: float, where: str) -> None:
    """Refuse a gauge that misses its surface, and say on which it lies instead."""
    point = foot.point + foot.offset
    message = (
        f"{where}: expected at most {1e3 * tolerance:g} mm from surface '{surface.name}', got "
        f"{1e3 * np.linalg.norm(foot.offset):.3g} mm at ({', '.join(f'{value:.4g}' for value in point)}) m"
    )
    for side in (EXTERNAL, INTERNAL):
        if side == surface.name or side not in surface.mesh.surface:
            continue
        if np.linalg.norm(GaugeSurface(surface.mesh, side).foot(point).offset) <= tolerance:
            message += f"; it lies on surface '{side}'"
    raise InputError(message)
