"""The march: balances, corners, shocks, and where it must give up."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from math import atan, log, pi, radians, tan
from typing import Literal

import numpy as np
import pytest
from cone_theory import taylor_maccoll_surface
from sweeps import sweep

from builder.aero.engines.euler import pressure_at_stations, pressure_ratio_on_surface
from builder.aero.euler.bodies.solver import FlowSolution, free_stream_of, solve_flow
from builder.aero.euler.planes import GRID_LEVELS, MarchingGrid, free_stream
from builder.aero.euler.scheme.gas import expanded_pressure_ratio
from builder.aero.euler.scheme.grid import Step, cell_areas, full_body_rays, half_body_rays, place_vertices
from builder.aero.euler.scheme.march import advance_cells, decode, find_fluxes
from builder.aero.load_operator import load_operator
from builder.vehicle.shape.geometry import BodyOfRevolution, surface_grid
from strainfmu.errors import FlowReachError, InputError

BodyMaker = Callable[..., BodyOfRevolution]
VehicleFlow = Callable[[float, float], FlowSolution]

# Half-angle [deg], M, p/p_inf just behind a shoulder turning to 0 deg: Prandtl-Meyer from the cone's M.
SHOULDERS = [
    (5.0, 5.0, 0.754824),
    (5.0, 7.0, 0.730461),
    (10.0, 5.0, 0.702392),
    (10.0, 7.0, 0.699873),
    (15.0, 5.0, 0.692073),
    (15.0, 7.0, 0.718519),
]

# M, wave drag C_A of the tangent ogive of fineness 5 at a = 0: method of characteristics (Rossow, NACA TN 2399,
# in Jorgensen, NASA TN D-6996, fig. 6), read from the curve, which is a 3 % test on cones.
OGIVES = [(5.0, 0.0321), (6.0, 0.0308), (7.0, 0.0296)]


@pytest.mark.parametrize(
    ("mach_number", "incidence"),
    sweep([(5.0, 4.0), (5.0, 8.478), (6.0, 0.0), (6.0, 10.0), (7.0, 14.106)], [(5.0, 8.478), (6.0, 0.0)]),
)
def test_surface_pressure_carries_the_momentum(
    mach_number: float, incidence: float, vehicle_body: BodyOfRevolution, vehicle_flow: VehicleFlow
) -> None:
    """The pressure at the nodes, integrated, against the momentum of the exit plane: 0.5 % of the force."""
    flow = vehicle_flow(mach_number, incidence)
    surface = surface_grid(vehicle_body, 120, 72)
    ratio = pressure_ratio_on_surface(pressure_at_stations(flow.pieces, surface), flow.roll_angle, surface, 0.0)
    axial, normal = (load_operator(surface, 2.0) @ (ratio - 1.0))[:2]
    size = np.linalg.norm(flow.force_from_momentum)
    assert axial == pytest.approx(flow.force_from_momentum[0], rel=5e-3)
    assert normal == pytest.approx(flow.force_from_momentum[1], abs=5e-3 * size)
    np.testing.assert_allclose(flow.force, flow.force_from_momentum, rtol=0.0, atol=5e-3 * size)
    assert abs(flow.mass_defect) < 1e-4
    assert flow.n_repairs == 0


@pytest.mark.parametrize(("half_angle", "mach_number", "expected"), sweep(SHOULDERS, SHOULDERS[::5]))
def test_shoulder_expands_as_prandtl_and_meyer(
    half_angle: float, mach_number: float, expected: float, make_body: BodyMaker
) -> None:
    """The first ten pressures behind the corner within 0.3 %, on every grid."""
    body = make_body((1.0, half_angle, half_angle), (1.05, 0.0, 0.0))
    for level, grid in GRID_LEVELS.items():
        stations, pressure = solve_flow(body, mach_number, 0.0, grid).pieces[1]
        assert 1.0 < stations[0] < 1.002, level
        np.testing.assert_allclose(pressure[:10], expected, rtol=3e-3, err_msg=level)


@pytest.mark.parametrize(
    ("half_angle", "behind", "mach_number"),
    sweep([(5.0, 1.0, 5.0), (5.0, 1.0, 7.0), (10.0, 0.0, 5.0), (10.0, 0.0, 3.0)], [(5.0, 1.0, 7.0)]),
)
def test_pressure_rises_evenly_behind_a_shoulder(
    half_angle: float, behind: float, mach_number: float, make_body: BodyMaker
) -> None:
    """Fine grid: within 0.3 % of a straight line from Prandtl-Meyer's value over 20 mm. It does not swing."""
    body = make_body((1.0, half_angle, half_angle), (1.1, behind, behind))
    stations, pressure = solve_flow(body, mach_number, 0.0, GRID_LEVELS["fine"]).pieces[1]
    surface, mach = taylor_maccoll_surface(radians(half_angle), mach_number)
    first = surface * expanded_pressure_ratio(mach, radians(half_angle - behind))
    near = stations < 1.02
    found = pressure[near].mean(axis=1) / first - 1.0
    x = stations[near] - 1.0
    rise = (x @ found) / (x @ x)
    np.testing.assert_allclose(found, rise * x, rtol=0.0, atol=3e-3)


@pytest.mark.parametrize(("mach_number", "incidence"), sweep([(1.5, 0.0), (2.0, 5.0), (3.0, 10.0)], [(1.5, 0.0)]))
def test_shoulder_keeps_the_balances_at_low_mach_numbers(
    mach_number: float, incidence: float, vehicle_body: BodyOfRevolution
) -> None:
    """There the layer is thick against the body, and its cells with it. Mass is that of the start, within its
    tolerance over ten."""
    grid = GRID_LEVELS["coarse"]
    flow = solve_flow(vehicle_body, mach_number, radians(incidence), grid)
    imbalance = np.linalg.norm(flow.force - flow.force_from_momentum)
    assert imbalance < 5e-4 * np.linalg.norm(flow.force)
    assert abs(flow.mass_defect) < 0.1 * grid.conical_tolerance


@pytest.mark.parametrize(
    ("mach_number", "incidence"), sweep([(5.0, 3.0), (6.0, 8.478), (7.0, 14.106)], [(6.0, 8.478)])
)
def test_the_start_is_settled_well_within_the_error_of_the_grid(
    mach_number: float, incidence: float, vehicle_body: BodyOfRevolution
) -> None:
    """Forces of a start to a thirtieth of the tolerance: 5e-5 of the force, a tenth of the next grid's change."""

    def force(level: str, **entries: float) -> np.ndarray:
        grid = replace(GRID_LEVELS[level], **entries)
        return solve_flow(vehicle_body, mach_number, radians(incidence), grid).force

    medium = force("medium")
    change = np.linalg.norm(force("medium", conical_tolerance=1e-5) - medium)
    assert change < 5e-5 * np.linalg.norm(medium)
    assert change < 0.1 * np.linalg.norm(force("fine") - medium)


def test_expansion_that_ends_near_vacuum_is_marched(make_body: BodyMaker) -> None:
    """The gas relations end the fan on the lee; the march alone gets through."""
    body = make_body((1.0, 16.0, 0.5), (1.6, 0.0, 0.0), (1.8, -5.0, -5.0))
    flow = solve_flow(body, 8.0, radians(20.0), GRID_LEVELS["coarse"])
    assert 0.0 < flow.pieces[-1][1].min() < 0.01


def test_march_alone_leaves_the_pressure_off(make_body: BodyMaker) -> None:
    """The option by which the printed reproduction is made: 1 % at first, then 3 to 4 %, at 10 deg and M 7."""
    body = make_body((1.0, 10.0, 10.0), (1.05, 0.0, 0.0))
    grid = replace(GRID_LEVELS["fine"], corner="marched")
    error = solve_flow(body, 7.0, 0.0, grid).pieces[1][1][:4].mean(axis=1) / 0.699873 - 1.0
    np.testing.assert_allclose(error, [-0.0098, -0.0304, -0.0362, -0.0269], atol=5e-4)


@pytest.mark.parametrize(("mach_number", "expected"), sweep(OGIVES, OGIVES[1:2]))
def test_wave_drag_of_a_tangent_ogive(mach_number: float, expected: float, make_body: BodyMaker) -> None:
    """Within 4 %: the curve's own accuracy and the +-0.01 of its reading."""
    body = make_body((1.0, np.degrees(2.0 * atan(0.1)), 0.0))
    assert body.base_radius == pytest.approx(0.1, rel=1e-12)
    flow = solve_flow(body, mach_number, 0.0)
    assert flow.force[0] / (0.7 * mach_number**2 * pi * 0.1**2) == pytest.approx(expected, rel=0.04)
    assert flow.force[0] == pytest.approx(flow.force_from_momentum[0], rel=1e-3)


@pytest.mark.parametrize("mach_number", sweep([one for one, _ in OGIVES], [6.0]))
def test_wave_drag_of_a_tangent_ogive_is_converged(mach_number: float, make_body: BodyMaker) -> None:
    """0.3 % of the three grids' limit on the medium one: what is left to the curve above is the curve's."""
    body = make_body((1.0, np.degrees(2.0 * atan(0.1)), 0.0))
    coarse, medium, fine = (solve_flow(body, mach_number, 0.0, grid).force[0] for grid in GRID_LEVELS.values())
    assert 1.5 < log((coarse - medium) / (medium - fine)) / log(1.5) < 2.5
    assert abs(medium / (fine - (medium - fine) / (1.5**2 - 1.0)) - 1.0) < 3e-3


def test_leeward_cross_flow_shock(vehicle_flow: VehicleFlow) -> None:
    """At M 5, 8.478 deg the pressure at the base falls round the side and rises again to the leeward ray."""
    flow = vehicle_flow(5.0, 8.478)
    at_base = flow.pieces[-1][1][-1]
    lowest = int(at_base.argmin())
    assert np.degrees(flow.roll_angle[lowest]) == pytest.approx(45.0, abs=20.0)
    assert at_base[0] > 3.0 * at_base[lowest]
    assert np.all(np.diff(at_base[: lowest + 1]) < 0.0)
    assert at_base[-1] == at_base.max()


@pytest.mark.parametrize("mach_number", sweep([5.0, 6.0, 7.0], [6.0]))
def test_no_variation_round_the_body_without_incidence(mach_number: float, vehicle_flow: VehicleFlow) -> None:
    """Within 2e-4: round-off and the limiter, less than the tolerance of the conical start."""
    for _, pressure in vehicle_flow(mach_number, 0.0).pieces:
        np.testing.assert_allclose(pressure, np.tile(pressure.mean(axis=1)[:, None], (1, 36)), rtol=2e-4)


def test_incidence_from_below_mirrors_the_flow(make_body: BodyMaker) -> None:
    body, grid = make_body((1.0, 10.0, 10.0)), MarchingGrid(n_radial=12, n_circumferential=16)
    up, down = (solve_flow(body, 6.0, radians(angle), grid) for angle in (3.0, -3.0))
    np.testing.assert_allclose(down.force, up.force * [1.0, -1.0], rtol=1e-4)
    np.testing.assert_allclose(down.pieces[0][1][-1], up.pieces[0][1][-1][::-1], rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("mach_number", "incidence"), [(5.0, 2.0), (5.0, 8.478), (6.0, 4.0), (7.0, 10.0)])
def test_twice_the_cells_change_the_forces_little(
    mach_number: float, incidence: float, vehicle_body: BodyOfRevolution, vehicle_flow: VehicleFlow
) -> None:
    """The default 24 x 36 against 48 x 72 cells: C_A and C_N within 1 %."""
    fine = solve_flow(
        vehicle_body, mach_number, radians(incidence), MarchingGrid(n_radial=48, n_circumferential=72)
    )
    np.testing.assert_allclose(vehicle_flow(mach_number, incidence).force, fine.force, rtol=0.01)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("mach_number", "angle_of_attack", "sideslip_angle"),
    [(5.0, 0.0, 0.0), (6.0, 0.1, 0.0), (7.0, -0.2, 0.0), (6.0, 0.1, 0.15), (5.0, 0.0, -0.2)],
)
def test_uniform_stream_stays_uniform_on_a_moving_grid(
    mach_number: float, angle_of_attack: float, sideslip_angle: float
) -> None:
    """One step on a skewed grid that moves: all cells but those at the wall keep the stream to 1e-12."""
    random = np.random.default_rng(3)
    n_half, n_r, dx = 10, 9, 0.02
    rays = full_body_rays(n_half) if sideslip_angle else half_body_rays(n_half)
    n_phi = rays.cell_sine.size
    spacing = np.linspace(0.0, 1.0, n_r + 1) ** 1.3
    before, after = np.empty((2, n_phi + 1, n_r + 1)), np.empty((2, n_phi + 1, n_r + 1))
    wall = np.full(n_phi + 1, 0.10)
    place_vertices(wall, 0.3 + 0.05 * random.random(n_phi + 1), spacing, rays, before)
    place_vertices(wall, 0.31 + 0.05 * random.random(n_phi + 1), spacing, rays, after)
    for vertex in (before, after):
        vertex[:, 1:-1, 1:] += 2e-3 * random.normal(size=(2, n_phi - 1, n_r))
        if rays.closed:
            vertex[:, -1] = vertex[:, 0]
    area_before, area_after = np.empty((n_phi, n_r)), np.empty((n_phi, n_r))
    cell_areas(before, area_before)
    cell_areas(after, area_after)
    stream = free_stream_of(mach_number, angle_of_attack, sideslip_angle)
    conserved = free_stream(stream, n_phi, n_r)
    cell, wave = np.empty((5, n_phi, n_r)), np.empty((4, n_phi + 2, n_r))
    assert decode(conserved, rays, stream, cell, wave)
    change, result, pressure = np.empty_like(conserved), np.empty_like(conserved), np.empty(n_phi)
    repairs = np.zeros(1, dtype=np.int64)
    step = Step(before, after, dx)
    assert find_fluxes(step, cell, wave, rays, stream, change, wall_pressure=pressure, repairs=repairs)
    advance_cells(conserved, area_before, change, change, area_after, result)
    assert np.abs(area_after / area_before - 1.0).max() > 0.05
    size = conserved[1].max()
    np.testing.assert_allclose(result[:, :, 1:], conserved[:, :, 1:], rtol=0.0, atol=1e-12 * size)
    assert repairs[0] == 0


@pytest.mark.fast
def test_grid_has_the_area_of_its_circles() -> None:
    """Between body 0.1 m and outer boundary 0.3 m lies half of pi (0.3^2 - 0.1^2), all round the whole."""
    for rays, share in ((half_body_rays(12), 0.5), (full_body_rays(12), 1.0)):
        n_phi = rays.cell_sine.size
        vertex, area = np.empty((2, n_phi + 1, 9)), np.empty((n_phi, 8))
        place_vertices(np.full(n_phi + 1, 0.1), np.full(n_phi + 1, 0.3), MarchingGrid().spacing(8), rays, vertex)
        cell_areas(vertex, area)
        assert area.sum() == pytest.approx(share * pi * (0.3**2 - 0.1**2), rel=1e-12)


def test_spacing_grows_outward_by_the_clustering() -> None:
    step = np.diff(MarchingGrid(clustering=1.0).spacing(24))
    assert step[-1] / step[0] == pytest.approx(np.exp(23.0 / 24.0), rel=1e-12)
    np.testing.assert_allclose(np.diff(MarchingGrid(clustering=0.0).spacing(24)), 1.0 / 24.0, rtol=1e-12)


COARSE = MarchingGrid(n_radial=12, n_circumferential=18)


@pytest.mark.parametrize(
    ("pieces", "mach_number", "incidence", "words"),
    [
        (((1.0, 40.0, 40.0),), 1.5, 0.0, ("axial Mach number", "(tip)", "M 1.5", "incidence 0 deg")),
        pytest.param(
            *(((1.0, 10.0, 10.0),), 2.0, 50.0, ("axial Mach number", "(tip)", "M 2,", "incidence 50 deg")),
            marks=pytest.mark.slow,
        ),
        (((1.0, 10.0, 10.0), (1.5, 40.0, 40.0)), 3.0, 0.0, ("axial Mach number", "M 3,", "incidence 0 deg")),
        (((1.0, 5.0, 5.0), (1.5, 35.0, 35.0)), 3.0, 3.0, ("axial Mach number", "M 3,", "incidence 3 deg")),
    ],
)
def test_condition_out_of_reach_is_named(
    pieces: tuple[tuple[float, float, float], ...],
    mach_number: float,
    incidence: float,
    words: tuple[str, ...],
    make_body: BodyMaker,
) -> None:
    with pytest.raises(FlowReachError) as error:
        solve_flow(make_body(*pieces), mach_number, radians(incidence), COARSE)
    message = str(error.value)
    for word in words:
        assert word in message
    station = float(message.split("x = ")[1].split(" m")[0])
    assert station == pytest.approx(0.0 if len(pieces) == 1 else 1.0, abs=0.02)
    assert "\n" not in message
    assert isinstance(error.value, InputError)


def test_a_refusal_at_the_tip_states_what_helps(make_body: BodyMaker) -> None:
    """The stated Mach number is the lowest, in steps of 0.1, at which the march gets over this tip."""
    body, incidence = make_body((1.0, 34.5, 34.5)), radians(6.0)
    grid = MarchingGrid(n_radial=8, n_circumferential=12)
    with pytest.raises(FlowReachError) as error:
        solve_flow(body, 2.0, incidence, grid)
    message = str(error.value)
    assert message.endswith("; else take engine = 'newtonian'")
    lowest = float(message.split("this tip needs M ")[1].split(" ")[0])
    assert solve_flow(body, lowest, incidence, grid).force[0] > 0.0
    with pytest.raises(FlowReachError, match="falls to 1"):
        solve_flow(body, lowest - 0.1, incidence, grid)
    with pytest.raises(FlowReachError, match="no Mach number helps here"):
        solve_flow(body, 2.0, radians(50.0), grid)


@pytest.mark.parametrize(("boat_tail", "corner"), [(-30.0, "fan"), (-12.0, "marched")])
@pytest.mark.parametrize("incidence", [0.0, 10.0])
def test_expansion_out_of_reach_is_not_called_a_shock(
    incidence: float, boat_tail: float, corner: Literal["fan", "marched"], make_body: BodyMaker
) -> None:
    """A boat-tail that turns the flow too far: no word of a detached shock or of sonic flow."""
    body = make_body((1.0, 10.0, 10.0), (1.3, boat_tail, boat_tail))
    with pytest.raises(FlowReachError, match=r"expands to near vacuum at x = 1") as error:
        solve_flow(body, 7.0, radians(incidence), replace(COARSE, corner=corner))
    assert "axial Mach number" not in str(error.value)
    assert "detach" not in str(error.value)


@pytest.mark.parametrize("incidence", sweep([0.0, 5.0, 10.0], [10.0]))
def test_steep_boat_tail_at_high_mach_number_is_solved(incidence: float, make_body: BodyMaker) -> None:
    """22 deg away at M 7: an expansion to a few percent of p_inf, and the wall carries the momentum."""
    flow = solve_flow(make_body((1.0, 10.0, 10.0), (1.3, -12.0, -12.0)), 7.0, radians(incidence))
    assert 0.0 < flow.pieces[1][1].min() < 0.1
    np.testing.assert_allclose(
        flow.force, flow.force_from_momentum, rtol=0.0, atol=1e-3 * np.linalg.norm(flow.force)
    )


@pytest.mark.fast
@pytest.mark.parametrize("mach_number", [0.8, 1.0, float("nan")])
def test_subsonic_stream_is_refused(mach_number: float, make_body: BodyMaker) -> None:
    with pytest.raises(FlowReachError, match="must be greater than 1"):
        solve_flow(make_body((1.0, 10.0, 10.0)), mach_number, 0.0)


TINY_FLOWS = """
import json
from math import radians
import numpy as np
from builder.aero.euler.bodies import body_march
from builder.aero.euler.scheme import gas
from builder.aero.euler.bodies.solver import MarchingGrid, solve_flow
from builder.vehicle.shape.geometry import chain_segments
from strainfmu.errors import FlowReachError

body_march.MAX_LEGS, body_march.LARGEST_UNREST = 3, float("inf")  # unsettled, but the same in both
ten = radians(10.0)
grid = MarchingGrid(n_radial=8, n_circumferential=8, conical_tolerance=1.0, corner="marched")
body = chain_segments([(0.5, ten, ten), (0.52, 0.0, 0.0), (0.53, 0.0, -0.02)])
flow = solve_flow(body, 5.0, radians(4.0), grid)
corner = chain_segments([(0.5, ten, ten), (0.6, 4.0 * ten, 4.0 * ten)])
refused = []
for shape, mach in ((corner, 3.0), (chain_segments([(1.0, 4.0 * ten, 4.0 * ten)]), 1.5)):
    try:
        solve_flow(shape, mach, 0.0, grid)
    except FlowReachError as error:
        refused.append(str(error))
walls = [gas.wall_pressure(1.0, 1.0, 5.0, turn) for turn in (-1.0, -0.1, -5e-7, 0.0, 0.1, 1.0, 2.0)]
states = [gas.primitive(1.0, m, 0.1, 0.2, 15.0) for m in (1.0, 6.0)]
values = [*flow.force, *flow.force_from_momentum, *flow.pieces[-1][1][-1], *walls, *states[0], *states[1]]
print(json.dumps([values, flow.n_steps, refused]))
"""


def tiny_flows(interpreted: bool) -> tuple[np.ndarray, int, list[str]]:
    """Run a few small flows in a process of their own; return numbers, marching steps and refusals."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1" if interpreted else "0"}
    done = subprocess.run(
        [sys.executable, "-c", TINY_FLOWS], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    values, steps, refused = json.loads(done.stdout)
    return np.array(values), steps, refused


@pytest.mark.slow
def test_compiled_solver_is_the_interpreted_one() -> None:
    """The same without machine code, to 1e-7: limiters and the extrapolation of the start make round-off grow.

    The interpreter takes seconds even for flows of a few steps.
    """
    compiled, steps, refused = tiny_flows(interpreted=False)
    interpreted, steps_interpreted, refused_interpreted = tiny_flows(interpreted=True)
    np.testing.assert_allclose(interpreted, compiled, rtol=1e-7, atol=1e-12)
    assert steps == steps_interpreted > 5
    assert refused == refused_interpreted
    assert len(refused) == 2


def test_total_drag_of_a_cone_grows_with_its_area(make_body: BodyMaker) -> None:
    """Conical flow has no length: a cone twice as long has four times the force, and the same pressure."""
    short, long = (solve_flow(make_body((x, 10.0, 10.0)), 6.0, radians(4.0), COARSE) for x in (1.0, 2.0))
    np.testing.assert_allclose(long.force, 4.0 * short.force, rtol=1e-12)
    base_area = pi * tan(radians(10.0)) ** 2
    assert short.force[0] / base_area == pytest.approx(float(np.mean(short.pieces[0][1][-1] - 1.0)), rel=1e-12)
