"""What a case does: where it is flown, motion, faults of readings, heat, friction and other pressure, beside
closed forms."""

from dataclasses import replace
from math import radians
from typing import Any

import numpy as np
import pytest
from shape_case import flown as solved
from shape_case import shape_vehicle
from trial_cases import case_of, other_world, with_entries

from builder.aero.engines.newtonian import largest_pressure_coefficient
from builder.pipeline.measured_levels import level_conditions
from builder.pipeline.trials import shape_conditions
from builder.trial.cases import Case, Plan, cases_for, load_trial
from builder.trial.conditions import (
    FEWER_BEYOND,
    RISE,
    Motion,
    Where,
    edges_of,
    envelope_incidence,
    flown_conditions,
    held_out_conditions,
)
from builder.trial.faults import (
    AddedStrain,
    Fault,
    Gauges,
    Heating,
    Lost,
    NoSuchGaugesError,
    heated,
    standard_temperature,
)
from builder.trial.flows import Flow, Spot
from builder.trial.readings import World, read_motion
from builder.trial.run import Task, run_task
from builder.truth.flow_table import FlowTable, solved_knots, truth_surface
from builder.truth.true_structure import TrueStructure
from builder.vehicle.file import IC3X, VEHICLES, Vehicle, load_vehicle
from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.errors import FlowReachError
from strainfmu.flight_condition import FlightCondition

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


def test_the_sets_of_the_shipped_layout(world: World) -> None:
    """Four rows, of which 14 sets may be lost, two directions, and what is drawn; without such gauges none."""

    def sets_of(**lost: Any) -> list[np.ndarray]:
        return list(Lost(**lost).in_use(roll, axial, np.random.default_rng(0)).values())

    roll, axial = world.gauges.row, np.abs(world.inverse_map.gauge_direction[:, 0]) > 0.7
    assert sorted({float(angle) for angle in roll}) == [0.0, 90.0, 180.0, 270.0]
    assert axial.sum() == 36
    assert [len(sets_of(gauges="rows", count=count)) for count in (1, 2, 3)] == [4, 6, 4]
    np.testing.assert_array_equal(sets_of(gauges="direction"), [axial, ~axial])
    for gauges in ("direction of a row", "direction and row"):
        assert all(0 < used.sum() < len(axial) for used in sets_of(gauges=gauges))
    assert [int(used.sum()) for used in sets_of(gauges="all but", count=3, sets=4)] == [3, 3, 3, 3]
    assert [int(used.sum()) for used in sets_of(gauges="all but", count=0, sets=1)] == [len(axial) // 2]
    lost, line = {"gauges": "rows", "count": 4}, "no such gauges to lose among 54 in 4 rows"
    with pytest.raises(NoSuchGaugesError, match=line):
        sets_of(**lost)
    case = Case.model_validate({"error": "lost gauges", "size": "all", "class": "beyond", "lost": lost})
    assert run_task(Task(key="", world="lost", case=case, plan=Plan(), make_world=lambda: world))[1] == line


def test_a_heated_gauge_reads_what_its_data_sheet_says(world: World) -> None:
    """Thermal strain and apparent strain c1 T + c2 T^2 add to the strain over a softer wall, times the factor."""
    entry = standard_temperature(3.6)
    rise, at_sensors, thermal = np.array([100.0, 50.0]), np.arange(8.0), np.array([3e-5, -1e-5])
    random, again = np.random.default_rng(1), np.random.default_rng(1)
    cold, scatter = np.full((5, 2), 1e-4), np.array([[1.0, -2.0]])
    hot, measured = heated(entry, (thermal, rise, at_sensors), cold, scatter, random)
    time = again.uniform(0.0, 1.0, (5, 1))
    warm = time * rise
    sheet = 1e-6 * (0.05 * warm - 0.002 * warm**2 + 0.01 * scatter * warm)
    expected = (1.0 - 1e-4 * warm) * (cold / (1.0 - 4.5e-4 * warm) + time * thermal + sheet)
    np.testing.assert_allclose(hot, expected)
    np.testing.assert_allclose(measured - 293.15 - time * at_sensors, again.standard_normal((5, 8)), atol=1e-9)
    length, gauges = world.vehicle.body().length, world.gauges
    _, rise, _ = Heating(nose_K=80.0, aft_K=10.0).at_end(world.vehicle)
    np.testing.assert_allclose(rise, 80.0 - 70.0 * gauges.station / length, atol=1e-9)


def test_motion_has_its_rate_and_size(vehicle: Vehicle) -> None:
    """A turn inside the envelope, steps and gusts."""

    def incidence(**motion: Any) -> np.ndarray:
        found = Motion(seconds=4.0, **motion).conditions(vehicle, np.random.default_rng(1))
        return np.array([condition.total_incidence for condition in found])

    for rate in (5.0, 40.0):
        turn = incidence(turn_deg_s=rate)
        assert np.max(np.abs(np.diff(turn))) / 0.01 == pytest.approx(radians(rate), rel=0.05)
        assert np.max(turn) <= envelope_incidence(vehicle)
    step = np.abs(np.diff(incidence(step_deg=2.0)))
    assert np.count_nonzero(step > 1e-9) in (3, 4)
    assert np.max(step) <= radians(2.0) * (1.0 + 1e-9)
    gust = np.abs(np.diff(incidence(gust_deg=2.0)))
    assert np.max(gust) == pytest.approx(radians(2.0) * 0.01 / RISE, rel=0.01)


def test_rows_and_all_strain_get_lost_and_air_data_drift(world: World) -> None:
    rows, random = world.gauges.row, np.random.default_rng(2)
    two = Motion(seconds=4.0, lost_rows=2).gives(rows, random)
    assert two[:199].all()
    lost = np.unique(rows[~two[-1]])
    assert len(lost) == 2
    assert lost[1] - lost[0] == 180.0
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


def test_friction_presses_each_section_by_what_lies_ahead(world: World, true_model: TrueStructure) -> None:
    """Axial strain -T(x) / (2 pi r t E) of a thin tube, T the friction ahead of x; within 3 %."""
    vehicle, surface, placed = world.vehicle, true_model.surface, true_model.placed
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


def test_newtonian_flow_has_the_pressure_of_its_engine(vehicle: Vehicle, flow_beyond: FlowTable) -> None:
    """Windward on the front cone p/p_inf is 1 + 0.7 M^2 C_p,max sin^2(5 deg + a): 1 %. On a shape whose own flow
    is newtonian it leaves the windward side."""
    table, station = Flow(engine="newtonian").table(vehicle, flow_beyond), 8
    mach, incidence = float(table.mach_knots[2]), float(table.incidence_knots[3])
    sign = np.where(np.arange(table.harmonic.shape[3]) % 2, -1.0, 1.0)  # windward: phi = pi
    found = float(table.harmonic[2, 3, station] @ sign)
    inclination = np.radians(5.0) + incidence
    largest = largest_pressure_coefficient(mach, "rayleigh_pitot")
    assert found == pytest.approx(1.0 + 0.7 * mach**2 * largest * np.sin(inclination) ** 2, rel=0.01)
    steep = solved([FlightCondition(6.5, np.radians(15.0), 0.0, 22e3)])
    changed = Flow(engine="newtonian").surface(shape_vehicle(), steep)
    other, own = (one.pressure / steep.internal_pressure for one in (changed, steep))
    is_leeward = own < 1.0 + 1e-9  # where the test's own newtonian flow is ambient
    assert 0.0 < other[is_leeward].min() < 0.95
    assert np.all(other[is_leeward] <= 1.0 + 1e-9)
    np.testing.assert_allclose(other[own > 1.05], own[own > 1.05], rtol=1e-9)


def test_drawn_flows_lie_between_and_beyond_the_two(world: World) -> None:
    """Loads are linear in the pressure: of each flight the same number times the difference, for all loads."""
    drawn = case_of(world.vehicle, "drawn flows", trial="uncertainty")
    newtonian = drawn.model_copy(update={"flow": Flow(engine="newtonian")})
    own = drawn.model_copy(update={"flow": None})
    loads = [world.flights(case).coefficients for case in (own, newtonian, drawn)]
    share = (loads[2] - loads[0])[:, :2] / (loads[1] - loads[0])[:, :2]
    np.testing.assert_allclose(share[:, 0], share[:, 1], rtol=1e-3)
    assert 0.5 < np.std(share[:, 0]) < 1.5


@pytest.mark.parametrize("is_shape", [False, True])
def test_other_pressure_lies_where_it_should(is_shape: bool, vehicle: Vehicle, flow_beyond: FlowTable) -> None:
    """A bump windward at its station, suction to both sides of the leeward meridian, more all over, over p_inf."""

    def added(**entry: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return place over the length, angle from the leeward meridian, and what is added, (k, n_p)."""
        if is_shape:
            shape = shape_vehicle()
            flows = solved(flown_conditions(Where(), shape, None, 6, np.random.default_rng(1)))
            x, y, z = flows.point.T
            leeward = np.array([[one.leeward_roll_angle] for one in flows.conditions()])
            ambient = np.array([[one.ambient_pressure] for one in flows.conditions()])
            more = (Flow(**entry).surface(shape, flows).pressure - flows.pressure) / ambient
            return np.tile(x / x.max(), (6, 1)), np.arctan2(y, z) - leeward, more
        surface = truth_surface(vehicle)
        harmonic = Flow(**entry).table(vehicle, flow_beyond).harmonic[1, 2:3] - flow_beyond.harmonic[1, 2:3]
        more = harmonic @ np.cos(np.outer(np.arange(harmonic.shape[-1]), surface.roll_angle))
        x, roll = np.meshgrid(surface.x / surface.x[-1], surface.roll_angle, indexing="ij")
        return x.reshape(1, -1), roll.reshape(1, -1), more.reshape(1, -1)

    for size, place, length, roll_deg, width_deg in ((0.5, 0.5, 0.03, 180.0, 20.0), (-0.3, 0.7, 0.1, 25.0, 10.0)):
        spot = Spot(size=size, place=place, length=length, roll_deg=roll_deg, width_deg=width_deg)
        x, angle, more = added(spot=spot)
        most = np.arange(len(more)), np.argmax(np.sign(size) * more, axis=1)
        assert x[most] == pytest.approx(place, abs=0.05)
        expected = size * np.exp(-0.5 * ((x[most] - place) / length) ** 2)
        np.testing.assert_allclose(more[most], expected, rtol=0.2)
        off = np.abs(np.angle(np.exp(1j * angle[most])))
        np.testing.assert_allclose(np.degrees(off), roll_deg, atol=16.0)
    np.testing.assert_allclose(added(raised=0.3)[2], 0.3, atol=1e-12)


@pytest.mark.fast
def test_knots_that_are_not_solved_go() -> None:
    done = np.ones((4, 5), dtype=bool)
    done[0, 1:] = done[1, 4] = False
    rows, columns = solved_knots(done)
    assert rows.tolist() == [False, True, True, True]
    assert columns.tolist() == [True, True, True, True, False]
    done[2, 2] = False
    rows, columns = solved_knots(done)
    assert done[np.ix_(rows, columns)].all()
    assert rows.sum() >= 2
    rows, columns = solved_knots(np.zeros((2, 2), dtype=bool))
    assert rows.sum() * columns.sum() == 0


def test_flights_of_a_shape_share_their_flows(shape_world: World) -> None:
    """One set inside, a quarter of it near the edge, beyond it twice, and below and beyond the Mach numbers; any
    altitude."""
    vehicle = shape_world.vehicle
    found = shape_conditions(vehicle, cases_for(vehicle, load_trial("stress")), 24, 1)
    assert len(found) == 24 + 5 * (24 // FEWER_BEYOND)
    assert len({(one.mach_number, one.angle_of_attack, one.sideslip_angle) for one in found}) == len(found)
    flights, own = (
        shape_world.flights(case_of(vehicle, *name)) for name in (("altitude", "12 km"), ("nothing wrong",))
    )
    np.testing.assert_allclose(flights.ambient_pressure, pressure_and_temperature(12e3)[0])
    np.testing.assert_allclose(flights.coefficients, own.coefficients, rtol=1e-9, atol=1e-12)
    few = solved(list(own.conditions[:2]))
    with pytest.raises(FlowReachError, match="none of its flows"):
        other_world(shape_world, flows=few).flights(case_of(vehicle, "Mach number below its least"))


@pytest.mark.fast
def test_edges_are_the_ends_of_both_ranges_but_zero() -> None:
    vehicle, random = shape_vehicle(), np.random.default_rng(1)
    for low, high in ((0.7, 1.0), (1.2, 1.2)):
        found = flown_conditions(Where(edge=[low, high]), vehicle, None, 800, random)
        assert len(found) == 200
        off = np.abs(np.degrees([(one.angle_of_attack, one.sideslip_angle) for one in found])) / [4.0, 2.0]
        assert low - 1e-9 <= off.max(axis=1).min() <= off.max() <= high + 1e-9
    many, few = (flown_conditions(Where(), vehicle, None, n, np.random.default_rng(1)) for n in (200, 20))
    assert many[:20] == few  # so that more conditions keep the flows of fewer
    ends = edges_of(with_entries(vehicle, "conditions", sideslip_angle_deg=[0.0, 1.0, 2.0]))
    assert [(name, middle + reach) for name, middle, reach in ends] == [
        ("angle_of_attack", -4.0),
        ("angle_of_attack", 4.0),
        ("sideslip_angle", 2.0),
    ]


TABLE = FlowTable(
    vehicle="any",
    mach_knots=np.array([5.0, 7.0]),
    incidence_knots=np.radians([5.0, 10.0]),
    harmonic=np.zeros((2, 2, 1, 1)),
    provenance={},
)


@pytest.mark.fast
@pytest.mark.parametrize("name", ["ic3x", "finned_body"])
@pytest.mark.parametrize(
    ("entry", "drawn"),
    [
        ({"valid_altitude_km": (0.0, 40.0)}, (12.0, 30.0)),
        ({"valid_altitude_km": (0.0, 10.0)}, (0.0, 10.0)),
        ({"valid_altitude_km": (35.0, 50.0)}, (35.0, 50.0)),
        ({"estimator": "linear", "form": "absolute"}, (20.0, 20.0)),
    ],
)
def test_flights_are_inside_all_ranges_of_the_file_at_altitudes_of_the_map(
    name: str, entry: dict[str, Any], drawn: tuple[float, float]
) -> None:
    """A map that holds at none of 12 to 30 km is flown where it holds."""
    shipped = load_vehicle(VEHICLES / f"{name}.toml")
    vehicle = with_entries(shipped, "map", **entry)
    if shipped.is_axisymmetric:
        conditions = held_out_conditions(vehicle, TABLE, 200, np.random.default_rng(1))
    else:
        conditions = level_conditions(vehicle)
        rows = np.array([one.as_row() for one in conditions])[:, [0, 1, 2, 4]]
        rows[:, 1:3] = np.degrees(rows[:, 1:3])
        low, high = np.array([5.0, -6.0, -4.0, -4.0]), np.array([6.0, 6.0, 4.0, 4.0])
        assert np.all((rows >= low) & (rows <= high))
        assert np.all(np.ptp(rows, axis=0) > 0.9 * (high - low))
    altitude = 1e-3 * np.array([one.altitude for one in conditions])
    reach = 0.1 * (drawn[1] - drawn[0])
    assert drawn[0] <= altitude.min() <= drawn[0] + reach
    assert drawn[1] - reach <= altitude.max() <= drawn[1]


@pytest.mark.fast
def test_incidences_are_within_the_envelope() -> None:
    """14.1 deg of the shipped vehicle; a range that begins beyond it is refused."""
    shipped, random = load_vehicle(IC3X), np.random.default_rng(1)
    wide = replace(TABLE, incidence_knots=np.radians([5.0, 18.0]))

    def flown(**entries: list[float]) -> list[FlightCondition]:
        return flown_conditions(Where(**entries), shipped, wide, 300, random)

    conditions = flown(incidence=[0.0, 0.8], altitudes_km=[15.0, 28.0])
    assert 11.0 < np.degrees(max(one.total_incidence for one in conditions)) <= 11.3
    altitude = [one.altitude for one in conditions]
    assert 15e3 <= min(altitude) < 16e3 < 27e3 < max(altitude) <= 28e3
    incidence = np.degrees([one.total_incidence for one in flown(incidence_deg=[3.0, 90.0])])
    assert 3.0 <= incidence.min() < 3.5
    assert 13.5 < incidence.max() <= 14.2
    with pytest.raises(FlowReachError, match="20 needed, got 14"):
        flown(incidence_deg=[20.0, 30.0])
