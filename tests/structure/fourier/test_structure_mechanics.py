"""What holds to rounding error on any mesh (rigid motions, resultants, reciprocity); rate of convergence."""

from itertools import pairwise

import numpy as np
import pytest

from builder.structure.fourier import fourier_elasticity
from builder.structure.fourier.fourier_elasticity import (
    assemble_stiffness,
    factor_harmonic,
    rigid_motions,
    roll_integral,
    stiffness_of_elements,
)
from builder.structure.fourier.meridian_mesh import End, MeridianMesh, quadratic_shape, tube_mesh
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import (
    HarmonicResponse,
    harmonic_response,
    pressure_load,
    strain_rows,
)
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid, chain_segments
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

MOTIONS = {"axial": (0, 0), "roll": (0, None), "lateral translation": (1, 0), "lateral rotation": (1, 1)}


@pytest.mark.parametrize("motion", MOTIONS)
def test_rigid_motion_strains_nothing(mesh: MeridianMesh, wall: Wall, motion: str) -> None:
    harmonic, column = MOTIONS[motion]
    roll = np.column_stack([0.0 * mesh.node, mesh.node[:, 1]]).ravel()
    field = roll if column is None else rigid_motions(mesh, harmonic)[:, column]
    stiffness = assemble_stiffness(mesh, wall.material).matrix(harmonic)
    force_scale = np.abs(stiffness) @ np.abs(field)
    assert np.abs(stiffness @ field).max() < 1e-10 * force_scale.max()
    gauge_x = np.linspace(0.12, 3.5, 40)
    rows = strain_rows(mesh, gauge_x, harmonic)
    assert np.abs(rows @ field).max() < 1e-10 * (np.abs(rows) @ np.abs(field)).max()


def test_the_stiffness_is_the_sum_over_parts_of_the_mesh(mesh: MeridianMesh, wall: Wall) -> None:
    whole, n_e = assemble_stiffness(mesh, wall.material), len(mesh.element)
    first, rest = np.arange(n_e // 3), np.arange(n_e // 3, n_e)
    softer = stiffness_of_elements(mesh, wall.material, whole, first, np.full(len(first), 0.25))
    stiffer = stiffness_of_elements(mesh, wall.material, whole, first, np.full(len(first), 0.75))
    other = stiffness_of_elements(mesh, wall.material, whole, rest)
    np.testing.assert_allclose(softer, stiffer / 3.0, atol=1e-12 * np.abs(whole.term).max())
    np.testing.assert_allclose(softer + stiffer + other, whole.term, atol=1e-12 * np.abs(whole.term).max())
    assert not (softer.any(axis=0) & other.any(axis=0)).all()


def test_constant_strain_is_exact(mesh: MeridianMesh) -> None:
    """Patch test: u_x = e_x x + g r (a stretch and a shear), u_r = e_r r, on the distorted vehicle mesh."""
    x, r = mesh.node.T
    field = np.column_stack([2e-3 * x, -1e-3 * r, np.zeros_like(x)]).ravel()
    gauge_x = np.linspace(0.12, 3.5, 40)
    meridional, hoop, shear = (strain_rows(mesh, gauge_x, 0) @ field).T
    angle = np.where(gauge_x < 1.75, *np.deg2rad([5.0, 1.0]))
    expected = 2e-3 * np.cos(angle) ** 2 - 1e-3 * np.sin(angle) ** 2
    np.testing.assert_allclose(meridional, expected, rtol=1e-10)
    np.testing.assert_allclose(hoop, -1e-3, rtol=1e-10)
    np.testing.assert_allclose(shear, 0.0, atol=1e-15)


def test_uniform_tension_needs_end_forces_only(mesh: MeridianMesh, wall: Wall) -> None:
    """Patch test: under uniform axial stress the nodes inside the mesh are in equilibrium."""
    tube = tube_mesh(np.array([0.0, 0.3, 0.5]), np.full(3, 0.1), np.full(3, 0.11), 0.07, 2, aft="free")
    x, r = tube.node.T
    nu = wall.material.poisson_ratio
    field = np.column_stack([x, -nu * r, np.zeros_like(x)]).ravel()
    force = (assemble_stiffness(tube, wall.material).matrix(0) @ field).reshape(-1, 3)
    inside = (x > 0.0) & (x < 0.5)
    assert np.abs(force[inside]).max() < 1e-10 * np.abs(force).max()
    tension = wall.material.youngs_modulus * (0.11**2 - 0.10**2) / 2.0
    assert force[x == 0.5, 0].sum() == pytest.approx(tension, rel=1e-10)


@pytest.mark.parametrize("harmonic", [0, 1, 2, 5])
def test_quadrature_leaves_no_motion_without_strain(harmonic: int) -> None:
    """One free element: only the rigid motions of its harmonic have no energy, also when long and thin."""
    for length, thickness in [(0.02, 0.02), (0.1, 0.002)]:
        x = np.array([0.0, 2.0 * length])
        tube = tube_mesh(x, np.full(2, 0.1), np.full(2, 0.1 + thickness), length)
        single = MeridianMesh(
            node=tube.node[:9],
            element=tube.element[:1],
            outer_edge=tube.outer_edge[:1],
            inner_edge=tube.inner_edge[:1],
        )
        stiffness = assemble_stiffness(single, Material(1.0, 0.3)).matrix(harmonic)
        energy = np.linalg.eigvalsh(stiffness.toarray())
        rigid = {0: 2, 1: 2}.get(harmonic, 0)
        assert np.count_nonzero(energy < 1e-11 * energy[-1]) == rigid


def test_long_elements_do_not_lock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Edge bending on elements of half a decay length; a third point along the wall makes it far worse."""
    radius, thickness = 0.5, 0.001
    decay = np.sqrt(radius * thickness) / (3.0 * (1.0 - 0.31**2)) ** 0.25
    x = 0.6 - decay * np.linspace(3.0, 1.0, 20)

    def axial(length: float) -> np.ndarray:
        mesh = tube_mesh(
            np.array([0.0, 0.6]),
            np.full(2, radius - 0.5 * thickness),
            np.full(2, radius + 0.5 * thickness),
            length,
        )
        response = harmonic_response(mesh, Material(110e9, 0.31), x, np.array([0.0, 0.6]), 0)
        return response.meridional[:, 0].sum(axis=1)

    fine = axial(0.05 * decay)
    selective = np.abs(axial(0.5 * decay) - fine).max()
    monkeypatch.setattr(fourier_elasticity, "POINTS_ALONG", 3)
    full = np.abs(axial(0.5 * decay) - fine).max()
    assert selective < 0.02 * np.abs(fine).max()
    assert full > 5.0 * selective


def surface_integral(
    mesh: MeridianMesh, station_x: np.ndarray, pressure: np.ndarray
) -> tuple[float, float, float]:
    """Exact axial force (m = 0), lateral force and moment about the tip (m = 1, along z) of a field p(x)."""
    total = np.zeros(3)
    point, weight = np.polynomial.legendre.leggauss(8)
    for edge in mesh.outer_edge:
        position = mesh.node[edge]
        front, aft = position[0, 0], position[2, 0]
        cuts = np.unique([front, aft, *station_x[(station_x > front) & (station_x < aft)]])
        for a, b in pairwise(cuts):
            x = 0.5 * (a + b) + 0.5 * (b - a) * point
            xi = (2.0 * x - front - aft) / (aft - front)
            shape, by_xi = quadratic_shape(xi)
            r, slope = shape @ position[:, 1], (by_xi @ position[:, 1]) * 2.0 / (aft - front)
            # One-sided at doubled stations: interpolate inside the interval only.
            k = np.searchsorted(station_x, 0.5 * (a + b)) - 1
            share = (x - station_x[k]) / (station_x[k + 1] - station_x[k])
            dx = 0.5 * (b - a) * weight * (pressure[k] * (1.0 - share) + pressure[k + 1] * share) * r
            total += [2.0 * np.pi * dx @ slope, -np.pi * dx.sum(), -np.pi * dx @ (x + r * slope)]
    return float(total[0]), float(total[1]), float(total[2])


def test_load_has_the_resultant_of_the_pressure(mesh: MeridianMesh, grid: SurfaceGrid) -> None:
    """Axial force, lateral force and moment, with a jump of pressure at the slope break."""
    pressure = np.cos(3.0 * grid.x) + np.where(grid.angle > np.deg2rad(3.0), 2.0, 0.5)
    force = (pressure_load(mesh, grid.x) @ pressure).reshape(-1, 3)
    x, r = mesh.node.T
    exact = surface_integral(mesh, grid.x, pressure)
    lateral = roll_integral(1) * force[:, 1].sum()
    # Moment of lateral force at x and of axial force at height z = r cos(phi).
    moment = roll_integral(1) * (force[:, 1] @ x - force[:, 0] @ r)
    found = (roll_integral(0) * force[:, 0].sum(), lateral, moment)
    np.testing.assert_allclose(found, exact, rtol=1e-12)


def test_load_of_uniform_pressure_is_that_of_the_body(
    mesh: MeridianMesh, body: BodyOfRevolution, grid: SurfaceGrid
) -> None:
    """The meshed cones are the cones: axial force p pi R^2, lateral force pi * plan area / 2."""
    force = pressure_load(mesh, grid.x).toarray().sum(axis=1).reshape(-1, 3).sum(axis=0)
    break_radius = 1.75 * np.tan(np.deg2rad(5.0))
    half_plan_area = 0.5 * 1.75 * break_radius + 0.5 * 1.85 * (break_radius + body.base_radius)
    assert roll_integral(0) * force[0] == pytest.approx(np.pi * body.base_radius**2, rel=1e-12)
    assert roll_integral(1) * force[1] == pytest.approx(-np.pi * half_plan_area, rel=1e-12)


@pytest.mark.parametrize("harmonic", [0, 1, 4])
def test_adjoint_agrees_with_forward(
    mesh: MeridianMesh, wall: Wall, grid: SurfaceGrid, response: HarmonicResponse, harmonic: int
) -> None:
    solver = factor_harmonic(mesh, assemble_stiffness(mesh, wall.material), harmonic)
    displacement = solver.solve(pressure_load(mesh, grid.x).toarray())
    forward = strain_rows(mesh, response.gauge_x, harmonic) @ displacement
    for i, part in enumerate((response.meridional, response.hoop, response.shear)):
        scale = np.abs(forward[:, i]).max()
        np.testing.assert_allclose(part[:, harmonic], forward[:, i], rtol=0, atol=1e-10 * scale)


def test_strain_converges_with_order_three_or_better() -> None:
    """Halving the elements, both ways, of a short clamped tube under p cos(2 phi)."""
    x = np.array([0.113, 0.171, 0.207])

    def strains(length: float, n_layers: int) -> np.ndarray:
        mesh = tube_mesh(np.array([0.0, 0.4]), np.array([0.10, 0.12]), np.array([0.12, 0.14]), length, n_layers)
        response = harmonic_response(mesh, Material(110e9, 0.31), x, np.array([0.0, 0.4]), 2)
        return np.stack([response.meridional, response.hoop, response.shear])[:, :, 2].sum(axis=-1)

    finest = strains(0.4 / 128, 8)
    error = [np.abs(strains(0.4 / n, n // 8) - finest).max(axis=1) for n in (8, 16, 32)]
    order = np.log2(error[0] / error[2]) / 2.0
    assert np.all(order > 3.0), order


@pytest.mark.parametrize(("aft", "harmonic"), [("free", 0), ("free", 1), ("guided", 1)])
def test_loose_body_is_refused(aft: End, harmonic: int) -> None:
    tube = tube_mesh(np.array([0.0, 0.4]), np.full(2, 0.1), np.full(2, 0.12), 0.05, aft=aft)
    with pytest.raises(InputError, match=f"rigid motion of harmonic {harmonic}"):
        factor_harmonic(tube, assemble_stiffness(tube, Material(110e9, 0.31)), harmonic)


def test_wall_folded_by_curvature_is_refused() -> None:
    tube = tube_mesh(np.array([0.0, 0.4]), np.full(2, 0.1), np.full(2, 0.12), 0.05)
    folded = MeridianMesh(
        node=tube.node * [-1.0, 1.0], element=tube.element, outer_edge=tube.outer_edge, inner_edge=tube.inner_edge
    )
    with pytest.raises(InputError, match="folds over itself"):
        assemble_stiffness(folded, Material(110e9, 0.31))


def test_stations_must_cover_the_surface(mesh: MeridianMesh) -> None:
    with pytest.raises(InputError, match=r"reach from 0.1 m to 3.6 m, the surface from 0 m"):
        pressure_load(mesh, np.array([0.1, 3.6]))
    with pytest.raises(InputError, match="must not decrease"):
        pressure_load(mesh, np.array([0.0, 2.0, 1.0, 3.6]))


def test_ogive_vehicle_keeps_its_wall_thickness() -> None:
    """A curved meridian: nodes on the inner surface are one thickness from the outer one."""
    angles = np.deg2rad([12.0, 2.0, 2.0, 6.0])
    ogive = chain_segments([(1.0, angles[0], angles[1]), (1.5, angles[2], angles[2]), (2.0, angles[3], angles[3])])
    mesh = shell_mesh(ogive, Wall(0.004, 0.10, Material(110e9, 0.31)), 0.02)
    inner = mesh.node[np.unique(mesh.inner_edge)]
    x = np.linspace(0.0, 2.0, 200001)
    outer = np.column_stack([x, ogive.radius(x)])
    # Not at the base, whose plane cuts the normal, nor in the concave corner, farther off by 1/cos(2 deg).
    away = (inner[:, 0] < 1.99) & (np.abs(inner[:, 0] - 1.5) > 1e-3)
    distance = [np.hypot(*(outer - point).T).min() for point in inner[away]]
    np.testing.assert_allclose(distance, 0.004, atol=2e-8)
    middle = 0.5 * (mesh.node[mesh.inner_edge[:, 0], 0] + mesh.node[mesh.inner_edge[:, 2], 0])
    np.testing.assert_allclose(mesh.node[mesh.inner_edge[:, 1], 0], middle, atol=1e-14)
