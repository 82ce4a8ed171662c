"""What a mapping report measures, and which wrong surface each refusal names."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from builder.aero.mapping_report import MappingReport, MappingTolerances, check_mapping, mapping_report
from builder.aero.pressure_map import pressure_map
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.vehicle.shape.geometry import chain_segments, surface_grid
from strainfmu.errors import InputError
from tests.aero.triangulated_shapes import box

BODY = chain_segments([(1.75, radians(5.0), radians(5.0)), (3.6, radians(1.0), radians(1.0))])


def body(n_x: int = 40, n_roll: int = 48) -> SurfaceMesh:
    return mesh_of_grid(surface_grid(BODY, n_x, n_roll))


def closed(mesh: SurfaceMesh, n_roll: int = 48) -> SurfaceMesh:
    """Return ``mesh`` with its base, a fan whose rim nodes are the last ring's."""
    ring = np.arange(mesh.n_nodes - n_roll, mesh.n_nodes)
    centre = np.array([[BODY.length, 0.0, 0.0]])
    fan = np.stack([np.full(n_roll, mesh.n_nodes), np.roll(ring, -1), ring], axis=1)
    return SurfaceMesh(np.concatenate([mesh.point, centre]), np.concatenate([mesh.triangle, fan]))


def report_of(source: SurfaceMesh, target: SurfaceMesh) -> MappingReport:
    pressure = 1.0 + 5.0 * source.point[:, 2] + 0.3 * source.point[:, 0]
    return mapping_report(pressure_map(source, target), source, target, pressure)


def test_same_mesh_loses_nothing() -> None:
    report = report_of(body(), body())
    np.testing.assert_allclose(
        [report.force_residual, report.moment_residual, report.largest_gap, report.area_mismatch], 0.0, atol=1e-14
    )
    assert report.unfitted_fraction == 0.0
    check_mapping(report, MappingTolerances())


def test_residuals_and_gap_of_a_thicker_body() -> None:
    """A target 1 % thicker: the gap is 1 % of the base radius, a constant's axial force grows as the base area."""
    source = body()
    target = moved(source, np.diag([1.0, 1.01, 1.01]))
    report = mapping_report(pressure_map(source, target), source, target, np.ones(source.n_nodes))
    assert report.largest_gap == pytest.approx(0.01 * BODY.base_radius, rel=1e-3)
    assert report.gap_relative == pytest.approx(0.01 * BODY.base_radius / 3.6, rel=1e-3)
    assert report.largest_gap_point[0] == pytest.approx(3.6)
    polygon = 24 * np.sin(2.0 * np.pi / 48) * BODY.base_radius**2
    assert report.force_residual == pytest.approx(0.0201 * polygon, rel=1e-9)
    assert report.force_residual_relative == pytest.approx(0.0201, rel=1e-9)
    # Lateral area grows by 1 %, less what the slope adds: below 0.01 %.
    assert report.area_mismatch == pytest.approx(1.0 / 1.01 - 1.0, rel=0.01)


def test_meshes_of_other_resolution_pass() -> None:
    check_mapping(report_of(body(60, 72), body(40, 36)), MappingTolerances())


def moved(mesh: SurfaceMesh, matrix: object, shift: object = (0.0, 0.0, 0.0)) -> SurfaceMesh:
    return SurfaceMesh(mesh.point @ np.array(matrix, dtype=float).T + np.array(shift), mesh.triangle)


def half(mesh: SurfaceMesh) -> SurfaceMesh:
    middle = mesh.point[mesh.triangle].mean(axis=1)
    triangle = mesh.triangle[middle[:, 1] > 0.0]
    used, renumbered = np.unique(triangle, return_inverse=True)
    return SurfaceMesh(mesh.point[used], renumbered.reshape(-1, 3))


def cut_at(station: float) -> SurfaceMesh:
    """Return a fine body without its triangles ahead of ``station`` [m]."""
    whole = body(200)
    kept = whole.triangle[(whole.point[whole.triangle, 0] >= station).all(axis=1)]
    used, numbered = np.unique(kept, return_inverse=True)
    return SurfaceMesh(whole.point[used], numbered.reshape(-1, 3))


EYE = np.eye(3)


@pytest.mark.parametrize(
    ("source", "hint"),
    [
        (moved(body(), 1000.0 * EYE), "in mm, scale it by 0.001"),
        (moved(body(), EYE / 0.0254), "in inches, scale it by 0.0254"),
        (moved(body(), EYE / 0.3048), "in feet, scale it by 0.3048"),
        (moved(body(), 1000.0 * EYE[[1, 2, 0]]), "in mm"),
        (moved(body(), EYE[[2, 0, 1]]), "axes are in another order"),
        (moved(body(), np.diag([-1.0, 1.0, -1.0])), "x points the other way"),
        (moved(body(), EYE, (0.25, 0.0, 0.0)), "shifted by 0.25 m along x: body axes start at the nose tip"),
        (cut_at(0.05), "the source begins at x = 0.0[56].* m, the target at 0 m: one of them is cut off there"),
        (half(body()), "half model"),
        (closed(body()), "leave the base out"),
        (SurfaceMesh(body().point, body().triangle[:, ::-1]), "normals point inward"),
        (moved(body(), np.diag([1.0, 1.3, 1.3])), "shapes differ: extents x 3.6 m"),
    ],
    ids=[
        *("mm", "inch", "foot", "mm and axes", "axes", "forward", "nose", "cut", "half", "base", "inward"),
        "other shape",
    ],
)
def test_wrong_surfaces_are_named(source: SurfaceMesh, hint: str) -> None:
    with pytest.raises(InputError, match=f"^mapping: .*{hint}") as caught:
        check_mapping(report_of(source, body(45, 44)), MappingTolerances())
    assert "\n" not in str(caught.value)


def test_missing_base_is_named() -> None:
    with pytest.raises(InputError, match="the base is missing"):
        check_mapping(report_of(body(), closed(body())), replace(MappingTolerances(), gap_relative=1.0))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("gap_relative", "apart at"),
        ("area_mismatch", "areas differ by"),
        ("force_residual_relative", "changes the force by"),
        ("moment_residual_relative", "changes the moment by"),
    ],
)
def test_each_tolerance_refuses(name: str, text: str) -> None:
    """Nothing that differs passes a tolerance of 0; the message gives what is allowed."""
    report = report_of(body(), body(45, 44))
    loose = MappingTolerances(
        gap_relative=1.0,
        area_mismatch=1.0,
        unfitted_fraction=1.0,
        force_residual_relative=1.0,
        moment_residual_relative=1.0,
    )
    check_mapping(report, loose)
    with pytest.raises(InputError, match=f"{text}.*at most 0 % is allowed"):
        check_mapping(report, replace(loose, **{name: 0.0}))


def test_gap_is_found_both_ways() -> None:
    """A source with a box that stands 0.14 m proud: no target node is far from it, its own nodes are."""
    target = body()
    proud = box([3.0, -0.002, 0.15], [3.5, 0.002, BODY.base_radius + 0.14], (6, 2, 4))
    source = SurfaceMesh(
        np.concatenate([target.point, proud.point]),
        np.concatenate([target.triangle, proud.triangle + target.n_nodes]),
    )
    report = report_of(source, target)
    # The outermost nodes, on 0.1 % of the area, do not count.
    assert report.largest_gap == pytest.approx(0.14 + BODY.base_radius - BODY.radius(3.0), abs=2e-3)
    assert report.largest_gap_point[2] > BODY.base_radius + 0.13


def test_unfit_nodes_count_by_their_area() -> None:
    """The front of a cut tip faces ahead, where no source does: many nodes there are hardly any area."""
    source = body()
    ring = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    front = [np.column_stack([0.0 * ring, r * np.sin(ring), r * np.cos(ring)]) for r in (1e-5, 2e-5)]
    here, after = np.arange(48), np.roll(np.arange(48), -1)
    cap = np.concatenate(
        [np.stack([here, here + 48, after + 48], axis=1), np.stack([here, after + 48, after], axis=1)]
    )
    target = SurfaceMesh(
        np.concatenate([source.point, *front]), np.concatenate([source.triangle, cap[:, ::-1] + source.n_nodes])
    )
    assert report_of(source, target).unfitted_fraction < 1e-6
