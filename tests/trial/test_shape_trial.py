"""A vehicle that is no body of revolution: its flights, and a trial of it: conditions, flows, verdicts of a
closed-form structure."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from deflected_shape import DEFLECTIONS, NAME, deflected, known_map
from shape_case import N_D, flown, grid_conditions, shape_map, shape_vehicle
from shape_truth import beam, flights_at
from trial_cases import case_of, other_world

from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.loads.sections import six_loads
from builder.aero.shapes import sections_mesh
from builder.campaign.snapshots import Snapshots
from builder.pipeline.trials import shape_conditions
from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts, exactly_built
from builder.structure.as_built.displaced_structure import refuse_others
from builder.trial.cases import Plan, cases_for, load_trial, trial_path
from builder.trial.conditions import FEWER_BEYOND, Where, conditions_in_ranges, edges_of, flown_conditions
from builder.trial.flows import Flow, Spot
from builder.trial.readings import World
from builder.trial.run import scored
from builder.trial.score import MISSED, Row
from builder.truth.flights import drawn_vehicle
from builder.truth.shape import ShapeFlights, at_conditions, on_nodes, refuse_without_other_model
from builder.vehicle.conditions.flight_conditions import FlowParameter
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.errors import FlowReachError, InputError
from strainfmu.flight_condition import FlightCondition

PLAN = Plan(conditions=24, vehicles=8)


@cache
def world() -> World:
    vehicle = shape_vehicle()
    cases = cases_for(vehicle, load_trial(trial_path("stress")))
    flows = flown(shape_conditions(vehicle, cases, PLAN.conditions, PLAN.seed))
    return World(
        vehicle=vehicle,
        structure=beam(flows.surface),
        flows=flows,
        inverse_map=shape_map(),
        conditions=PLAN.conditions,
    )


def row_of(error: str, size: str = "") -> Row:
    (rows,) = scored(world(), case_of(world().vehicle, error, size), PLAN).values()
    return rows[0]


@pytest.mark.parametrize(
    ("error", "size"),
    [
        ("nothing wrong", "vehicle of the file"),
        ("altitude", "25 km"),
        ("angle near its largest", "70 to 100 % of it"),
        ("angle beyond its largest", "+20 %"),
        ("Mach number below its least", "-20 %"),
        ("Mach number beyond its largest", "+20 %"),
        ("bias of one gauge", "+50 um/m"),
    ],
)
def test_nothing_is_missed(error: str, size: str) -> None:
    row = row_of(error, size)
    assert row["verdict"] != MISSED, row["why"]
    assert row["samples"] == 24 * 8  # a quarter of the conditions beyond, four times as many vehicles


def test_another_theory_is_noticed_and_lost_gauges_widen_sigma() -> None:
    assert row_of("three gauges lost")["health"] == "DEGRADED 100"
    right, bump = row_of("nothing wrong"), row_of("local pressure, windward", "+100 % of p_inf")
    assert right["flagged_percent"] < 5.0
    assert bump["flagged_percent"] > 15.0
    assert bump["wrong_flagged_percent"] + bump["undetected_percent"] > 50.0


def test_altitudes_and_hardware_share_their_flows() -> None:
    """One set inside, a quarter of it near the edge, beyond it twice, and below and beyond the Mach numbers."""
    vehicle = world().vehicle
    found = shape_conditions(vehicle, cases_for(vehicle, load_trial(trial_path("stress"))), 24, 1)
    assert len(found) == 24 + 5 * (24 // FEWER_BEYOND)
    assert len({(one.mach_number, one.angle_of_attack, one.sideslip_angle) for one in found}) == len(found)
    flights, own = (
        world().flights(case_of(vehicle, *name)) for name in (("altitude", "12 km"), ("nothing wrong",))
    )
    np.testing.assert_allclose(flights.ambient_pressure, pressure_and_temperature(12e3)[0])
    np.testing.assert_allclose(flights.coefficients, own.coefficients, rtol=1e-9, atol=1e-12)
    few = flown(list(own.conditions[:2]))
    assert at_conditions(few, own.conditions[2:]) is None
    with pytest.raises(FlowReachError, match="none of its flows"):
        other_world(world(), flows=few).flights(case_of(vehicle, "Mach number below its least"))


@pytest.mark.fast
def test_edges_are_the_ends_of_both_ranges_but_zero() -> None:
    vehicle, random = shape_vehicle(), np.random.default_rng(1)
    for low, high in ((0.7, 1.0), (1.2, 1.2)):
        found = flown_conditions(Where(edge=[low, high]), vehicle, None, 800, random)
        assert len(found) == 200
        off = np.abs(np.degrees([(one.angle_of_attack, one.sideslip_angle) for one in found])) / [4.0, 2.0]
        assert low - 1e-9 <= off.max(axis=1).min() <= off.max() <= high + 1e-9
    one_sided = vehicle.conditions.model_copy(update={"sideslip_angle_deg": [0.0, 1.0, 2.0]})
    ends = edges_of(vehicle.model_copy(update={"conditions": one_sided}))
    assert [(name, middle + reach) for name, middle, reach in ends] == [
        ("angle_of_attack", -4.0),
        ("angle_of_attack", 4.0),
        ("sideslip_angle", 2.0),
    ]


def test_other_pressure_lies_where_it_should() -> None:
    """A bump windward at its station, suction to both sides of the leeward meridian, more all over; another engine
    leaves the windward side."""
    vehicle = world().vehicle
    flows = flown(list(world().flights(case_of(vehicle, "nothing wrong")).conditions[:6]))
    ambient = np.array([[one.ambient_pressure] for one in flows.conditions()])
    leeward = np.array([one.leeward_roll_angle for one in flows.conditions()])
    length = flows.point[:, 0].max()

    def added(**entry: Any) -> np.ndarray:
        return np.asarray((Flow(**entry).surface(vehicle, flows).pressure - flows.pressure) / ambient)

    bump = added(spot=Spot(size=0.5, place=0.5, length=0.03, roll_deg=180.0, width_deg=20.0))
    x, y, z = flows.point[bump.argmax(axis=1)].T
    assert x == pytest.approx(0.5 * length, abs=0.06)
    off = (x - 0.5 * length) / (0.03 * length)
    np.testing.assert_allclose(bump.max(axis=1), 0.5 * np.exp(-0.5 * off**2), rtol=0.1)
    assert np.all(np.cos(np.arctan2(y, z) - leeward) < -0.95)
    suction = added(spot=Spot(size=-0.3, place=0.7, length=0.1, roll_deg=25.0, width_deg=10.0))
    assert suction.max() <= 0.0
    _, y, z = flows.point[suction.argmin(axis=1)].T
    off = np.abs(np.angle(np.exp(1j * (np.arctan2(y, z) - leeward))))
    np.testing.assert_allclose(np.degrees(off), 25.0, atol=12.0)
    np.testing.assert_allclose(added(raised=0.3), 0.3)
    steep = flown([FlightCondition(6.5, np.radians(15.0), 0.0, 22e3)])
    other, own = (
        one.pressure / steep.internal_pressure for one in (Flow(engine="newtonian").surface(vehicle, steep), steep)
    )
    is_leeward = own < 1.0 + 1e-9  # where the test's own newtonian flow is ambient
    assert is_leeward.any()
    assert np.all(other[is_leeward] <= 1.0 + 1e-9)
    assert other[is_leeward].min() < 0.95
    np.testing.assert_allclose(other[own > 1.05], own[own > 1.05], rtol=1e-9)


def test_known_parameters_are_honest_and_wrong_ones_are_flagged() -> None:
    plan, vehicle = Plan(conditions=20, vehicles=4), shape_vehicle()
    parameters = {NAME: FlowParameter(values=list(DEFLECTIONS))}
    sections = {
        "conditions": {"parameters": parameters},
        "aerodynamics": {"engine": "table", "manifest": "f.toml"},
    }
    changed = {name: getattr(vehicle, name).model_copy(update=entry) for name, entry in sections.items()}
    vehicle = vehicle.model_copy(update=changed)
    drawn = flown_conditions(Where(), vehicle, None, plan.conditions, np.random.default_rng(plan.seed))
    at_rest = flown([replace(one, parameters=()) for one in drawn])
    flows = deflected(at_rest, np.array([one.parameters[0] for one in drawn]))
    made = World(
        vehicle=vehicle, structure=beam(flows.surface), flows=flows, inverse_map=known_map(), conditions=20
    )
    names = (
        ("flow parameters known", "as stated"),
        ("flow parameters known", "wrong by 5 sigma"),
        ("filter over time, flow parameters known", "wrong by 5 sigma"),
    )
    cases = [case_of(vehicle, error, size) for error, size in names]
    right, wrong, filtered = (next(iter(scored(made, case, plan).values()))[0] for case in cases)
    assert right["class"] == "alone"
    assert right["undetected_percent"] <= 3.0
    assert right["flagged_percent"] < 5.0
    assert MISSED not in (wrong["verdict"], filtered["verdict"])
    assert wrong["flagged_percent"] > 40.0
    assert (filtered["estimator"], filtered["samples"]) == ("filter", 80)


CONDITIONS = grid_conditions((6.0, 6.7), (-3.0, 1.0), (0.5, 1.5))


@cache
def flows() -> Snapshots:
    return flown(CONDITIONS)


@cache
def flights() -> ShapeFlights:
    return flights_at(CONDITIONS)


def built(**errors: Any) -> AsBuilt:
    return exactly_built(N_D).changed(**errors)


def test_hardware_errors_act_on_the_strain_of_the_net_pressure() -> None:
    structure, read = beam(flows().surface), flights().read
    net = flows().pressure - flows().internal_pressure[:, None]
    straight, aft, around, turned, across = (net @ way.T for way in structure.operator)
    np.testing.assert_allclose(read(built()), straight, rtol=1e-9, atol=1e-15)
    shift, gain = np.linspace(-1e-3, 2e-3, N_D), np.linspace(-0.02, 0.01, N_D)
    one = built(
        axial_shift=shift,
        circumferential_shift=2.0 * shift,
        orientation=3.0 * shift,
        layout_roll=0.01,
        gauge_gain=gain,
        common_gain=0.02,
        wall_thickness=-0.05,
        apparent_strain=np.full(N_D, 1e-6),
        transverse_sensitivity=4.0 * shift,
    )
    moved = straight + shift * aft + (2.0 * shift + 0.01 * structure.gauges.radius) * around
    moved += 3.0 * shift * turned + 4.0 * shift * across
    np.testing.assert_allclose(read(one), (1.0 + gain) * 1.02 / 0.95 * moved + 1e-6, rtol=1e-9)
    ambient = flights().ambient_pressure[:, None]
    more = read(built(internal_pressure=0.1)) - read(built())
    np.testing.assert_allclose(more, -0.1 * ambient * structure.operator[0].sum(axis=1), rtol=1e-6)
    # A row turns as its gauges do.
    row, counts = flights().gauges.row, flights().counts
    assert counts == Counts(gauge=N_D, row=4)
    turn = np.linspace(-0.01, 0.02, counts.row)
    by_row = read(exactly_built(counts).changed(row_orientation=turn))
    np.testing.assert_array_equal(by_row, read(built(orientation=turn[row])))


def test_many_vehicles_at_once_are_each_on_its_own() -> None:
    """Errors that no displaced gauge shows are refused."""
    noise = load_vehicle(VEHICLES / "elliptic_cone.toml").noise
    many = drawn_vehicle(noise, N_D, np.random.default_rng(3), count=4)
    for flight in (0, 5):
        found = flights().read(many, slice(flight, flight + 1))
        for vehicle in range(4):
            alone = flights().read(many.one_of(vehicle))[flight]
            np.testing.assert_allclose(found[vehicle], alone, rtol=1e-12)
    refuse_others(noise)
    for entry in ("clamp_compliance_mm", "region_modulus_percent"):
        with pytest.raises(InputError, match=f"noise.{entry}: expected 0"):
            refuse_others(noise.model_copy(update={entry: 1.0}))


def test_coefficients_are_those_of_the_snapshots_and_the_rolling_moment_comes_besides() -> None:
    net, found, reference = flows().pressure, flights(), shape_vehicle().reference_quantities()
    np.testing.assert_allclose(found.coefficients, flows().coefficients(), rtol=1e-9, atol=1e-12)
    net = net - flows().internal_pressure[:, None]
    moment = net @ six_loads(flows().surface, reference.moment_station)[5]
    expected = moment / (found.dynamic_pressure * reference.area * reference.length)
    np.testing.assert_allclose(found.rolling, expected, rtol=1e-12)
    assert np.abs(found.rolling).max() > 1e-4


def test_pressure_goes_to_the_nodes_of_the_map() -> None:
    """Linear over triangles: a coarser surface gets it within what the flow bends between nodes."""
    nodes = sections_mesh(shape_vehicle().sectioned_body(), 15, 36)
    engine, ratio = NewtonianEngine(nodes), []
    for one in flows().conditions():
        ratio.append(engine.pressure_ratio(engine.solve(engine.flow_key(one)), one) * one.ambient_pressure)
    there = replace(flows(), pressure=np.array(ratio), point=nodes.point, triangle=nodes.triangle)
    found = on_nodes(flows().surface, flows().pressure, nodes)
    off = np.abs(found / on_nodes(there.surface, there.pressure, nodes) - 1.0)[:, nodes.point[:, 0] > 0.2]
    assert off.max() < 0.05
    assert np.median(off) < 5e-3


@pytest.mark.fast
def test_conditions_are_inside_all_ranges_of_the_file() -> None:
    vehicle = load_vehicle(VEHICLES / "finned_body.toml")
    found = conditions_in_ranges(vehicle, (15.0, 28.0), 200, np.random.default_rng(1))
    rows = np.array([one.as_row() for one in found])
    rows[:, 1:3] = np.degrees(rows[:, 1:3])
    low, high = np.array([5.0, -6.0, -4.0, 15e3, -4.0]), np.array([6.0, 6.0, 4.0, 28e3, 4.0])
    assert np.all((rows >= low) & (rows <= high))
    assert np.all(np.ptp(rows, axis=0) > 0.9 * (high - low))
    fewer = conditions_in_ranges(vehicle, (15.0, 28.0), 20, np.random.default_rng(1))
    assert fewer == found[:20]  # so that more conditions keep the flows of fewer


@pytest.mark.fast
def test_a_vehicle_without_another_model_is_refused() -> None:
    finned = load_vehicle(VEHICLES / "finned_body.toml")
    refuse_without_other_model(finned)
    parameters = {
        name: one.model_copy(update={"surfaces": []}) for name, one in finned.conditions.parameters.items()
    }
    of_table = {"aerodynamics": {"engine": "table"}, "conditions": {"parameters": parameters}}
    of_code = {"structure": {"influence": "influence.csv", "checked_by": None}}
    for changes, message in (
        (of_table, "aerodynamics.engine: expected 'euler' or 'newtonian'"),
        (of_code, "structure.influence: expected none"),
    ):
        sections = {name: getattr(finned, name).model_copy(update=entry) for name, entry in changes.items()}
        with pytest.raises(InputError, match=message):
            refuse_without_other_model(finned.model_copy(update=sections))
