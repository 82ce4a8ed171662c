"""Scores, aims, conditions and the table of a comparison."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from builder.compare.aims import aims
from builder.compare.candidate import Answer
from builder.compare.flights import (
    GAUGE_NOISE,
    HARDWARE,
    VEHICLES,
    drawn_angle,
    drawn_incidence,
    example_conditions,
    random_conditions,
    readings,
    vehicle_that_flies,
    with_errors,
)
from builder.compare.run import table_csv
from builder.compare.score import AIR_DATA_KEYS, Tally, rms_of_tenths, tenths
from builder.figures.comparison.rivals import compare_figure
from builder.structure.as_built.response_tables import nominal_table
from builder.structure.as_built.vehicle import AsBuilt, Counts
from builder.trial.score import ROLLING
from builder.truth.flights import RevolvedFlights
from builder.truth.revolution.strain import TrueFlights, TrueStructure
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def shipped() -> Vehicle:
    return load_vehicle(IC3X)


@dataclass(frozen=True, eq=False, kw_only=True)
class RollingFlights(TrueFlights):
    """Flights with a rolling moment, never read."""

    rolling: FloatArray | None = None

    @property
    def counts(self) -> Counts:
        return Counts(gauge=1)

    def read(self, built: AsBuilt, rows: slice = slice(None)) -> FloatArray:
        raise NotImplementedError  # the tally counts answers; nothing reads strain


def flights(rolling: float | None = None) -> RollingFlights:
    """Return two flights whose coefficients are 1, without strain."""
    condition = FlightCondition(mach_number=6.0, angle_of_attack=0.05, sideslip_angle=0.02, altitude=20e3)
    return RollingFlights(
        rolling=None if rolling is None else np.full(2, rolling),
        conditions=(condition, condition),
        table=nominal_table(np.zeros((2, 1, 1, 3)), 0),
        uniform=nominal_table(np.zeros((1, 1, 1, 3)), 0),
        coefficients=np.ones((2, 5)),
        ambient_pressure=np.full(2, condition.ambient_pressure),
        dynamic_pressure=np.full(2, condition.dynamic_pressure),
        internal_pressure=np.zeros(2),
    )


def test_errors_coverage_and_air_data_are_counted() -> None:
    flown, tally = flights(), Tally()
    one = flown.conditions[0]
    air = np.tile([0.0, 0.0, 6.1, 1.02 * one.ambient_pressure, np.nan], (2, 1))
    air[:, 0], air[:, 1] = one.angle_of_attack + np.radians(0.2), one.sideslip_angle
    coefficients, std = np.ones((2, 5)), np.full((2, 5), 0.1)
    coefficients[0, 0], coefficients[1, 1] = 1.2, 1.4
    true = np.ones((2, 3))
    tally.add(Answer(coefficients=coefficients, std=std, air_data=air, field=1.1 * true), flown, true)
    found = tally.entry()
    assert found["rms"]["C_A"] == pytest.approx(0.2 / np.sqrt(2.0), rel=1e-4)
    assert list(found["coverage_percent"].values()) == [100.0, 50.0, 100.0, 100.0, 100.0]
    assert found["field_median_percent"] == pytest.approx(10.0)
    air_data = found["air_data_p95"]
    assert air_data["angle_of_attack_deg"] == pytest.approx(0.2, rel=1e-4)
    assert air_data["static_pressure_percent"] == pytest.approx(2.0, rel=1e-4)
    assert air_data["dynamic_pressure_percent"] is None
    assert found["samples"] == 2


def test_what_an_estimator_has_not_is_none_and_what_it_does_not_answer_is_not_covered() -> None:
    tally, coefficients = Tally(), np.ones((2, 5))
    coefficients[1] = np.nan
    tally.add(Answer(coefficients=coefficients, std=np.ones((2, 5))), flights(), np.ones((2, 3)))
    found = tally.entry()
    assert found["rms"] == dict.fromkeys(COEFFICIENT_NAMES, 0.0)
    assert found["coverage_percent"] == dict.fromkeys(COEFFICIENT_NAMES, 50.0)
    assert found["field_median_percent"] is found["field_percentiles_percent"] is None
    assert found["air_data_p95"] == dict.fromkeys(AIR_DATA_KEYS)


def test_the_rolling_moment_counts_where_the_body_has_one() -> None:
    """An estimator without it has no number there, and its other coverages stay."""
    tallies = [Tally(names=(*COEFFICIENT_NAMES, ROLLING)) for _ in range(2)]
    for tally, rolling in zip(tallies, (np.array([[0.3, 0.05], [0.1, 0.05]]), None), strict=True):
        answer = Answer(coefficients=np.ones((2, 5)), std=np.ones((2, 5)), rolling=rolling)
        tally.add(answer, flights(rolling=0.1), np.ones((2, 3)))
    with_it, without = (tally.entry() for tally in tallies)
    assert with_it["rms"][ROLLING] == pytest.approx(0.2 / np.sqrt(2.0), rel=1e-4)
    assert with_it["coverage_percent"][ROLLING] == 50.0
    assert with_it["rms_of_tenths"]["mach_number"][ROLLING][0] == pytest.approx(0.2)
    assert without["rms"][ROLLING] is without["coverage_percent"][ROLLING] is None
    assert set(without["coverage_percent"].values()) == {100.0, None}
    entries = [
        {**entry, "estimator": "one", "errors": "hardware", "air_data_inputs": "given"}
        for entry in (with_it, without)
    ]
    for one in entries:
        one |= {"example_field_p95_percent": None, "step_microseconds": 1.0}
    rows = list(csv.DictReader(io.StringIO(table_csv(entries))))
    assert (rows[0]["coverage_percent_M_R"], rows[1]["rms_M_R"]) == ("50.0", "")


def test_rms_of_tenths_is_that_of_the_flights_in_increasing_order() -> None:
    incidence = np.random.default_rng(1).permutation(20).astype(float)
    error = np.tile(incidence[:, None], (1, 5))
    found = rms_of_tenths(error, tenths(incidence))
    assert found["C_N"] == pytest.approx([np.hypot(k, k + 1) / np.sqrt(2.0) for k in range(0, 20, 2)], rel=1e-4)
    few = rms_of_tenths(error[:3], tenths(incidence[:3]))["C_A"]
    assert few.count(None) == 7


def entries(rms: float, coverage: float = 100.0) -> list[dict[str, Any]]:
    """Return entries of the nonlinear estimator of ``rms`` and ``coverage``, and of linear maps of rms 1e-3."""
    common: dict[str, Any] = {
        "bound": dict.fromkeys(COEFFICIENT_NAMES, 2e-4),
        "coverage_percent": dict.fromkeys(COEFFICIENT_NAMES, coverage),
        "field_median_percent": 1.0,
        "field_p95_percent": 5.0,
        "example_field_p95_percent": 2.0,
        "field_percentiles_percent": [float(one) for one in range(21)],
        "air_data_p95": dict.fromkeys(AIR_DATA_KEYS, 0.1),
        "step_microseconds": 1.0,
        "samples": 10,
    }
    return [
        {
            "estimator": name,
            "errors": errors,
            "air_data_inputs": navigation,
            "rms": dict.fromkeys(COEFFICIENT_NAMES, rms if name == "nonlinear" else 1e-3),
            "rms_of_tenths": {
                by: {one: [2.0 * rms if name == "nonlinear" else 1e-3, *([None] * 9)] for one in COEFFICIENT_NAMES}
                for by in ("total_incidence", "mach_number")
            },
            **common,
        }
        for errors in (GAUGE_NOISE, HARDWARE)
        for name in ("nonlinear", "linear Case 1", "linear Case 2")
        for navigation in ("given", "q_inf only", "M and p_inf only")
    ]


def test_aims_are_met_or_named() -> None:
    met = {aim.what: aim.is_met for aim in aims(entries(3e-4), is_shipped=True)}
    assert [what for what, is_met in met.items() if not is_met] == ["field p95 [%]"]
    assert len(met) == 5 + 3 + 3 + 6 + 5 + 4
    other = aims(entries(6e-4, coverage=98.0), is_shipped=False)
    assert len(other) == 6 + 5 + 4
    assert not any(aim.is_met for aim in other)
    assert other[0].line.startswith(
        "MISSED: smallest 3 sigma coverage [%], gauge noise, air-data inputs given: 98, at least"
    )


def test_the_table_has_a_row_per_entry_and_none_is_empty() -> None:
    given = entries(1e-3)
    given[0]["field_median_percent"] = None
    rows = list(csv.DictReader(io.StringIO(table_csv(given))))
    assert len(rows) == len(given)
    assert rows[0]["field_median_percent"] == ""
    assert rows[0]["rms_C_N"] == "0.001"
    assert rows[1]["p95_sideslip_deg"] == "0.1"


def test_the_figure_shows_every_estimator() -> None:
    pytest.importorskip("matplotlib")
    given = [one for one in entries(1e-3) if one["air_data_inputs"] == "given"]
    given[0]["field_percentiles_percent"] = None
    figure = compare_figure(given, "body")
    assert len(figure.axes) == 6
    assert len(figure.axes[0].patches) == 15
    assert len(figure.axes[4].lines) == 2
    assert figure.axes[0].get_xticklabels()[0].get_text() == "$C_A$"
    legend = [one.get_text() for one in figure.legends[0].get_texts()]
    assert "nonlinear estimator" in legend
    assert "nonlinear" not in legend


def test_conditions_are_inside_the_envelope_and_the_flows(shipped: Vehicle) -> None:
    """|a|, |b| up to 8 deg on the shipped vehicle; without a range of sideslip the disc of total incidence."""
    random = np.random.default_rng(1)
    found = random_conditions(shipped, 300, random)
    angles = np.degrees([(one.angle_of_attack, one.sideslip_angle) for one in found])
    assert 7.8 < np.abs(angles).max() <= 8.0
    assert max(one.total_incidence for one in found) <= drawn_incidence(shipped)
    assert min(one.altitude for one in found) >= 15e3
    assert max(one.altitude for one in found) <= 28e3
    knots = vehicle_that_flies(shipped).truth
    assert min(knots.mach_number) == 5.0
    assert max(knots.mach_number) == 7.0
    assert np.radians(max(knots.total_incidence_deg)) > drawn_incidence(shipped)
    conditions = shipped.conditions.model_copy(update={"sideslip_angle_deg": [0.0]})
    planar = shipped.model_copy(update={"conditions": conditions})
    assert drawn_angle(planar) is None
    turned = random_conditions(planar, 200, random)
    assert 9.0 < np.degrees(max(one.total_incidence for one in turned)) <= 10.0 + 1e-9
    assert max(abs(one.sideslip_angle) for one in turned) > np.radians(8.0)


def test_the_example_is_that_of_the_source(shipped: Vehicle) -> None:
    found = example_conditions(shipped)
    one = found[0]
    assert len(found) == 100
    assert (one.mach_number, one.altitude) == (5.0, 20e3)
    assert np.degrees([one.angle_of_attack, one.sideslip_angle]) == pytest.approx([6.0, 6.0])


def test_every_vehicle_flies_some_of_the_conditions(vehicle: Vehicle, true_model: TrueStructure) -> None:
    """Errors of the hardware are those of VEHICLES vehicles; gauge noise alone leaves q_inf exact."""
    k, n_d, n_s = 30, len(true_model.names), true_model.table.nominal.shape[2]
    one = FlightCondition(mach_number=6.0, angle_of_attack=0.05, sideslip_angle=0.02, altitude=20e3)
    flown = TrueFlights(
        conditions=(one,) * k,
        table=nominal_table(np.full((k, 2, n_s, 3), 1e-9), 0),
        uniform=nominal_table(np.zeros((1, 1, n_s, 3)), 0),
        coefficients=np.ones((k, 5)),
        ambient_pressure=np.full(k, one.ambient_pressure),
        dynamic_pressure=np.full(k, one.dynamic_pressure),
        internal_pressure=np.zeros(k),
    )
    drawn = {
        errors: next(
            readings(
                vehicle=vehicle,
                flights=RevolvedFlights(structure=true_model, flown=flown),
                errors=errors,
                noise_std=np.zeros(n_d),
                draws=1,
                random=np.random.default_rng(1),
            )
        )
        for errors in (GAUGE_NOISE, HARDWARE)
    }
    exact, whole = drawn[GAUGE_NOISE], drawn[HARDWARE]
    assert len(np.unique(exact.last, axis=0)) == len(np.unique(exact.dynamic_pressure)) == 1
    assert len(np.unique(whole.last, axis=0)) == len(np.unique(whole.dynamic_pressure)) == VEHICLES
    assert (exact.dynamic_pressure_std, np.isnan(whole.dynamic_pressure_std)) == (0.0, True)
    assert len(np.unique(whole.mach_number)) == k


def test_maps_know_of_the_errors_that_are_drawn(shipped: Vehicle) -> None:
    exact, whole = (with_errors(shipped, errors, 2) for errors in (GAUGE_NOISE, HARDWARE))
    assert exact.noise.gauge_gain_percent == exact.noise.dynamic_pressure_percent == 0.0
    assert whole.noise == shipped.noise
    assert (exact.map.case, exact.map.estimator, exact.map.keep_field) == (2, "nonlinear", True)
    assert exact.map.discrepancy_percent == 0.8
    assert whole.map.discrepancy_percent == shipped.map.discrepancy_percent
