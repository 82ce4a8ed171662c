"""Section loads of the native library by the nonlinear estimator: the numbers of numpy, whatever else changes."""

from __future__ import annotations

from ctypes import c_double
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_resource import arrays_of, put, refusal, with_arrays
from flight_fmu import FIRST, N_D, FlightFmu, FlightSample, check, random_flight, whole_map
from further_maps import STATIONS, check_further, with_further_tables
from raw_fmu import OK, Fmu3
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.offers import has_further_outputs
from strainfmu.estimator.resource.map_file import map_arrays
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros
from strainfmu.interface.estimator_variables import output_values
from strainfmu.interface.further_variables import has_section_loads_by_strain_alone

pytestmark = pytest.mark.fast

N_T = 3
FIRST_ZERO = FIRST + 28
OUTPUTS = range(FIRST_ZERO + 2 * N_D + 2 + N_T, FIRST_ZERO + 2 * N_D + 2 + N_T + 4 + 12 * len(STATIONS))
"""Value references of the further loads, behind zeros, temperatures and the filter's time constant."""

TOLERANCE = 1e-12
"""Of the largest of a kind; 2e-14 is reached."""


@pytest.fixture(scope="module")
def inverse_map() -> InverseMap:
    """Tables and linear map of one covariance of the gauges, with temperature modes."""
    one = with_further_tables(whole_map())
    assert one.manifold is not None
    one = replace(one, manifold=replace(one.manifold, gauge_covariance=one.gauge_covariance))
    noise = float(np.sqrt(np.median(np.diag(one.gauge_covariance))))
    strain = 0.1 * noise * np.random.default_rng(3).normal(size=(N_D, 5))
    sheet = noise * np.array([2e-2, -1e-4])
    return with_temperature(one, k=5, n_t=N_T, mode_strain=strain, apparent_strain=sheet)


class Pair:
    """An instance and numpy's tracker, fed alike."""

    def __init__(self, fmu: FlightFmu, inverse_map: InverseMap) -> None:
        self.fmu, self.tracker = fmu, FlightTracker(ManifoldEstimator(inverse_map))

    def step(self, sample: FlightSample, temperature: np.ndarray | None = None) -> FlightEstimate:
        """Both take a step with ``sample``; all outputs agree."""
        flow = dict(sample.flow)
        q = flow.pop("dynamic_pressure", np.nan)
        found = self.tracker.step(sample.strain, q, sample.valid, temperature=temperature, **flow)
        check(self.fmu.advance(sample), found, TOLERANCE)
        expected = np.array(output_values(found, with_further=True)[-len(OUTPUTS) :])
        check_further(self.fmu.get_reals(OUTPUTS), expected, TOLERANCE)
        return found

    def set_zeros(self, zeros: GaugeZeros) -> None:
        self.tracker.estimator = self.tracker.estimator.with_zeros(zeros)
        values = [*zeros.value, *zeros.std, zeros.common_std]
        assert self.fmu.set_reals(range(FIRST_ZERO, FIRST_ZERO + 2 * N_D + 1), values) == OK


def test_cold_and_warm_steps_with_lost_gauges(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    random, pair = np.random.default_rng(1), Pair(fmu, inverse_map)
    for k, one in enumerate(random_flight(inverse_map, 14, seed=31)):
        valid = random.random(N_D) > 0.08 * (k % 7)
        strain = np.where(random.random(N_D) < 0.05, np.nan, one.strain) if k % 3 else one.strain
        pair.step(replace(one, strain=strain, valid=valid))
    last = random_flight(inverse_map, 1, seed=31)[0]
    nothing = pair.step(replace(last, valid=np.zeros(N_D, dtype=bool)))
    assert np.isnan(nothing.further_loads).all()
    assert np.isfinite(pair.step(last).further_loads).all()


def test_settings_and_unknown_navigation(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    pair, settings = Pair(fmu, inverse_map), ManifoldEstimator(inverse_map).settings
    settings = replace(settings, reference_area=0.3, reference_length=1.7, moment_station=2.2)
    pair.tracker.estimator = pair.tracker.estimator.with_settings(settings)
    assert fmu.set_scalars(6, 0.3, 1.7, 2.2) == OK
    for k, one in enumerate(random_flight(inverse_map, 6, seed=32)):
        kept = ("mach_number", "static_pressure", "dynamic_pressure")[: k % 4]
        pair.step(replace(one, flow={name: one.flow[name] for name in kept}))


def test_zeros_and_temperatures(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    random, pair = np.random.default_rng(2), Pair(fmu, inverse_map)
    noise = float(np.sqrt(inverse_map.gauge_covariance[0, 0]))
    for k, one in enumerate(random_flight(inverse_map, 12, seed=33)):
        if k % 5 == 4:
            std = noise * random.uniform(0.0, 2.0, N_D)
            pair.set_zeros(GaugeZeros(value=1e-6 * random.normal(size=N_D), std=std, common_std=noise))
        temperature = REFERENCE + 3.0 * random.normal(size=N_T)
        temperature[random.random(N_T) < 0.2] = np.nan
        first = FIRST_ZERO + 2 * N_D + 1
        assert fmu.set_reals(range(first, first + N_T), temperature) == OK
        moved = replace(one, strain=one.strain + pair.tracker.estimator.zeros.value)
        pair.step(moved, None if np.isnan(temperature).all() else temperature)


def test_loads_of_the_linear_map_off_the_tables(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    pair, linear = Pair(fmu, inverse_map), []
    samples = random_flight(inverse_map, 16, seed=34)
    bent = np.random.default_rng(6).normal(size=N_D) * 0.3 * np.abs(samples[0].strain).max()
    for k, one in enumerate(samples):
        sample = replace(one, strain=one.strain + bent) if 2 <= k < 6 else one
        if k == 5:  # no loads of the linear map either
            sample = replace(sample, flow={})
        linear.append(pair.step(sample).is_linear)
    assert linear == [k in (2, 3, 4, *range(6, 10)) for k in range(16)]


def test_read_in_any_order_and_at_any_time(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    first, second = random_flight(inverse_map, 2, seed=35)
    fmu.advance(first)
    state, expected = fmu.get_state(), fmu.get_reals(OUTPUTS)
    fmu.advance(second)
    moved = fmu.get_reals([*reversed(OUTPUTS)])[::-1]
    assert not np.array_equal(moved, expected)
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.get_reals(OUTPUTS).tobytes() == expected.tobytes()


def test_arrays_of_fmi_3(fmu: FlightFmu, inverse_map: InverseMap, resources: Path) -> None:
    three, sample = Fmu3(str(resources), N_D).start(), random_flight(inverse_map, 1, seed=36)[0]
    fmu.give(replace(sample, flow={"dynamic_pressure": sample.flow["dynamic_pressure"]}))
    assert three.set("Float64", c_double, [Fmu3.STRAIN], sample.strain) == OK
    assert three.set("Float64", c_double, [Fmu3.FIRST_SCALAR], [sample.flow["dynamic_pressure"]]) == OK
    first = Fmu3.TARE + 28 + 2
    found = [three.get("Float64", c_double, [first + i], 1)[1] for i in range(4)]
    found += [three.get("Float64", c_double, [first + 4 + i], len(STATIONS))[1] for i in range(12)]
    assert np.concatenate(found).tobytes() == fmu.get_reals(OUTPUTS).tobytes()


def test_tables_without_loads_state_none(inverse_map: InverseMap) -> None:
    assert inverse_map.manifold is not None
    older = replace(inverse_map, manifold=replace(inverse_map.manifold, further=None))
    assert has_further_outputs(inverse_map)
    assert not has_further_outputs(older)
    assert has_section_loads_by_strain_alone(older)
    assert not has_section_loads_by_strain_alone(inverse_map)
    assert not any(name.startswith("flight_loads.") for name in map_arrays(older))


@pytest.mark.parametrize(
    ("name", "change", "text"),
    [
        ("variance", lambda old: old[1:], "expected "),
        ("table", lambda old: old[..., :-1], "expected "),
        ("row", put(0, 1.0), "expected rows that ascend without a gap"),
        ("variance", put(0, np.nan), "holds a value that is not finite (number 0)"),
    ],
)
def test_what_cannot_be_is_refused(
    inverse_map: InverseMap, tmp_path: Path, name: str, change: Any, text: str
) -> None:
    location = with_arrays(inverse_map, tmp_path, {f"flight_loads.{name}": change})
    said = refusal(FlightFmu(location, N_D))
    assert "'flight_loads." in said
    assert text in said


def test_tables_of_loads_go_with_those_of_strain(inverse_map: InverseMap, tmp_path: Path) -> None:
    without = {name: None for name in arrays_of(inverse_map) if name.startswith("flight_loads.")}
    said = refusal(FlightFmu(with_arrays(inverse_map, tmp_path, without), N_D))
    assert "parts that do not go together" in said
