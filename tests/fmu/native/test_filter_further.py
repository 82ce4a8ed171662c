"""Section loads in the filter of the native library: the numbers of numpy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from damaged_resource import refusal, with_arrays
from flight_fmu import FILTER, N_D, FlightFmu, FlightSample, check, random_flight, whole_map
from further_maps import STATIONS, check_further, with_further_tables
from raw_fmu import OK

from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.estimator_variables import output_values

pytestmark = pytest.mark.fast

OUTPUTS = range(FILTER + 1, FILTER + 1 + 4 + 12 * len(STATIONS))
"""Value references of the further loads, behind the time constant."""

STEP = 0.01
TOLERANCE = 1e-9
"""Of the largest of a kind, as of the filter's other outputs."""


@pytest.fixture(scope="module")
def inverse_map() -> InverseMap:
    return with_further_tables(whole_map())


def compare(
    fmu: FlightFmu, inverse_map: InverseMap, samples: list[FlightSample], time_constant: float = 1.0
) -> list[FlightEstimate]:
    """Assert that all steps are those of numpy; the latter."""
    flight = FlightFilter(ManifoldEstimator(inverse_map), FilterSettings(time_constant=time_constant))
    assert fmu.filter(time_constant) == OK
    found = []
    for k, sample in enumerate(samples):
        found.append(flight.recorded(STEP, sample.strain, sample.flow, valid=sample.valid).estimate[0])
        native = fmu.advance_over(sample, STEP * k, STEP)
        check(native, found[-1], tolerance=TOLERANCE)
        expected = np.array(output_values(found[-1], with_further=True)[-len(OUTPUTS) :])
        check_further(fmu.get_reals(OUTPUTS), expected, TOLERANCE)
    return found


@pytest.mark.parametrize("time_constant", [1e-9, 1.0])
def test_with_lost_gauges_and_navigation(fmu: FlightFmu, inverse_map: InverseMap, time_constant: float) -> None:
    random, samples = np.random.default_rng(1), []
    for k, one in enumerate(random_flight(inverse_map, 30, seed=2)):
        flow = {name: value for name, value in one.flow.items() if random.random() > 0.3}
        valid = random.random(N_D) > 0.1 * (k % 5)
        samples.append(replace(one, valid=valid & (k % 13 < 11), flow=flow))
    found = compare(fmu, inverse_map, samples, time_constant)
    assert sum(np.isfinite(one.further_loads).all() and not one.valid.any() for one in found) >= (
        time_constant == 1.0
    )


def test_off_the_tables_and_back(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Loads of the linear map where it has some; without q_inf those of the sample alone."""
    samples = random_flight(inverse_map, 14, seed=15)
    bent = np.random.default_rng(6).normal(size=N_D) * 0.2 * np.abs(samples[0].strain).max()
    off = [replace(one, strain=one.strain + bent) if 3 <= k < 8 else one for k, one in enumerate(samples)]
    off[5] = replace(off[5], flow={"mach_number": off[5].flow["mach_number"]})
    found = compare(fmu, inverse_map, off)
    assert [one.is_linear for one in found[3:8]] == [True, True, False, True, True]


def test_settings_and_state(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """Other references; a state brings the law back, from which the next step gives the same loads."""
    samples = random_flight(inverse_map, 6, seed=3)
    assert fmu.filter(1.0) == OK
    for k, one in enumerate(samples[:4]):
        fmu.advance_over(one, STEP * k, STEP)
    state = fmu.get_state()
    first = fmu.advance_over(samples[4], 4 * STEP, STEP)
    loads = fmu.get_reals(OUTPUTS)
    fmu.advance_over(samples[5], 5 * STEP, STEP)
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.advance_over(samples[4], 4 * STEP, STEP).tobytes() == first.tobytes()
    assert fmu.get_reals(OUTPUTS).tobytes() == loads.tobytes()
    assert fmu.call("SetFMUstate", state) == OK
    area, length = (float(value) for value in fmu.get_reals(range(33 + 2 * N_D, 35 + 2 * N_D)))
    assert fmu.set_scalars(6, 2.0 * area, 3.0 * length) == OK
    fmu.advance_over(samples[4], 4 * STEP, STEP)
    np.testing.assert_allclose(fmu.get_reals(OUTPUTS[:2]), loads[:2] / 6.0, rtol=1e-12)
    np.testing.assert_allclose(fmu.get_reals(OUTPUTS[2:]), loads[2:], rtol=1e-12)


def test_a_filter_of_other_sections_is_refused(inverse_map: InverseMap, tmp_path: Path) -> None:
    fewer = {f"filter.further_{name}": lambda old: old[:0] for name in ("load", "cross", "variance")}
    fmu = FlightFmu(with_arrays(inverse_map, tmp_path, fewer), N_D)
    assert refusal(fmu).endswith("'filter.further_load': expected the section loads of the map")
