"""Transfer of pressure and forces between surfaces of one body, against closed forms."""

from math import pi, radians

import numpy as np
import pytest

from builder.aero.cfd.surface_transfer import reconstruct
from builder.aero.pressure_map import (
    consistent_map,
    nodal_force_operator,
    pressure_map,
)
from builder.aero.surface.mesh import SurfaceMesh, mesh_load_operator, mesh_of_grid, roll_moment_operator
from builder.vehicle.shape.geometry import chain_segments, surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from tests.aero.triangulated_shapes import box

pytestmark = pytest.mark.fast

BODY = chain_segments([(1.75, radians(5.0), radians(5.0)), (3.6, radians(1.0), radians(1.0))])


def body(n_x: int, n_roll: int) -> SurfaceMesh:
    return mesh_of_grid(surface_grid(BODY, n_x, n_roll))


def plane(n: int, seed: int) -> SurfaceMesh:
    """Return the unit square in the xy-plane; inner nodes moved at random, so that no two meshes are alike."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, n), indexing="ij")
    inner = ((x > 0.0) & (x < 1.0) & (y > 0.0) & (y < 1.0)).ravel()
    point = np.stack([x.ravel(), y.ravel(), np.zeros(n * n)], axis=1)
    point[inner, :2] += np.random.default_rng(seed).uniform(-0.2, 0.2, (inner.sum(), 2)) / n
    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij"))
    a, b, c, d = i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1, i * n + j + 1
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return SurfaceMesh(point, triangles.astype(np.int64))


def force_and_moment(mesh: SurfaceMesh, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return total force and total moment about the origin of nodal forces (3 n,)."""
    at_node = force.reshape(-1, 3)
    return at_node.sum(axis=0), np.cross(mesh.point, at_node).sum(axis=0)


def test_constant_is_kept_between_unrelated_meshes() -> None:
    source, target = body(40, 36), body(61, 50)
    rows = consistent_map(source, target.point, target.node_normal)
    # To rounding: a row's three weights sum to 1.
    np.testing.assert_allclose(rows @ np.full(source.n_nodes, 7.0), 7.0, rtol=1e-15)
    assert rows.min() >= 0.0


def test_linear_field_on_a_plane_is_exact() -> None:
    """Pressure linear over each triangle holds a linear field exactly: 1e-14."""
    source, target = plane(9, 1), plane(14, 2)
    rows = consistent_map(source, target.point, target.node_normal)
    field = 3.0 + source.point @ [2.0, -1.5, 0.0]
    np.testing.assert_allclose(rows @ field, 3.0 + target.point @ [2.0, -1.5, 0.0], rtol=1e-14)


def test_values_in_cells_map_linear_fields() -> None:
    """First-order reconstruction in between: a field linear over a plane comes through, away from its rim."""
    source, target = plane(15, 1), plane(10, 2)
    slope = np.array([2.0, -1.5, 0.0])
    middle = source.point[source.triangle].mean(axis=1)
    linear, values = reconstruct(source, np.arange(len(source.triangle)), 3.0 + middle @ slope)
    mapped = consistent_map(linear, target.point, target.node_normal) @ values
    inner = np.abs(target.point[:, :2] - 0.5).max(axis=1) < 0.35
    # The limiter may hold a corner back where neighbours are on one side only: 1 % of the range (3.5).
    np.testing.assert_allclose(mapped[inner], (3.0 + target.point @ slope)[inner], atol=0.035)


def test_error_falls_with_the_square_of_the_mesh() -> None:
    """cos(phi) round the aft body: a chord errs by h^2/8 at most, h the angle between nodes; twice as fine, 1/4.

    (Towards a tip, trapezoids cut in two add an error of their own unless stations are refined with roll angles.)
    """
    target = body(61, 50)
    aft = target.point[:, 0] > BODY.slope_breaks[0]
    wanted = np.cos(np.arctan2(target.point[:, 1], target.point[:, 2]))
    errors = []
    for n_roll in (36, 72):
        source = body(80, n_roll)
        rows = consistent_map(source, target.point, target.node_normal)
        field = np.cos(np.arctan2(source.point[:, 1], source.point[:, 2]))
        errors.append(np.abs(rows @ field - wanted)[aft].max())
    assert errors[0] < (2.0 * pi / 36) ** 2 / 8.0 * 1.05
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_jump_at_a_slope_break_is_kept() -> None:
    """Pressure 3 ahead of the break, 1 behind it: no target node, doubled or not, takes a value in between."""
    source, grid = body(90, 50), surface_grid(BODY, 100, 72)
    target = mesh_of_grid(grid)
    fore = int(np.flatnonzero(np.diff(surface_grid(BODY, 90, 50).x) == 0.0)[0])
    jump = np.where(np.arange(source.n_nodes) // 50 <= fore, 3.0, 1.0)
    mapped = consistent_map(source, target.point, target.node_normal) @ jump
    break_node = int(np.flatnonzero(np.diff(grid.x) == 0.0)[0])
    wanted = np.where(np.arange(target.n_nodes) // 72 <= break_node, 3.0, 1.0)
    np.testing.assert_allclose(mapped, wanted, rtol=1e-15)


def test_nodal_forces_are_those_of_the_pressure() -> None:
    """Sum and moment of the nodal forces against the load operator: equal integrals, 1e-13."""
    mesh, x_ref = body(40, 36), 2.0
    pressure = np.random.default_rng(0).normal(size=mesh.n_nodes)
    force, _ = force_and_moment(mesh, nodal_force_operator(mesh) @ pressure)
    arm = SurfaceMesh(mesh.point - [x_ref, 0.0, 0.0], mesh.triangle)
    _, moment = force_and_moment(arm, nodal_force_operator(mesh) @ pressure)
    loads = mesh_load_operator(mesh, x_ref) @ pressure
    np.testing.assert_allclose(loads, [force[0], force[2], force[1], moment[1], -moment[2]], atol=1e-13)


def pressure_field(mesh: SurfaceMesh) -> FloatArray:
    """Return a pressure with windward side and an axial gradient."""
    roll = np.arctan2(mesh.point[:, 1], mesh.point[:, 2])
    return 1.0 + 0.8 * np.cos(roll - 0.4) ** 2 - 0.2 * mesh.point[:, 0]


def test_conservative_pressure_has_the_loads_of_the_source() -> None:
    """Five loads to 1e-13 of their size, where interpolation alone loses 0.1 % of the axial force and more."""
    source, target = body(40, 36), body(61, 50)
    given = np.stack([pressure_field(source), source.point[:, 2]])
    mapped = pressure_map(source, target).conservative(given)
    for x_ref in (0.0, 2.0):
        wanted = given @ mesh_load_operator(source, x_ref).T
        np.testing.assert_allclose(mapped @ mesh_load_operator(target, x_ref).T, wanted, atol=1e-13)
    transfer = pressure_map(source, target)
    lost = transfer.consistent(given[0]) @ transfer.target_loads.T - given[0] @ transfer.source_loads.T
    assert abs(lost[0]) > 1e-3 * abs(given[0] @ transfer.source_loads[0])


def test_conservative_pressure_is_the_closest_one() -> None:
    """Least squares: moving along any load-free direction only increases the area-weighted distance."""
    source, target = body(40, 36), body(61, 50)
    transfer = pressure_map(source, target)
    given = pressure_field(source)
    change = transfer.conservative(given) - transfer.consistent(given)
    free = np.random.default_rng(3).normal(size=(20, target.n_nodes))
    loads = transfer.target_loads
    free -= free @ np.linalg.pinv(loads) @ loads
    inner = np.abs(free @ (target.node_area * change))
    assert inner.max() < 1e-12 * np.abs(free).max() * np.abs(change).max() * target.node_area.sum()


def test_conservation_changes_a_good_map_little() -> None:
    """Between meshes of 36 and 50 nodes round the body the correction is below 1 % of the pressure's range."""
    source, target = body(40, 36), body(61, 50)
    transfer, given = pressure_map(source, target), pressure_field(source)
    change = np.abs(transfer.conservative(given) - transfer.consistent(given))
    assert change.max() < 0.01 * np.ptp(given)


def test_rolling_moment_of_a_body_with_fins_is_kept() -> None:
    """A box of 2 x 1: pressure on its sides rolls it; six loads to rounding."""
    source, target = (box([0.0, -1.0, -0.5], [3.0, 1.0, 0.5], cells) for cells in ((6, 4, 4), (9, 7, 5)))
    given = np.where(source.point[:, 2] > 0.0, 1.0, -1.0) * source.point[:, 1] + source.point[:, 0]
    mapped = pressure_map(source, target).conservative(given)
    for loads in (lambda mesh: mesh_load_operator(mesh, 1.0), lambda mesh: roll_moment_operator(mesh)[None]):
        np.testing.assert_allclose(loads(target) @ mapped, loads(source) @ given, atol=1e-12)
    assert abs(roll_moment_operator(source) @ given) > 0.1
    assert len(pressure_map(body(40, 36), body(61, 50)).source_loads) == 5


def test_load_that_pressure_cannot_carry_is_refused() -> None:
    """A flat plate takes no axial force."""
    plate = plane(5, 0)
    tilted = SurfaceMesh(
        plate.point @ np.array([[1.0, 0.0, 0.1], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), plate.triangle
    )
    with pytest.raises(InputError, match="cannot carry the axial force"):
        pressure_map(tilted, plate).conservative(np.ones(tilted.n_nodes))
