"""Temperature sensors of the native library: the numbers of Python while sensors come and go; what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from native_case import NativeCase
from raw_fmu import OK, VALUES, Fmu2, first_zero, write_resource
from scaled_maps import whole_scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import ThermalMap

pytestmark = pytest.mark.fast

N_T = 8


def warm(inverse_map: InverseMap) -> InverseMap:
    """``inverse_map`` with 12 modes and eight sensors, thermal strain of the size of its gauges' noise."""
    noise = float(np.sqrt(np.median(np.diag(inverse_map.gauge_covariance))))
    random, n = np.random.default_rng(3), inverse_map.n_gauges
    sheet = noise * np.array([2e-2, -1e-4])
    strain = 0.1 * noise * random.normal(size=(n, 12))
    return with_temperature(inverse_map, k=12, n_t=N_T, mode_strain=strain, apparent_strain=sheet)


@pytest.fixture(scope="module", params=["case 1", "case 2"])
def hot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> NativeCase:
    one = {
        "case 1": lambda: whole_scaled_map(1, seed=4, n=30, n_states=5),
        "case 2": lambda: whole_scaled_map(2, seed=4, n=27, n_states=40),
    }[request.param]()
    held = warm(one)
    return NativeCase(held, write_resource(held, tmp_path_factory.mktemp("warm")))


def first_temperature(n_gauges: int) -> int:
    return first_zero(n_gauges) + 2 * n_gauges + 1


def drawn_temperature(thermal: ThermalMap, k: int, random: np.random.Generator) -> np.ndarray:
    """Readings of modes at random, sensors that are off or broken among them."""
    amplitude = thermal.prior_std * random.normal(size=len(thermal.prior_std))
    temperature = REFERENCE + thermal.sensor_operator @ amplitude + thermal.sensor_std * random.normal(size=N_T)
    if k % 5 == 1:
        broken = [0.0, -1.0, np.nan, np.inf, 1e5, REFERENCE + 2001.0]
        temperature[random.choice(N_T, 3, replace=False)] = random.choice(broken, 3)
    if k % 17 == 3:
        temperature[:] = 0.0
    return temperature


def test_derivatives_are_those_of_differences(hot: NativeCase) -> None:
    """By temperatures and strains at once, against central differences."""
    random, thermal, n = np.random.default_rng(7), hot.inverse_map.thermal, hot.n
    fmu, temperature = Fmu2(hot.uri, n).start(), drawn_temperature(thermal, 0, random)
    temperature[2] = 0.0
    strain = hot.inverse_map.mean_strain + hot.inverse_map.noise_std
    inputs = [*range(27, 27 + n), *range(first_temperature(n), first_temperature(n) + N_T)]
    at, direction = np.concatenate([strain, temperature]), np.concatenate([0.01 * strain, random.normal(size=N_T)])
    direction[n + 2] = 5.0  # of the sensor that is off
    assert fmu.set_reals(inputs, at) == OK
    ours = fmu.derivative(VALUES, inputs, direction)
    step = np.where(np.arange(n + N_T) == n + 2, 0.0, 1e-3 * direction)
    ends = []
    for sign in (1.0, -1.0):
        assert fmu.set_reals(inputs, at + sign * step) == OK
        ends.append(fmu.get_reals(VALUES))
    size = np.abs(ends[0]) + np.abs(ends[1])
    np.testing.assert_allclose((ends[0] - ends[1]) / 2e-3, ours, rtol=1e-5, atol=1e-8 * size.max())
