"""Displacement per surface pressure: closed forms of a tube clamped at its aft end."""

import numpy as np
import pytest

from builder.structure.fourier.fourier_model import SurfaceTargets, displacement_operator, displacement_rows
from builder.structure.fourier.meridian_mesh import MeridianMesh, tube_mesh
from builder.structure.wall import Material
from builder.vehicle.shape.geometry import SurfaceGrid

LENGTH, INNER, OUTER = 4.0, 0.098, 0.100
METAL = Material(110e9, 0.31)
PRESSURE = 1e4


@pytest.fixture(scope="module")
def tube() -> MeridianMesh:
    return tube_mesh(np.array([0.0, LENGTH]), np.full(2, INNER), np.full(2, OUTER), 0.02)


@pytest.fixture(scope="module")
def grid() -> SurfaceGrid:
    return SurfaceGrid(x=np.array([0.0, LENGTH]), radius=np.full(2, OUTER), angle=np.zeros(2), n_roll=8)


def displaced(
    tube: MeridianMesh, grid: SurfaceGrid, x: float, roll: float, direction: list[float], pressure: np.ndarray
) -> float:
    """Return the displacement [m] at one point under ``pressure`` (n_roll,), the same at all stations."""
    targets = SurfaceTargets(x=np.array([x]), roll_angle=np.array([roll]), direction=np.array([direction]))
    found = displacement_operator(tube, METAL, targets, grid, 3) @ np.tile(pressure, len(grid.x))
    return float(found[0])


@pytest.mark.parametrize("roll_deg", [0.0, 90.0, 130.0, 270.0])
def test_tip_of_a_cantilever(tube: MeridianMesh, grid: SurfaceGrid, roll_deg: float) -> None:
    """Pressure p cos(phi): a line load -pi p R along z; bending q L^4 / 8 E I and shear q L^2 / 2 k G A.

    The same all round the tip within the ovalisation of its free end.
    """
    load = -np.pi * PRESSURE * OUTER
    inertia, area = np.pi / 4.0 * (OUTER**4 - INNER**4), np.pi * (OUTER**2 - INNER**2)
    nu, modulus = METAL.poisson_ratio, METAL.youngs_modulus
    shear = 2.0 * (1.0 + nu) / (4.0 + 3.0 * nu)  # of thin tubes, Cowper 1966
    expected = load * LENGTH**4 / (8.0 * modulus * inertia)
    expected += load * LENGTH**2 / (2.0 * shear * modulus / (2.0 * (1.0 + nu)) * area)
    roll = np.deg2rad(roll_deg)
    pressure = PRESSURE * np.cos(grid.roll_angle)
    assert displaced(tube, grid, 0.0, roll, [0.0, 0.0, 1.0], pressure) == pytest.approx(expected, rel=2e-3)
    assert abs(displaced(tube, grid, 0.0, roll, [0.0, 1.0, 0.0], pressure)) < 2e-3 * abs(expected)


def test_tube_under_outer_pressure(tube: MeridianMesh, grid: SurfaceGrid) -> None:
    """Lame far from the ends: u_r(a) = -2 p a b^2 / E (b^2 - a^2); the free end moves by 2 nu p b^2 L / E (..)."""
    factor = PRESSURE * OUTER**2 / (METAL.youngs_modulus * (OUTER**2 - INNER**2))
    uniform = np.full(grid.n_roll, PRESSURE)
    roll = np.deg2rad(200.0)
    outward = [0.0, float(np.sin(roll)), float(np.cos(roll))]
    assert displaced(tube, grid, 2.0, roll, outward, uniform) == pytest.approx(-2.0 * INNER * factor, rel=1e-5)
    ahead = displaced(tube, grid, 1.0, roll, [1.0, 0.0, 0.0], uniform)
    behind = displaced(tube, grid, 3.0, roll, [1.0, 0.0, 0.0], uniform)
    assert behind - ahead == pytest.approx(2.0 * METAL.poisson_ratio * factor * 2.0, rel=1e-5)


def test_rows_of_a_rigid_motion(tube: MeridianMesh) -> None:
    """Translation along z, u_r = cos(phi), u_phi = -sin(phi): each component comes back at any station."""
    field = np.tile([0.0, 1.0, -1.0], len(tube.node))
    np.testing.assert_allclose(displacement_rows(tube, np.array([0.37, 2.911])) @ field, [[0.0, 1.0, -1.0]] * 2)
