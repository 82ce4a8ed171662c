"""Quality of a mapping: how well two surfaces agree, what a transfer loses, and when it is refused."""

from dataclasses import dataclass

import numpy as np

from builder.aero.pressure_map import PressureMap
from builder.aero.surface.closest_points import closest_points
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

MIN_LOAD = 0.01
"""Fraction of the integral of |p| dS below which a force is a difference of large numbers, not a measure."""
NEGLIGIBLE_AREA = 1e-3
"""Fraction of the source's area on which a distance from the target is not looked at."""
OPEN_SURFACE = 1e-6
"""A surface is open if its vector areas sum to more than this fraction of its area."""


@dataclass(frozen=True, eq=False, kw_only=True)
class MappingReport:
    """What the consistent transfer of a pressure loses, and how far the surfaces are apart.

    Forces are in the pressure's unit times m2, moments times m3. The load's size is |F| of the source, but at
    least 1 % of the integral of |p| dS.

    Attributes
    ----------
    force_residual, moment_residual : largest over the fields, of consistently mapped loads less the source's.
    force_residual_relative : largest ratio to the load's size.
    moment_residual_relative : the same, to the load's size times ``length``.
    largest_gap : from a node of one surface to the other, both ways [m].
    largest_gap_point : (3,) that node [m].
    length : the largest extent of the target [m].
    area_mismatch : source area over target area, less 1.
    unfitted_fraction : fraction of the target's area whose nodes have no source triangle within 60 deg of their
        normal nearby.
    source_box, target_box : (2, 3) minimum and maximum coordinates [m].
    source_centre, target_centre : (3,) centroids of the surfaces [m].
    source_closed, target_closed : the surface has no opening.
    """

    force_residual: float
    force_residual_relative: float
    moment_residual: float
    moment_residual_relative: float
    largest_gap: float
    largest_gap_point: FloatArray
    length: float
    area_mismatch: float
    unfitted_fraction: float
    source_box: FloatArray
    target_box: FloatArray
    source_centre: FloatArray
    target_centre: FloatArray
    source_closed: bool
    target_closed: bool

    @property
    def gap_relative(self) -> float:
        """Largest gap over the target's length."""
        return self.largest_gap / self.length


@dataclass(frozen=True, kw_only=True)
class MappingTolerances:
    """The limits of :func:`check_mapping`.

    The defaults are four to ten times the values of meshes of one body that differ in resolution alone, and well
    below the values of a wrong surface. Measured on the shipped vehicle with Newtonian pressure, M 5 to 7, 0 to 10
    deg, between meshes of 36 to 144 nodes round the body and 36 to 280 along it: gap at most 0.02 % of the length
    (a chord of 36), area 0.12 %, force 0.6 %, moment 0.05 %, no node without a fitting triangle.

    Attributes
    ----------
    gap_relative : largest gap over length.
    area_mismatch : relative, either sign.
    unfitted_fraction : fraction of the target's area.
    force_residual_relative, moment_residual_relative : of the consistent transfer; the conservative one has none.
    """

    gap_relative: float = 2e-3
    area_mismatch: float = 0.02
    unfitted_fraction: float = 0.01
    force_residual_relative: float = 0.02
    moment_residual_relative: float = 5e-3


@dataclass(frozen=True, eq=False)
class SurfaceGap:
    """The largest distance between two surfaces, from a node of one to the other, both ways.

    Attributes
    ----------
    size : [m].
    point : (3,) the node [m].
    """

    size: float
    point: FloatArray


def mapping_report(
    transfer: PressureMap,
    source: SurfaceMesh,
    target: SurfaceMesh,
    pressure: FloatArray,
    gap: SurfaceGap | None = None,
) -> MappingReport:
    """Measure ``transfer``, made from ``source`` to ``target``, with net ``pressure`` (..., n_source).

    ``gap`` is :func:`surface_gap` of the same three, where it is known.
    """
    fields = pressure.reshape(-1, source.n_nodes)
    source_loads = fields @ transfer.source_loads.T
    lost = np.abs(transfer.consistent(fields) @ transfer.target_loads.T - source_loads)
    force, moment = np.linalg.norm(lost[:, :3], axis=1), np.linalg.norm(lost[:, 3:], axis=1)
    length = float(np.ptp(target.point, axis=0).max())
    size = np.maximum(np.linalg.norm(source_loads[:, :3], axis=1), MIN_LOAD * np.abs(fields) @ source.node_area)
    size = np.where(size > 0.0, size, 1.0)
    gap = surface_gap(transfer, source, target) if gap is None else gap
    return MappingReport(
        force_residual=float(force.max()),
        force_residual_relative=float((force / size).max()),
        moment_residual=float(moment.max()),
        moment_residual_relative=float((moment / size).max()) / length,
        largest_gap=gap.size,
        largest_gap_point=gap.point,
        length=length,
        area_mismatch=float(source.area.sum() / target.area.sum()) - 1.0,
        unfitted_fraction=float(target.node_area[~transfer.closest.fits].sum() / target.area.sum()),
        source_box=_box(source),
        target_box=_box(target),
        source_centre=_centre(source),
        target_centre=_centre(target),
        source_closed=_is_closed(source),
        target_closed=_is_closed(target),
    )


def surface_gap(transfer: PressureMap, source: SurfaceMesh, target: SurfaceMesh) -> SurfaceGap:
    """Return the largest gap between the surfaces of ``transfer``.

    The source may stand proud of the target, as a fin that the target lacks: target nodes alone do not show it.
    """
    back = closest_points(target, source.point, np.zeros_like(source.point))
    # Of the source's nodes those on hardly any area are left out: the target's tip may be cut.
    order = np.argsort(-back.gap, kind="stable")
    relevant = np.cumsum(source.node_area[order]) > NEGLIGIBLE_AREA * source.area.sum()
    target_node, source_node = int(np.argmax(transfer.closest.gap)), int(order[np.argmax(relevant)])
    if back.gap[source_node] > transfer.closest.gap[target_node]:
        return SurfaceGap(float(back.gap[source_node]), source.point[source_node])
    return SurfaceGap(float(transfer.closest.gap[target_node]), target.point[target_node])


def _box(mesh: SurfaceMesh) -> FloatArray:
    return np.stack([mesh.point.min(axis=0), mesh.point.max(axis=0)])


def _centre(mesh: SurfaceMesh) -> FloatArray:
    middle = mesh.point[mesh.triangle].mean(axis=1)
    centre: FloatArray = mesh.area @ middle / mesh.area.sum()
    return centre


def _is_closed(mesh: SurfaceMesh) -> bool:
    return bool(np.linalg.norm(mesh.vector_area.sum(axis=0)) <= OPEN_SURFACE * mesh.area.sum())


def check_mapping(report: MappingReport, tolerances: MappingTolerances) -> None:
    """Refuse a mapping that is worse than allowed.

    Raises
    ------
    InputError
        Names what is too large, what is allowed, where it is, and what was probably meant.
    """
    where = "(" + ", ".join(f"{value:.4g}" for value in report.largest_gap_point) + ") m"
    checks = (
        (
            report.gap_relative,
            tolerances.gap_relative,
            f"the surfaces are {report.largest_gap:.3g} m apart at {where}, {{}} of the length",
        ),
        (abs(report.area_mismatch), tolerances.area_mismatch, "the surfaces' areas differ by {}"),
        (
            report.unfitted_fraction,
            tolerances.unfitted_fraction,
            "on {} of the area no triangle of the source faces the target's way",
        ),
        (
            report.force_residual_relative,
            tolerances.force_residual_relative,
            "interpolation changes the force by {}",
        ),
        (
            report.moment_residual_relative,
            tolerances.moment_residual_relative,
            "interpolation changes the moment by {} of force times length",
        ),
    )
    for value, allowed, text in checks:
        if not value <= allowed:
            loss = text.format(f"{100 * value:.3g} %")
            raise InputError(f"mapping: {loss}, at most {100 * allowed:.3g} % is allowed; {likely_cause(report)}")
    if report.source_closed and not report.target_closed:
        raise InputError(f"mapping: {_BASE_INCLUDED}")


_SCALES = ((1000.0, "mm"), (100.0, "cm"), (1.0 / 0.0254, "inches"), (1.0 / 0.3048, "feet"), (1e-3, "km"))
_AXES = "xyz"
_BASE_INCLUDED = "the source is closed and the target open: leave the base out of the source"
_SAME_SIZE = 0.03
_SAME_PLACE = 1e-3


def likely_cause(report: MappingReport) -> str:
    """Return, from the bounding boxes, what most likely makes the two surfaces differ."""
    source, target = np.ptp(report.source_box, axis=0), np.ptp(report.target_box, axis=0)
    if _same_size(source, target):
        return _cause_of_place(report)
    axis = int(np.argmax(np.sort(target)))
    ratio = float(np.sort(source)[axis] / np.sort(target)[axis])
    for scale, unit in _SCALES:
        if abs(ratio / scale - 1.0) < _SAME_SIZE and _same_size(np.sort(source) / scale, np.sort(target)):
            return f"the source is {ratio:.4g} times as large: it is in {unit}, scale it by {1.0 / scale:.6g}"
    if _same_size(np.sort(source), np.sort(target)):
        pairs = [f"{_AXES[i]} {source[i]:.3g} m (expected {target[i]:.3g} m)" for i in range(3)]
        return f"the axes are in another order: extents {', '.join(pairs)}; body axes are x aft, y starboard, z up"
    for i in range(3):
        axes = [k for k in range(3) if k != i]
        if _same_size(source[axes], target[axes]) and abs(2.0 * source[i] / target[i] - 1.0) < _SAME_SIZE:
            return f"the source is half as wide along {_AXES[i]}: a half model, mirror it first"
    pairs = [f"{_AXES[i]} {source[i]:.4g} m (expected {target[i]:.4g} m)" for i in range(3)]
    return f"the shapes differ: extents {', '.join(pairs)}"


def _cause_of_place(report: MappingReport) -> str:
    """Return why surfaces of the same extents do not coincide."""
    ends = report.source_box - report.target_box
    room = _SAME_PLACE * report.length
    extent = np.ptp(report.target_box, axis=0)
    of_source = (report.source_centre - report.source_box[0]) / extent
    of_target = (report.target_centre - report.target_box[0]) / extent
    for i in range(3):
        mirrored = abs(of_source[i] + of_target[i] - 1.0) < _SAME_SIZE
        if mirrored and abs(of_source[i] - of_target[i]) > _SAME_SIZE:
            return f"{_AXES[i]} points the other way: body axes are x aft, y starboard, z up"
    end, i = divmod(int(np.argmax(np.abs(ends))), len(_AXES))
    if abs(ends[end, i]) > room:
        if abs(ends[1, i] - ends[0, i]) <= room:
            shift = f"{ends[end, i]:.4g} m along {_AXES[i]}"
            return f"the source is shifted by {shift}: body axes start at the nose tip"
        place = f"{_AXES[i]} = {report.source_box[end, i]:.4g} m, the target at {report.target_box[end, i]:.4g} m"
        return f"the source {('begins', 'ends')[end]} at {place}: one of them is cut off there or has a part more"
    if report.source_closed and not report.target_closed:
        return _BASE_INCLUDED
    if report.target_closed and not report.source_closed:
        return "the source is open and the target closed: the base is missing"
    if report.unfitted_fraction > 0.5:
        return "the source's normals point inward: turn its triangles over"
    return (
        "the extents agree, so the shapes differ in between, a part is missing or extra, or one of the meshes is "
        "too coarse (structure.resolution, or surface nodes of resolution.map)"
    )


def _same_size(a: FloatArray, b: FloatArray) -> bool:
    return bool(np.all(np.abs(a - b) <= _SAME_SIZE * np.maximum(b, 1e-3 * b.max())))
