"""Cones and arcs against closed forms, and where the pressure nodes lie."""

from math import cos, pi, radians, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builder.vehicle.shape.geometry import chain_segments, surface_grid
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

FIVE, ONE = radians(5.0), radians(1.0)


def test_two_cones() -> None:
    body = chain_segments([(1.75, FIVE, FIVE), (3.6, ONE, ONE)])
    shoulder = 1.75 * tan(FIVE)
    np.testing.assert_allclose(body.radius(np.array([0.0, 1.0, 1.75])), [0.0, tan(FIVE), shoulder], atol=1e-15)
    assert body.base_radius == pytest.approx(shoulder + 1.85 * tan(ONE), rel=1e-14)
    assert (body.length, body.tip_angle) == (3.6, FIVE)
    np.testing.assert_array_equal(body.slope_breaks, [1.75])
    assert body.angle(1.75, "upstream") == FIVE
    assert body.angle(1.75, "downstream") == ONE
    assert body.radius(1.0).shape == ()


@given(length=st.floats(0.2, 5.0), fineness=st.floats(2.0, 10.0))
def test_tangent_ogive(length: float, fineness: float) -> None:
    """Radius of curvature rho = (R^2 + L^2)/(2 R), r(x) = sqrt(rho^2 - (L - x)^2) + R - rho."""
    base = length / (2.0 * fineness)
    curvature = (base**2 + length**2) / (2.0 * base)
    body = chain_segments([(length, float(np.arcsin(length / curvature)), 0.0)])
    x = np.linspace(0.0, length, 11)
    expected = np.sqrt(curvature**2 - (length - x) ** 2) + base - curvature
    np.testing.assert_allclose(body.radius(x), expected, atol=1e-10 * length)
    np.testing.assert_allclose(np.sin(body.angle(x)), (length - x) / curvature, atol=1e-10)
    assert body.base_radius == pytest.approx(base, rel=1e-9)


def test_arc_that_flares_out() -> None:
    """From 0 to 10 deg over 0.5 m behind a cylinder of r: r + rho (1 - cos 10 deg), rho = 0.5/sin 10 deg."""
    ten = radians(10.0)
    body = chain_segments([(1.0, FIVE, FIVE), (2.0, 0.0, 0.0), (2.5, 0.0, ten)])
    assert body.base_radius == pytest.approx(tan(FIVE) + 0.5 / sin(ten) * (1.0 - cos(ten)), rel=1e-12)
    np.testing.assert_array_equal(body.slope_breaks, [1.0])


def test_angle_is_the_slope_of_the_radius() -> None:
    body = chain_segments([(1.0, 0.2, 0.05), (2.0, 0.05, 0.05), (3.0, 0.05, -0.1)])
    x, step = np.linspace(0.1, 2.9, 57), 1e-6
    x = x[np.abs(np.abs(x - 1.5) - 0.5) > 1e-3]
    slope = (body.radius(x + step) - body.radius(x - step)) / (2.0 * step)
    np.testing.assert_allclose(slope, np.tan(body.angle(x)), atol=1e-8)
    assert len(body.slope_breaks) == 0


@pytest.mark.parametrize(
    ("pieces", "words"),
    [
        ([(1.0, 0.1, 0.1), (1.0, 0.0, 0.0)], "profile segment 2: end_x_m 1 must lie aft of 1"),
        ([(1.0, 0.1, 0.1), (0.5, 0.0, 0.0)], "profile segment 2: end_x_m 0.5 must lie aft of 1"),
        ([(1.0, 0.1, 0.1), (3.0, -0.1, -0.1)], "profile segment 2: the radius falls to zero"),
        ([(1.0, 0.0, 0.0)], "profile segment 1: the radius falls to zero"),
        ([], "the tip must be pointed"),
    ],
)
def test_impossible_profiles_are_refused(pieces: list[tuple[float, float, float]], words: str) -> None:
    with pytest.raises(InputError, match=words):
        chain_segments(pieces)


def test_stations_are_doubled_at_slope_breaks() -> None:
    body = chain_segments([(1.75, FIVE, FIVE), (3.6, ONE, ONE)])
    grid = surface_grid(body, 40, 24)
    assert np.all(np.diff(grid.x) >= 0.0)
    before, behind = np.flatnonzero(grid.x == 1.75)
    assert behind == before + 1
    assert (grid.angle[before], grid.angle[behind]) == (FIVE, ONE)
    assert grid.radius[before] == pytest.approx(grid.radius[behind], rel=1e-14)
    assert (grid.x[0], grid.x[-1]) == (0.0, 3.6)
    assert len(grid.x) == pytest.approx(40, abs=2)
    assert grid.n_nodes == len(grid.x) * 24


def test_nodes_run_round_the_body_first() -> None:
    grid = surface_grid(chain_segments([(1.0, FIVE, FIVE)]), 10, 16)
    field = np.arange(grid.n_nodes, dtype=float)
    assert grid.as_map(field)[3, 5] == field[3 * 16 + 5]
    assert grid.as_map(np.zeros((7, grid.n_nodes))).shape == (7, 10, 16)
    np.testing.assert_allclose(grid.roll_angle, 2.0 * pi * np.arange(16) / 16)


def test_surface_area_of_a_cone() -> None:
    """pi R s: the trapezoid over the nodes is exact for a radius linear in x."""
    grid = surface_grid(chain_segments([(1.0, FIVE, FIVE)]), 10, 16)
    lateral = 2.0 * pi * np.trapezoid(grid.radius / np.cos(grid.angle), grid.x)
    radius = tan(FIVE)
    assert lateral == pytest.approx(pi * radius * sqrt(1.0 + radius**2), rel=1e-13)


def test_an_arc_that_dips_below_the_axis_is_refused() -> None:
    with pytest.raises(InputError, match="segment 2: the radius falls to zero"):
        chain_segments([(1.0, 0.17, 0.17), (3.0, -0.7, 0.7)])
