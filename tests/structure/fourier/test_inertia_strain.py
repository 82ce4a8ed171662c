"""Strain by inertia against closed forms of tubes, and against known loads of the same structure."""

from dataclasses import replace

import numpy as np
import pytest

from builder.structure.fourier.inertia_strain import bending_strain, inertia_strain
from builder.structure.fourier.inner_surface import PlacedGauges
from builder.structure.fourier.meridian_mesh import NO_NODES, MeridianMasses, MeridianMesh, tube_mesh
from builder.structure.loads.applied import Acceleration
from builder.structure.loads.fourier import fourier_structure
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.wall import Material

E, NU, DENSITY = 110e9, 0.31, 4430.0
INNER, OUTER, LENGTH = 0.098, 0.100, 1.0
GRAVITY = 9.80665
MATERIAL = Material(E, NU)
SOLID = {"all": MeridianMasses(density=(DENSITY,))}


def tube() -> MeridianMesh:
    ends = np.array([0.0, LENGTH])
    return tube_mesh(ends, np.full(2, INNER), np.full(2, OUTER), element_length=0.02)


def gauges(x: list[float], roll: float = 0.0) -> PlacedGauges:
    """An axial and a hoop gauge at each station."""
    n = len(x)
    return PlacedGauges(
        x=np.repeat(x, 2),
        roll_angle=np.full(2 * n, roll),
        meridional=np.tile([1.0, 0.0], n),
        circumferential=np.tile([0.0, 1.0], n),
    )


def strain(channel: int, x: list[float], roll: float = 0.0, unit: float = 0.0) -> np.ndarray:
    found = inertia_strain(tube(), MATERIAL, gauges(x, roll), SOLID, unit)["all"]
    return found[:, channel].reshape(-1, 2)


def test_lateral_g_bends_a_cantilever() -> None:
    x = [0.3, 0.5]
    area, second = np.pi * (OUTER**2 - INNER**2), np.pi / 4.0 * (OUTER**4 - INNER**4)
    # Up: the free nose at x = 0 lags, so that the upper side (roll angle 0) is stretched.
    moment = DENSITY * area * GRAVITY * np.array(x) ** 2 / 2.0
    found = GRAVITY * strain(2, x)[:, 0]
    assert found == pytest.approx(moment * INNER / (E * second), rel=0.05)
    # A beam of its own weight has a strain besides that is the same at all stations.
    assert np.diff(found) == pytest.approx(np.diff(moment) * INNER / (E * second), rel=1e-3)
    assert GRAVITY * strain(1, x, roll=np.pi / 2.0)[:, 0] == pytest.approx(found, rel=1e-9)
    assert strain(2, x, roll=np.pi / 2.0)[:, 0] == pytest.approx(0.0, abs=1e-12)


def test_axial_g_stretches_a_bar() -> None:
    x = [0.3, 0.5]
    # Accelerated aft by its aft end, the part ahead lags: tension.
    assert GRAVITY * strain(0, x)[:, 0] == pytest.approx(DENSITY * GRAVITY * np.array(x) / E, rel=1e-3)


def test_spin_widens_a_ring() -> None:
    found = strain(6, [0.4]) + strain(7, [0.4])
    middle = 0.5 * (INNER + OUTER)
    assert -found[0, 1] == pytest.approx(DENSITY * middle**2 / E, rel=0.03)
    assert -found[0, 0] == pytest.approx(-NU * DENSITY * middle**2 / E, rel=0.05)


def test_pitch_rate_stretches_a_bar() -> None:
    x = np.array([0.3, 0.5])
    # Of a rotation about the clamped end: the part ahead pulls forward with density w^2 (L - s).
    expected = DENSITY * (LENGTH * x - 0.5 * x**2) / E
    assert -strain(5, x.tolist(), unit=LENGTH)[:, 0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("roll", [0.0, 0.7, 2.0])
def test_known_loads_of_the_same_structure_agree(roll: float) -> None:
    placed = gauges([0.2, 0.6], roll)
    structure = fourier_structure(tube(), MATERIAL, placed, LoadProperties(density=DENSITY), max_harmonic=2)
    unit = 0.35
    found = inertia_strain(tube(), MATERIAL, placed, SOLID, unit)["all"]
    for axis in range(3):
        linear = tuple(float(k == axis) for k in range(3))
        assert found[:, axis] == pytest.approx(gauge_strain(structure, [Acceleration(linear=linear)]), abs=1e-15)
    # An angular acceleration about the unit moves the nose tip, too: - dw x r_0.
    about_y = gauge_strain(structure, [Acceleration(linear=(0.0, 0.0, unit), angular=(0.0, 1.0, 0.0))])
    about_z = gauge_strain(structure, [Acceleration(linear=(0.0, -unit, 0.0), angular=(0.0, 0.0, 1.0))])
    assert found[:, 3] == pytest.approx(about_y, abs=1e-15)
    assert found[:, 4] == pytest.approx(about_z, abs=1e-15)


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 2, -1]])
def test_strain_of_a_turn_does_not_depend_on_the_axes(axis: list[int]) -> None:
    """A tube that spins about an axis across it strains as one rolled with its gauges."""
    w, turn = np.array(axis, dtype=float), 0.6
    c, s = np.cos(turn), np.sin(turn)
    rolled = np.array([[1, 0, 0], [0, c, s], [0, -s, c]]) @ w  # +z toward +y

    def by_rate(rate: np.ndarray, roll: float) -> np.ndarray:
        p = np.outer(rate, rate) - rate @ rate * np.eye(3)
        channels = np.array([p[0, 0], p[1, 1], p[2, 2], p[0, 1], p[0, 2], p[1, 2]])
        return inertia_strain(tube(), MATERIAL, gauges([0.3], roll), SOLID, 0.2)["all"][:, 5:] @ channels

    assert by_rate(w, 0.3) == pytest.approx(by_rate(rolled, 0.3 + turn), rel=1e-6, abs=1e-18)


def test_a_free_body_reads_nothing_of_its_own_motion() -> None:
    free = replace(tube(), clamped_node=NO_NODES, masses=SOLID["all"])
    found = inertia_strain(free, MATERIAL, gauges([0.3, 0.6]), SOLID, 0.2)["all"]
    held = inertia_strain(tube(), MATERIAL, gauges([0.3, 0.6]), SOLID, 0.2)["all"]
    assert np.abs(found[:, :5]).max() < 1e-9 * np.abs(held[:, :5]).max()
    # Spun about its middle a free bar is stretched as the halves pull: density w^2 (l^2/4 - s^2) / 2.
    s = np.array([0.3, 0.6]) - 0.5 * LENGTH
    assert -found[::2, 5] == pytest.approx(DENSITY * (0.25 * LENGTH**2 - s**2) / 2.0 / E, rel=2e-3)


def test_a_mass_bends_the_wall_behind_it() -> None:
    masses = {"equipment": MeridianMasses(density=(0.0,), points=((0.2, 2.0),))}
    found = inertia_strain(tube(), MATERIAL, gauges([0.1, 0.5, 0.7]), masses, 0.0)["equipment"][::2, 2]
    second = np.pi / 4.0 * (OUTER**4 - INNER**4)
    assert found[0] == pytest.approx(0.0, abs=1e-3 * found[2])
    assert found[1:] == pytest.approx(2.0 * (np.array([0.5, 0.7]) - 0.2) * INNER / (E * second), rel=0.01)


def curvature(beta: float, x: np.ndarray) -> np.ndarray:
    """Of the first mode of a beam, over its largest: x from the free end, clamped at 1 or free there, too."""
    if beta < 2.0:
        ratio = (np.sinh(beta) - np.sin(beta)) / (np.cosh(beta) + np.cos(beta))
        from_clamp = beta * (1.0 - x)
        shape = np.cosh(from_clamp) + np.cos(from_clamp) - ratio * (np.sinh(from_clamp) + np.sin(from_clamp))
        return np.asarray(shape / 2.0)
    middle = beta * (x - 0.5)
    shape = np.cosh(middle) / np.cosh(beta / 2.0) - np.cos(middle) / np.cos(beta / 2.0)
    return np.asarray(shape / (1.0 / np.cosh(beta / 2.0) - 1.0 / np.cos(beta / 2.0)))


@pytest.mark.parametrize(("is_free", "beta"), [(False, 1.87510), (True, 4.73004)])
def test_the_first_bending_mode_is_that_of_a_beam(is_free: bool, beta: float) -> None:
    ends, x = np.array([0.0, 4.0]), np.array([0.8, 1.6, 2.4])  # slender: shear is small
    mesh = tube_mesh(ends, np.full(2, INNER), np.full(2, OUTER), element_length=0.04)
    if is_free:
        mesh = replace(mesh, clamped_node=NO_NODES, masses=SOLID["all"])
    found = bending_strain(mesh, MATERIAL, gauges(x.tolist()), SOLID["all"])
    assert np.abs(found[::2, 1]).max() == pytest.approx(1.0)
    expected = curvature(beta, x / 4.0)
    assert found[::2, 1] / found[2, 1] == pytest.approx(expected / expected[1], rel=0.03)
    across = bending_strain(mesh, MATERIAL, gauges(x.tolist(), np.pi / 2.0), SOLID["all"])
    assert across[:, 0] == pytest.approx(found[:, 1], rel=1e-6)
