"""Rows of the long table: five parts of the samples, statistical errors on draws of a known law, verdicts."""

from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flight_maps import N_D, flight_map, whole_map, with_considered_columns, with_considered_error
from scaled_maps import scaled_map

from builder.figures.comparison import trial_figure
from builder.trial.bound import KNOWN, cramer_rao_bound
from builder.trial.cases import Case
from builder.trial.compared import with_drawn_errors
from builder.trial.conditions import flight_states, quantities
from builder.trial.estimators import Estimates, of_map
from builder.trial.readings import Readings, with_map_errors
from builder.trial.run import labelled
from builder.trial.score import PARTS, Clusters, Row, judged, rows_of
from builder.trial.table import cells_of, columns_of, in_order, loads_of, reasons, write_table
from strainfmu.arrays import FloatArray
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
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
    extras = {
        "angle_of_attack": (np.array([0.06, 0.05]), 0.01 * two),
        "static_pressure": (1.02 * p_inf * two, 0.01 * p_inf * two),
        "pressure field": (np.array([0.1, 0.3]), np.nan * two),
    }
    estimates = Estimates(value=np.zeros((2, 1)), std=np.ones((2, 1)), extras=extras)
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
    assert a["covered_1_percent"] == pytest.approx(40.0)
    assert a["undetected_percent"] == pytest.approx(sixth)
    assert (a["rms"], a["bias"], a["sigma"]) == pytest.approx((np.sqrt(36.0 / 5.0), 0.4, 1.0))
    assert a["over_bound"] == pytest.approx(a["rms"] / 2.0)
    assert "over_bound" not in b
    assert b["rms_z"] == pytest.approx(np.sqrt((1.0 + 1.0 + 1.0 + 81.0) / 5.0))


def test_errors_are_those_of_many_trials() -> None:
    """20 vehicles in 30 flights, each with an error of its own: the clustered error is the spread of the mean.

    It is 0.93 to 1 of it: 20 vehicles are few. An error of independent samples would be 0.2 of it. What never
    occurs has an upper limit.
    """
    random, vehicles, flights = np.random.default_rng(2), 20, 30
    vehicle, flight = (one.ravel() for one in np.meshgrid(np.arange(vehicles), np.arange(flights), indexing="ij"))
    clusters, found = Clusters(vehicle, flight), []
    for _ in range(400):
        value = random.standard_normal(vehicles)[vehicle] + 0.5 * random.standard_normal(flights)[flight]
        found.append(clusters.mean(value + 0.2 * random.standard_normal(len(value))))
    means, errors = np.transpose(found)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(means), rel=0.1)
    independent = Clusters(np.arange(len(vehicle)), np.arange(len(vehicle))).mean(value)[1]
    assert independent < 0.3 * np.std(means)
    row = Clusters(np.arange(300) % 30, np.arange(300)).percent("undetected", np.zeros(300, dtype=bool))
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
        ("beyond", 0.9, 40, 0, "open", ""),
    ],
)
def test_verdicts(group: str, z: float, n: int, undetected: int, verdict: str, why: str) -> None:
    of_case = rows(z, n, n if n > 40 else n // 2, undetected)
    assert judged(Case(error="e", group=group, at_least={"flagged_percent": 50.0}), of_case)[0] == "missed"
    found, text = judged(Case(error="e", group=group), of_case)
    assert found == verdict
    assert text.startswith(why)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".json"])
def test_the_table_is_written_and_read_back(suffix: str, tmp_path: Path) -> None:
    import pandas

    table = labelled(Case(error="e", size="1 %", group="beyond"), "linear", six_samples())
    path = tmp_path / f"trial{suffix}"
    write_table(table, path)
    back = {".csv": pandas.read_csv, ".parquet": pandas.read_parquet, ".json": pandas.read_json}[suffix](path)
    assert list(back.columns) == columns_of(table)
    assert list(back["case"]) == 3 * ["e, 1 %"]
    assert list(back["load"]) == ["all", "a", "b"]
    assert back["undetected_percent"][0] == pytest.approx(100.0 / 3.0, rel=1e-5)
    ((group, ordered),) = in_order(table).items()
    assert (group, len(ordered)) == ("beyond", 1)
    cells = cells_of(ordered[0], loads_of(table)["e, 1 %", "linear"])
    assert cells[:4] == ["e, 1 %", "linear", "6", "16.67"]
    assert cells[-4] == "60.00 a"
    assert reasons(table)[-1] == "open: 1 of 1, more samples decide"


FLOWN = tuple(
    FlightCondition(mach, radians(alpha), radians(beta), 20e3)
    for mach, alpha, beta in ((5.4, 3.0, 1.0), (6.0, -4.0, 2.0), (6.6, 5.0, -3.0))
)


def small_map(discrepancy: float = 0.0) -> InverseMap:
    return replace(scaled_map(2, 1, N_D), manifold=flight_map(discrepancy=discrepancy, hardware=True))


def bound_of(inverse_map: InverseMap, known: tuple[str, ...] = KNOWN) -> FloatArray:
    found = cramer_rao_bound(inverse_map, FLOWN, known)
    assert found is not None
    return found


def test_an_estimator_that_knows_the_flow_reaches_it() -> None:
    """Noise, gains and navigation drawn for 400 vehicles at three flights, no pressure off the tables."""
    inverse_map, random, n = small_map(), np.random.default_rng(1), 400 * len(FLOWN)
    manifold, flight = inverse_map.manifold, np.arange(n) % len(FLOWN)
    assert manifold is not None
    state = flight_states(FLOWN)[flight]
    names = ("mach_number", "ambient_pressure", "dynamic_pressure")
    mach, pressure, q = (quantities(FLOWN, name)[flight] for name in names)
    strain, _ = with_drawn_errors(manifold, state, random)
    error = random.standard_normal((3, n))
    known = {
        "mach_number": mach + manifold.mach_number_error * error[0],
        "static_pressure": pressure * (1.0 + manifold.static_pressure_error * error[1]),
        "dynamic_pressure": q * (1.0 + manifold.dynamic_pressure_error * error[2]),
        "q_source": np.ones(n),
    }
    truth = evaluate(manifold.tables, state).value[:, N_D:] / (q[:, None] * manifold.references)
    every = replace(read(truth, bound=bound_of(inverse_map)[flight]), strain=strain, known=known, flight=flight)
    rows = rows_of(COEFFICIENT_NAMES, of_map(inverse_map)(every), every)
    np.testing.assert_allclose([row["over_bound"] for row in rows[1:]], 1.0, atol=0.1)


def test_the_flow_makes_it_no_larger_and_there_is_none_without_tables_nor_beyond_them() -> None:
    np.testing.assert_allclose(bound_of(small_map(discrepancy=1e-2)), bound_of(small_map()), rtol=1e-12)
    assert np.max(bound_of(small_map(), ("mach_number", "altitude")) / bound_of(small_map())) > 1.05
    assert cramer_rao_bound(scaled_map(2, 1, N_D), FLOWN, KNOWN) is None
    beyond = (FlightCondition(8.0, 0.0, 0.0, 20e3), FlightCondition(6.0, radians(15.0), 0.0, 20e3), FLOWN[0])
    found = cramer_rao_bound(small_map(), beyond, KNOWN)
    assert found is not None
    assert np.isnan(found).all(axis=1).tolist() == [True, True, False]


def test_zeros_of_a_calibration_do_not_change_it() -> None:
    zeros = 3e-3 * np.random.default_rng(1).standard_normal(N_D)
    np.testing.assert_allclose(bound_of(replace(small_map(), zero_offset=zeros)), bound_of(small_map()), rtol=1e-6)


def test_errors_have_the_covariance_that_the_map_states() -> None:
    """40,000 samples at two conditions, noise of the draw 1 %: strain, loads and what joins them."""
    inverse_map = with_considered_columns(with_considered_error(whole_map()))
    manifold = inverse_map.manifold
    assert manifold is not None
    n, n_d = 80_000, manifold.n_gauges
    flight = np.arange(n) % 2
    true = replace(read(np.ones((n, 5))), strain=np.ones((n, n_d)), flight=flight, conditions=FLOWN[:2])
    found = with_map_errors(inverse_map, true, np.random.default_rng(1))
    for number, condition in enumerate(FLOWN[:2]):
        rows = flight == number
        to_load = condition.dynamic_pressure * manifold.references
        errors = np.hstack([found.strain[rows] - 1.0, (found.truth[rows] - 1.0) * to_load])
        columns = np.hstack([np.vstack([manifold.error_strain, manifold.error_load]), manifold.considered_columns])
        tables = manifold.considered_tables
        assert tables is not None
        of_tables = evaluate(tables, found.states[rows][:1]).value.T
        root = np.hstack([condition.ambient_pressure * columns, of_tables])[: n_d + 5]
        size = np.linalg.norm(root, axis=1)
        np.testing.assert_allclose(np.cov((errors / size).T), (root @ root.T) / np.outer(size, size), atol=0.03)
        np.testing.assert_allclose(errors.mean(axis=0) / size, 0.0, atol=0.03)


def parts_of(error: str, of: str, flagged: float, undetected: float, verdict: str = "ok") -> list[dict[str, Any]]:
    shares = [100.0 - flagged - undetected, flagged, 0.0, undetected, 0.0]
    row = {"case": error, "error": error, "class": of, "estimator": "map", "verdict": verdict}
    row |= {f"{part}_percent": share for part, share in zip(PARTS, shares, strict=True)}
    row["undetected_percent_error"] = 0.1
    return [{**row, "load": "all"}, {**row, "load": "C_N", "rms": 1.0, "rms_z": 0.8}]


def test_what_is_missed_comes_first_then_what_is_undetected_in_table_and_figure() -> None:
    """The figure has a band of sigma."""
    shown = [
        *parts_of("a", "beyond", 0.0, 0.0),
        *parts_of("all_stated", "beyond", 0.0, 0.0),
        *parts_of("b", "alone", 0.0, 0.0),
        *parts_of("c", "beyond", 90.0, 0.01),
        *parts_of("d", "beyond", 10.0, 2.0),
        *parts_of("e", "beyond", 0.0, 0.02, "missed"),
    ]
    groups = in_order(shown)
    assert list(groups) == ["alone", "beyond"]
    assert [row["case"] for row in groups["beyond"]] == ["all_stated", "e", "d", "c", "a"]
    axes = trial_figure([*shown, *parts_of("f", "drawn", 0.0, 0.0)], "vehicle").axes
    assert [label.get_text() for label in axes[4].get_yticklabels()] == ["all_stated", "e", "d", "c", "a"]
    assert len(axes[1].patches) == 1  # of the class "drawn" alone
    assert [len(axis.patches) for axis in axes[3::2]] == [0, 0]
