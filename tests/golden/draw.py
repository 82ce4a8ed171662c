"""Draws of the streams of golden files: random samples and flights. Needed to record streams alone."""

from dataclasses import replace
from typing import Any

import numpy as np
from inputs import Inputs

from strainfmu.atmosphere import pressure_and_temperature, static_pressure_at
from strainfmu.estimator.air_inputs import INERTIAL_NAMES
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap, with_known
from strainfmu.estimator.map.validity import flow_parameters
from strainfmu.estimator.off_deadline import channels_of

Random = np.random.Generator

AIR_DATA = ("mach_number", "static_pressure", "dynamic_pressure")
COLD_NOISE = 2e-7
"""Noise of gauges where the covariance of a map with temperature modes holds their prior, too [m/m]."""


def inputs_of(strain: np.ndarray, **known: Any) -> Inputs:
    """Return samples of ``strain`` (k, n_d) of which nothing is known but ``known``."""
    k = len(strain)
    nothing: dict[str, Any] = {
        "valid": np.ones(strain.shape, dtype=bool),
        "time": 0.02 * np.arange(k),
        "temperature": np.zeros((k, 0)),
        "thrust": np.zeros(k),
        "parameter": np.zeros((k, 0)),
        "parameter_std": np.zeros((k, 0)),
        "zero": np.zeros(0),
    }
    return Inputs(strain=strain, **(nothing | known))


# Readings.


def readings(m: InverseMap, random: Random, rows: np.ndarray, amplitude: np.ndarray | None) -> dict[str, Any]:
    """Return what sensors and temperature sensors read where the rows of the map, cold, are ``rows`` (k, n_d).

    ``amplitude`` (k, n) are those of its temperature modes; None for a map without.
    """
    found: dict[str, Any] = {}
    if m.has_temperature and amplitude is not None:
        thermal = m.thermal
        rise = amplitude @ thermal.gauge_operator.T
        apparent = sum(one * rise ** (k + 1) for k, one in enumerate(thermal.apparent_strain))
        by_load = rows / (1.0 + thermal.modulus_slope * rise) + amplitude @ thermal.mode_strain.T
        rows = (1.0 + thermal.gauge_factor_slope * rise) * (by_load + apparent)
        noise = thermal.sensor_std * random.standard_normal((len(rows), thermal.n_sensors))
        found["temperature"] = thermal.reference_temperature + amplitude @ thermal.sensor_operator.T + noise
    found["strain"] = rows
    if m.has_auxiliary_sensors:
        thrust = random.choice([0.0, 300.0, -40.0], len(rows))
        found["thrust"] = thrust
        found["strain"] = rows * m.sensors.scale + thrust[:, None] * m.sensors.thrust_response
    return found


def drawn_amplitudes(m: InverseMap, random: Random, time: np.ndarray | None, k: int) -> np.ndarray | None:
    """Return (k, n) amplitudes of temperature modes: drawn for each sample, or falling over ``time`` (k,) [s]."""
    if not m.has_temperature:
        return None
    prior = m.thermal.prior_std
    if time is None:
        return np.asarray(prior * random.standard_normal((k, len(prior))))
    return np.asarray(np.exp(-time / 3.0)[:, None] * prior * random.standard_normal(len(prior)))


def drawn_parameters(m: InverseMap, random: Random, k: int, spoilt: bool = True) -> dict[str, np.ndarray]:
    """Return flow parameters and their standard deviations, out of range and unknown at times if ``spoilt``."""
    known = flow_parameters(m)
    n = len(known.names)
    if n == 0:
        return {}
    value = known.minimum + (known.maximum - known.minimum) * random.uniform(-0.02, 1.02, (k, n))
    value[spoilt & (random.random((k, n)) < 0.04)] += 3.0
    value[spoilt & (random.random((k, n)) < 0.1)] = np.nan
    if m.manifold is None or m.manifold.parameters is None:
        return {"parameter": value}
    std = random.choice([0.02, 0.1, 0.5, np.nan], (k, n), p=[0.3, 0.3, 0.2, 0.2])
    return {"parameter": value, "parameter_std": std}


def two_settings(m: InverseMap, random: Random, steps: int) -> dict[str, np.ndarray]:
    """Return flow parameters that are set twice in a flight, then known without deviation, then not at all."""
    half = (np.arange(steps) > steps // 2).astype(int)
    found = {name: values[half] for name, values in drawn_parameters(m, random, 2, spoilt=False).items()}
    if "parameter_std" in found:
        found["parameter_std"][5 * steps // 6 :] = np.nan
    if "parameter" in found:
        found["parameter"][11 * steps // 12 :] = np.nan
    return found


def with_motion(m: InverseMap, seed: int, of: str, **options: Any) -> Inputs:
    """Return what ``of`` does of a vehicle that moves: its inertial unit loses single inputs, or all of them."""
    found: Inputs = globals()[of](m, seed, **options)
    assert m.inertia is not None
    random, k = np.random.default_rng(seed + 2000), len(found)
    size = np.array([20.0, 25.0, 25.0, 1.5, 1.5, 1.5, 5.0, 5.0])
    true = size * random.standard_normal((k, len(size)))
    vibration = m.inertia.vibration_std * np.exp(random.normal(0.0, 1.5, k))
    modes = m.inertia.vibration_strain
    strain = channels_of(dict(zip(INERTIAL_NAMES, true.T, strict=False))) @ m.inertia.mode_strain.T
    strain += vibration[:, None] * random.standard_normal((k, modes.shape[1])) @ modes.T
    read = true + 2e-3 * size * random.standard_normal(true.shape)
    read[random.random(true.shape) < 0.05] = np.nan
    read[random.random(k) < 0.2] = np.nan
    read[7::60, 1] = 1e9
    vibration[random.random(k) < 0.4] = np.nan
    vibration[5::40], vibration[9::40] = 0.0, 1e-4 * m.inertia.vibration_std
    flow = found.flow | dict(zip(INERTIAL_NAMES, [*read.T, vibration], strict=True))
    return replace(found, strain=found.strain + strain, flow=flow)


# Linear maps.


def linear_rows(m: InverseMap, random: Random, ratio: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
    """Return (k, n_d) rows at ``ratio`` (k,) of the nominal dynamic pressure, with all errors of the map.

    ``state`` (k, n) are standard normal states, then errors; drawn by default.
    """
    columns = columns_of(m)
    if state is None:
        state = random.standard_normal((len(ratio), columns.shape[1]))
    if m.form == "absolute":
        root = np.linalg.cholesky(m.noise_covariance)
        return np.asarray(
            m.mean_strain + state @ columns.T + random.standard_normal((len(ratio), m.n_gauges)) @ root.T
        )
    own = m.thermal_and_inertia.isothermal_covariance
    fixed = m.fixed_strain
    noise = random.standard_normal((len(ratio), m.n_gauges)) @ np.linalg.cholesky(own).T
    return np.asarray(fixed + ratio[:, None] * (m.mean_strain - fixed + state @ columns.T) + noise)


def columns_of(m: InverseMap) -> np.ndarray:
    """Return (n_d, n) strain per standard deviation of each state, then of each error in proportion to q_inf.

    A state of Case 1 has no prior: its strain is about a third of the mean's.
    """
    size = np.sqrt(np.mean(m.mean_strain**2)) / np.sqrt(np.mean(m.state_operator**2, axis=0))
    states = m.state_operator * (
        np.minimum(0.3 * size, 1.0) if m.form == "absolute" or m.case == 2 else 0.3 * size
    )
    return states if m.form == "absolute" else np.hstack([states, m.error_strain])


def linear_samples(m: InverseMap, seed: int, n: int) -> Inputs:
    """Masks, outliers, broken sensors and broken air data among samples of the map's own law."""
    random = np.random.default_rng(seed)
    ratio = random.choice([1.0, 1.0, 0.0], n) + 0.0
    ratio = np.where(ratio > 0.0, ratio, random.uniform(0.3, 3.0, n))
    found = readings(m, random, linear_rows(m, random, ratio), drawn_amplitudes(m, random, None, n))
    strain = found["strain"]
    scale = m.sensors.scale
    noise = m.noise_std * scale
    for k in range(0, n, 4):
        gauge = random.integers(m.n_gauges)
        strain[k, gauge] += noise[gauge] * random.choice([8.0, 30.0, 300.0]) * random.normal()
    broken(m, random, strain)
    pressure = ratio * m.nominal_dynamic_pressure
    std = random.choice([0.0, 1e3, np.nan], n)
    mach, altitude = linear_air_data(random, pressure)
    pressure[::17] = random.choice([0.0, 1e-7, 1e-6, 1e7, 1.1e7, 9e9, np.nan, np.inf, -2.0], len(pressure[::17]))
    std[::41] = np.inf
    flow = {"dynamic_pressure": pressure, "dynamic_pressure_std": std, "mach_number": mach, "altitude": altitude}
    found |= {"strain": strain, **drawn_parameters(m, random, n)}
    lose_temperatures(random, found)
    if m.has_auxiliary_sensors:
        found["thrust"][::23] = np.nan
    return inputs_of(**found, valid=drawn_masks(random, n, m.n_gauges), flow=flow)


def linear_air_data(random: Random, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return Mach number and altitude (k,) that agree with the dynamic ``pressure`` (k,), or not, or are none."""
    k = len(pressure)
    mach = random.uniform(5.0, 7.0, k)
    altitude = altitude_of(pressure / (0.7 * mach**2))
    mach *= random.choice([1.0, 1.0, 1.0, 1.3], k)
    mach[::3] = np.nan
    altitude[::3] = np.nan
    broken_value = [np.nan, np.inf, -np.inf, -2.0, 0.0, 1e30, 8.0, 5.0, 20e3, 71e3, 71.1e3]
    mach[1::14], altitude[1::14] = (random.choice(broken_value, len(mach[1::14])) for _ in range(2))
    return mach, altitude


def altitude_of(static_pressure: np.ndarray) -> np.ndarray:
    """Return the altitudes (k,) [m] with ``static_pressure`` (k,) [Pa] in the standard atmosphere."""
    altitude = np.linspace(0.0, 60e3, 601)
    pressure = np.array([pressure_and_temperature(one)[0] for one in altitude])
    return np.asarray(np.interp(-np.log(static_pressure), -np.log(pressure), altitude))


def drawn_masks(random: Random, k: int, n: int) -> np.ndarray:
    """Return (k, n) masks of a pool: all sensors in a third of samples, a few lost in most, many in some."""
    valid, pool = np.ones((k, n), dtype=bool), [np.ones(n, dtype=bool)]
    for row in range(k):
        if row % 25 == 0:
            most = n if row % 50 == 0 else min(4, n)
            lost = random.choice(n, random.integers(0, most), replace=False)
            pool.append(np.isin(np.arange(n), lost, invert=True))
        valid[row] = pool[random.integers(max(0, len(pool) - 6), len(pool))] if row % 3 else pool[0]
    valid[-1] = False
    return valid


def broken(m: InverseMap, random: Random, strain: np.ndarray) -> None:
    """Let single readings, whole samples, or all of them at zero, be what no sensor reads."""
    k, n = strain.shape
    for row in range(0, k, 31):
        strain[row, random.integers(n)] = random.choice([np.nan, np.inf, -np.inf, 1e30])
        strain[row, random.integers(m.n_strain_gauges)] = random.choice([0.06, -1.0])
    strain[[7, 62, 203][: 1 + k // 100]] = 0.0
    strain[19] = np.nan


def lose_temperatures(random: Random, found: dict[str, Any]) -> None:
    """Let temperature sensors fail: some of a sample, or all."""
    if "temperature" in found:
        k, n = found["temperature"].shape
        found["temperature"][random.random((k, n)) < 0.1] = np.nan
        found["temperature"][random.random(k) < 0.1] = np.nan
        found["temperature"][3::50, 0] = 1e5


def linear_flight(m: InverseMap, seed: int, steps: int) -> Inputs:
    """States that wander, q_inf that changes, one jump; sensors, samples, q_inf and temperatures get lost."""
    random = np.random.default_rng(seed)
    time, columns = drawn_time(random, steps), columns_of(m)
    state = np.empty((steps, columns.shape[1]))
    state[0] = random.standard_normal(columns.shape[1])
    for k in range(1, steps):
        keep = np.exp(-min(time[k] - time[k - 1], 0.05) / 20.0) if k != 2 * steps // 3 else 0.0
        state[k] = keep * state[k - 1] + np.sqrt(1.0 - keep**2) * random.standard_normal(len(state[k]))
    ratio = np.ones(steps) if m.form == "absolute" else 0.9 + 0.5 * np.sin(0.7 * time)
    found = readings(m, random, linear_rows(m, random, ratio, state), drawn_amplitudes(m, random, time, steps))
    found |= two_settings(m, random, steps)
    pressure = ratio * m.nominal_dynamic_pressure * (1.0 + 0.01 * random.normal())
    pressure[17::37] = np.nan
    found["strain"][random.random(found["strain"].shape) < 0.01] = np.nan
    std = random.choice([np.nan, 0.01], steps) * pressure
    valid = flight_masks(random, steps, m.n_gauges)
    flow = {"dynamic_pressure": pressure, "dynamic_pressure_std": std}
    return inputs_of(**found, time=time, valid=valid, flow=flow)


def flight_masks(random: Random, k: int, n: int) -> np.ndarray:
    """Return (k, n) masks of a flight: sensors get lost for some samples, all of them for a few."""
    valid, mask = np.empty((k, n), dtype=bool), np.ones(n, dtype=bool)
    for row in range(k):
        if row % 7 == 6:
            mask = random.random(n) > random.choice([0.0, 0.0, 0.05, 0.2])
        valid[row] = mask & (row % 45 < 43)
    return valid


def drawn_time(random: Random, steps: int) -> np.ndarray:
    """Return (steps,) times [s]: steps of 5 to 50 ms, and two of 2 s."""
    size = random.uniform(0.005, 0.05, steps)
    size[[steps // 3, steps // 2]] = 2.0
    return np.asarray(np.cumsum(size) - size[0])


# Maps with tables over the flight state.


def state_ranges(manifold: ManifoldMap) -> tuple[np.ndarray, np.ndarray]:
    """Return middles and half-widths (4,) of the flight states that are flown."""
    low, high = manifold.pressure_range
    pressure = np.log([max(5.0 * low, 2e3), min(0.4 * high, 2.5e4)])
    middle, half = manifold.crossflow
    if manifold.crossflow_range is None:
        half = 0.65 * manifold.incidence_limit * np.ones(2)
    centre = [manifold.mach_range.mean(), *np.broadcast_to(middle, 2), pressure.mean()]
    width = [0.5 * np.ptp(manifold.mach_range), *np.broadcast_to(half, 2), 0.5 * np.ptp(pressure)]
    return np.array(centre), np.array(width)


def table_rows(
    m: InverseMap, random: Random, state: np.ndarray, found: dict[str, Any], lasting: bool
) -> np.ndarray:
    """Return (k, n_d) rows at ``state`` (k, 4), with discrepancy, gain errors and noise of the map.

    Errors are drawn for each sample, or ``lasting``. Flow parameters are those in ``found``, their mean where not
    known.
    """
    manifold = m.manifold
    assert manifold is not None
    k, n, one = len(state), m.n_gauges, 1 if lasting else len(state)
    warm = m.thermal_and_inertia.n_modes > 0
    noise = np.full(n, COLD_NOISE) if warm else np.sqrt(np.diag(manifold.gauge_covariance))
    discrepancy = random.standard_normal((one, manifold.error_strain.shape[1])) @ manifold.error_strain.T
    gain = manifold.gain_std * random.standard_normal((one, n)) + manifold.common_gain * random.normal(
        size=(one, 1)
    )
    response = _response(manifold, state, found)[:, :n] + np.exp(state[:, 3:]) * discrepancy
    return np.asarray((1.0 + gain) * response + noise * random.standard_normal((k, n)))


def _response(manifold: ManifoldMap, state: np.ndarray, found: dict[str, Any]) -> np.ndarray:
    """Return strains and loads at ``state`` (k, 4)."""
    parameters = manifold.parameters
    if parameters is None or "parameter" not in found:
        return np.asarray(evaluate(manifold.tables, state).value)
    value = np.where(np.isfinite(found["parameter"]), found["parameter"], parameters.powers.mean)
    rows = []
    for one, at in zip(value, state, strict=True):
        known = with_known(manifold, one, np.full(len(one), 1e-9))
        rows.append(evaluate(known.tables, at[None]).value[0])
    return np.array(rows)


def air_data_of(manifold: ManifoldMap, random: Random, state: np.ndarray) -> dict[str, np.ndarray]:
    """Return what Mach number, static and dynamic pressure read at ``state`` (k, 4), with their errors."""
    k, mach, static = len(state), state[:, 0], np.exp(state[:, 3])
    noise = random.standard_normal((3, k))
    errors = (manifold.mach_number_error, manifold.static_pressure_error, manifold.dynamic_pressure_error)
    return {
        "mach_number": mach + errors[0] * noise[0],
        "static_pressure": static * (1.0 + errors[1] * noise[1]),
        "dynamic_pressure": 0.7 * mach**2 * static * (1.0 + errors[2] * noise[2]),
    }


def table_samples(m: InverseMap, seed: int, n: int) -> Inputs:
    """Flight states all over the tables; masks, outliers, strain off the tables, air data wrong or missing."""
    random, manifold = np.random.default_rng(seed), m.manifold
    assert manifold is not None
    middle, half = state_ranges(manifold)
    state = middle + half * random.uniform(-1.0, 1.0, (n, 4))
    state[::40, 0] += 0.2 * half[0] * random.choice([-7.0, 7.0], len(state[::40]))
    found: dict[str, Any] = drawn_parameters(m, random, n)
    rows = table_rows(m, random, state, found, lasting=False)
    size = np.abs(rows).max(axis=1)
    for k in range(2, n, 9):
        rows[k, random.integers(m.n_gauges)] += random.choice([2e-6, 6e-6, 5e-5]) * random.normal()
    for k in range(4, n, 37):
        rows[k] += 0.1 * size[k] * random.standard_normal(m.n_gauges)
    found |= readings(m, random, rows, drawn_amplitudes(m, random, None, n))
    broken(m, random, found["strain"])
    lose_temperatures(random, found)
    flow = air_data_of(manifold, random, state)
    spoil_air_data(manifold, random, flow)
    return inputs_of(**found, valid=drawn_masks(random, n, m.n_gauges), flow=flow)


def spoil_air_data(manifold: ManifoldMap, random: Random, flow: dict[str, np.ndarray]) -> None:
    """Let air data be missing, replaced by altitude, wrong, impossible, or known with stated deviations."""
    k = len(flow["mach_number"])
    size = {"mach_number": manifold.mach_number_error + np.zeros(k)}
    size["static_pressure"] = manifold.static_pressure_error * flow["static_pressure"]
    size["dynamic_pressure"] = manifold.dynamic_pressure_error * flow["dynamic_pressure"]
    flow["altitude"] = altitude_of(flow["static_pressure"])
    by_altitude = random.random(k) < 0.1
    flow["static_pressure"][by_altitude] = np.nan
    flow["altitude"][~by_altitude] = np.nan
    for number, name in enumerate(AIR_DATA):
        wrong = random.random(k) < 0.06
        flow[name] += wrong * random.choice([-1.0, 1.0], k) * random.uniform(2.0, 9.0, k) * size[name]
        flow[name][random.random(k) < 0.15] = np.nan
        flow[name][11 + number :: 60] = random.choice(
            [np.inf, 0.0, -6.0, 1e30], len(flow[name][11 + number :: 60])
        )
        stated = np.where(random.random(k) < 0.2, random.choice([0.2, 1.0, 3.0], k) * size[name], np.nan)
        stated[5 + number :: 90] = random.choice([0.0, np.inf], len(stated[5 + number :: 90]))
        flow[f"{name}_std"] = stated
    none = random.random(k) < 0.08
    for name in (*AIR_DATA, "altitude"):
        flow[name][none] = np.nan


def state_path(manifold: ManifoldMap, random: Random, time: np.ndarray) -> np.ndarray:
    """Return (k, 4) flight states of a slow manoeuvre inside the tables."""
    middle, half = state_ranges(manifold)
    phase, period = random.uniform(0.0, 2.0 * np.pi, 4), np.array([20.0, 6.0, 8.0, 40.0])
    wave = np.sin(2.0 * np.pi * time[:, None] / period + phase)
    return np.asarray(middle + half * random.uniform(0.4, 0.9, 4) * wave)


def table_flight(m: InverseMap, seed: int, steps: int) -> Inputs:
    """A manoeuvre with one jump; sensors, whole samples, temperatures and air data get lost, one reads wrong."""
    random, manifold = np.random.default_rng(seed), m.manifold
    assert manifold is not None
    time = drawn_time(random, steps)
    state, other = (state_path(manifold, random, time) for _ in range(2))
    state[2 * steps // 3 :] = other[2 * steps // 3 :]
    found: dict[str, Any] = two_settings(m, random, steps)
    rows = table_rows(m, random, state, found, lasting=True)
    found |= readings(m, random, rows, drawn_amplitudes(m, random, time, steps))
    found["strain"][random.random(found["strain"].shape) < 0.01] = np.nan
    lose_temperatures(random, found)
    flow = air_data_of(manifold, random, state)
    for name in AIR_DATA:
        flow[name] = np.where((random.random(steps // 10 + 1) < 0.2)[np.arange(steps) // 10], np.nan, flow[name])
    flow["mach_number"][steps // 4 : steps // 4 + 6] += 8.0 * manifold.mach_number_error
    return inputs_of(**found, time=time, valid=flight_masks(random, steps, m.n_gauges), flow=flow)


# Any map.


def with_zeros(m: InverseMap, seed: int, of: str, std: float, **options: Any) -> Inputs:
    """Return what ``of`` does, of gauges with zero offsets known to ``std`` times their noise."""
    found: Inputs = globals()[of](m, seed, **options)
    random, n = np.random.default_rng(seed + 1000), m.n_strain_gauges
    value = 20.0 * m.noise_std[:n] * random.standard_normal(n)
    deviation = std * m.noise_std[:n] * random.uniform(0.5, 1.5, n)
    read = found.strain.copy()
    read[:, :n] += value + deviation * random.standard_normal(n)
    zero = np.concatenate([value, deviation, [0.5 * std * m.noise_std[:n].min()]])
    return replace(found, strain=read, zero=zero)


def with_settings(m: InverseMap, seed: int, of: str, settings: dict[str, float], **options: Any) -> Inputs:
    """Return what ``of`` does, with other ``settings`` of the estimator."""
    found: Inputs = globals()[of](m, seed, **options)
    return replace(found, settings=settings)


def with_sources(m: InverseMap, seed: int, of: str, **options: Any) -> Inputs:
    """Return what ``of`` does, where q_inf is often computed from other air data, or stated to be, and angles are
    measured now and then."""
    found: Inputs = globals()[of](m, seed, **options)
    random, flow, k = np.random.default_rng(seed + 1000), dict(found.flow), len(found)
    none = np.full(k, np.nan)
    by_altitude, stated = static_pressure_at(flow.get("altitude", none)), flow.get("static_pressure", none)
    of_others = 0.7 * flow.get("mach_number", none) ** 2 * np.where(np.isfinite(stated), stated, by_altitude)
    computed = (random.random(k) < 0.6) & np.isfinite(of_others)
    flow["dynamic_pressure"] = np.where(computed, of_others, flow["dynamic_pressure"])
    flow["q_source"] = random.choice([0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0], k)
    for name in ("measured_angle_of_attack", "measured_sideslip_angle"):
        flow[name] = np.where(random.random(k) < 0.5, random.normal(0.0, 0.05, k), np.nan)
        flow[f"{name}_std"] = np.where(random.random(k) < 0.5, 0.05, np.nan)
    return replace(found, flow=flow)
