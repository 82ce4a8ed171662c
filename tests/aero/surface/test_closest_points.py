"""The closest fitting point of a triangulated surface, against closed forms and brute force."""

from math import radians

import numpy as np
import pytest

from builder.aero.surface.closest_points import closest_on_triangles, closest_points
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.vehicle.shape.geometry import chain_segments, surface_grid

pytestmark = pytest.mark.fast

TRIANGLE = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.mark.parametrize(
    ("point", "closest"),
    [
        ((0.5, 0.25, 3.0), (0.5, 0.25, 0.0)),
        ((1.0, -2.0, 0.0), (1.0, 0.0, 0.0)),
        ((-1.0, 0.5, 1.0), (0.0, 0.5, 0.0)),
        ((-1.0, -1.0, 0.0), (0.0, 0.0, 0.0)),
        ((5.0, 0.0, 1.0), (2.0, 0.0, 0.0)),
        # Beyond the long edge, whose foot is where 2 t (p - b) meets it: p = (2, 2), edge from (2, 0) to (0, 1).
        ((2.0, 2.0, 0.0), (1.2, 0.4, 0.0)),
    ],
    ids=["inside", "edge", "other edge", "corner", "far corner", "long edge"],
)
def test_regions_of_a_triangle(point: tuple[float, ...], closest: tuple[float, ...]) -> None:
    """Inside, edges and corners: feet of perpendiculars by hand."""
    weight, distance = closest_on_triangles(np.array([point]), TRIANGLE[None])
    np.testing.assert_allclose(weight[0] @ TRIANGLE, closest, atol=1e-15)
    assert weight.min() >= 0.0
    assert distance[0] == pytest.approx(np.linalg.norm(np.subtract(point, closest)), rel=1e-14)


def test_triangle_without_area_is_its_edges() -> None:
    sliver = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]])
    weight, distance = closest_on_triangles(np.array([[0.75, 1.0, 0.0]]), sliver)
    np.testing.assert_allclose(weight @ sliver[0], [[0.75, 0.0, 0.0]], atol=1e-15)
    assert distance[0] == pytest.approx(1.0)


def test_search_misses_nothing() -> None:
    """Against all pairs, on triangles with edges from 1e-3 to 1: equal distances."""
    rng = np.random.default_rng(5)
    size = 10.0 ** rng.uniform(-3.0, 0.0, 400)
    corner = rng.normal(size=(400, 1, 3)) + size[:, None, None] * rng.normal(size=(400, 3, 3))
    mesh = SurfaceMesh(corner.reshape(-1, 3), np.arange(1200).reshape(-1, 3))
    point = 2.0 * rng.normal(size=(300, 3))
    found = closest_points(mesh, point, np.zeros((300, 3)))
    owner, triangle = np.divmod(np.arange(300 * 400), 400)
    every = closest_on_triangles(point[owner], corner[triangle])[1].reshape(300, 400).min(axis=1)
    # Without a normal to fit, the nearest is taken: to rounding.
    np.testing.assert_allclose(found.gap, every, rtol=1e-12)
    assert found.fits.all()


@pytest.mark.parametrize("outside", [1.0, -1.0])
def test_thin_plate_keeps_its_sides(outside: float) -> None:
    """Two sides 1 mm apart, target nodes off the source by 2 mm to either side: each finds its own side."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0.0, 0.3, 31), np.linspace(0.0, 0.1, 11)))
    plate = two_sided_plate(31, 11, 1e-3)
    point = np.stack([x, y, np.full_like(x, outside * (0.5e-3 + 2e-3))], axis=1)
    for side in (1.0, -1.0):
        normal = np.zeros_like(point)
        normal[:, 2] = side
        found = closest_points(plate, point, normal)
        assert found.fits.all()
        assert (np.sign(plate.vector_area[found.triangle, 2]) == side).all()
        np.testing.assert_allclose(found.gap, 2e-3 if side == outside else 3e-3, rtol=1e-12)


def test_no_side_fits() -> None:
    """A point that looks along x over a plate finds the nearest triangle, marked as not fitting."""
    found = closest_points(two_sided_plate(5, 5, 0.1), np.array([[0.1, 0.05, 0.2]]), np.array([[1.0, 0.0, 0.0]]))
    assert not found.fits[0]
    assert found.gap[0] == pytest.approx(0.15, rel=1e-12)


def test_slope_break_keeps_its_sides() -> None:
    """Doubled nodes at a break of 4 deg: upstream nodes find triangles ahead of it, downstream ones behind it."""
    body = chain_segments([(1.75, radians(5.0), radians(5.0)), (3.6, radians(1.0), radians(1.0))])
    source, grid = mesh_of_grid(surface_grid(body, 90, 50)), surface_grid(body, 100, 72)
    target = mesh_of_grid(grid)
    found = closest_points(source, target.point, target.node_normal)
    middle = source.point[source.triangle].mean(axis=1)[found.triangle, 0]
    behind = np.repeat(np.arange(len(grid.x)) > int(np.flatnonzero(np.diff(grid.x) == 0.0)[0]), grid.n_roll)
    np.testing.assert_array_equal(middle > 1.75, behind)


def two_sided_plate(n_x: int, n_y: int, thickness: float) -> SurfaceMesh:
    """Return a plate 0.3 m by 0.1 m: upper and lower side, without edges; nodes of the upper side first."""
    x, y = np.meshgrid(np.linspace(0.0, 0.3, n_x), np.linspace(0.0, 0.1, n_y), indexing="ij")
    sides = [np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1) for z in (thickness / 2, -thickness / 2)]
    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(n_x - 1), np.arange(n_y - 1), indexing="ij"))
    a, b, c, d = i * n_y + j, (i + 1) * n_y + j, (i + 1) * n_y + j + 1, i * n_y + j + 1
    upper = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return SurfaceMesh(np.concatenate(sides), np.concatenate([upper, upper[:, ::-1] + x.size]).astype(np.int64))
