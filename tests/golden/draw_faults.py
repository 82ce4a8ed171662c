"""Draws of the streams of golden files: flights with one fault each, for what the estimator does about it."""

from dataclasses import replace

import numpy as np
from draw import (
    AIR_DATA,
    air_data_of,
    drawn_amplitudes,
    inputs_of,
    linear_rows,
    readings,
    state_path,
    state_ranges,
    table_rows,
)
from inputs import Inputs

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.reference.gain import residual_precision

Random = np.random.Generator


def calm_flight(
    m: InverseMap, random: Random, steps: int, time_step: float = 0.01, pressure: float | None = None
) -> Inputs:
    """Return a flight without a fault, at a static ``pressure`` [Pa] or one in the middle of the tables."""
    manifold = _tables(m)
    time = time_step * np.arange(steps)
    state = state_path(manifold, random, time)
    if pressure is not None:
        state[:, 3] = np.log(pressure)
    rows = table_rows(m, random, state, {}, lasting=True)
    found = readings(m, random, rows, drawn_amplitudes(m, random, time, steps))
    return inputs_of(**found, time=time, flow=air_data_of(manifold, random, state))


def _tables(m: InverseMap) -> ManifoldMap:
    assert m.manifold is not None
    return m.manifold


def _moved(found: Inputs, name: str, error: np.ndarray) -> Inputs:
    """Return the flight whose air-data input ``name`` reads more by ``error`` (k,)."""
    return replace(found, flow={**found.flow, name: found.flow[name] + error})


def _during(steps: int, first: int, last: int) -> np.ndarray:
    return (np.arange(steps) >= first) & (np.arange(steps) < last)


# Air data.


def air_data_dropped(m: InverseMap, seed: int) -> Inputs:
    """One air-data input after another, which are all measured, reads a quarter more for a while."""
    found = calm_flight(m, np.random.default_rng(seed), 80)
    found = replace(found, flow={**found.flow, "q_source": np.ones(80)})
    for number, name in enumerate(AIR_DATA):
        during = _during(80, 10 + 24 * number, 24 + 24 * number)
        found = _moved(found, name, 0.25 * during * found.flow[name])
    return found


def air_data_doubted(m: InverseMap, seed: int) -> Inputs:
    """Mach number and static pressure read wrong by 2.5 to 5 standard deviations in single samples."""
    random = np.random.default_rng(seed)
    found, manifold = calm_flight(m, random, 80), _tables(m)
    size = random.choice([-1.0, 1.0], (2, 80)) * random.uniform(2.5, 5.0, (2, 80))
    which = np.arange(80) % 4
    found = _moved(found, "mach_number", (which == 1) * size[0] * manifold.mach_number_error)
    static = manifold.static_pressure_error * found.flow["static_pressure"]
    return _moved(found, "static_pressure", (which == 3) * size[1] * static)


# Strain.


def return_after_misfit(m: InverseMap, seed: int, size: float) -> Inputs:
    """Strain leaves the tables by ``size`` of the largest for 14 samples, and comes back."""
    random = np.random.default_rng(seed)
    found = calm_flight(m, random, 50)
    bent = size * np.abs(found.strain[0]).max() * random.standard_normal(m.n_gauges)
    return replace(found, strain=found.strain + _during(50, 6, 20)[:, None] * bent)


def jumps_and_spikes(m: InverseMap, seed: int) -> Inputs:
    """Six flights of 12 samples in turn; spikes of single sensors; no air data in the second and third."""
    random = np.random.default_rng(seed)
    parts = [calm_flight(m, random, 12) for _ in range(6)]
    found = inputs_of(
        np.concatenate([one.strain for one in parts]),
        time=0.01 * np.arange(72),
        flow={name: np.concatenate([one.flow[name] for one in parts]) for name in AIR_DATA},
    )
    for row in (25, 39, 54):
        found.strain[row, row % m.n_gauges] += 5e-5
    blind = _during(72, 12, 36)
    return replace(found, flow={name: np.where(blind, np.nan, value) for name, value in found.flow.items()})


def one_sensor_off(m: InverseMap, seed: int) -> Inputs:
    """Three sensors in turn read more by a bias that grows."""
    found = calm_flight(m, np.random.default_rng(seed), 60)
    noise = np.sqrt(np.diag(_tables(m).gauge_covariance))
    for number, gauge in enumerate((5, 17, 30)):
        during = _during(60, 6 + 18 * number, 20 + 18 * number)
        growing = np.linspace(3.0, 9.0, 14)
        found.strain[during, gauge % m.n_gauges] += growing * noise[gauge % m.n_gauges]
    return found


def pressure_off_the_tables(m: InverseMap, seed: int, size: float) -> Inputs:
    """A discrepancy mode in single samples, below the threshold of chi-square."""
    found = calm_flight(m, np.random.default_rng(seed), 40)
    mode = _tables(m).discrepancy_shapes[:, 1]
    part = np.where(np.arange(40) % 8 == 3, size * np.linspace(0.5, 1.5, 40), 0.0)
    return replace(found, strain=found.strain + part[:, None] * mode)


def restart(m: InverseMap, seed: int) -> Inputs:
    """Two flights, the second from one sample to the next."""
    random = np.random.default_rng(seed)
    one, other = (calm_flight(m, random, 20) for _ in range(2))
    flow = {name: np.concatenate([one.flow[name], other.flow[name]]) for name in AIR_DATA}
    strain = np.concatenate([one.strain, other.strain])
    return inputs_of(strain, time=0.01 * np.arange(40), flow=flow)


def without_air_data(m: InverseMap, seed: int, pressure: float) -> Inputs:
    """No air data at a low static ``pressure`` [Pa], but Mach number now and then and a pressure for a while."""
    found = calm_flight(m, np.random.default_rng(seed), 70, pressure=pressure)
    steps = np.arange(70)
    kept = {
        "mach_number": (steps % 30) >= 20,
        "static_pressure": _during(70, 40, 48),
        "dynamic_pressure": np.zeros(70, dtype=bool),
    }
    return replace(found, flow={name: np.where(kept[name], found.flow[name], np.nan) for name in AIR_DATA})


def each_without_air_data(m: InverseMap, seed: int, pressure: float, n: int = 120) -> Inputs:
    """Samples all over the tables at a low static ``pressure`` [Pa] without any pressure of air data."""
    random, (middle, half) = np.random.default_rng(seed), state_ranges(_tables(m))
    state = middle + half * random.uniform(-1.0, 1.0, (n, 4))
    state[:, 3] = np.log(pressure)
    flow = air_data_of(_tables(m), random, state)
    mach = np.where(np.arange(n) % 4 == 0, flow["mach_number"], np.nan)
    return inputs_of(table_rows(m, random, state, {}, lasting=False), flow={"mach_number": mach})


def coasting(m: InverseMap, seed: int) -> Inputs:
    """No sensor for 10 samples, then for 3 s, then without air data for a minute, and back each time."""
    found = calm_flight(m, np.random.default_rng(seed), 70, 0.02)
    lost = _during(70, 8, 18) | _during(70, 28, 32) | _during(70, 44, 52)
    size = np.full(70, 0.02)
    size[30], size[47:50] = 3.0, 20.0
    blind = _during(70, 42, 52)
    flow = {name: np.where(blind, np.nan, value) for name, value in found.flow.items()}
    valid = np.broadcast_to(~lost[:, None], found.strain.shape).copy()
    return replace(found, valid=valid, time=np.cumsum(size) - size[0], flow=flow)


# Linear maps.


def one_gauge_off(m: InverseMap, seed: int) -> Inputs:
    """Every gauge in turn is off by 4 to 12 standard deviations of what the others predict for it."""
    random, bias = np.random.default_rng(seed), np.linspace(4.0, 12.0, 9)
    n = m.n_gauges
    precision = np.diag(residual_precision(m))
    strain = np.repeat(m.mean_strain[None], n * len(bias), axis=0)
    strain += 0.2 * m.noise_std * random.standard_normal(strain.shape)
    gauge = np.repeat(np.arange(n), len(bias))
    strain[np.arange(len(strain)), gauge] += np.tile(bias, n) / np.sqrt(precision[gauge])
    pressure = np.full(len(strain), m.nominal_dynamic_pressure)
    return inputs_of(strain, flow={"dynamic_pressure": pressure, "dynamic_pressure_std": np.zeros(len(strain))})


def linear_restart(m: InverseMap, seed: int) -> Inputs:
    """States that jump twice, strain of no known pressure for 8 samples, and q_inf that is lost for 8."""
    random, steps = np.random.default_rng(seed), 80
    n = m.state_operator.shape[1] + m.error_strain.shape[1]
    state = np.repeat(random.standard_normal((3, n)), [25, 25, 30], axis=0)
    ratio = np.ones(steps)
    rows = linear_rows(m, random, ratio, state)
    bent = 30.0 * m.noise_std * random.standard_normal(m.n_gauges)
    rows += _during(steps, 36, 44)[:, None] * bent
    found = readings(m, random, rows, drawn_amplitudes(m, random, 0.02 * np.arange(steps), steps))
    pressure = np.where(_during(steps, 60, 68), np.nan, ratio * m.nominal_dynamic_pressure)
    return inputs_of(**found, flow={"dynamic_pressure": pressure})
