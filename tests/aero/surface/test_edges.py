"""Surfaces made fit: closed, outward, doubled at edges."""

from math import pi, radians

import numpy as np
import pytest

from builder.aero.surface.edges import merge_nodes, prepare_surface, split_at_edges, turn_outward
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.errors import InputError
from tests.aero.triangulated_shapes import box, cone, sphere, together

pytestmark = pytest.mark.fast

SHARP = radians(30.0)


def volume(mesh: SurfaceMesh) -> float:
    """Return the enclosed volume [m3] (Gauss)."""
    return float(np.sum(mesh.vector_area * mesh.point[mesh.triangle].mean(axis=1)) / 3.0)


def test_box_gets_three_nodes_at_each_corner() -> None:
    merged = merge_nodes(box((0, 0, 0), (1, 1, 1), (2, 2, 2)), 1e-7)
    assert merged.n_nodes == 26
    split = split_at_edges(merged, SHARP)
    # Six faces of nine nodes, none shared; every node's normal is its face's.
    assert split.n_nodes == 54
    np.testing.assert_allclose(np.abs(split.node_normal).max(axis=1), 1.0, rtol=1e-15)
    assert volume(split) == pytest.approx(1.0, rel=1e-14)


def test_smooth_surface_stays_whole() -> None:
    """A sphere of 384 triangles, 14 deg between neighbours: its nodes stay one each (Euler: m/2 + 2)."""
    split = split_at_edges(sphere(8), SHARP)
    assert split.n_nodes == len(split.triangle) // 2 + 2


def test_tip_of_a_cone_is_split_among_its_triangles() -> None:
    """No edge at the tip is sharp, yet the mean normal there points along the axis: each triangle gets its own."""
    split = split_at_edges(cone(radians(10.0), 48), SHARP)
    assert split.n_nodes == 48 + 48
    # On every node the slope is the cone's, sin(10 deg), up to the chords: (pi/48)^2/2 = 0.2 %.
    np.testing.assert_allclose(-split.node_normal[:, 0], np.sin(radians(10.0)), rtol=3e-3)


def test_base_rim_is_sharp() -> None:
    split = split_at_edges(cone(radians(10.0), 48, closed=True), SHARP)
    base = split.node_normal[:, 0] > 0.9
    np.testing.assert_allclose(split.node_normal[base], np.tile([1.0, 0.0, 0.0], (base.sum(), 1)), atol=1e-15)
    assert base.sum() == 49


def test_triangles_at_random_are_turned_outward() -> None:
    """Two parts, half of the triangles turned over: volumes come out positive, 4 pi/3 and 1."""
    mesh = merge_nodes(together(sphere(20), box((2, 0, 0), (3, 1, 1), (3, 3, 3))), 1e-7)
    over = np.random.default_rng(0).random(len(mesh.triangle)) < 0.5
    mixed = SurfaceMesh(mesh.point, np.where(over[:, None], mesh.triangle[:, ::-1], mesh.triangle))
    outward, turned = turn_outward(mixed)
    np.testing.assert_array_equal(outward.vector_area, mesh.vector_area)
    assert turned == over.sum()
    assert volume(outward) == pytest.approx(4.0 * pi / 3.0 + 1.0, rel=0.01)


def test_open_base_counts_as_closed() -> None:
    """An inward cone without base is turned, and the note says so; the base plane's position does not matter."""
    mesh = cone(radians(10.0), 48)
    inward = SurfaceMesh(mesh.point + np.array([7.0, 0.2, 0.0]), mesh.triangle[:, ::-1])
    prepared, notes = prepare_surface(inward, SHARP)
    assert prepared.vector_area[:, 0].max() < 0.0
    assert notes == ("48 of 48 triangles were turned to face outward",)
    assert prepare_surface(mesh, SHARP)[1] == ()


def test_hole_is_refused() -> None:
    mesh = merge_nodes(sphere(4), 1e-7)
    with pytest.raises(InputError, match=r"3 edges have one triangle only, the first at \(.*half model") as caught:
        prepare_surface(SurfaceMesh(mesh.point, mesh.triangle[1:]), SHARP)
    assert "\n" not in str(caught.value)


def test_edge_of_three_triangles_is_refused() -> None:
    wall = SurfaceMesh(np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.5, -1.0]]), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match="more than two triangles share the edge"):
        prepare_surface(together(box((0, 0, 0), (1, 1, 1)), wall), SHARP)


def test_moebius_strip_is_refused() -> None:
    n = 20
    along = np.linspace(0.0, 2.0 * pi, n + 1)
    rims = []
    for side in (-0.2, 0.2):
        radius = 1.0 + side * np.cos(0.5 * along)
        rims.append(np.stack([radius * np.cos(along), radius * np.sin(along), side * np.sin(0.5 * along)], axis=1))
    i = np.arange(n)
    triangle = np.concatenate(
        [np.stack([i, i + 1, n + 1 + i], axis=1), np.stack([i + 1, n + 2 + i, n + 1 + i], axis=1)]
    )
    with pytest.raises(InputError, match="Moebius"):
        turn_outward(merge_nodes(SurfaceMesh(np.concatenate(rims), triangle), 1e-7))


def test_normals_of_a_fin_stay_on_their_sides() -> None:
    """A fin 4 mm thick: nodes on it look to either side, on its rim outward, none in between."""
    fin = split_at_edges(box((0, -2e-3, 0), (0.3, 2e-3, 0.1), (6, 1, 4)), SHARP)
    np.testing.assert_allclose(np.abs(fin.node_normal).max(axis=1), 1.0, rtol=1e-12)
