"""Spherical tips: the sphere's flow itself, and the march that begins in it."""

from functools import cache
from math import pi, radians

import numpy as np
import pytest
from cone_theory import GAMMA, taylor_maccoll_pressure
from sweeps import sweep

from builder.aero.euler.bodies import body_march
from builder.aero.euler.bodies.solver import FlowSolution, solve_flow, solve_full_flow
from builder.aero.euler.bodies.surface_function import cap_of
from builder.aero.euler.planes import GRID_LEVELS, MarchingGrid
from builder.aero.euler.starts import sphere_flow, spherical_start
from builder.aero.euler.starts.sphere_flow import SphereFlow, solve_sphere
from builder.vehicle.shape.geometry import BodyOfRevolution, Segment, chain_pieces
from builder.vehicle.shape.profile_entries import Haack, PowerLaw, spherical_cap, with_end_angles
from strainfmu.errors import FlowReachError

COARSE = GRID_LEVELS["coarse"]


@cache
def sphere_cone(nose_radius: float, half_angle_deg: float, length: float) -> BodyOfRevolution:
    """Return a sphere-cone, lengths in [m]."""
    angle = radians(half_angle_deg)

    def cone(x: float, radius: float) -> Segment:
        return Segment(start_x=x, end_x=length, start_radius=radius, start_angle=angle, end_angle=angle)

    return chain_pieces([lambda x, radius: spherical_cap(nose_radius, angle), cone])


@cache
def blunt_flow(mach_number: float, incidence_deg: float, grid: MarchingGrid = COARSE) -> FlowSolution:
    """Return the flow over a sphere-cone of 9 deg, 20 nose radii long."""
    return solve_flow(sphere_cone(0.08, 9.0, 1.6), mach_number, radians(incidence_deg), grid)


def coefficients(flow: FlowSolution, body: BodyOfRevolution) -> np.ndarray:
    """Return C_A and C_N on the base area."""
    return flow.force / (0.5 * GAMMA * flow.mach_number**2 * pi * body.base_radius**2)


@pytest.mark.fast
@pytest.mark.parametrize(("mach_number", "ratio"), [(6.0, 46.815), (20.0, 515.484)])
def test_stagnation_pressure_is_the_pitot_pressure(mach_number: float, ratio: float) -> None:
    """Over p_inf, by Rayleigh's formula."""
    sphere = solve_sphere(mach_number, radians(75.0))
    assert GAMMA * sphere.wall_pressure(np.zeros(1)) == pytest.approx(ratio, rel=2e-5)


@pytest.mark.parametrize("mach_number", sweep([4.0, 6.0, 10.0, 20.0], [6.0, 20.0]))
def test_stand_off_is_that_of_the_correlation(mach_number: float) -> None:
    """Seiff's correlation 0.78 rho_inf/rho_2 (NASA SP-24, 1962)."""
    density = (GAMMA + 1.0) * mach_number**2 / ((GAMMA - 1.0) * mach_number**2 + 2.0)
    stand_off = float(solve_sphere(mach_number, radians(75.0)).shock_radius(np.zeros(1))[0]) - 1.0
    assert stand_off == pytest.approx(0.78 / density, rel=0.03)


@pytest.mark.parametrize(
    ("mach_number", "tolerance"), sweep([(2.0, 4e-3), (6.0, 1.5e-3), (20.0, 1.5e-3)], [(6.0, 1.5e-3)])
)
def test_the_sphere_does_not_depend_on_how_far_it_is_solved(mach_number: float, tolerance: float) -> None:
    theta = np.radians(np.linspace(0.0, 65.0, 14))
    near = solve_sphere(mach_number, radians(75.0)).wall_pressure(theta)
    far = solve_sphere(mach_number, radians(100.0)).wall_pressure(theta)
    assert np.allclose(far, near, rtol=tolerance, atol=0.0)


@pytest.mark.fast
def test_mass_through_the_layer_is_what_the_shock_takes_in() -> None:
    """Across the layer at theta: integral of rho v 2 pi r sin(theta) dr = M pi (r_s sin(theta))^2."""
    sphere = solve_sphere(6.0, radians(75.0))
    node, weight = np.polynomial.legendre.leggauss(16)
    for theta in np.radians([10.0, 40.0, 70.0]):
        shock = float(sphere.shock_radius(np.array([theta]))[0])
        r = 1.0 + (shock - 1.0) * 0.5 * (1.0 + node)
        _, density, _, v = sphere.state(np.full_like(r, theta), r)
        through = np.sum(0.5 * (shock - 1.0) * weight * density * v * 2.0 * pi * r * np.sin(theta))
        assert through == pytest.approx(6.0 * pi * (shock * np.sin(theta)) ** 2, rel=1e-4)


# Half-angle [deg], M, where the pressure is lowest [nose radii].
SHARP = [(10.0, 6.0, 7.95), (15.0, 10.0, 5.15)]


@pytest.mark.parametrize(
    ("mach_number", "incidence_deg"), sweep([(3.0, 4.0), (6.0, 8.0), (10.0, 12.0)], [(6.0, 8.0)])
)
def test_force_of_the_wall_is_the_momentum_that_the_flow_lost(mach_number: float, incidence_deg: float) -> None:
    """From the stagnation point to the base: the cap's pressure, the cut and the march fit together."""
    flow = blunt_flow(mach_number, incidence_deg)
    assert np.linalg.norm(flow.force - flow.force_from_momentum) < 2e-4 * np.linalg.norm(flow.force)
    assert abs(flow.mass_defect) < 3e-6
    assert flow.n_repairs == 0


@pytest.mark.parametrize(("half_angle_deg", "mach_number", "dip"), sweep(SHARP, SHARP[:1]))
def test_far_downstream_it_is_the_sharp_cone(half_angle_deg: float, mach_number: float, dip: float) -> None:
    """200 nose radii aft: Taylor-Maccoll. Between, the pressure falls below the cone's and comes back."""
    flow = solve_flow(sphere_cone(0.01, half_angle_deg, 2.0), mach_number, 0.0)
    x, pressure = flow.pieces[0]
    over_cone = pressure[:, 0] / taylor_maccoll_pressure(radians(half_angle_deg), mach_number)
    assert over_cone[-1] == pytest.approx(1.0, abs=1e-3)
    lowest = int(np.argmin(over_cone))
    assert 0.65 < over_cone[lowest] < 0.85
    assert x[lowest] / 0.01 == pytest.approx(dip, abs=0.3)


def test_it_does_not_matter_where_the_cap_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    body = sphere_cone(0.08, 9.0, 1.6)
    near = coefficients(blunt_flow(6.0, 8.0), body)
    monkeypatch.setattr(spherical_start, "START_MACH_NUMBER", 1.6)
    far = coefficients(solve_flow(body, 6.0, radians(8.0), COARSE), body)
    assert np.allclose(far, near, rtol=5e-4, atol=0.0)


def test_grids_agree() -> None:
    """C_A and C_N of the coarse grid within 0.1 % of the fine one's; pressure 2.5 nose radii aft within 0.5 %."""
    coarse, fine = blunt_flow(6.0, 8.0), blunt_flow(6.0, 8.0, GRID_LEVELS["fine"])
    assert np.allclose(coarse.force, fine.force, rtol=1e-3, atol=0.0)
    found = [
        [np.interp(0.2, x, pressure[:, column]) for column in (0, -1)]
        for x, pressure in (flow.pieces[0] for flow in (coarse, fine))
    ]
    assert np.allclose(*found, rtol=0.005, atol=0.0)


@pytest.mark.fast
def test_grid_of_the_tip_is_as_fine_at_the_wall() -> None:
    tip = spherical_start.tip_grid(COARSE)
    assert tip.n_radial == 2 * COARSE.n_radial
    assert tip.spacing(tip.n_radial)[1] == pytest.approx(COARSE.spacing(COARSE.n_radial)[1], rel=1e-9)


def test_the_whole_body_bears_what_its_halves_bear() -> None:
    body = sphere_cone(0.08, 9.0, 1.6)
    grid = MarchingGrid(n_radial=12, n_circumferential=18)
    half = solve_flow(body, 6.0, radians(6.0), grid)
    full = solve_full_flow(body, 6.0, 0.0, radians(6.0), grid)
    assert np.allclose([full.force[0], -full.force[1]], half.force, rtol=1e-3, atol=0.0)


def test_a_cut_that_is_not_supersonic_is_refused() -> None:
    """A cap that ends at 40 deg ends ahead of the sonic line; a cone of 30 deg at 10 deg loses it to windward."""
    with pytest.raises(
        FlowReachError, match=r"^euler: the axial Mach number is below 1\.05 where the spherical tip ends"
    ):
        solve_flow(sphere_cone(0.1, 40.0, 0.6), 6.0, 0.0, COARSE)
    with pytest.raises(FlowReachError, match=r"M 6, total incidence 10 deg: outside the solver's reach") as caught:
        solve_flow(sphere_cone(0.1, 30.0, 0.6), 6.0, radians(10.0), COARSE)
    assert "\n" not in str(caught.value)


def test_a_march_that_begins_at_the_very_end_of_the_cap() -> None:
    """At M 2 the cut lies where the cap ends; a break of slope there makes the cap a smooth piece of its own."""
    angle = radians(24.0)

    def cone(x: float, radius: float) -> Segment:
        return Segment(start_x=x, end_x=0.3, start_radius=radius, start_angle=angle, end_angle=angle)

    body = chain_pieces([lambda x, radius: spherical_cap(0.02, radians(25.0)), cone])
    assert len(body.slope_breaks) == 1
    flow = solve_flow(body, 2.0, 0.0, COARSE)
    assert flow.pieces[1][1][-1].mean() == pytest.approx(taylor_maccoll_pressure(angle, 2.0), rel=0.05)


@pytest.mark.fast
def test_only_spheres_are_caps() -> None:
    cap = cap_of(sphere_cone(0.08, 9.0, 1.6))
    assert cap is not None
    assert cap.radius == pytest.approx(0.08)
    assert cap.end_angle == pytest.approx(radians(81.0))
    angle = radians(9.0)
    cone = Segment(start_x=0.0, end_x=1.0, start_radius=0.0, start_angle=angle, end_angle=angle)
    assert cap_of(BodyOfRevolution((cone,))) is None


def von_karman(fineness: float) -> BodyOfRevolution:
    """Return von Karman's ogive of diameter 0.2 m."""
    size = {"start_x": 0.0, "start_radius": 0.0, "start_angle": 0.5 * pi, "end_angle": 0.0}
    ogive = Haack(end_x=0.2 * fineness, base_radius=0.1, shape_factor=0.0, **size)
    return chain_pieces([lambda x, radius: with_end_angles(ogive)])


@cache
def ogive_flow(mach_number: float, incidence_deg: float) -> FlowSolution:
    return solve_flow(von_karman(3.0), mach_number, radians(incidence_deg), COARSE)


def test_a_tip_of_infinite_slope_gets_the_cap_that_it_needs() -> None:
    """Mach 2 at 6 deg, where no cone at the tip has an attached shock: force and momentum agree behind the cap."""
    flow = ogive_flow(2.0, 6.0)
    assert 0.0 < flow.capped_to < 0.02 * 0.6
    assert np.linalg.norm(flow.force - flow.force_from_momentum) < 2e-5 * np.linalg.norm(flow.force)
    assert flow.n_repairs == 0
    station, pressure = flow.pieces[0]
    assert station[0] == 0.0
    assert station[-1] == pytest.approx(0.6, rel=0.01)
    assert np.all(np.diff(station) > 0.0)
    # The tip has the pitot pressure (Rayleigh, M 2: 5.640); a stream at 6 deg meets the sphere beside it.
    assert ogive_flow(2.0, 0.0).pieces[0][1][0].mean() == pytest.approx(5.640, rel=1e-3)
    assert pressure.max() == pytest.approx(5.640, rel=2e-3)


def test_forces_converge_as_the_cap_shrinks(monkeypatch: pytest.MonkeyPatch) -> None:
    """C_A and C_N of caps that are made too long approach the forces of the smallest cap."""
    body, smallest = von_karman(3.0), ogive_flow(2.0, 6.0)
    at_smallest = coefficients(smallest, body)
    differences, ends = [], []
    for start in (1.4, 1.25):
        monkeypatch.setattr(spherical_start, "START_MACH_NUMBER", start)
        flow = solve_flow(body, 2.0, radians(6.0), COARSE)
        ends.append(flow.capped_to)
        differences.append(np.abs(coefficients(flow, body) - at_smallest))
    assert ends[0] > ends[1] > smallest.capped_to
    assert np.all(differences[1] < 0.25 * differences[0])
    assert np.all(differences[1] < 0.025 * at_smallest)


@pytest.mark.parametrize("incidence_deg", sweep([0.0, 4.0], [4.0]))
def test_where_the_tip_can_be_marched_a_cap_gives_the_same_forces(
    incidence_deg: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At Mach 3 a cone over the foremost hundredth is in reach; both starts agree in C_A, C_N and pressure aft."""
    marched = ogive_flow(3.0, incidence_deg)
    assert marched.capped_to == 0.0

    def refused(*_: object) -> None:
        raise FlowReachError("no conical start")

    monkeypatch.setattr(body_march, "_conical_start", refused)
    capped = solve_flow(von_karman(3.0), 3.0, radians(incidence_deg), COARSE)
    assert 0.0 < capped.capped_to < 0.006
    assert np.allclose(capped.force, marched.force, rtol=2e-3, atol=1e-6)
    aft = [np.interp(0.3, x, pressure[:, -1]) for x, pressure in (capped.pieces[0], marched.pieces[0])]
    assert aft[0] == pytest.approx(aft[1], rel=1e-3)


@pytest.mark.fast
def test_what_no_cap_can_help_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cone has no slender end for a cap, and near M 1 the flow over the sphere itself is not found."""

    @cache
    def tried(mach_number: float, reach: float) -> SphereFlow | FlowReachError:
        try:
            return solve_sphere(mach_number, reach)
        except FlowReachError as error:
            return error

    def once_tried(mach_number: float, reach: float) -> SphereFlow:
        found = tried(mach_number, reach)
        if isinstance(found, FlowReachError):
            raise found
        return found

    monkeypatch.setattr(spherical_start, "solve_sphere", once_tried)
    monkeypatch.setattr(sphere_flow, "MAX_ITERATIONS", 6)
    not_found = r"the flow over the spherical tip is not found at Mach number 1\.2 for M 1\.2"
    for body, said in ((sphere_cone(0.08, 9.0, 1.6), not_found), (von_karman(3.0), "outside the solver's reach")):
        with pytest.raises(FlowReachError, match=said):
            solve_flow(body, 1.2, 0.0, MarchingGrid(n_radial=8, n_circumferential=12))


def test_a_paraboloid_is_marched_behind_its_sphere() -> None:
    """r^2 = 2 R x is blunt: the tip has the pitot pressure, and wall force and momentum agree."""
    size = {"start_x": 0.0, "start_radius": 0.0, "start_angle": 0.5 * pi, "end_angle": 0.0}
    nose = with_end_angles(PowerLaw(end_x=0.4, base_radius=0.2, exponent=0.5, **size))
    flow = solve_flow(chain_pieces([lambda x, radius: nose]), 6.0, 0.0, COARSE)
    assert flow.capped_to > 0.0
    assert flow.pieces[0][1].max() == pytest.approx(46.815, rel=1e-3)
    assert np.linalg.norm(flow.force - flow.force_from_momentum) < 2e-4 * np.linalg.norm(flow.force)
