"""``strainfmu compare`` on a vehicle that is no body of revolution."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from shape_case import grid_snapshots, shape_map, shape_structure, shape_vehicle
from shape_truth import flights_at

from builder.compare.flights import (
    GAUGE_NOISE,
    HARDWARE,
    Effort,
    altitudes_km,
    example_conditions,
    random_conditions,
)
from builder.compare.training import training_flights
from builder.compare.trial import Flown, Trial, all_entries
from builder.reporting import Silent
from builder.trial.score import ROLLING
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.flight_condition import FlightCondition

Run = Callable[..., tuple[int, str, str]]


def flown(conditions: list[FlightCondition]) -> Flown:
    flights = flights_at(conditions)
    return Flown(flights=flights, field=flights.pressure)


def test_estimators_are_scored_with_the_rolling_moment_and_the_field() -> None:
    """A closed-form structure; flow and maps are real."""
    vehicle, effort = shape_vehicle(), Effort(conditions=15, draws=1, training=1200)
    conditions = random_conditions(vehicle, effort.conditions, np.random.default_rng(effort.seed))
    snapshots = grid_snapshots()
    trial = Trial(
        vehicle=vehicle,
        snapshots=snapshots,
        structure=shape_structure(snapshots.surface),
        flown=flown(conditions),
        example=flown(example_conditions(vehicle)[:3]),
        effort=effort,
        has_rivals=False,
    )
    of = {(one["estimator"], one["errors"], one["air_data_inputs"]): one for one in all_entries(trial, Silent())}
    assert len(of) == 2 * 9
    for errors in (GAUGE_NOISE, HARDWARE):
        nonlinear, linear = (of[name, errors, "given"] for name in ("nonlinear", "linear Case 2"))
        assert set(nonlinear["rms"]) == {"C_A", "C_N", "C_Y", "M_P", "M_Y", ROLLING}
        assert min(nonlinear["coverage_percent"].values()) > 99.0
        assert nonlinear["rms"]["C_A"] < linear["rms"]["C_A"]
        assert 0.0 < nonlinear["field_median_percent"] < 1.0
        assert nonlinear["air_data_p95"]["angle_of_attack_deg"] < 0.2
        assert of["Kalman filter, random walk", errors, "given"]["rms"][ROLLING] is None
    assert of["nonlinear", GAUGE_NOISE, "given"]["example_field_p95_percent"] < 2.0


@pytest.mark.fast
def test_the_example_is_at_three_quarters_of_every_range() -> None:
    one = example_conditions(load_vehicle(VEHICLES / "finned_body.toml"))[0]
    assert np.degrees([one.angle_of_attack, one.sideslip_angle]) == pytest.approx([4.5, 3.0])
    assert (one.mach_number, one.parameters) == (5.0, (3.0,))


def test_learning_estimators_are_trained_inside_the_ranges_of_both_angles() -> None:
    manifold = shape_map().manifold
    assert manifold is not None
    found = training_flights(manifold, altitudes_km(shape_vehicle()), 400, np.random.default_rng(1))
    angles = np.degrees(found.target[:, 5:])
    assert np.all(np.abs(angles) <= [4.01, 2.01])
    assert np.all(np.ptp(angles, axis=0) > [7.5, 3.7])


@pytest.mark.fast
def test_a_vehicle_without_a_second_mesh_is_refused_before_the_long_work(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "finned_body.toml"
    text = (VEHICLES / "finned_body.toml").read_text(encoding="utf-8")
    path.write_text(text.replace('checked_by = "finned_body_check.vtu"\n', ""), encoding="utf-8")
    code, _, message = run("compare", path, "-o", tmp_path / "out")
    assert code == 2
    assert message.count("\n") == 1
    assert message.startswith(f"strainfmu: {path}: structure.checked_by: entry is missing")
    assert not (tmp_path / "out" / "structure.h5").exists()


@pytest.mark.slow
def test_the_finned_body_from_file_to_table(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    from builder.compare import run as compare_run

    monkeypatch.setattr(compare_run, "find_spec", lambda name: None)
    command = ("compare", VEHICLES / "finned_body.toml", "-o", tmp_path, "--conditions", 20, "--draws", 2)
    code, out, _ = run(*command)
    assert code == 0
    assert "structure.h5" in {path.name for path in tmp_path.iterdir()}
    of = {
        (one["estimator"], one["errors"], one["air_data_inputs"]): one
        for one in json.loads((tmp_path / "compare.json").read_text(encoding="utf-8"))
    }
    nonlinear, linear = (of[name, "hardware", "given"] for name in ("nonlinear", "linear Case 2"))
    assert min(nonlinear["coverage_percent"].values()) >= 97.5
    assert nonlinear["rms"]["C_A"] < 0.5 * linear["rms"]["C_A"]
    assert nonlinear["field_median_percent"] < 1.5
    code, out, _ = run(*command)
    assert code == 0
    for name in ("structure.h5", "snapshots.h5", "compare_flows.h5", "compare.json"):
        assert f"{name}: up to date, reused" in out


@pytest.mark.fast
def test_a_mesh_does_not_check_itself(tmp_path: Path, run: Run) -> None:
    """Its error would be 0."""
    path = tmp_path / "finned_body.toml"
    text = (VEHICLES / "finned_body.toml").read_text(encoding="utf-8")
    path.write_text(text.replace("finned_body_check.vtu", "finned_body.vtu"), encoding="utf-8")
    code, _, message = run("compare", path, "-o", tmp_path / "out")
    line = "structure.checked_by: expected another mesh than structure.mesh, got 'finned_body.vtu' again"
    assert (code, message) == (2, f"strainfmu: {path}: {line}\n")
