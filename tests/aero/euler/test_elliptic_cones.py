"""Surface pressure of elliptic cones by the march all round, against linearised conical flow."""

from math import radians, tan

import numpy as np
import pytest

from builder.aero.euler.bodies.solver import solve_full_flow
from builder.aero.euler.planes import MarchingGrid
from tests.aero.euler.conical_perturbation import wall_response
from tests.aero.euler.test_full_body import EllipticCone, assert_balanced

pytestmark = pytest.mark.usefixtures("compiled_solver")


@pytest.mark.parametrize(
    ("half_angle_deg", "mach_number", "cone", "slope"),
    [(5.0, 6.0, 0.0216259, 0.32795), (10.0, 7.0, 0.0698611, 0.66663), (15.0, 5.0, 0.1542357, 0.97436)],
)
def test_theory_gives_the_known_slope_of_inclined_cones(
    half_angle_deg: float, mach_number: float, cone: float, slope: float
) -> None:
    """Taylor and Maccoll's Cp, and its change with incidence, which agrees with Sims, NASA SP-3007, to 1e-4."""
    found = wall_response(radians(half_angle_deg), mach_number, 1)
    assert found[0] == pytest.approx(cone, rel=2e-5)
    assert found[1] == pytest.approx(slope, rel=3e-5)


def slope_of_ellipse(half_angle: float, mach_number: float, ellipticity: float, grid: MarchingGrid) -> float:
    """Return the cos 2 phi part of Cp over that of the surface's angle, of a cone of semi-axes t (1 +- e)."""
    t = tan(half_angle)
    wide, narrow = t * (1.0 + ellipticity), t * (1.0 - ellipticity)
    flow = solve_full_flow(EllipticCone(y_slope=wide, z_slope=narrow), mach_number, 0.0, 0.0, grid)
    assert_balanced(flow, 1e-3)
    roll = flow.roll_angle
    cp = (flow.pieces[-1][1][-1] - 1.0) / (0.7 * mach_number**2)
    surface = np.arctan(1.0 / np.hypot(np.sin(roll) / wide, np.cos(roll) / narrow))
    return float(np.mean(cp * np.cos(2.0 * roll)) / np.mean(surface * np.cos(2.0 * roll)))


@pytest.mark.parametrize(
    ("n_radial", "tolerance"),
    [(16, 0.012), pytest.param(32, 0.006, marks=pytest.mark.slow)],
)
@pytest.mark.parametrize(("half_angle_deg", "mach_number"), [(10.0, 6.0), (15.0, 7.0)])
def test_pressure_round_slightly_elliptic_cones(
    half_angle_deg: float, mach_number: float, n_radial: int, tolerance: float
) -> None:
    """The slope at e = 0.05 and 0.1, which is even in e, carried on to e = 0; and how much of it 2:1 leaves."""
    half_angle, grid = (
        radians(half_angle_deg),
        # A start that settles to 3e-4 moves the slope at e = 0.05 by as much as finer cells do.
        MarchingGrid(n_radial=n_radial, n_circumferential=3 * n_radial // 2, conical_tolerance=1e-4),
    )
    exact = wall_response(half_angle, mach_number, 2)[1]
    small, large = (slope_of_ellipse(half_angle, mach_number, e, grid) / exact for e in (0.05, 0.1))
    print(f"{half_angle_deg:g} deg, M {mach_number:g}: {small:.4f}, {large:.4f} of the exact slope at e = 0")
    assert small + (small - large) / 3.0 == pytest.approx(1.0, abs=tolerance)
    assert large < small
