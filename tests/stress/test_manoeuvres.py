"""Manoeuvres over time: what moves and fails in them, scores of filter and single samples, refusals."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest
from changed_vehicle import change
from ogive import copied_ogive

from builder.reporting import Silent
from builder.stress import flights
from builder.stress import run as stress_run
from builder.stress.flights import envelope_incidence
from builder.stress.manoeuvre import RISE, Manoeuvre, ManoeuvreSet, manoeuvre_set
from builder.stress.manoeuvre_score import fly, manoeuvre_scores
from builder.stress.score import Range
from builder.vehicle.file import Vehicle

TIME = 0.01 * np.arange(400)


def named(error: str, size: str) -> Manoeuvre:
    return next(one for one in manoeuvre_set().manoeuvres if (one.error, one.size) == (error, size))


def incidence_of(vehicle: Vehicle, one: Manoeuvre, seed: int = 1) -> np.ndarray:
    """Return (n,) the total incidence over :data:`TIME`."""
    found = one.conditions(vehicle, TIME, np.random.default_rng(seed))
    return np.array([condition.total_incidence for condition in found])


def test_all_are_distinct_and_have_what_a_kind_has() -> None:
    held = manoeuvre_set().manoeuvres
    assert len({(one.error, one.size) for one in held}) == len(held)
    assert {one.group for one in held} <= {"within", "outside"}
    assert all(one.what and one.seconds > 0.0 for one in held)
    assert {one.turn_deg_s for one in held} >= {5.0, 10.0, 21.0, 30.0, 40.0}


@pytest.mark.parametrize("rate", [5.0, 40.0])
def test_a_turn_reaches_its_rate_inside_the_envelope(flown: Vehicle, rate: float) -> None:
    incidence = incidence_of(flown, named("turn", f"{rate:g} deg/s"))
    assert np.max(np.abs(np.diff(incidence))) / 0.01 == pytest.approx(radians(rate), rel=0.05)
    assert np.max(incidence) <= envelope_incidence(flown)


def test_steps_and_gusts_have_their_size(flown: Vehicle) -> None:
    step = np.abs(np.diff(incidence_of(flown, named("step", "2 deg"))))
    assert np.count_nonzero(step > 1e-9) in (3, 4)
    assert np.max(step) <= radians(2.0) * (1.0 + 1e-9)
    gust = np.abs(np.diff(incidence_of(flown, named("gust", "2 deg in 0.1 s"))))
    assert np.max(gust) == pytest.approx(radians(2.0) * 0.01 / RISE, rel=0.01)


def test_rows_and_all_strain_get_lost(trial: Range) -> None:
    roll, random = trial.hardware.roll_angle, np.random.default_rng(2)
    two = named("lost rows in flight", "2 opposite rows at 5 deg/s").gives(TIME, roll, random)
    assert two[:199].all()
    lost = np.unique(np.round(np.mod(roll[~two[-1]], 2.0 * np.pi), 6))
    assert len(lost) == 2
    assert np.cos(lost[1] - lost[0]) == pytest.approx(-1.0)
    none = named("no strain", "0.5 s at 30 deg/s").gives(TIME, roll, random)
    assert np.count_nonzero(~none.any(axis=1)) == pytest.approx(50, abs=1)
    assert np.isnan(fly(trial, 0.01, named("no strain", "0.5 s at 30 deg/s"), random).strain[200]).all()


def test_scores_of_a_linear_map(trial: Range) -> None:
    """Steady flight gains, turns lose nothing, and single samples are their own measure."""
    steady, turn = named("steady flight", "noise alone"), named("turn", "10 deg/s")
    given = ManoeuvreSet(time_step=0.01, time_constants=(1.0,), coverage_percent=99.0, manoeuvres=(steady, turn))
    few = Range(trial.vehicle, trial.model, trial.inverse_map, replace(trial.effort, draws=2))
    entries = [one.entry() for one in manoeuvre_scores(few, given, Silent())]
    assert [(one["error"], one["time_constant_s"]) for one in entries] == [
        ("steady flight", 0.0),
        ("steady flight", 1.0),
        ("turn", 0.0),
        ("turn", 1.0),
    ]
    ratio = [np.array([*one["rms_over_single"].values()]) for one in entries]
    assert np.all(ratio[0] == 1.0)
    assert np.all(ratio[1] < 0.67)
    assert np.all(ratio[3] < 1.05)
    assert all(one["estimator"] == "linear" and one["samples"] == 800 for one in entries)


@pytest.mark.usefixtures("compiled_solver")
def test_the_command_writes_an_entry_for_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Callable[..., tuple[int, str, str]]
) -> None:
    monkeypatch.setattr(flights, "MACH_KNOTS", 4)
    monkeypatch.setattr(flights, "INCIDENCE_KNOTS", 4)
    short = replace(manoeuvre_set(), manoeuvres=(replace(named("turn", "10 deg/s"), seconds=0.5),))
    monkeypatch.setattr(stress_run, "manoeuvre_set", lambda: short)
    vehicle = copied_ogive(tmp_path / "vehicle")
    change(vehicle, ("modes = 4", 'modes = 4\nalarm_levels = "nominal"'))
    code, text, _ = run("stress", vehicle, "-o", tmp_path / "out", "--flights", "--draws", 1)
    assert code == 0
    assert "rms error over single samples" in text
    entries = json.loads((tmp_path / "out" / "stress.json").read_text(encoding="utf-8"))
    assert {one["error"] for one in entries} == {"turn"}
    assert all({"class", "undetected_percent", "coverage_percent"} <= one.keys() for one in entries)
