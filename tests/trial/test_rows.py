"""Rows of the long table: five parts of the samples, statistical errors on draws of a known law, verdicts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from builder.trial.cases import Case
from builder.trial.estimators import Estimates
from builder.trial.readings import Readings
from builder.trial.rules import judged
from builder.trial.run import labelled
from builder.trial.score import PARTS, Clusters, Row, rows_of
from builder.trial.table import cells_of, columns_of, in_order, loads_of, reasons, write_table
from strainfmu.estimator.health import HealthState
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast

OK, SUSPECT, DEGRADED, OUTSIDE = HealthState.OK, HealthState.SUSPECT, HealthState.DEGRADED, HealthState.OUTSIDE


def read(truth: np.ndarray, vehicle: np.ndarray | None = None, bound: np.ndarray | None = None) -> Readings:
    n = np.arange(len(truth))
    return Readings(
        strain=np.zeros((len(n), 0)),
        known={},
        truth=truth,
        vehicle=n if vehicle is None else vehicle,
        flight=n,
        bound=bound,
    )


def six_samples() -> list[Row]:
    """Right; right and flagged; wrong and flagged; wrong, one with DEGRADED; without an estimate."""
    error = np.array([[0.0, 0.1], [2.0, 0.1], [-4.0, 0.1], [0.0, 0.9], [4.0, 0.0], [np.nan, np.nan]])
    std = np.tile([1.0, 0.1], (6, 1))
    health = np.array([OK, SUSPECT, OUTSIDE, DEGRADED, OK, OUTSIDE])
    bound = np.full((6, 1), 2.0)
    return rows_of(("a", "b"), Estimates(value=error, std=std, health=health), read(np.zeros((6, 2)), bound=bound))


def test_air_data_have_errors_in_their_units_and_pressures_over_the_true_ones() -> None:
    """What is no quantity of the flight is an error as it is."""
    condition = FlightCondition(mach_number=6.0, angle_of_attack=0.05, sideslip_angle=0.02, altitude=20e3)
    p_inf, two = condition.ambient_pressure, np.ones(2)
    others = {
        "angle_of_attack": (np.array([0.06, 0.05]), 0.01 * two),
        "static_pressure": (1.02 * p_inf * two, 0.01 * p_inf * two),
        "pressure field": (np.array([0.1, 0.3]), np.nan * two),
    }
    estimates = Estimates(value=np.zeros((2, 1)), std=np.ones((2, 1)), others=others)
    flights = replace(read(np.zeros((2, 1))), conditions=(condition,) * 2)
    _, _, angle, pressure, field = rows_of(("a",), estimates, flights)
    assert (angle["rms"], angle["sigma"]) == pytest.approx((0.01 / np.sqrt(2.0), 0.01))
    assert pressure["load"] == "static_pressure"
    assert (pressure["p95"], pressure["sigma"]) == pytest.approx((0.02, 0.01))
    assert (field["median"], field["p95"]) == pytest.approx((0.2, 0.29))
    assert "covered_percent" not in field


def test_each_sample_is_one_of_five() -> None:
    every, a, b = six_samples()
    sixth = 100.0 / 6.0
    assert [every[f"{part}_percent"] for part in PARTS] == pytest.approx([sixth, sixth, sixth, 2 * sixth, sixth])
    for row in (every, a, b):
        assert sum(row[f"{part}_percent"] for part in PARTS) == pytest.approx(100.0)
    assert (every["load"], every["samples"], every["flagged_percent"]) == ("all", 6, pytest.approx(3 * sixth))
    assert every["alarm_percent"] == pytest.approx(sixth)
    assert a["covered_percent"] == pytest.approx(60.0)  # of samples with an estimate
    assert a["undetected_percent"] == pytest.approx(sixth)
    assert (a["rms"], a["bias"], a["sigma"]) == pytest.approx((np.sqrt(36.0 / 5.0), 0.4, 1.0))
    assert a["over_bound"] == pytest.approx(a["rms"] / 2.0)
    assert "over_bound" not in b
    assert b["rms_z"] == pytest.approx(np.sqrt((1.0 + 1.0 + 1.0 + 81.0) / 5.0))


def test_normal_errors_of_the_stated_size() -> None:
    random = np.random.default_rng(1)
    std = random.uniform(0.5, 2.0, (200_000, 2))
    made = Estimates(value=std * random.standard_normal(std.shape), std=std)
    for row in rows_of(("a", "b"), made, read(np.zeros(std.shape)))[1:]:
        assert row["covered_1_percent"] == pytest.approx(68.27, abs=0.5)
        assert row["covered_percent"] == pytest.approx(99.73, abs=0.05)
        assert row["rms_z"] == pytest.approx(1.0, abs=0.01)


def test_errors_are_those_of_many_trials() -> None:
    """20 vehicles in 30 flights, each with an error of its own: the clustered error is the spread of the mean.

    It is 0.93 to 1 of it: 20 vehicles are few. An error of independent samples would be 0.2 of it.
    """
    random, vehicles, flights = np.random.default_rng(2), 20, 30
    vehicle, flight = (one.ravel() for one in np.meshgrid(np.arange(vehicles), np.arange(flights), indexing="ij"))
    clusters, means, errors = Clusters(vehicle, flight), [], []
    for _ in range(400):
        value = random.standard_normal(vehicles)[vehicle] + 0.5 * random.standard_normal(flights)[flight]
        mean, error = clusters.mean(value + 0.2 * random.standard_normal(len(value)))
        means.append(mean)
        errors.append(error)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(means), rel=0.1)
    independent = Clusters(np.arange(len(vehicle)), np.arange(len(vehicle))).mean(value)[1]
    assert independent < 0.3 * np.std(means)


def test_what_never_occurs_has_an_upper_limit() -> None:
    clusters = Clusters(np.arange(300) % 30, np.arange(300))
    row = clusters.percent("undetected", np.zeros(300, dtype=bool))
    assert row == {"undetected_percent": 0.0, "undetected_percent_error": 1.0, "undetected_percent_upper": 1.0}
    assert np.isnan(Clusters(np.zeros(3, dtype=int), np.arange(3)).mean(np.arange(3.0))[1])


def rows(z: float, n: int, vehicles: int, undetected: int = 0) -> list[Row]:
    random = np.random.default_rng(3)
    value = np.clip(z * random.standard_normal((n, 1)), -2.9, 2.9)
    value[:undetected] = 9.0
    made = Estimates(value=value, std=np.ones((n, 1)), health=np.zeros(n, dtype=int))
    return rows_of(("a",), made, read(np.zeros((n, 1)), np.arange(n) % vehicles))


@pytest.mark.parametrize(
    ("group", "z", "n", "undetected", "verdict", "why"),
    [
        ("drawn", 0.9, 4000, 0, "ok", ""),
        ("drawn", 0.3, 4000, 0, "missed", "rms z of a 0.3 +- 0.0033, at least 0.7"),
        ("alone", 0.3, 4000, 0, "ok", ""),
        ("alone", 0.9, 100, 2, "open", "covered of a 98 +- 1.4 %, at least 99 %"),
        ("beyond", 0.9, 4000, 400, "missed", "undetected 10 +- 0.47 %, at most 5 %"),
        ("beyond", 0.9, 4000, 100, "ok", ""),
        ("unobservable", 0.9, 100, 100, "-", ""),
    ],
)
def test_verdicts(group: str, z: float, n: int, undetected: int, verdict: str, why: str) -> None:
    case = Case.model_validate({"error": "e", "class": group})
    found, text = judged(case, rows(z, n, n, undetected))
    assert found == verdict
    assert text.startswith(why)


def test_few_samples_leave_a_verdict_open() -> None:
    case = Case.model_validate({"error": "e", "class": "beyond"})
    assert judged(case, rows(0.9, 40, 20))[0] == "open"
    strict = Case.model_validate({"error": "e", "class": "beyond", "flagged_at_least": 50.0})
    assert judged(strict, rows(0.9, 40, 20))[0] == "missed"


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".json"])
def test_the_table_is_written_and_read_back(suffix: str, tmp_path: Path) -> None:
    import pandas

    table = labelled(
        Case.model_validate({"error": "e", "size": "1 %", "class": "beyond"}), "linear", six_samples()
    )
    path = tmp_path / f"trial{suffix}"
    write_table(table, path)
    back = {".csv": pandas.read_csv, ".parquet": pandas.read_parquet, ".json": pandas.read_json}[suffix](path)
    assert list(back.columns) == columns_of(table)
    assert list(back["case"]) == 3 * ["e, 1 %"]
    assert list(back["load"]) == ["all", "a", "b"]
    assert back["undetected_percent"][0] == pytest.approx(100.0 / 3.0, rel=1e-5)
    first = [{**row, "error": "all_stated", "verdict": "ok"} for row in table]
    assert next(iter(in_order([*table, *first]).values()))[0]["error"] == "all_stated"
    ((group, ordered),) = in_order(table).items()
    assert (group, len(ordered)) == ("beyond", 1)
    cells = cells_of(ordered[0], loads_of(table)["e, 1 %", "linear"])
    assert cells[:4] == ["e, 1 %", "linear", "6", "16.67"]
    assert cells[-4] == "60.00 a"
    assert reasons(table)[-1] == "open: 1 of 1, more samples decide"
