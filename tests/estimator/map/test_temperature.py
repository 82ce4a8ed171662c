"""Temperature at run time: sensors and gauges together by the book, readings brought back to the reference."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_maps import exact_response, flight_map
from scaled_maps import NOMINAL, scaled_map
from thermal_maps import REFERENCE, thermal_part, with_temperature

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.reference.readings import amplitudes, row_noise, rows_of

pytestmark = pytest.mark.fast

LINEAR = {"apparent_strain": np.zeros(0), "gauge_factor_slope": 0.0, "modulus_slope": 0.0}


def warm_map(**changes: object) -> InverseMap:
    return with_temperature(scaled_map(2, seed=4), **changes)


@pytest.mark.parametrize("known", [(0, 1, 2, 3), (1,), ()])
def test_sensors_and_gauges_together_by_the_book(known: tuple[int, ...]) -> None:
    """One Gaussian of states, errors and mode amplitudes, conditioned on strains and sensors at once."""
    held = warm_map(**LINEAR)
    thermal, error, load = held.thermal, held.error_strain, held.error_load
    random, q = np.random.default_rng(3), 1.7 * NOMINAL
    s, rows = q / NOMINAL, list(known)
    strain = s * held.mean_strain + 2e-5 * random.normal(size=18)
    temperature = np.full(4, np.nan)
    temperature[rows] = REFERENCE + 30.0 * random.normal(size=len(rows))
    a, n = s * held.state_operator, s * error
    modes = thermal.mode_strain * thermal.prior_std
    seen = thermal.sensor_operator[rows] * thermal.prior_std
    unknown = np.block([[a, n, modes], [np.zeros((len(rows), a.shape[1] + n.shape[1])), seen]])
    noise = np.zeros((18 + len(rows),) * 2)
    noise[:18, :18] = thermal.isothermal_covariance
    noise[18:, 18:] = np.diag(thermal.sensor_std[rows] ** 2)
    of_load = np.hstack([s * held.load_per_state, s * load, np.zeros((5, modes.shape[1]))])
    data = np.concatenate([strain - s * held.mean_strain, temperature[rows] - REFERENCE])
    gain = of_load @ unknown.T @ np.linalg.inv(noise + unknown @ unknown.T)
    found = Estimator(held).step(strain, q, temperature=temperature)
    np.testing.assert_allclose(found.loads, s * held.load_of_mean + gain @ data, rtol=1e-7)
    covariance = of_load @ of_load.T - gain @ unknown @ of_load.T
    np.testing.assert_allclose(found.load_covariance, covariance, rtol=1e-5, atol=1e-7 * np.abs(covariance).max())
    if not known:
        assert np.array_equal(found.loads, Estimator(held).step(strain, q).loads)


def test_readings_are_brought_back_to_the_reference() -> None:
    """Sensors that see every mode exactly: slopes and data sheet as the gauges have them."""
    thermal = thermal_part(1e-14 * np.eye(9), k=3, n_t=3, sensor_std=np.full(3, 1e-9))
    random = np.random.default_rng(2)
    strain, amplitude = 1e-4 * random.normal(size=9), np.array([20.0, -5.0, 60.0])
    rise = thermal.gauge_operator @ amplitude
    of_sheet = 2e-7 * rise - 1e-9 * rise**2
    reading = (1.0 - 1e-4 * rise) * (strain / (1.0 - 4.5e-4 * rise) + thermal.mode_strain @ amplitude + of_sheet)
    temperature = REFERENCE + thermal.sensor_operator @ amplitude
    of_sensors = amplitudes(thermal, temperature[None], np.ones(3, dtype=bool))
    held = replace(scaled_map(2, 1, 9), thermal=thermal)
    found = rows_of(held, reading[None], np.zeros(1), amplitude=of_sensors.mean)[0]
    np.testing.assert_allclose(found, strain, atol=1e-12)
    noise = row_noise(held, held.gauge_covariance, left=of_sensors.covariance[0])
    np.testing.assert_allclose(noise, 1e-14 * np.eye(9), atol=1e-20)


def test_samples_of_several_sets_of_sensors_are_those_of_each() -> None:
    held, random = warm_map(), np.random.default_rng(1)
    strain = held.mean_strain + 1e-5 * random.normal(size=(7, 18))
    temperature = REFERENCE + 20.0 * random.normal(size=(7, 4))
    temperature[2:5, 1] = np.nan
    temperature[5, :] = np.nan
    temperature[6, 3] = 1e5  # no temperature
    zeros = GaugeZeros(value=1e-4 * random.normal(size=18), std=np.full(18, 1e-7), common_std=1e-7)
    estimator = Estimator(held, zeros=zeros)
    whole = estimator.estimate(strain + zeros.value, NOMINAL, temperature=temperature)
    for k in range(7):
        one = estimator.step(strain[k] + zeros.value, NOMINAL, temperature=temperature[k])
        np.testing.assert_allclose(whole.loads[k], one.loads, rtol=1e-10)
        np.testing.assert_allclose(whole.loads_std[k], one.loads_std, rtol=1e-10)
        assert whole.health[k] == one.health
    assert np.all(whole.loads_std[0] < whole.loads_std[5])


def flights() -> InverseMap:
    """Tables and linear map with one covariance of the gauges."""
    plain = scaled_map(2, 1, 48)
    manifold = replace(flight_map(discrepancy=1e-2), gauge_covariance=plain.gauge_covariance)
    return with_temperature(replace(plain, manifold=manifold), k=3)


def test_tracker_takes_thermal_strain_off() -> None:
    held, random, k = flights(), np.random.default_rng(7), 24
    thermal, truth = held.thermal, exact_response(6.0, 0.05, 0.03, 6e3)
    amplitude = thermal.prior_std * random.normal(size=(k, 3))
    rise = amplitude @ thermal.gauge_operator.T
    strain = truth[:48] / (1.0 - 4.5e-4 * rise) + amplitude @ thermal.mode_strain.T + 2e-7 * rise - 1e-9 * rise**2
    root = np.linalg.cholesky(thermal.isothermal_covariance)
    reading = (1.0 - 1e-4 * rise) * strain + random.normal(size=(k, 48)) @ root.T
    noise = thermal.sensor_std * random.normal(size=(k, 4))
    temperature = REFERENCE + amplitude @ thermal.sensor_operator.T + noise
    estimator, flow = Estimator(held), {"mach_number": 6.0, "static_pressure": 6e3}
    found = estimator.estimate(reading, temperature=temperature, **flow)
    apart = np.abs(found.loads - truth[48:]) / found.loads_std
    assert np.mean(apart < 3.0) > 0.97
    assert np.mean(found.chi_square <= found.chi_square_limit) > 0.97
    for row in range(3):
        one = estimator.track(reading[row], temperature=temperature[row], **flow)
        assert np.all(np.abs(one.loads - found.loads[row]) < 0.1 * found.loads_std[row])
    np.testing.assert_allclose(
        found.loads[0], estimator.estimate(reading[0], temperature=temperature[0], **flow).loads, rtol=1e-9
    )


def test_the_file_holds_the_modes(tmp_path: Path) -> None:
    held = warm_map()
    save_inverse_map(held, tmp_path / "map.h5")
    found = load_inverse_map(tmp_path / "map.h5").thermal
    assert found is not None
    assert found.sensor_names == held.thermal.sensor_names
    assert np.array_equal(found.mode_strain, held.thermal.mode_strain)


def test_what_is_wrong_is_named() -> None:
    cold, warm = Estimator(scaled_map(2, seed=4)), Estimator(warm_map())
    strain = cold.inverse_map.mean_strain
    with pytest.raises(InputError, match=r"temperature: expected none, the map was built without \[temperature\]"):
        cold.step(strain, NOMINAL, temperature=[300.0])
    with pytest.raises(InputError, match=r"temperature: expected \(4,\) or \(1, 4\) values, got \(3,\)"):
        warm.step(strain, NOMINAL, temperature=[300.0, 300.0, 300.0])
    with pytest.raises(InputError, match="temperature: expected real numbers, got complex128"):
        warm.step(strain, NOMINAL, temperature=[300.0 + 1j] * 4)
    with pytest.raises(InputError, match="thermal: prior_std must be positive"):
        thermal_part(np.eye(3), prior_std=np.zeros(6))
