"""Scores of kinds of error on a coarse vehicle: targets that hold, limits that are known, flows that are there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from builder.stress.flows import newtonian_flows, vortex_pairs, windward_bump
from builder.stress.kind import Kind
from builder.stress.kinds import all_kinds
from builder.stress.model import RevolvedModel
from builder.stress.run import check_fit, of_map, table_csv
from builder.stress.score import Range
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.flows import truth_surface
from builder.vehicle.file import Vehicle
from strainfmu.errors import FlowReachError, InputError


def kind_of(trial: Range, error: str, size: str) -> Kind:
    return next(kind for kind in all_kinds(trial.vehicle) if (kind.error, kind.size) == (error, size))


@pytest.mark.parametrize(
    ("error", "size"),
    [
        ("nothing wrong", "vehicle of the file"),
        ("all installation errors", "drawn at their stated sizes"),
        ("Young's modulus", "+1 %"),
        ("wall thickness", "+2 %"),
        ("roll of the layout", "+1 deg"),
        ("altitude", "25 km"),
        ("angles mirrored", "the other sign of one or both"),
        ("dynamic pressure", "+10 %"),
        ("incidence beyond its largest", "+20 %"),
        ("Mach number below its least", "-20 %"),
        ("Mach number beyond its largest", "+20 %"),
        ("filter over time, zeros", "exactly known"),
        ("filter over time, zeros", "wrong by 5 sigma of the noise"),
        ("filter over time, zeros", "wrong in common by 5 sigma of the noise"),
    ],
)
def test_targets_hold(trial: Range, error: str, size: str) -> None:
    """3 % silent within, 5 % outside, 95 % flagged 20 % beyond: as for the shipped vehicle."""
    kind = kind_of(trial, error, size)
    # The zeros of a filtered flight are wrong alike in all flights of a vehicle: six vehicles would be few.
    score = trial.score(kind if kind.filtered is None else replace(kind, draws=4.0))
    assert score.missed == ()
    assert score.score.detected + score.score.undetected <= 1.0
    assert sum(score.score.health.values()) == pytest.approx(1.0)


def test_what_no_strain_shows_is_silent(trial: Range) -> None:
    """A tenth too much q_inf: silent without navigation, flagged with it."""
    without = trial.score(kind_of(trial, "dynamic pressure, no navigation", "+10 %"))
    assert without.kind.group == "unobservable"
    assert without.score.undetected > 0.2
    assert without.missed == ()
    assert trial.score(kind_of(trial, "dynamic pressure", "+10 %")).score.detected == 1.0


def test_lost_gauges_are_flagged_and_their_estimate_is_right(trial: Range) -> None:
    score = trial.score(kind_of(trial, "three gauges lost", "no reading"))
    assert score.score.health == {"DEGRADED": 1.0}
    assert score.score.wrong < 0.03


def test_a_score_is_the_same_each_time_and_whatever_else_is_scored(trial: Range) -> None:
    kind = kind_of(trial, "bias of three gauges", "+20 um/m")
    assert trial.score(kind).entry() == trial.score(kind).entry()


def test_missed_targets_are_named(trial: Range) -> None:
    score = trial.score(kind_of(trial, "dynamic pressure, no navigation", "+10 %"))
    strict = replace(score, kind=replace(score.kind, group="within", flagged_target=95.0))
    silent, flagged = strict.missed
    assert silent.endswith("at most 3 % aimed at")
    assert flagged.endswith("at least 95 % aimed at")
    assert strict.entry()["missed"] == [silent, flagged]
    assert f'"{silent}; {flagged}"' in table_csv([strict.entry()])


def test_flights_that_the_flows_do_not_reach_are_refused(trial: Range, flow_beyond: FlowTable) -> None:
    short = replace(
        flow_beyond,
        mach_knots=flow_beyond.mach_knots[1:],
        harmonic=flow_beyond.harmonic[1:, :-2],
        incidence_knots=flow_beyond.incidence_knots[:-2],
    )
    assert isinstance(trial.model, RevolvedModel)
    other = Range(
        vehicle=trial.vehicle,
        model=replace(trial.model, table=short),
        inverse_map=trial.inverse_map,
        effort=trial.effort,
    )
    for error, size in (("incidence beyond its largest", "+20 %"), ("Mach number below its least", "-20 %")):
        with pytest.raises(FlowReachError, match="needed, the flows go up to"):
            other.score(kind_of(trial, error, size))


def test_another_map_is_refused(trial: Range) -> None:
    names = tuple(f"other {name}" for name in trial.inverse_map.gauge_names)
    with pytest.raises(InputError, match=r"^map.h5: expected the 54 gauges of layout .*, got 54 gauges"):
        check_fit(trial.vehicle, replace(trial.inverse_map, gauge_names=names), Path("map.h5"))
    larger = replace(trial.inverse_map, reference_area=1.0)
    with pytest.raises(InputError, match=r"^map.h5: reference area \[m2\]: expected .* of the vehicle, got 1"):
        check_fit(trial.vehicle, larger, Path("map.h5"))


def test_the_envelope_is_that_of_the_map(trial: Range, vehicle: Vehicle) -> None:
    """A vehicle file with other conditions: those of the map count."""
    listed = {"mach_number": [2.0], "altitude_km": 5.0}
    changed = vehicle.model_copy(update={"conditions": vehicle.conditions.model_copy(update=listed)})
    found = of_map(changed, trial.inverse_map).conditions
    assert found.mach_number == [5.0, 7.0]
    assert found.angle_of_attack_deg == pytest.approx([0.0, 10.0])
    assert found.altitudes_km == [20.0]


def test_newtonian_flow_has_the_pressure_of_its_engine(flown: Vehicle, flow_beyond: FlowTable) -> None:
    """Windward on the front cone p/p_inf is 1 + 0.7 M^2 C_p,max sin^2(5 deg + a): 1 %."""
    from builder.aero.engines.local_inclination import largest_pressure_coefficient

    table, station = newtonian_flows(flown, flow_beyond), 8
    mach, incidence = float(table.mach_knots[2]), float(table.incidence_knots[3])
    sign = np.where(np.arange(table.harmonic.shape[3]) % 2, -1.0, 1.0)  # windward: phi = pi
    found = float(table.harmonic[2, 3, station] @ sign)
    inclination = np.radians(5.0) + incidence
    largest = largest_pressure_coefficient(mach, "rayleigh_pitot")
    assert found == pytest.approx(1.0 + 0.7 * mach**2 * largest * np.sin(inclination) ** 2, rel=0.01)


def test_a_bump_lies_windward_at_mid_body(flown: Vehicle, flow_beyond: FlowTable) -> None:
    added = windward_bump(0.5).on_table(flown, flow_beyond).harmonic[0, 0] - flow_beyond.harmonic[0, 0]
    surface = truth_surface(flown)
    field = added @ np.cos(np.outer(np.arange(added.shape[1]), surface.roll_angle))
    station, around = np.unravel_index(np.argmax(field), field.shape)
    assert surface.x[station] == pytest.approx(0.5 * surface.x[-1], abs=0.05)
    assert surface.roll_angle[around] == pytest.approx(np.pi)
    assert field.max() == pytest.approx(0.5, rel=0.1)


def test_a_vortex_pair_sucks_to_both_sides_of_the_leeward_meridian(flown: Vehicle, flow_beyond: FlowTable) -> None:
    pair = vortex_pairs(-0.3)["0.7 L"]
    added = pair.on_table(flown, flow_beyond).harmonic[1, 2] - flow_beyond.harmonic[1, 2]
    surface = truth_surface(flown)
    field = added @ np.cos(np.outer(np.arange(added.shape[1]), surface.roll_angle))
    station, _ = np.unravel_index(np.argmin(field), field.shape)
    assert surface.x[station] == pytest.approx(0.7 * surface.x[-1], abs=0.05)
    around = np.degrees(np.minimum(surface.roll_angle, 2.0 * np.pi - surface.roll_angle))
    deepest = around[np.argsort(field[station])[:2]]
    np.testing.assert_allclose(deepest, 25.0, atol=10.0)
    assert field.min() == pytest.approx(-0.3, rel=0.2)
    np.testing.assert_allclose(field[station], np.roll(field[station][::-1], 1), atol=1e-12)
