"""Auxiliary sensors of the native library: lost sensors, thrust, zeros, tare; what is refused."""

from ctypes import c_int, c_size_t

import numpy as np
import pytest
from agreement import Sample
from native_case import NativeCase
from random_map import map_of, random_model
from raw_fmu import OK, Fmu2, first_zero, of_filter, write_resource
from scaled_maps import NOMINAL, whole_scaled_map
from sensor_maps import ROWS, with_sensors
from thermal_maps import with_temperature

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import SensorRows
from strainfmu.estimator.tare import TareState

pytestmark = pytest.mark.fast

N_S = len(ROWS)
N_T = 4

MAPS = {
    "absolute": lambda: map_of(random_model(n_gauges=27, n_states=4)),
    "case 1": lambda: whole_scaled_map(1, seed=4, n=26, n_states=4),
    "case 2": lambda: whole_scaled_map(2, seed=4, n=24, n_states=30),
    "warm": lambda: with_temperature(whole_scaled_map(1, seed=5, n=24, n_states=3), mode_strain=MODES),
}
MODES = 4e-7 * np.random.default_rng(3).normal(size=(24, 6))


@pytest.fixture(scope="module", params=MAPS)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> NativeCase:
    held = with_sensors(MAPS[request.param]())
    return NativeCase(held, write_resource(held, tmp_path_factory.mktemp("sensors")))


def rows_of(inverse_map: InverseMap) -> SensorRows:
    return inverse_map.sensors


def thrust_reference(case: NativeCase) -> int:
    zeros = 2 * case.inverse_map.n_strain_gauges + 1
    return first_zero(case.n) + zeros + (N_T if case.inverse_map.has_temperature else 0)


def give(fmu: Fmu2, sample: Sample) -> None:
    fmu.set_strain(sample.strain)
    fmu.set_valid(sample.valid)
    assert fmu.set_scalars(0, *sample.flow) == OK


def readings(case: NativeCase, row: np.ndarray, thrust: float = 0.0) -> np.ndarray:
    """(n_d,) what gauges and sensors read where the rows of the map are ``row``."""
    rows = rows_of(case.inverse_map)
    return np.asarray(row * rows.scale + (0.0 if np.isnan(thrust) else thrust) * rows.thrust_response)


def test_a_lost_sensor_does_not_count(case: NativeCase) -> None:
    """Not valid, not finite, beyond its range: equal bits; thrust that is not known loses those that it moves."""
    fmu, row = Fmu2(case.uri, case.n).start(), case.inverse_map.mean_strain
    rows, valid = rows_of(case.inverse_map), np.ones(case.n, dtype=bool)
    assert fmu.set_scalars(0, case.inverse_map.nominal_dynamic_pressure) == OK
    for which in range(case.n - N_S, case.n):
        found = []
        for value in (np.nan, -np.inf, 1.01 * rows.largest[which], None):
            strain = readings(case, row)
            strain[which] = strain[which] if value is None else value
            fmu.set_valid(valid if value is not None else np.arange(case.n) != which)
            fmu.set_strain(strain)
            found.append(fmu.outputs())
        fmu.set_valid(valid)
        assert found[0][23] == case.n - 1
        assert found[0][20] == HealthState.DEGRADED
        assert len({one.tobytes() for one in found}) == 1
    fmu.set_strain(readings(case, row))
    assert fmu.set_reals([thrust_reference(case)], [np.nan]) == OK
    assert fmu.outputs()[23] == case.n - np.count_nonzero(rows.follows_thrust)


def test_range_of_gauges_is_not_that_of_sensors(case: NativeCase) -> None:
    fmu = Fmu2(case.uri, case.n).start()
    strain = readings(case, case.inverse_map.mean_strain)
    smallest = 0.5 * float(np.abs(strain[: case.inverse_map.n_strain_gauges]).min())
    assert fmu.set_scalars(4, smallest) == OK
    sample = Sample(strain, np.ones(case.n, dtype=bool), NOMINAL, np.nan)
    give(fmu, sample)
    assert fmu.outputs()[23] == N_S


def test_a_tare_of_the_gauges(case: NativeCase) -> None:
    n, random = case.inverse_map.n_strain_gauges, np.random.default_rng(2)
    fmu, window = Fmu2(case.uri, case.n).start(), list[np.ndarray]()
    flag = thrust_reference(case) + 1 + of_filter(case.inverse_map)
    assert fmu.set_scalars(0, 0.0) == OK
    zero = 1e-5 * random.normal(size=n)
    for k in range(125):  # the window, and steps until its zeros are in use
        is_up = k < 100
        strain = np.append(zero + 0.1 * case.inverse_map.noise_std[:n] * random.normal(size=n), np.full(N_S, 1.0))
        assert fmu.call("SetBoolean", fmu.references([flag]), c_size_t(1), (c_int * 1)(is_up)) == OK
        fmu.set_strain(strain)
        assert fmu.step(0.01 * k) == OK
        window += [strain[:n]] if is_up else []
    zeros = Estimator(case.inverse_map).tare(np.array(window), 0.0).zeros
    assert fmu.get_integers([flag + 1])[0] == TareState.DONE
    found = fmu.get_reals(range(flag + 2, flag + 2 + 2 * n + 1))
    np.testing.assert_allclose(found[:n], zeros.value, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(found[n:], [*zeros.std, zeros.common_std], rtol=1e-9, atol=1e-15)
