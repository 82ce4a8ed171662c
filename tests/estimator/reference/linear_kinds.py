"""Kinds of linear maps, random samples of each, and what core and reference make of them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from other_load_maps import with_own_further
from random_map import map_of, random_model
from scaled_maps import scaled_map, whole_scaled_map
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import ThermalMap
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.reference import linear
from strainfmu.estimator.reference.readings import amplitudes, row_noise, rows_of
from strainfmu.estimator.settings import default_settings

MASKS = 5
"""Sets of sensors in use that samples of a kind have, at most, beside those of broken ones."""


def in_use(
    inverse_map: InverseMap, readings: np.ndarray, valid: np.ndarray, sensor_range: float, thrust: np.ndarray
) -> np.ndarray:
    """Return (k, n_d) which ``readings`` (k, n_d) count: ``valid``, finite and in range.

    ``sensor_range`` is the largest strain [m/m]; the map has the ranges of auxiliary sensors.
    """
    sensors, found = inverse_map.sensors, inverse_map.sensors.without_thrust(readings, thrust)
    largest = np.where(sensors.is_strain, sensor_range, sensors.largest)
    return np.asarray(valid & (np.abs(found) <= largest))


def known_sensors(thermal: ThermalMap, temperature: np.ndarray) -> np.ndarray:
    """Return which of ``temperature`` (k, n_t) [K] are readings."""
    return np.asarray(
        (temperature > 0.0) & (np.abs(temperature - thermal.reference_temperature) <= POLICIES.largest_rise)
    )


def absolute(gamma: float) -> InverseMap:
    """Return a map in form "absolute", Case 1 where ``gamma`` is 0."""
    return map_of(random_model(gamma, n_gauges=27, n_states=20 if gamma else 5))


def warm(inverse_map: InverseMap) -> InverseMap:
    """Return ``inverse_map`` with temperature modes of the size of its gauges' noise."""
    noise = float(np.sqrt(np.median(np.diag(inverse_map.gauge_covariance))))
    strain = 0.1 * noise * np.random.default_rng(3).normal(size=(inverse_map.n_gauges, 6))
    return with_temperature(inverse_map, mode_strain=strain, apparent_strain=noise * np.array([2e-2, -1e-4]))


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of map: what makes it, and whether its gauges have zero offsets of unknown errors."""

    make: Callable[[], InverseMap]
    has_zeros: bool = False


KINDS = {
    "case_1": Kind(make=lambda: whole_scaled_map(1, seed=4, n=24, n_states=5)),
    "case_2": Kind(make=lambda: whole_scaled_map(2, seed=4, n=24, n_states=30)),
    "case_2_fixed_errors": Kind(make=lambda: scaled_map(2, seed=9, n=24, n_states=30)),
    "five_gauges": Kind(make=lambda: scaled_map(2, seed=4, n=5, n_states=6)),
    "absolute_case_1": Kind(make=lambda: absolute(0.0)),
    "absolute_gamma_1": Kind(make=lambda: absolute(1.0)),
    "absolute_gamma_1e-3": Kind(make=lambda: absolute(1e-3)),
    "absolute_gamma_1e-6": Kind(make=lambda: absolute(1e-6)),
    "absolute_sensors": Kind(make=lambda: with_sensors(map_of(random_model(n_gauges=27, n_states=4)))),
    "absolute_zeros": Kind(make=lambda: absolute(1e-3), has_zeros=True),
    "absolute_temperature": Kind(make=lambda: warm(absolute(1e-3))),
    "temperature": Kind(make=lambda: warm(whole_scaled_map(2, seed=4, n=20, n_states=25))),
    "sensors_temperature_zeros": Kind(
        make=lambda: with_sensors(warm(whole_scaled_map(1, seed=5, n=24, n_states=3))), has_zeros=True
    ),
    "sections": Kind(make=lambda: with_own_further(whole_scaled_map(2, seed=6, n=20, n_states=25))),
    "zeros": Kind(make=lambda: whole_scaled_map(2, seed=8, n=24, n_states=10), has_zeros=True),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Samples (k, ..) of a map.

    Attributes
    ----------
    readings, valid : (k, n_d) and whether they may be used.
    pressure, pressure_std : (k,) q_inf and its standard deviation [Pa].
    temperature : (k, n_t) [K]; None of a map without.
    thrust : (k,) [N].
    zeros : of the gauges; None for none.
    """

    readings: np.ndarray
    valid: np.ndarray
    pressure: np.ndarray
    pressure_std: np.ndarray
    temperature: np.ndarray | None
    thrust: np.ndarray
    zeros: GaugeZeros | None


def drawn(inverse_map: InverseMap, kind: Kind, n: int, seed: int) -> Samples:
    """Return ``n`` samples of the map's own law; sensors are masked, broken, out of range or far off."""
    random, m = np.random.default_rng(seed), inverse_map
    ratio = 2.0 ** random.uniform(-2.0, 2.0, n)
    _, truth = linear.models(m)
    free = 0.3 * np.sqrt(np.mean(truth.mean**2)) / np.sqrt(np.mean(truth.free**2, axis=0))
    columns = np.hstack([free * truth.free, truth.columns])
    s = ratio[:, None] if m.form == "dynamic_pressure" else 1.0
    noise = random.standard_normal((n, m.n_gauges)) @ np.linalg.cholesky(truth.noise).T
    state = random.standard_normal((n, columns.shape[1]))
    rows = truth.fixed + s * (truth.mean + state @ columns.T) + noise
    thrust, temperature, zeros = np.zeros(n), None, None
    if kind.has_zeros:
        std = m.noise_std[: m.n_strain_gauges]
        value = 20.0 * std * random.standard_normal(len(std))
        zeros = GaugeZeros(value=value, std=std * random.uniform(0.5, 1.5, len(std)), common_std=0.5 * std.min())
        rows[:, : len(std)] += value
    readings = rows
    if m.has_auxiliary_sensors:
        thrust = random.choice([0.0, 300.0, np.nan], n, p=[0.5, 0.4, 0.1])
        readings = rows * m.sensors.scale + np.nan_to_num(thrust)[:, None] * m.sensors.thrust_response
    if m.has_temperature:
        n_t = m.thermal.n_sensors
        temperature = m.thermal.reference_temperature + 30.0 * random.standard_normal((n, n_t))
        lost = random.random((4, n_t)) < np.array([[0.0], [0.3], [0.3], [1.0]])
        temperature[lost[random.integers(0, 4, n)]] = np.nan
    masks = random.random((MASKS, m.n_gauges)) > np.linspace(0.0, 0.6, MASKS)[:, None]
    for broken in (np.nan, np.inf, 0.06):
        readings[random.random(n) < 0.02, random.integers(m.n_strain_gauges)] = broken
    far = random.integers(0, n, n // 20)
    readings[far, 0] += 30.0 * m.noise_std[0] * random.standard_normal(len(far))
    pressure = ratio * m.nominal_dynamic_pressure
    return Samples(
        readings=readings,
        valid=masks[random.integers(0, MASKS, n)],
        pressure=pressure,
        pressure_std=random.choice([0.0, 0.01, 0.03], n) * pressure,
        temperature=temperature,
        thrust=thrust,
        zeros=zeros,
    )


def by_core(inverse_map: InverseMap, samples: Samples) -> Estimate:
    """Return what the compiled core makes of ``samples``."""
    zeros = samples.zeros
    offsets = None
    if zeros is not None:
        offsets = GaugeZeros(value=zeros.value, std=zeros.std, common_std=zeros.common_std)
    estimator, more = Estimator(inverse_map, zeros=offsets), {}
    if samples.temperature is not None:
        more["temperature"] = samples.temperature
    if inverse_map.has_auxiliary_sensors:
        more["thrust"] = samples.thrust
    return estimator.estimate(
        samples.readings, samples.pressure, valid=samples.valid, dynamic_pressure_std=samples.pressure_std, **more
    )


def by_reference(inverse_map: InverseMap, samples: Samples) -> Iterator[tuple[np.ndarray, linear.LinearEstimate]]:
    """Yield the places of samples with the same sensors in use, and what the reference makes of them."""
    sensor_range = default_settings(inverse_map).sensor_range
    used = in_use(inverse_map, samples.readings, samples.valid, sensor_range, samples.thrust)
    thermal, sets = inverse_map.thermal, used
    if samples.temperature is not None:
        sets = np.hstack([used, known_sensors(thermal, samples.temperature)])
    n = used.shape[1]
    for one in np.unique(sets, axis=0):
        at = np.flatnonzero((sets == one).all(axis=1))
        amplitude = left = None
        if samples.temperature is not None:
            found = amplitudes(thermal, samples.temperature[at], one[n:])
            amplitude, left = found.mean, found.covariance[0]
        model, _ = linear.models(inverse_map)
        rows = rows_of(inverse_map, samples.readings[at], samples.thrust[at], samples.zeros, amplitude)
        noise = row_noise(inverse_map, model.noise, samples.zeros, left)
        pressure = samples.pressure[at], samples.pressure_std[at]
        yield at, linear.estimate(inverse_map, rows, one[:n], *pressure, noise)
