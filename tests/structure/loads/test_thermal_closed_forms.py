"""Gauge strain under known temperatures on the Fourier model, against thermoelasticity."""

from dataclasses import replace

import numpy as np
import pytest
from tube_loads import ALPHA, LENGTH, NU, PROPERTIES, ROLL, A, B, X, read, tube

from builder.structure.loads.fourier import FourierStructure
from builder.structure.loads.gauge_strain import gauge_temperature
from builder.structure.loads.temperature import temperature_mode, uniform_temperature

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def free_tube() -> FourierStructure:
    return tube(front="free", aft="free")


def test_free_expansion_reads_alpha_t_and_compensated_gauges_nothing(free_tube: FourierStructure) -> None:
    found = read(free_tube, uniform_temperature(50.0))
    np.testing.assert_allclose(found, 50.0 * ALPHA, rtol=1e-8)
    compensated = replace(free_tube, properties=replace(PROPERTIES, compensation=ALPHA))
    np.testing.assert_allclose(read(compensated, uniform_temperature(50.0)), 0.0, atol=1e-8 * ALPHA)


def test_temperature_linear_in_space_leaves_no_stress(free_tube: FourierStructure) -> None:
    """T = 30 K + 20 K/m x + 100 K/m (z cos 0.4 + y sin 0.4): strain alpha T in every direction at every gauge."""
    ends = np.array([0.0, LENGTH])
    along = temperature_mode(ends, 30.0 + 20.0 * ends)
    middle, through = np.full(2, 50.0 * (A + B)), np.full(2, 100.0 * (B - A))
    across = temperature_mode(ends, middle, harmonic=1, roll_angle=0.4, through_wall=through)
    found = read(free_tube, along, across)
    temperature = 30.0 + 20.0 * X[:, None] + 100.0 * A * np.cos(ROLL - 0.4)
    np.testing.assert_allclose(found, np.broadcast_to(ALPHA * temperature[..., None], found.shape), rtol=1e-6)


def test_uniform_heating_between_two_clamps() -> None:
    """No axial strain on average, hoop (1 + nu) alpha T far from the clamps.

    The clamps hold the radius too: over 1 / beta each (edge bending, Timoshenko and Woinowsky-Krieger, section
    115) Poisson's ratio makes the wall longer, and what lies between is shorter.
    """
    found = read(tube(front="clamped", aft="clamped"), uniform_temperature(80.0))
    free = 80.0 * ALPHA
    beta = (3.0 * (1.0 - NU**2)) ** 0.25 / np.sqrt(0.5 * (A + B) * (B - A))
    axial = -2.0 * NU * (1.0 + NU) * free / (beta * LENGTH)
    np.testing.assert_allclose(found[..., 0], axial, rtol=0.07)
    np.testing.assert_allclose(found[..., 1], (1.0 + NU) * free - NU * axial, rtol=1e-3)


def test_gradient_through_the_wall() -> None:
    """Both faces of a free long cylinder expand by alpha T_mean (Timoshenko and Goodier, section 151).

    A compensated gauge inside reads alpha (T_mean - T_inside).
    """
    a, b, difference = 0.10, 0.13, 40.0
    structure = tube(front="free", aft="free", a=a, b=b)
    field = temperature_mode(np.zeros(1), np.zeros(1), through_wall=np.array([difference]))
    r = np.linspace(a, b, 20001)
    temperature = difference * ((r - a) / (b - a) - 0.5)
    mean = np.trapezoid(temperature * r, r) / (0.5 * (b**2 - a**2))
    np.testing.assert_allclose(read(structure, field), ALPHA * mean, rtol=0.005)
    compensated = replace(structure, properties=replace(PROPERTIES, compensation=ALPHA))
    np.testing.assert_allclose(read(compensated, field), ALPHA * (mean + 0.5 * difference), rtol=0.001)
    np.testing.assert_allclose(gauge_temperature(structure, field), -0.5 * difference)


def test_thermal_bending_between_clamps() -> None:
    """A beam held by both ends under T = T_1 cos phi: no curvature, so no axial strain; hoop (1 + nu) alpha T."""
    field = temperature_mode(
        np.zeros(1),
        np.array([10.0]),
        harmonic=1,
        roll_angle=0.3,
        through_wall=np.array([20.0 * (B - A) / (A + B)]),
    )
    found = read(tube(front="clamped", aft="clamped"), field)
    inside = 10.0 * 2.0 * A / (A + B) * np.cos(ROLL - 0.3)
    np.testing.assert_allclose(found[..., 0], 0.0, atol=0.01 * 10.0 * ALPHA)
    expected = np.broadcast_to((1.0 + NU) * ALPHA * inside, (3, 4))
    np.testing.assert_allclose(found[..., 1], expected, atol=0.01 * 10.0 * ALPHA)
