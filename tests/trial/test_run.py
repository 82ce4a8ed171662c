"""Trials of coarse vehicles and of the shipped one: verdicts that hold, limits that are known, coverage at every
altitude, both plans, sensors, masses, heat, lost gauges."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from coarse_vehicle import COARSE
from sweeps import sweep
from trial_cases import case_of, health_of, other_world, with_entries

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.manifold.nonlinear_build import with_manifold
from builder.pipeline.estimator_choice import Estimators
from builder.pipeline.trials import check_fit, of_map, run_trial
from builder.structure.fourier.fourier_model import structural_model
from builder.trial.cases import Built, Case, Plan, cases_for, load_trial
from builder.trial.conditions import Where
from builder.trial.faults import standard_temperature
from builder.trial.readings import World, joined, read_case
from builder.trial.run import readings_of, scored
from builder.trial.score import ALL, MISSED, Row
from builder.truth.flow_table import load_flow_table
from builder.truth.true_structure import TrueStructure
from builder.vehicle.file import IC3X, load_vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY
from strainfmu.estimator.map.inverse_map import load_inverse_map

PLAN = Plan(conditions=50, vehicles=6)


def rows_for(world: World, error: str, size: str = "", trial: str = "stress", plan: Plan = PLAN) -> list[Row]:
    (rows,) = scored(world, case_of(world.vehicle, error, size, trial), plan).values()
    return rows


MASSES = (
    "inertia of the masses",
    "inertia of the masses, inertial unit",
    "inertia of a mass that is not listed",
    "inertia of a mass that is not listed, inertial unit",
    "vibration",
    "vibration, stated",
)


MISSED_NOTHING: list[tuple[str, str, str, float]] = [
    ("world", "nothing wrong", "vehicle of the file", 0.0),
    ("world", "all installation errors", "drawn at their stated sizes", 0.0),
    ("world", "Young's modulus", "+1 %", 0.0),
    ("world", "wall thickness", "+2 %", 0.0),
    ("world", "roll of the layout", "+1 deg", 0.0),
    ("world", "altitude", "25 km", 0.0),
    ("world", "angles mirrored", "the other sign of one or both", 0.0),
    ("tabled_world", "angles mirrored", "the other sign of one or both", 0.0),
    ("world", "dynamic pressure", "+10 %", 100.0),
    ("world", "incidence beyond its largest", "+20 %", 0.0),
    ("world", "Mach number below its least", "-20 %", 0.0),
    ("world", "Mach number beyond its largest", "+20 %", 0.0),
    ("world", "friction", "+0.01 in C_A", 0.0),
    ("world", "filter over time, zeros", "exactly known", 0.0),
    ("world", "filter over time, zeros", "wrong by 5 sigma of the noise", 0.0),
    ("world", "filter over time, zeros", "wrong in common by 5 sigma of the noise", 0.0),
    ("sensed_world", "auxiliary sensors", "", 0.0),
    ("sensed_world", "nothing wrong", "", 0.0),
    ("sensed_world", "wall thinner over the middle third", "", 0.0),
    ("sensed_world", "gain of one auxiliary sensor", "", 2.0),
    ("sensed_world", "bias of one auxiliary sensor", "", 20.0),
    ("sensed_world", "one auxiliary sensor frozen", "", 40.0),
    *(("heavy_world", error, "", 0.0) for error in MASSES),
    ("shape_world", "nothing wrong", "vehicle of the file", 0.0),
    ("shape_world", "altitude", "25 km", 0.0),
    ("shape_world", "angle near its largest", "70 to 100 % of it", 0.0),
    ("shape_world", "angle beyond its largest", "+20 %", 0.0),
    ("shape_world", "Mach number below its least", "-20 %", 0.0),
    ("shape_world", "Mach number beyond its largest", "+20 %", 0.0),
    ("shape_world", "bias of one gauge", "+50 um/m", 0.0),
    *((name, "three gauges lost", "", 0.0) for name in ("world", "sensed_world", "shape_world")),
    ("sensed_world", "one auxiliary sensor lost", "", 0.0),
    ("deflected_world", "flow parameters known", "as stated", 0.0),
    ("deflected_world", "flow parameters known", "wrong by 5 sigma", 40.0),
    ("deflected_world", "filter over time, flow parameters known", "wrong by 5 sigma", 0.0),
]
NEAR_ANOTHER = (
    ("world", "wall thickness", "+2 %"),
    ("world", "Mach number below its least", "-20 %"),
    ("world", "filter over time, zeros", "exactly known"),
    ("heavy_world", "inertia of a mass that is not listed", ""),
    ("shape_world", "angle near its largest", "70 to 100 % of it"),
    ("shape_world", "Mach number below its least", "-20 %"),
    ("sensed_world", "three gauges lost", ""),
)
"""Of these, rows like one that each run takes: stiffness, the other end of a range, the same loss elsewhere."""


@pytest.mark.parametrize(
    ("fixture", "error", "size", "flagged"),
    sweep(MISSED_NOTHING, [row for row in MISSED_NOTHING if row[:3] not in NEAR_ANOTHER]),
)
def test_nothing_is_missed(
    fixture: str, error: str, size: str, flagged: float, request: pytest.FixtureRequest
) -> None:
    # The zeros of a filtered flight are wrong alike in all flights of a vehicle: six vehicles would be few.
    plan = PLAN.model_copy(update={"vehicles": 24}) if error == "filter over time, zeros" else PLAN
    every = rows_for(request.getfixturevalue(fixture), error, size, plan=plan)[0]
    assert every["verdict"] != MISSED, every["why"]
    assert sum(health_of(every).values()) == pytest.approx(100.0)
    assert every["flagged_percent"] >= flagged
    if error.endswith("lost"):  # sigma is wider, which is no flag
        assert (every["health"], every["flagged_percent"]) == ("DEGRADED 100", 0.0)
        assert every["undetected_percent"] < 3.0
    if fixture == "heavy_world":
        assert every["class"] == "alone"
        assert ("DEGRADED" in every["health"]) == (error == "vibration, stated")
    if fixture == "shape_world":  # a quarter of the conditions beyond, four times as many vehicles
        assert every["samples"] == 24 * 6


def test_what_no_strain_shows_is_silent_and_another_theory_is_noticed(world: World, shape_world: World) -> None:
    """A tenth too much q_inf without navigation; inertia that the map does not include; more pressure windward."""
    without = rows_for(world, "dynamic pressure, no navigation")[0]
    assert (without["class"], without["verdict"], without["why"]) == ("unobservable", "-", "")
    assert without["undetected_percent"] > 20.0
    assert rows_for(world, MASSES[0])[0]["undetected_percent"] > 20.0
    assert rows_for(shape_world, "nothing wrong")[0]["flagged_percent"] < 5.0
    bump = rows_for(shape_world, "local pressure, windward", "+100 % of p_inf")[0]
    assert bump["flagged_percent"] > 15.0
    assert bump["wrong_flagged_percent"] + bump["undetected_percent"] > 50.0


def test_a_vehicle_of_its_own_in_every_sample(world: World) -> None:
    """Each sample has errors of its own; navigation errs as stated; a score is the same each time."""
    case, plan = case_of(world.vehicle, "own flows", trial="uncertainty"), Plan(vehicles=8)
    read = joined(list(readings_of(world, case, plan)))
    assert read.strain.shape == (400, 54)
    assert read.vehicle.tolist() == list(range(400))
    assert read.flight.tolist() == np.repeat(np.arange(50), 8).tolist()
    mach = read.known["mach_number"] - np.array([one.mach_number for one in read.conditions])[read.flight]
    assert np.std(mach) == pytest.approx(world.vehicle.noise.navigation_mach_number, rel=0.1)
    (rows,) = scored(world, case, plan).values()
    assert (rows[0]["vehicles"], rows[0]["flights"], rows[0]["samples"]) == (400, 50, 400)
    assert rows[0]["verdict"] != MISSED
    assert scored(other_world(world), case, plan) == {"map": rows}


def test_both_plans_read_the_same_of_one_vehicle(world: World) -> None:
    """Single errors, without signs, are the same vehicle in either plan; all but the noise is equal."""
    case = case_of(world.vehicle, "wall thickness", "+2 %")
    flights, random = world.flights(case), np.random.default_rng(1)
    lasting = read_case(world, case, flights, number=0, random=random)
    own = read_case(world, case, flights, number=0, random=random, rows=slice(3, 4), vehicles=2)
    np.testing.assert_allclose(own.strain[1], lasting.strain[3], atol=7.0 * float(world.noise_std.max()))
    for name, value in own.known.items():
        np.testing.assert_array_equal(np.broadcast_to(value, 2), np.broadcast_to(lasting.known[name], 50)[[3, 3]])
    np.testing.assert_array_equal(own.truth, lasting.truth[[3, 3]])


@pytest.mark.parametrize(("error", "size"), [("steady flight", "noise alone"), ("turn", "10 deg/s")])
def test_a_filter_gains_in_steady_flight_and_loses_nothing_in_turns(world: World, error: str, size: str) -> None:
    plan = Plan(vehicles=2, estimators=["linear", "linear 1 s"])
    single, filtered = scored(world, case_of(world.vehicle, error, size, "manoeuvres"), plan).values()
    assert [row["over_single"] for row in single[1:]] == 5 * [1.0]
    assert max(row["over_single"] for row in filtered[1:]) < (0.67 if error == "steady flight" else 1.05)
    assert single[0]["samples"] == 800


def test_the_inertial_unit_sharpens(heavy_world: World) -> None:
    without, measured = (rows_for(heavy_world, error)[2] for error in MASSES[:2])
    assert without["load"] == measured["load"] == "C_N"
    # 0.313: the gain allows for 5 % error of the strain by inertia. With inertia_strain_percent = 0 it is 0.274.
    assert measured["rms"] < 0.32 * without["rms"]
    unit = case_of(heavy_world.vehicle, MASSES[1])
    read = read_case(heavy_world, unit, heavy_world.flights(unit), number=0, random=np.random.default_rng(1))
    lateral = np.hypot(read.known["specific_force_y"], read.known["specific_force_z"])
    assert lateral == pytest.approx(5.0 * 9.80665, abs=0.6)


def test_maps_and_estimators_that_do_not_fit_are_refused_and_the_envelope_is_that_of_the_map(
    world: World, sensed_world: World, heavy_world: World
) -> None:
    path, names = Path("map.h5"), tuple(f"other {name}" for name in world.inverse_map.gauge_names)
    for made in (world, sensed_world, heavy_world):
        check_fit(made.vehicle, made.inverse_map, path)
    renamed, larger = (
        replace(world.inverse_map, **change) for change in ({"gauge_names": names}, {"reference_area": 1.0})
    )
    for flown, inverse_map, message in (
        (world, renamed, "gauges of layout .*: expected 54: .*, got 54: other"),
        (world, larger, r"reference area \[m2\]: expected .*, got 1"),
        (sensed_world, world.inverse_map, "auxiliary sensors: expected 9: .*, got 0: none"),
        (world, sensed_world.inverse_map, "auxiliary sensors: expected 0: none, got 9: port_0deg"),
        (heavy_world, world.inverse_map, "map: expected with masses, got without masses"),
        (world, heavy_world.inverse_map, "map: expected without masses, got with masses"),
    ):
        with pytest.raises(InputError, match=f"^map.h5: {message}"):
            check_fit(flown.vehicle, inverse_map, path)
    case = Case.model_validate({"error": "e", "class": "alone"})
    for name, message in (("nonlinear", "expected a map with tables"), ("other", "expected 'map', 'linear'")):
        with pytest.raises(InputError, match=f"^estimators: .*{message}"):
            scored(world, case, Plan(estimators=[name]))
    other = with_entries(world.vehicle, "conditions", mach_number=[2.0], altitude_km=5.0)
    found = of_map(other, world.inverse_map).conditions
    assert (found.mach_number, found.altitudes_km) == ([5.0, 7.0], [20.0])
    assert found.angle_of_attack_deg == pytest.approx([0.0, 10.0])


def test_a_map_without_temperature_flies_the_standard_wall(world: World) -> None:
    (cold, warm) = cases_for(world.vehicle, load_trial("heating"))
    assert [cold.group, warm.group] == ["alone", "beyond"]
    of_cold, of_warm = (scored(world, case, Plan(vehicles=1))["map"] for case in (cold, warm))
    assert of_cold[1]["rms"] < of_warm[1]["rms"]
    assert of_cold[0]["flagged_percent"] <= 2.0 < of_warm[0]["flagged_percent"]


@pytest.mark.slow
def test_a_wall_that_warms_costs_little(world: World, snapshots: Snapshots) -> None:
    entry = standard_temperature(world.vehicle.body().length)
    vehicle = world.vehicle.model_copy(update={"temperature": entry})
    structure = structural_model(vehicle, COARSE, [vehicle.gauges.layout])
    linear = build_inverse_map(vehicle, snapshots, structure)
    made = with_manifold(linear, vehicle, snapshots, structure)
    warm = other_world(world, vehicle=vehicle, inverse_map=made, conditions=100)
    plan = Plan(vehicles=1, estimators=["linear", "nonlinear"])
    isothermal, *hot = (
        scored(warm, case_of(vehicle, "wall that warms", size, "heating"), plan)
        for size in ("isothermal", "temperature sensors", "no temperature sensors")
    )
    for name in plan.estimators:
        for every, *loads in (rows[name] for rows in hot):
            assert loads[0]["rms"] <= 1.5 * isothermal[name][1]["rms"]
            assert min(row["covered_percent"] for row in loads) >= 99.0
            assert every["verdict"] != MISSED


TARGET, SIZES = 99.0, ["two rows", "three rows", "one direction", "a direction and a row"]


@pytest.mark.parametrize("size", sweep([*SIZES, "all but 10, drawn"], [*SIZES[1:3], "all but 10, drawn"]))
def test_rows_and_directions_lost(full_world: World, size: str) -> None:
    """Without mirror images 66 % of the samples of opposite rows lost, and of all axial gauges, are inside."""
    mapped = other_world(full_world, conditions=150, seed=3)
    case, plan = case_of(mapped.vehicle, "lost gauges", size, "lost_gauges"), Plan(vehicles=2)
    assert case.lost is not None
    if case.lost.samples:  # sets that are drawn have the next samples
        few = case.model_copy(update={"lost": case.lost.model_copy(update={"sets": 4, "samples": 100})})
        every = scored(mapped, few, plan.model_copy(update={"estimators": ["linear"]}))["linear"][0]
        assert (every["samples"], every["sets"], every["vehicles"]) == (400, 4, 300)
        return
    rows = scored(mapped, case, plan.model_copy(update={"estimators": ["nonlinear", "linear"]}))
    every, *loads = rows["nonlinear"]
    assert every["samples"] == 300 * every["sets"]
    assert every["no_estimate_percent"] == 0.0
    assert min(row["covered_percent"] for row in loads) >= TARGET
    assert min(row["worst_set_percent"] for row in loads) >= TARGET - 2.0
    linear = rows["linear"][0]
    assert linear["undetected_percent"] <= 1.0
    if size == "three rows":
        assert linear["no_estimate_percent"] == 100.0


@pytest.fixture(scope="module")
def shipped(ic3x_demo: Path, ic3x_truth: TrueStructure) -> World:
    """The shipped vehicle with the map of both estimators."""
    made = load_inverse_map(ic3x_demo / "map.h5")
    vehicle = of_map(load_vehicle(IC3X), made)
    flows = load_flow_table(ic3x_demo / "independent_flows.h5", vehicle)
    return World(vehicle=vehicle, structure=ic3x_truth, flows=flows, inverse_map=made, seed=3)


@pytest.mark.parametrize("kind", ["linear", pytest.param("nonlinear", marks=pytest.mark.slow)])
@pytest.mark.parametrize("altitude_km", sweep([12.0, 15.0, 20.0, 25.0, 30.0], [12.0, 30.0]))
def test_three_sigma_cover_the_truth_at_every_altitude(altitude_km: float, kind: str, shipped: World) -> None:
    """A map of 20 km at 200 conditions: hardware errors drawn for 8 vehicles each, and exactly known ones."""
    for vehicles, stated in ((8, 1.0), (5, 0.0)):
        where, built = Where(altitude_km=altitude_km), Built(stated=stated)
        case = Case(error="as built", group="alone", where=where, as_built=built)
        every, *loads = scored(shipped, case, Plan(vehicles=vehicles, estimators=[kind]))[kind]
        assert min(row["covered_percent"] for row in loads) >= 99.0
        assert health_of(every).get("OUTSIDE", 0.0) <= 0.1
        assert every["undetected_percent"] <= 3.0


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ["linear", "nonlinear stepping"])
def test_false_alarms_are_as_stated(estimator: str, shipped: World) -> None:
    """1e6 samples, every one of a vehicle of its own, seeds that the levels were not set with: a factor 2."""
    many = other_world(shipped, conditions=10_000, seed=2)
    plan = Plan(vehicles=100, estimators=[estimator])
    rate = 0.01 * rows_for(many, "false alarms", trial="false_alarms", plan=plan)[0]["alarm_percent"]
    assert 0.5 * FALSE_ALARM_PROBABILITY <= rate <= 2.0 * FALSE_ALARM_PROBABILITY


def test_the_tables_of_a_map_are_as_good_at_small_incidence(shipped: World) -> None:
    """Shipped vehicle, 2,000 samples in a band: load errors are below 0.6 times the linear estimator's."""
    plan = Plan(vehicles=10, estimators=["linear", "nonlinear"])
    for size in ("0 to 0.25 deg", "0.5 to 1 deg"):
        case = case_of(shipped.vehicle, "incidence", size, "incidence")
        linear, nonlinear = scored(other_world(shipped, seed=1), case, plan).values()
        for of_linear, row in zip(linear[1:], nonlinear[1:], strict=True):
            assert row["rms"] <= 0.6 * of_linear["rms"]
            assert row["covered_percent"] > 99.0
            assert row["rms_z"] < 1.07


MOST_UNDETECTED = {
    ("incidence beyond its largest", "+5 to +20 %"): 13.0,
    ("another engine", "newtonian"): 20.0,
    ("another engine", "tangent cones"): 25.0,
    ("altitude in all inputs", "+5 km"): 66.0,
    ("altitude in all inputs", "+5 km, as static pressure"): 62.0,
    ("opposite rows exchanged", "pair in the plane of the flow, with angles"): 7.0,
    ("Mach number below its least, no navigation", "-20 %"): 36.0,
    ("local pressure, windward", "+100 % of p_inf"): 16.0,
    ("vortex pair, leeward", "-10 % of p_inf at 0.5 L"): 6.0,
    ("vortex pair, leeward", "-30 % of p_inf at 0.3 L"): 9.0,
    ("vortex pair, leeward", "-30 % of p_inf at 0.5 L"): 30.0,
    ("vortex pair, leeward", "-30 % of p_inf at 0.6 L"): 17.0,
}
"""Cases beyond of the linear map with more than 5 % undetected samples, and how many at most [%]: a seventh more
than measured. The states of the map fit their strain within the stated errors of the hardware."""

KNOWN = {None: {("another engine", "tangent cones")}, "linear": {("all_stated", "")}}
"""Cases that are missed: the nonlinear estimator's states fit the pressure of tangent cones in an eighth of the
samples; sigma of the linear map includes no pressure between its snapshots."""


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_solver")
@pytest.mark.parametrize("estimator", [None, "linear"])
def test_what_the_shipped_vehicle_misses(estimator: Estimators | None, tmp_path: Path) -> None:
    result = run_trial("stress", IC3X, tmp_path / "stress", estimator=estimator)
    rows = {(row["error"], row["size"]): row for row in result.rows if row["load"] == ALL}
    assert len(rows) >= 34
    known = MOST_UNDETECTED if estimator == "linear" else {}
    missed = {name for name, row in rows.items() if row["verdict"] == MISSED}
    assert missed <= known.keys() | KNOWN[estimator], [rows[name]["why"] for name in missed]
    for name, largest in known.items():
        assert rows[name]["undetected_percent"] <= largest
