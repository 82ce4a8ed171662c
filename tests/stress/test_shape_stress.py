"""The stress test of a vehicle that is no body of revolution: kinds, flows, scores of a closed-form structure."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from shape_case import flown, shape_map, shape_vehicle
from shape_truth import beam

from builder.stress.flights import FEWER_BEYOND, at_edge, edges_of
from builder.stress.flows import AnotherEngine, vortex_pairs, windward_bump
from builder.stress.kind import Kind
from builder.stress.kinds import all_kinds
from builder.stress.model import ShapeModel
from builder.stress.run import shape_conditions
from builder.stress.score import Effort, Range
from builder.truth.shape.flights import at_conditions
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.errors import FlowReachError
from strainfmu.flight_condition import FlightCondition

EFFORT = Effort(conditions=24, draws=8)


@cache
def trial() -> Range:
    vehicle = shape_vehicle()
    flows = flown(shape_conditions(vehicle, EFFORT))
    model = ShapeModel(vehicle=vehicle, structure=beam(flows.surface), flows=flows)
    return Range(vehicle=vehicle, model=model, inverse_map=shape_map(), effort=EFFORT)


def kind_of(error: str, size: str) -> Kind:
    return next(kind for kind in all_kinds(trial().vehicle) if (kind.error, kind.size) == (error, size))


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
def test_targets_hold(error: str, size: str) -> None:
    score = trial().score(kind_of(error, size))
    assert score.missed == ()
    assert score.score.samples >= 24


def test_lost_gauges_are_flagged_and_another_theory_is_noticed() -> None:
    assert trial().score(kind_of("three gauges lost", "no reading")).score.health == {"DEGRADED": 1.0}
    right = trial().score(kind_of("nothing wrong", "vehicle of the file"))
    bump = trial().score(kind_of("local pressure, windward", "+100 % of p_inf"))
    assert right.score.detected < 0.05
    assert bump.score.detected > 0.2
    assert bump.score.wrong > 0.5


def test_kinds_of_a_shape_have_edges_in_place_of_total_incidence() -> None:
    errors = {kind.error for kind in all_kinds(trial().vehicle)}
    assert {"angle near its largest", "angle beyond its largest", "another engine"} <= errors
    assert not {"incidence near its largest", "angles mirrored"} & errors
    own = load_vehicle(VEHICLES / "finned_body.toml")
    engines = [kind.size for kind in all_kinds(own) if kind.error == "another engine"]
    assert engines == ["newtonian, another leeward side"]


def test_altitudes_and_hardware_share_their_flows() -> None:
    """One set inside, a quarter of it near the edge, beyond it twice, and below and beyond the Mach numbers."""
    found = shape_conditions(trial().vehicle, EFFORT)
    beyond = EFFORT.conditions // FEWER_BEYOND
    assert len(found) == EFFORT.conditions + 5 * beyond
    assert len({(one.mach_number, one.angle_of_attack, one.sideslip_angle) for one in found}) == len(found)


@pytest.mark.fast
def test_edges_are_the_ends_of_both_ranges_but_zero() -> None:
    vehicle = shape_vehicle()
    random = np.random.default_rng(1)
    for low, high in ((0.7, 1.0), (1.2, 1.2)):
        found = at_edge(low, high)(vehicle, None, 200, random)
        angles = np.degrees([(one.angle_of_attack, one.sideslip_angle) for one in found])
        off = np.abs(angles) / [4.0, 2.0]
        assert np.all(off.max(axis=1) <= high + 1e-9)
        assert np.all(off.max(axis=1) >= low - 1e-9)
    one_sided = vehicle.conditions.model_copy(update={"sideslip_angle_deg": [0.0, 1.0, 2.0]})
    ends = edges_of(vehicle.model_copy(update={"conditions": one_sided}))
    assert [(name, middle + reach) for name, middle, reach in ends] == [
        ("angle_of_attack", -4.0),
        ("angle_of_attack", 4.0),
        ("sideslip_angle", 2.0),
    ]


def test_flows_are_those_of_the_condition_at_any_altitude() -> None:
    model = trial().model
    assert isinstance(model, ShapeModel)
    kind = kind_of("altitude", "12 km")
    flights = model.flights(kind, EFFORT.conditions, np.random.default_rng(EFFORT.seed))
    low = flights.ambient_pressure
    np.testing.assert_allclose(low, pressure_and_temperature(12e3)[0])
    own = model.flights(kind_of("nothing wrong", "vehicle of the file"), 24, np.random.default_rng(EFFORT.seed))
    assert len(own.conditions) == 24
    np.testing.assert_allclose(flights.coefficients, own.coefficients, rtol=1e-9, atol=1e-12)
    assert at_conditions(flown(own.conditions[:2]), own.conditions[2:]) is None
    short = ShapeModel(vehicle=model.vehicle, structure=model.structure, flows=flown(own.conditions[:2]))
    with pytest.raises(FlowReachError, match="none of its flows"):
        short.flights(kind_of("Mach number below its least", "-20 %"), 24, np.random.default_rng(1))


def test_other_pressure_lies_where_it_should() -> None:
    vehicle, model = trial().vehicle, trial().model
    assert isinstance(model, ShapeModel)
    flows = at_conditions(model.flows, model.flows.conditions()[:6])
    assert flows is not None
    ambient = np.array([one.ambient_pressure for one in flows.conditions()])[:, None]
    added = (windward_bump(0.5).on_surface(vehicle, flows).pressure - flows.pressure) / ambient
    node = added.argmax(axis=1)
    x, y, z = flows.point[node].T
    assert x == pytest.approx(0.5 * flows.point[:, 0].max(), abs=0.06)
    off = (x - 0.5 * flows.point[:, 0].max()) / (0.03 * flows.point[:, 0].max())
    np.testing.assert_allclose(added.max(axis=1), 0.5 * np.exp(-0.5 * off**2), rtol=0.1)
    leeward = np.array([one.leeward_roll_angle for one in flows.conditions()])
    assert np.all(np.cos(np.arctan2(y, z) - leeward) < -0.95)
    suction = (vortex_pairs(-0.3)["0.7 L"].on_surface(vehicle, flows).pressure - flows.pressure) / ambient
    assert suction.max() <= 0.0
    x, y, z = flows.point[suction.argmin(axis=1)].T
    off = np.abs(np.angle(np.exp(1j * (np.arctan2(y, z) - leeward))))
    np.testing.assert_allclose(np.degrees(off), 25.0, atol=12.0)
    steep = flown([FlightCondition(6.5, np.radians(15.0), 0.0, 22e3)])
    other, own = (
        one.pressure / steep.internal_pressure for one in (AnotherEngine().on_surface(vehicle, steep), steep)
    )
    leeward_node = own < 1.0 + 1e-9  # where the test's own newtonian flow is ambient
    assert leeward_node.any()
    assert np.all(other[leeward_node] <= 1.0 + 1e-9)
    assert other[leeward_node].min() < 0.95
    np.testing.assert_allclose(other[own > 1.05], own[own > 1.05], rtol=1e-9)
