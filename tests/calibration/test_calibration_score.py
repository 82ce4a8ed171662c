"""The score of calibrations: its summary, how it goes on, and one vehicle from end to end."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from coarse_vehicle import COARSE

from builder.calibration.as_built.outside_errors import OUTSIDE
from builder.calibration.estimate.outside_terms import NOISE
from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.score.setup import SetupOptions, flights_of, rows_of_test, setup_of
from builder.calibration.score.summary import BEFORE, EQUATIONS, EXACT, errors_of, summary
from builder.calibration.score.summary import table as as_text
from builder.calibration.score.vehicles import OUTSIDE_KINDS, Score, rows_of
from builder.campaign.snapshots import Snapshots
from builder.truth.revolution.flow_table import FlowTable
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolutions
from builder.vehicle.shape.geometry import surface_grid
from strainfmu.errors import InputError
from strainfmu.estimator.health import HealthState


@pytest.mark.fast
def test_errors_are_pooled_over_vehicles_and_put_over_the_exact_ones() -> None:
    random, rows = np.random.default_rng(0), []
    for vehicle, size in ((0, 1.0), (1, 3.0)):
        error = size * random.standard_normal((4000, 5))
        health = np.full(4000, HealthState.OK)
        health[:40] = HealthState.SUSPECT
        exact = errors_of(error, np.full_like(error, size), health)
        tested = errors_of(2.0 * error, np.full_like(error, size))
        rows += [
            {"vehicle": vehicle, "map": "case 1", "state": EXACT, **exact},
            {"vehicle": vehicle, "map": "case 1", "state": "12 cases", "chi_square_per_reading": size, **tested},
            {"vehicle": vehicle, "map": EQUATIONS, "state": "12 cases", **errors_of(10.0 * error, error)},
        ]
    exact, tested, equations = summary(rows)
    assert tested["ratio"] == [2.0] * 5
    assert equations["ratio"] == [10.0] * 5  # over the exactly known map of case 1
    assert exact["rms"]["C_A"] == pytest.approx(np.sqrt(5.0), rel=0.05)
    assert exact["pooled_coverage_percent"] == pytest.approx(99.73, abs=0.1)
    assert tested["pooled_coverage_percent"] == pytest.approx(86.6, abs=1.0)  # 1.5 sigma
    assert tested["chi_square_per_reading"] == [1.0, 2.0, 3.0]
    assert exact["alarm_percent"] == 1.0
    assert "86." in as_text([exact, tested, equations])


@pytest.mark.fast
def test_a_score_goes_on_with_its_own_settings_only(tmp_path: Path) -> None:
    path = tmp_path / "score.json"
    assert rows_of(path, {"cases": [12]}) == []
    path.write_text(json.dumps({"settings": {"cases": [12]}, "rows": [{"vehicle": 0}]}), encoding="utf-8")
    assert rows_of(path, {"cases": [12]}) == [{"vehicle": 0}]
    with pytest.raises(InputError, match=r"other settings \(cases\)"):
        rows_of(path, {"cases": [6]})
    path.write_text("[]", encoding="utf-8")
    with pytest.raises(InputError, match="expected a score"):
        rows_of(path, {"cases": [12]})


@pytest.mark.fast
def test_smaller_tests_begin_with_the_same_pads() -> None:
    assert list(rows_of_test(2, 4, 6)) == [0, 1, 4, 5]


@pytest.mark.fast
@pytest.mark.parametrize("ratio", [1.0, 1.5])
def test_flights_are_of_the_pressure_above_that_of_the_air(vehicle: Vehicle, ratio: float) -> None:
    """The same pressure all over the surface acts on its base alone: C_A q S = (p - p_inf) A."""
    body, knots = vehicle.body(), np.radians([2.0, 5.0, 8.0, 11.0])
    grid = surface_grid(body, 40, 24)
    harmonic = np.zeros((4, 4, 40, 3))
    harmonic[..., 0] = ratio
    mach = np.linspace(4.0, 8.0, 4)
    table = FlowTable(vehicle="even", mach_knots=mach, incidence_knots=knots, harmonic=harmonic, provenance={})
    found = flights_of(vehicle, table, grid, 5)
    ambient, dynamic = (
        np.array([getattr(one, name) for one in found.conditions])
        for name in ("ambient_pressure", "dynamic_pressure")
    )
    np.testing.assert_allclose(found.pressure, np.tile((ratio - 1.0) * ambient[:, None], 40 * 24), atol=1e-9)
    base = np.pi * body.radius(np.array([body.length]))[0] ** 2
    expected = (ratio - 1.0) * ambient * base / (dynamic * vehicle.reference_quantities().area)
    np.testing.assert_allclose(found.coefficients[:, 0], expected, rtol=1e-3, atol=1e-12)
    np.testing.assert_allclose(found.coefficients[:, 1:], 0.0, atol=1e-9)


@pytest.mark.slow
def test_a_tested_vehicle_flies_as_one_that_is_known(
    vehicle: Vehicle, snapshots: Snapshots, table: FlowTable
) -> None:
    """And errors that no tolerance states are named and estimated, so that the readings fit."""
    finer = COARSE.model_copy(update={"element_length_mm": 30.0})
    vehicle = vehicle.model_copy(update={"resolution": Resolutions(map=COARSE, truth=finer)})
    options = SetupOptions(cases=(12,), flights=20, draws=2, errors=LoadErrors(), with_outside=True)
    score = Score(setup_of(vehicle, snapshots, table, options), ["case 2"], OUTSIDE_KINDS)
    rows = [row for number in (0, 1) for row in score.of_vehicle(number)]
    found = {(one["map"], one["state"]): one for one in summary(rows)}
    print(as_text(summary(rows)))
    assert max(found["case 2", "12 cases"]["ratio"]) < 1.15
    assert max(found["case 2", BEFORE]["ratio"]) > 1.5
    assert max(found[EQUATIONS, "12 cases"]["ratio"]) > 3.0
    assert found["case 2", "12 cases"]["pooled_coverage_percent"] > 99.0
    fit = {state: one["chi_square_per_reading"] for (kind, state), one in found.items() if kind == "case 2"}
    assert 0.9 < fit["12 cases"][1] < 1.15  # the other mesh leaves 0.1
    for kind in OUTSIDE_KINDS:
        assert 0.85 < fit[f"12 cases, {kind}"][1] < 1.15, kind
    said = {row["state"]: row["said"] for row in rows if "said" in row}
    kinds = (*OUTSIDE, NOISE)
    assert said == {"12 cases": []} | {f"12 cases, {a}": [b] for a, b in zip(OUTSIDE_KINDS, kinds, strict=True)}
