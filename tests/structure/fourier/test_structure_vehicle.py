"""The strain operator of the real vehicle: symmetries, rotation of the strain, interpolation, convergence."""

import time

import numpy as np
import pytest

from builder.structure.fourier.inner_surface import PlacedGauges, place_gauges
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import (
    HarmonicResponse,
    harmonic_response,
    strain_operator,
)
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid, chain_segments, surface_grid
from strainfmu.errors import InputError


def field(grid: SurfaceGrid, by_roll: np.ndarray) -> np.ndarray:
    """(n_nodes,) pressure that varies over the length and as ``by_roll`` (n_roll,) around it."""
    return np.outer(1e5 * (1.0 + 0.3 * grid.x), by_roll).ravel()


def test_layout_at_right_angles_is_blind_to_doubly_odd_pressure(
    response: HarmonicResponse, ring_of_gauges: PlacedGauges, grid: SurfaceGrid
) -> None:
    z = strain_operator(response, ring_of_gauges, grid)
    seen = np.abs(z @ field(grid, np.cos(2.0 * grid.roll_angle))).max()
    for m in (2, 4, 6):
        assert np.abs(z @ field(grid, np.sin(m * grid.roll_angle))).max() < 1e-12 * seen


def test_rolling_the_pressure_permutes_the_gauges(
    response: HarmonicResponse, ring_of_gauges: PlacedGauges, grid: SurfaceGrid
) -> None:
    z = strain_operator(response, ring_of_gauges, grid)
    pressure = np.random.default_rng(0).normal(size=(len(grid.x), grid.n_roll))
    strain = (z @ pressure.ravel()).reshape(9, 4, 2)
    rolled = (z @ np.roll(pressure, grid.n_roll // 4, axis=1).ravel()).reshape(9, 4, 2)
    scale = np.abs(strain).max()
    np.testing.assert_allclose(rolled, np.roll(strain, 1, axis=1), rtol=0, atol=1e-12 * scale)


def test_gauge_at_45_degrees_reads_the_rotated_tensor(response: HarmonicResponse, grid: SurfaceGrid) -> None:
    """The three strains of a rosette (0, 90, 45, -45 deg): e45 + e-45 = e0 + e90; e45 - e-45 = 2 e_s_phi."""
    x, half = response.gauge_x[4], np.sqrt(0.5)
    rosette = PlacedGauges(
        x=np.full(4, x),
        roll_angle=np.full(4, 0.7),
        meridional=np.array([1.0, 0.0, half, half]),
        circumferential=np.array([0.0, 1.0, half, -half]),
    )
    z = strain_operator(response, rosette, grid)
    axial, hoop, plus, minus = z @ field(grid, np.exp(np.sin(grid.roll_angle + 0.3)))
    assert plus + minus == pytest.approx(axial + hoop, rel=1e-12)
    load = 1e5 * (1.0 + 0.3 * grid.x)
    cosine = z @ field(grid, np.cos(3 * grid.roll_angle))
    shear = response.shear[4, 3] @ load
    assert cosine[2] - cosine[3] == pytest.approx(2.0 * shear * np.sin(3 * 0.7), rel=1e-10)
    sine = z @ field(grid, np.sin(3 * grid.roll_angle))
    assert sine[2] - sine[3] == pytest.approx(-2.0 * shear * np.cos(3 * 0.7), rel=1e-10)


def test_shear_has_the_sign_of_the_beam(response: HarmonicResponse, grid: SurfaceGrid) -> None:
    """Front pressed towards -z: on its aft-facing cut it is held up, which is towards -phi at +y."""
    load = 1e5 * (1.0 + 0.3 * grid.x)
    assert response.shear[4, 1] @ load < 0.0


def test_highest_harmonic_interpolates_the_nodal_pressure(
    mesh: MeridianMesh,
    wall: Wall,
    grid: SurfaceGrid,
    response: HarmonicResponse,
    ring_of_gauges: PlacedGauges,
) -> None:
    """At the Nyquist harmonic (-1)^j is cos(n/2 phi), with weight one, not two."""
    z = strain_operator(response, ring_of_gauges, grid)
    assert response.max_harmonic == grid.n_roll // 2
    strain = z @ field(grid, (-1.0) ** np.arange(grid.n_roll))
    load = 1e5 * (1.0 + 0.3 * grid.x)
    expected = np.stack([response.meridional[:, -1] @ load, response.hoop[:, -1] @ load], axis=-1)
    np.testing.assert_allclose(
        strain.reshape(9, 4, 2),
        np.repeat(expected[:, None], 4, axis=1),
        rtol=1e-9,
        atol=1e-9 * np.abs(strain).max(),
    )


def test_uniform_pressure_is_the_mean_harmonic(
    response: HarmonicResponse, ring_of_gauges: PlacedGauges, grid: SurfaceGrid
) -> None:
    strain = strain_operator(response, ring_of_gauges, grid) @ np.ones(grid.n_nodes)
    expected = np.stack([response.meridional[:, 0].sum(axis=1), response.hoop[:, 0].sum(axis=1)], axis=-1)
    np.testing.assert_allclose(strain.reshape(9, 4, 2), np.repeat(expected[:, None], 4, axis=1), rtol=1e-10)


@pytest.mark.slow
def test_mesh_refinement_changes_little(
    body: BodyOfRevolution, wall: Wall, ring_of_gauges: PlacedGauges, grid: SurfaceGrid
) -> None:
    """Default against half the element length and one layer more; windward-like pressure, all gauges."""
    pressure = field(grid, np.exp(-0.8 * np.cos(grid.roll_angle - 0.4)))

    def strain(element_length: float, n_layers: int) -> np.ndarray:
        mesh = shell_mesh(body, wall, element_length, n_layers)
        response = harmonic_response(mesh, wall.material, ring_of_gauges.x, grid.x, 6)
        return strain_operator(response, ring_of_gauges, grid) @ pressure

    fine = strain(0.5 * 0.0075, 3)
    assert np.abs(strain(0.0075, 2) - fine).max() < 1e-4 * np.median(np.abs(fine))
    assert np.abs(strain(0.02, 1) - fine).max() < 1e-2 * np.median(np.abs(fine))


def test_agrees_with_hexahedra() -> None:
    """A cone and frustum of 6 mm wall at x = 2.2 m per 1e5 Pa, against 465,705 dofs of 20-node hexahedra."""
    cone, frustum = np.arctan(0.12 / 1.75), np.arctan(0.03 / 1.85)
    body = chain_segments([(1.75, cone, cone), (3.6, frustum, frustum)])
    wall = Wall(0.006, 0.10, Material(70e9, 0.33))
    mesh = shell_mesh(body, wall, 0.01)
    response = harmonic_response(mesh, wall.material, np.array([2.2]), np.array([0.0, 3.6]), 2)
    hoop, axial = response.hoop[0].sum(axis=1), response.meridional[0].sum(axis=1)
    found = 1e5 * np.array([hoop[0], axial[1], hoop[2]])
    np.testing.assert_allclose(found, [-26e-6, 1810e-6, 1250e-6], rtol=0.01)


def test_whole_way_within_its_time(body: BodyOfRevolution, wall: Wall) -> None:
    """54 gauges, about 350 elements along the wall, harmonics to 16: seconds, with progress after each."""
    x = np.repeat(np.linspace(0.35, 3.30, 9), 6)
    roll = np.tile(np.pi / 3.0 * np.arange(6), 9)
    angle = np.where(x < 1.75, *np.deg2rad([5.0, 1.0]))
    radius = body.radius(x) - wall.thickness / np.cos(angle)
    position = np.column_stack([x, radius * np.sin(roll), radius * np.cos(roll)])
    direction = np.column_stack([np.zeros(54), np.cos(roll), -np.sin(roll)])
    seen: list[tuple[int, int]] = []
    start = time.process_time()
    mesh = shell_mesh(body, wall, 0.0105, 1)
    gauges = place_gauges(mesh, position, direction)
    response = harmonic_response(
        mesh,
        wall.material,
        gauges.x,
        surface_grid(body, 100, 32).x,
        16,
        progress=lambda done, total: seen.append((done, total)),
    )
    assert time.process_time() - start < 10.0
    assert seen == [(i + 1, 17) for i in range(17)]
    assert response.hoop.shape[:2] == (9, 17)
    np.testing.assert_allclose(gauges.circumferential, 1.0, rtol=1e-12)
    np.testing.assert_allclose(np.mod(gauges.roll_angle + 1e-9, 2.0 * np.pi), roll, atol=1e-8)


def test_gauge_station_is_not_snapped_to_nodes(mesh: MeridianMesh, wall: Wall, grid: SurfaceGrid) -> None:
    """Strain of the smooth bending of the wall runs smoothly over nodes and element ends."""
    x = np.linspace(2.5, 2.56, 61)
    response = harmonic_response(mesh, wall.material, x, grid.x, 1)
    strain = response.meridional[:, 1].sum(axis=1)
    smooth = np.polyval(np.polyfit(x - 2.53, strain, 3), x - 2.53)
    assert np.abs(strain - smooth).max() < 1e-4 * np.abs(strain).max()
    assert np.all(np.diff(strain) * np.sign(strain[-1] - strain[0]) > 0.0)


def test_too_many_harmonics_are_refused(
    body: BodyOfRevolution, response: HarmonicResponse, ring_of_gauges: PlacedGauges
) -> None:
    with pytest.raises(InputError, match="max_harmonic 12 needs at least 24 roll angles, the grid has 22"):
        strain_operator(response, ring_of_gauges, surface_grid(body, 60, 22))


def test_response_of_another_grid_is_refused(
    body: BodyOfRevolution, response: HarmonicResponse, ring_of_gauges: PlacedGauges
) -> None:
    with pytest.raises(InputError, match="surface stations"):
        strain_operator(response, ring_of_gauges, surface_grid(body, 50, 24))


def test_gauge_at_another_station_is_refused(response: HarmonicResponse, grid: SurfaceGrid) -> None:
    stray = PlacedGauges(
        x=np.array([0.36]), roll_angle=np.zeros(1), meridional=np.ones(1), circumferential=np.zeros(1)
    )
    with pytest.raises(InputError, match=r"gauge 1: the response holds no station at x = 0.36 m"):
        strain_operator(response, stray, grid)


def test_wall_that_does_not_fit_is_refused(body: BodyOfRevolution) -> None:
    metal = Material(110e9, 0.31)
    with pytest.raises(InputError, match=r"solid_tip_length 0.04 m is too short"):
        shell_mesh(body, Wall(0.004, 0.04, metal), 0.02)
    with pytest.raises(InputError, match=r"less than the body's length 3.6 m"):
        shell_mesh(body, Wall(0.004, 4.0, metal), 0.02)
    falling = chain_segments([(1.0, 0.05, 0.05), (1.9, -0.05, -0.05)])
    with pytest.raises(InputError, match=r"fills the body at x = 1.8"):
        shell_mesh(falling, Wall(0.01, 0.5, metal), 0.02)
    with pytest.raises(InputError, match="element_length 0 m"):
        shell_mesh(body, Wall(0.004, 0.1, metal), 0.0)
    with pytest.raises(InputError, match="n_layers 0"):
        shell_mesh(body, Wall(0.004, 0.1, metal), 0.02, 0)


@pytest.mark.parametrize(("youngs_modulus", "poisson_ratio"), [(0.0, 0.3), (1e9, 0.5), (1e9, -0.1), (np.nan, 0.3)])
def test_impossible_material_is_refused(youngs_modulus: float, poisson_ratio: float) -> None:
    with pytest.raises(InputError):
        Material(youngs_modulus, poisson_ratio)


@pytest.mark.parametrize(("thickness", "tip"), [(0.0, 0.1), (0.004, -0.1), (np.inf, 0.1)])
def test_impossible_wall_is_refused(thickness: float, tip: float) -> None:
    with pytest.raises(InputError, match="must be greater than 0"):
        Wall(thickness, tip, Material(110e9, 0.31))
