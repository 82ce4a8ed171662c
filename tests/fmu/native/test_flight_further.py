"""Section loads of the native library by the nonlinear estimator: those of Python, whatever else changes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from agreement import tracked
from damaged_resource import arrays_of, refusal, with_arrays
from flight_fmu import FIRST, N_D, FlightFmu, random_flight, whole_map
from other_load_maps import STATIONS, of_five_loads, with_further_tables
from raw_fmu import OK
from thermal_maps import REFERENCE, with_temperature

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap, groups_of_outputs
from strainfmu.estimator.resource.map_file import map_arrays
from strainfmu.interface.estimator_variables import output_values

pytestmark = pytest.mark.fast

N_T = 3
FIRST_ZERO = FIRST + 28
OUTPUTS = range(FIRST_ZERO + 2 * N_D + 2 + N_T, FIRST_ZERO + 2 * N_D + 2 + N_T + 4 + 12 * len(STATIONS))
"""Value references of the other loads, behind zeros, temperatures and the filter's time constant."""


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


def test_settings_zeros_and_temperatures(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """All of them change in a flight, off the tables and back; a sample without sensors has no loads."""
    random, estimator, linear = np.random.default_rng(2), Estimator(inverse_map), list[bool]()
    noise = float(np.sqrt(inverse_map.gauge_covariance[0, 0]))
    samples = random_flight(inverse_map, 16, seed=34)
    before = np.nan
    bent = np.random.default_rng(6).normal(size=N_D) * 0.3 * np.abs(samples[0].strain).max()
    for k, one in enumerate(samples):
        if k == 11:
            settings = replace(estimator.settings, reference_area=0.3, reference_length=1.7, moment_station=2.2)
            estimator = estimator.with_settings(settings)
            assert fmu.set_scalars(6, 0.3, 1.7, 2.2) == OK
        if k == 13:
            std = noise * random.uniform(0.0, 2.0, N_D)
            estimator = estimator.with_zeros(GaugeZeros(value=1e-6 * std / noise, std=std, common_std=noise))
            zeros = [*estimator.zeros.value, *estimator.zeros.std, estimator.zeros.common_std]
            assert fmu.set_reals(range(FIRST_ZERO, FIRST_ZERO + 2 * N_D + 1), zeros) == OK
        temperature = REFERENCE + 0.3 * random.normal(size=N_T)
        temperature[random.random(N_T) < (0.2 if k > 10 else 1.0)] = np.nan
        if k == 13:  # another sensor is known: matrices are made at once, for the zeros too
            temperature[0] = REFERENCE if np.isnan(before) else np.nan
        before = temperature[0]
        first = FIRST_ZERO + 2 * N_D + 1
        assert fmu.set_reals(range(first, first + N_T), temperature) == OK
        off = one.strain + estimator.zeros.value + (bent if 2 <= k < 6 else 0.0)
        # No loads of the linear map either where q_inf is not known.
        flow = {} if k == 5 else one.flow
        sample = replace(one, strain=off, flow=flow, valid=np.full(N_D, k != 10))
        found = tracked(estimator, sample, temperature=temperature)
        fmu.advance(sample)
        np.testing.assert_array_equal(fmu.get_reals(OUTPUTS), output_values(found, True)[-len(OUTPUTS) - 1 : -1])
        assert np.isnan(found.other_loads).all() == (k == 10)
        linear.append(found.is_linear)
    assert linear[:11] == [k in (2, 3, 4, *range(6, 10)) for k in range(11)]


def test_read_in_any_order_and_at_any_time(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    first, second = random_flight(inverse_map, 2, seed=35)
    fmu.advance(first)
    state, expected = fmu.get_state(), fmu.get_reals(OUTPUTS)
    fmu.advance(second)
    moved = fmu.get_reals([*reversed(OUTPUTS)])[::-1]
    assert not np.array_equal(moved, expected)
    assert fmu.call("SetFMUstate", state) == OK
    assert fmu.get_reals(OUTPUTS).tobytes() == expected.tobytes()


def test_tables_have_the_loads_of_their_map(inverse_map: InverseMap) -> None:
    five = of_five_loads(inverse_map)
    assert groups_of_outputs(inverse_map)
    assert not groups_of_outputs(five)
    assert not any(name.startswith("flight_loads.") for name in map_arrays(five))
    with pytest.raises(InputError, match=r"inverse map: manifold: error_load has shape \(5, .*\), must be \(24, "):
        replace(inverse_map, manifold=five.manifold)


def test_tables_of_loads_go_with_those_of_strain(inverse_map: InverseMap, tmp_path: Path) -> None:
    without = {name: None for name in arrays_of(inverse_map) if name.startswith("flight_loads.")}
    said = refusal(FlightFmu(with_arrays(inverse_map, tmp_path, without), N_D))
    assert "parts that do not go together" in said
