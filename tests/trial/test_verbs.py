"""What a case does: faults of readings, motion, friction and other pressure, beside closed forms."""

from __future__ import annotations

from math import degrees, radians
from typing import Any

import numpy as np
import pytest
from trial_cases import case_of, other_world

from builder.aero.engines.local_inclination import largest_pressure_coefficient
from builder.trial.conditions import (
    RISE,
    Motion,
    Where,
    envelope_incidence,
    flown_conditions,
    held_out_conditions,
    stress_knots,
)
from builder.trial.faults import AddedStrain, Fault, Gauges
from builder.trial.flows import Flow, solved_knots
from builder.trial.readings import World, read_motion
from builder.truth.revolution.flow_table import FlowTable, truth_surface
from builder.truth.revolution.strain import TrueStructure
from builder.vehicle.file import IC3X, Vehicle, load_vehicle

N = 8
GAUGES = Gauges(
    station=np.array([0.5, 1.5, 2.5, 3.5] * 2), roll_angle=np.repeat([0.0, np.pi], 4), noise_std=np.full(N, 0.1)
)
LEEWARD = np.linspace(0.0, 3.0, 10)


def read(**fault: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return strain (10, 8) and what is read of it with a fault."""
    random = np.random.default_rng(1)
    strain = random.standard_normal((10, N))
    return strain, Fault(**fault).readings(strain, GAUGES, LEEWARD, random)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("fault", "changed", "expected"),
    [
        ({"of": 3, "add_um_per_m": 2e6}, 3, lambda strain: strain + 2.0),
        ({"of": 1, "add_sigmas": 20.0}, 1, lambda strain: strain + 2.0),
        ({"of": 1, "times": -1.0}, 1, lambda strain: -strain),
        ({"times": 1e3}, N, lambda strain: 1e3 * strain),
        ({"of": 3, "lost": True}, 3, lambda strain: np.nan * strain),
        ({"exchanged": "all"}, N, lambda strain: np.roll(strain, 4, axis=1)),
        ({"add_um_per_m": 3e6, "shape": "linear"}, N - 2, lambda strain: strain + 2 * [0.0, 1.0, 2.0, 3.0]),
        (
            {"add_um_per_m": -2e6, "shape": "cosine"},
            N,
            lambda strain: strain - 2.0 * np.cos(GAUGES.roll_angle - LEEWARD[:, None]),
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_readings_change_as_they_say(fault: Any, changed: int, expected: Any) -> None:
    strain, found = read(**fault)
    other = np.any(found != strain, axis=0)
    assert np.count_nonzero(other) == changed
    np.testing.assert_allclose(found[:, other], expected(strain)[:, other])


@pytest.mark.fast
def test_readings_of_another_source() -> None:
    assert np.count_nonzero(np.ptp(read(of=2, frozen=True)[1], axis=0) == 0.0) == 2
    strain, found = read(of=2, swapped=True)
    np.testing.assert_array_equal(np.sort(found, axis=1), np.sort(strain, axis=1))
    assert np.count_nonzero(np.any(found != strain, axis=0)) == 2
    strain, found = read(noise_times=3.0)
    assert np.std(found - strain) == pytest.approx(np.sqrt(8.0) * 0.1, rel=0.2)
    square = Gauges(GAUGES.station, np.repeat([0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi], 2), GAUGES.noise_std)
    found = Fault(exchanged="nearest").readings(strain, square, np.full(10, 1.5), np.random.default_rng(1))
    moved = np.any(found != strain, axis=0)  # no two rows have equal stations but the ones of 90 and 270 deg
    assert moved.tolist() == [False, False, True, True, False, False, True, True]


@pytest.mark.fast
def test_the_knots_go_beyond_the_envelope() -> None:
    mach, incidence = stress_knots(load_vehicle(IC3X))
    assert (mach[0], mach[-1]) == pytest.approx((0.78 * 5.0, 1.22 * 7.0))
    largest = np.arccos(np.cos(radians(10.0)) ** 2)
    assert degrees(incidence[-1]) == pytest.approx(1.3 * degrees(largest))
    solved = np.ones((4, 5), dtype=bool)
    solved[0, 1:] = solved[1, 4] = False
    rows, columns = solved_knots(solved)
    assert rows.tolist() == [False, True, True, True]
    assert columns.tolist() == [True, True, True, True, False]
    solved[2, 2] = False
    rows, columns = solved_knots(solved)
    assert solved[np.ix_(rows, columns)].all()
    assert rows.sum() >= 2
    rows, columns = solved_knots(np.zeros((2, 2), dtype=bool))
    assert rows.sum() * columns.sum() == 0


def test_motion_has_its_rate_and_size(flown: Vehicle) -> None:
    """A turn inside the envelope, steps and gusts."""

    def incidence(**motion: Any) -> np.ndarray:
        found = Motion(seconds=4.0, **motion).conditions(flown, np.random.default_rng(1))
        return np.array([condition.total_incidence for condition in found])

    for rate in (5.0, 40.0):
        turn = incidence(turn_deg_s=rate)
        assert np.max(np.abs(np.diff(turn))) / 0.01 == pytest.approx(radians(rate), rel=0.05)
        assert np.max(turn) <= envelope_incidence(flown)
    step = np.abs(np.diff(incidence(step_deg=2.0)))
    assert np.count_nonzero(step > 1e-9) in (3, 4)
    assert np.max(step) <= radians(2.0) * (1.0 + 1e-9)
    gust = np.abs(np.diff(incidence(gust_deg=2.0)))
    assert np.max(gust) == pytest.approx(radians(2.0) * 0.01 / RISE, rel=0.01)


def test_rows_and_all_strain_get_lost_and_air_data_drift(world: World) -> None:
    roll, random = world.gauges.roll_angle, np.random.default_rng(2)
    two = Motion(seconds=4.0, lost_rows=2).gives(roll, random)
    assert two[:199].all()
    lost = np.unique(np.round(np.mod(roll[~two[-1]], 2.0 * np.pi), 6))
    assert len(lost) == 2
    assert np.cos(lost[1] - lost[0]) == pytest.approx(-1.0)
    case = case_of(world.vehicle, "no strain", trial="manoeuvres")
    nothing = np.isnan(read_motion(world, case, 0, random).strain).all(axis=1)
    assert np.count_nonzero(nothing) == pytest.approx(50, abs=1)
    assert nothing[200]
    for error, name, rate in (
        ("drift of the given M", "mach_number", 0.05),
        ("drift of the given p_inf", "static_pressure", 0.02),
    ):
        case = case_of(world.vehicle, error, trial="manoeuvres")
        given = read_motion(world, case, 0, np.random.default_rng(4)).known[name]
        drift = given - given[0] if name == "mach_number" else given / given[0] - 1.0
        np.testing.assert_allclose(drift, rate * 0.01 * np.arange(600), atol=1e-9)


def test_even_pressure_pushes_on_the_base_area(world: World, flying: TrueStructure) -> None:
    case = case_of(world.vehicle, "viscous pressure")
    assert case.flow is not None
    assert isinstance(world.flows, FlowTable)
    raised = case.flow.table(world.vehicle, world.flows)
    np.testing.assert_allclose(raised.harmonic[..., 0] - world.flows.harmonic[..., 0], 0.3)
    found, without = world.flights(case), world.flights(case_of(world.vehicle, "nothing wrong"))
    base = np.pi * float(flying.surface.radius[-1]) ** 2
    expected = 0.3 * found.ambient_pressure * base / found.dynamic_pressure
    expected /= world.vehicle.reference_quantities().area
    np.testing.assert_allclose(found.coefficients[:, 0] - without.coefficients[:, 0], expected, rtol=1e-3)


def test_friction_presses_each_section_by_what_lies_ahead(world: World, flying: TrueStructure) -> None:
    """Axial strain -T(x) / (2 pi r t E) of a thin tube, T the friction ahead of x; within 3 %."""
    vehicle, surface, placed = world.vehicle, flying.surface, flying.placed
    strain = AddedStrain(vehicle).friction(0.01, np.array([1e5]))[0]
    area = np.pi * (surface.radius[1:] + surface.radius[:-1])
    area = np.cumsum(area * np.hypot(np.diff(surface.x), np.diff(surface.radius)))
    total = 0.01 * 1e5 * vehicle.reference_quantities().area
    ahead = total * np.interp(placed.x, surface.x[1:], area) / area[-1]
    thickness, modulus = 1e-3 * vehicle.structure.wall_thickness_mm, 1e9 * vehicle.material.youngs_modulus_GPa
    middle = np.interp(placed.x, surface.x, surface.radius) - 0.5 * thickness
    expected = -ahead / (2.0 * np.pi * middle * thickness * modulus)
    away = (placed.meridional > 0.99) & (placed.x > 1.0) & (placed.x < 3.0)
    np.testing.assert_allclose(strain[away], expected[away], rtol=0.03)


def test_newtonian_flow_has_the_pressure_of_its_engine(flown: Vehicle, flow_beyond: FlowTable) -> None:
    """Windward on the front cone p/p_inf is 1 + 0.7 M^2 C_p,max sin^2(5 deg + a): 1 %."""
    table, station = Flow(engine="newtonian").table(flown, flow_beyond), 8
    mach, incidence = float(table.mach_knots[2]), float(table.incidence_knots[3])
    sign = np.where(np.arange(table.harmonic.shape[3]) % 2, -1.0, 1.0)  # windward: phi = pi
    found = float(table.harmonic[2, 3, station] @ sign)
    inclination = np.radians(5.0) + incidence
    largest = largest_pressure_coefficient(mach, "rayleigh_pitot")
    assert found == pytest.approx(1.0 + 0.7 * mach**2 * largest * np.sin(inclination) ** 2, rel=0.01)


def test_drawn_flows_lie_between_and_beyond_the_two(world: World) -> None:
    """Loads are linear in the pressure: of each flight the same number times the difference, for all loads."""
    drawn = case_of(world.vehicle, "drawn flows", trial="uncertainty")
    newtonian = drawn.model_copy(update={"flow": Flow(engine="newtonian")})
    own = drawn.model_copy(update={"flow": None})
    loads = [world.flights(case).coefficients for case in (own, newtonian, drawn)]
    share = (loads[2] - loads[0])[:, :2] / (loads[1] - loads[0])[:, :2]
    np.testing.assert_allclose(share[:, 0], share[:, 1], rtol=1e-3)
    assert 0.5 < np.std(share[:, 0]) < 1.5


@pytest.mark.parametrize(
    ("error", "size", "place", "added", "tolerance"),
    [
        ("local pressure, windward", "+10 % of p_inf", 0.5, 0.1, 0.1),
        ("vortex pair, leeward", "-30 % of p_inf at 0.7 L", 0.7, -0.3, 0.2),
    ],
)
def test_a_spot_lies_where_it_should(
    flown: Vehicle, flow_beyond: FlowTable, error: str, size: str, place: float, added: float, tolerance: float
) -> None:
    """A bump windward, suction to both sides of the leeward meridian; size over p_inf, place over the length."""
    flow, surface = case_of(flown, error, size).flow, truth_surface(flown)
    assert flow is not None
    harmonic = flow.table(flown, flow_beyond).harmonic[1, 2] - flow_beyond.harmonic[1, 2]
    field = harmonic @ np.cos(np.outer(np.arange(harmonic.shape[1]), surface.roll_angle))
    station, around = np.unravel_index(np.argmax(np.sign(added) * field), field.shape)
    assert surface.x[station] == pytest.approx(place * surface.x[-1], abs=0.05)
    assert field[station, around] == pytest.approx(added, rel=tolerance)
    np.testing.assert_allclose(field[station], np.roll(field[station][::-1], 1), atol=1e-12)
    if added > 0.0:
        assert surface.roll_angle[around] == pytest.approx(np.pi)
    else:
        angle = np.degrees(np.minimum(surface.roll_angle, 2.0 * np.pi - surface.roll_angle))
        np.testing.assert_allclose(angle[np.argsort(field[station])[:2]], 25.0, atol=10.0)


def test_flights_have_the_places_that_a_case_asks_for(world: World) -> None:
    low = world.flights(case_of(world.vehicle, "incidence", "0.25 to 0.5 deg", "incidence")).conditions
    angles = np.degrees([condition.total_incidence for condition in low])
    assert 0.25 <= angles.min() <= angles.max() <= 0.5
    few = other_world(world, conditions=5)
    assert {c.altitude for c in few.flights(case_of(world.vehicle, "altitude", "12 km")).conditions} == {12e3}


TABLE = FlowTable(
    vehicle="any",
    mach_knots=np.array([5.0, 7.0]),
    incidence_knots=np.radians([5.0, 10.0]),
    harmonic=np.zeros((2, 2, 1, 1)),
    provenance={},
)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("valid", "drawn"), [((0.0, 40.0), (12.0, 30.0)), ((0.0, 10.0), (0.0, 10.0)), ((35.0, 50.0), (35.0, 50.0))]
)
def test_altitudes_are_those_of_the_map(valid: tuple[float, float], drawn: tuple[float, float]) -> None:
    """A map that holds at none of 12 to 30 km is flown where it holds."""
    shipped = load_vehicle(IC3X)
    vehicle = shipped.model_copy(update={"map": shipped.map.model_copy(update={"valid_altitude_km": valid})})
    conditions = held_out_conditions(vehicle, TABLE, 200, np.random.default_rng(1))
    altitude = 1e-3 * np.array([one.altitude for one in conditions])
    low, high = drawn
    reach = 0.1 * (high - low)
    assert low <= altitude.min() < low + reach
    assert high - reach < altitude.max() <= high


@pytest.mark.fast
def test_conditions_of_a_square_are_inside_it_and_its_flows() -> None:
    """|a|, |b| up to 8 deg on the shipped vehicle; without a range of sideslip the disc of total incidence."""
    shipped, random = load_vehicle(IC3X), np.random.default_rng(1)
    where = Where(square=0.8, altitudes_km=[15.0, 28.0])
    conditions = flown_conditions(where, shipped, TABLE, 300, random)
    angles = np.degrees([(one.angle_of_attack, one.sideslip_angle) for one in conditions])
    assert 7.8 < np.abs(angles).max() <= 8.0
    altitude = [one.altitude for one in conditions]
    assert 15e3 <= min(altitude) < 16e3 < 27e3 < max(altitude) <= 28e3
    mach, incidence = stress_knots(shipped, 0.8)
    assert (mach[0], mach[-1]) == (5.0, 7.0)
    assert incidence[-1] > max(one.total_incidence for one in conditions)
    entry = shipped.conditions.model_copy(update={"sideslip_angle_deg": [0.0]})
    turned = flown_conditions(where, shipped.model_copy(update={"conditions": entry}), TABLE, 200, random)
    assert 9.0 < np.degrees(max(one.total_incidence for one in turned)) <= 10.0 + 1e-9
    assert max(abs(one.sideslip_angle) for one in turned) > np.radians(8.0)
