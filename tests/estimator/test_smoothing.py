"""Smoothed samples: the joint Gaussian of a whole series, the core's filter, known loads, lost sensors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flight_fmu import random_flight
from flight_fmu import whole_map as whole_flight_map
from flight_maps import NOISE_STD, ROWS, STATIONS, exact_response, flight_map
from other_load_maps import COMBINATION, with_further
from parameter_maps import with_errors_of_parameters, with_parameter_tables
from scaled_maps import NOMINAL, scaled_map, whole_scaled_map
from thermal_maps import with_temperature
from warm_flights import warm_flight

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.reference.kalman import Law, Rows, measured, predicted
from strainfmu.estimator.smoothing import FlightSmoother, LinearSmoother, Smoothed, Step, smoothed, smoother_of

pytestmark = pytest.mark.fast
DATA = Path(__file__).parents[1] / "golden" / "data"
DT, N_D = 0.01, STATIONS * ROWS


@dataclass(kw_only=True, eq=False)
class OfSystem:
    """A sample of a filter of a linear system."""

    before: Law
    after: Law
    transition: np.ndarray
    continues: bool


def smoothed_samples(
    inverse_map: InverseMap, seconds: float, strain: np.ndarray, time: np.ndarray, **given: Any
) -> tuple[Estimate, Smoothed, list[Step]]:
    """Return the core's filtered estimates, the smoothed ones, and the steps."""
    estimator = Estimator(inverse_map).filter(seconds)
    found = estimator.track(strain, time=time, **given)
    smoother: FlightSmoother | LinearSmoother = smoother_of(estimator)
    steps = smoother.steps(found, time, np.nan)
    return found, smoother.estimates(found, steps, smoothed(steps)), steps


def flown(samples: list[Any]) -> dict[str, Any]:
    """Return strain, time and navigation of ``samples``."""
    flow = {name: np.array([one.flow[name] for one in samples]) for name in samples[0].flow}
    return {"strain": np.array([one.strain for one in samples]), "time": DT * np.arange(len(samples)), **flow}


def test_it_is_the_joint_gaussian_of_a_whole_series() -> None:
    """Of a system without considered errors, all samples at once; the filter begins again half way."""
    random, n, m, k = np.random.default_rng(1), 3, 2, 12
    matrix, root = 0.9 * np.eye(n) + 0.05 * random.normal(size=(n, n)), random.normal(size=(n, n))
    prior = Law(random.normal(size=n), root @ root.T + np.eye(n), np.zeros((n, 0)))
    by_state, noise, read = random.normal(size=(k, m, n)), 0.1 * np.eye(m), random.normal(size=(k, m))
    samples, law = [], prior
    for i in range(k):
        continues = i not in (0, 7)
        before = predicted(law, matrix, prior, 1.0) if continues else prior
        rows = Rows(read[i] - by_state[i] @ before.mean, by_state[i], np.zeros((m, 0)), noise)
        law, _ = measured(before, rows)
        samples.append(OfSystem(before=before, after=law, transition=matrix, continues=continues))
    found = smoothed(samples)
    for first, last in ((0, 7), (7, k)):
        size = last - first
        powers = [np.linalg.matrix_power(matrix, one) for one in range(size)]
        joint = np.block(
            [
                [
                    powers[i - j] @ prior.covariance if i >= j else prior.covariance @ powers[j - i].T
                    for j in range(size)
                ]
                for i in range(size)
            ]
        )
        whole = np.zeros((size * m, size * n))
        for i in range(size):
            whole[i * m : (i + 1) * m, i * n : (i + 1) * n] = by_state[first + i]
        gain = joint @ whole.T @ np.linalg.inv(whole @ joint @ whole.T + np.kron(np.eye(size), noise))
        mean = np.tile(prior.mean, size)
        mean = mean + gain @ (read[first:last].ravel() - whole @ mean)
        covariance = joint - gain @ whole @ joint
        for i in range(size):
            own = slice(i * n, (i + 1) * n)
            np.testing.assert_allclose(found[first + i].mean, mean[own], atol=1e-10)
            np.testing.assert_allclose(found[first + i].covariance, covariance[own, own], atol=1e-10)


def golden(file: str) -> dict[str, Any]:
    """Return the flight of a kind of map: jumps, lost gauges, air data and whole samples."""
    with np.load(DATA / f"{file}.npz") as content:
        found = {name: content[name] for name in content.files if name.startswith("flight/")}
    given = {
        name.split("/")[-1]: values if name.endswith("/valid") else values.astype(float)
        for name, values in found.items()
        if (name.count("/") == 1 or "/flow/" in name) and values.size
    }
    names = ("strain", "time", "valid", "dynamic_pressure", "mach_number", "static_pressure", "temperature")
    found = {name: given[name] for name in (*names, "dynamic_pressure_std", "altitude") if name in given}
    return found | {"q_source": np.ones(len(given["time"]))}


def warm_whole_map() -> InverseMap:
    return with_temperature(whole_flight_map())


@pytest.mark.parametrize("kind", ["revolution", "temperature"])
def test_it_takes_the_core_s_decisions(kind: str) -> None:
    """Laws of the reference are the core's, also where it began again and left out air data."""
    inverse_map = {"revolution": whole_flight_map, "temperature": warm_whole_map}[kind]()
    found, known, steps = smoothed_samples(inverse_map, 1.0, **golden(kind))
    std = np.sqrt(np.diagonal(found.state_covariance, axis1=1, axis2=2))
    state = np.array([one.after.mean[:4] for one in steps])
    of_law = np.array([np.sqrt(np.diag(one.after.covariance)[:4]) for one in steps])
    kept = np.array([one.of_loads is not None for one in steps])
    assert np.mean(kept) > 0.9
    assert sum(not one.continues for one in steps) > 2
    apart = np.maximum(np.abs(state - found.state) / std, np.abs(of_law / std - 1.0)).max(axis=1)[kept]
    assert np.mean(apart < 1e-6) > 0.9
    assert np.max(apart) < 0.01
    last = np.array([not one.continues for one in steps[1:]] + [True])
    ends = last & kept & (found.valid_gauges > 0)
    assert np.all(np.abs(known.loads[ends] - found.loads[ends]) < 0.01 * found.loads_std[ends])
    assert np.mean(known.loads_std[kept] < 1.01 * found.loads_std[kept]) > 0.95


@pytest.mark.parametrize("case", [1, 2])
def test_the_last_sample_of_a_linear_map_is_the_core_s(case: int) -> None:
    inverse_map = whole_scaled_map(case, seed=4, n=24, n_states={1: 5, 2: 30}[case])
    found, known, steps = smoothed_samples(inverse_map, 1.0, **golden(f"scaled_case_{case}"))
    ends = np.array([not one.continues for one in steps[1:]] + [True]) & (found.health == 0)
    np.testing.assert_allclose(known.loads[ends], found.loads[ends], atol=1e-9 * np.nanmin(found.loads_std))
    np.testing.assert_allclose(known.loads_std[ends], found.loads_std[ends], rtol=1e-9)
    assert np.nanmedian(known.loads_std / found.loads_std) < {1: 0.99, 2: 0.9995}[case]


def test_a_series_of_a_linear_map_is_better_known() -> None:
    own = scaled_map(2, 5)
    held = replace(own, noise_std=np.sqrt(np.diagonal(own.gauge_covariance)))
    random, decay, k = np.random.default_rng(6), np.exp(-DT), 150
    columns = np.hstack([held.state_operator, held.error_strain])
    states = random.standard_normal((k, columns.shape[1]))
    for i in range(1, k):
        states[i] = decay * states[i - 1] + np.sqrt(1.0 - decay**2) * states[i]
    noise = random.standard_normal((k, held.n_gauges)) @ np.linalg.cholesky(held.gauge_covariance).T
    strain = held.mean_strain + states @ columns.T + noise
    loads = held.load_of_mean + states @ np.hstack([held.load_per_state, held.error_load]).T
    q = {"dynamic_pressure": NOMINAL, "dynamic_pressure_std": 0.0}
    found, known, _ = smoothed_samples(held, 1.0, strain, DT * np.arange(k), **q)
    assert np.mean(((known.loads - loads) / found.loads_std) ** 2) < np.mean(
        ((found.loads - loads) / found.loads_std) ** 2
    )
    assert np.all(known.loads_std <= found.loads_std * (1.0 + 1e-9))
    assert np.mean(np.abs(known.loads - loads) < 3.0 * known.loads_std) > 0.98


@pytest.mark.parametrize("seed", [0, 1])
def test_a_flight_is_better_known(seed: int) -> None:
    """With navigation: where p_inf is hardly known, deviations follow its estimate from sample to sample."""
    held = replace(scaled_map(2, 1, N_D), noise_std=np.full(N_D, NOISE_STD), manifold=flight_map(discrepancy=1e-3))
    i, random = np.arange(60), np.random.default_rng(seed)
    state = np.array([6.2, 0.09, -0.05, 8.6]) + np.stack([0 * i, 0.02 * np.sin(0.03 * i), 1e-4 * i, 0 * i], axis=1)
    exact = np.array([exact_response(mach, u, w, np.exp(log)) for mach, u, w, log in state])
    strain = exact[:, :N_D] + NOISE_STD * random.standard_normal((60, N_D))
    air = {"mach_number": state[:, 0] + 0.02, "static_pressure": 1.01 * np.exp(state[:, 3])}
    found, known, _ = smoothed_samples(held, 1.0, strain, DT * i, **air)
    scale, true = found.loads_std.mean(axis=0), exact[:, N_D:]
    assert np.mean(((known.loads - true) / scale) ** 2) < np.mean(((found.loads - true) / scale) ** 2)
    assert np.all(known.loads_std < 1.01 * found.loads_std)
    assert np.mean(np.abs(known.loads - true) < 3.0 * known.loads_std) > 0.98
    assert known.loads[-1] == pytest.approx(found.loads[-1], rel=1e-6)


def test_section_loads_that_combine_the_five() -> None:
    held = with_further(whole_flight_map())
    _, known, _ = smoothed_samples(held, 1.0, **flown(random_flight(held, 10, seed=8)))
    expected = known.loads @ COMBINATION.T
    np.testing.assert_allclose(known.other_loads, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())


def test_lost_temperature_sensors_cost_no_memory() -> None:
    held = warm_whole_map()
    samples = warm_flight(held, 30, seed=6, time_step=DT)
    temperature = np.array([one.temperature for one in samples])
    temperature[20:] = np.nan
    found, known, steps = smoothed_samples(held, 10.0, temperature=temperature, **flown(samples))
    assert all(one.continues for one in steps[1:])
    assert np.all(known.loads_std <= 1.001 * found.loads_std)


@pytest.mark.parametrize("settings", [{}, {"moment_station": 0.7, "reference_area": 0.3, "reference_length": 1.5}])
def test_references_of_the_settings_count(settings: dict[str, float]) -> None:
    held = whole_flight_map()
    samples = flown(random_flight(held, 4, seed=2))
    base = Estimator(held)
    estimator = base.with_settings(replace(base.settings, **settings)).filter(1.0)
    found = estimator.track(**samples)
    smoother = smoother_of(estimator)
    steps = smoother.steps(found, samples["time"], np.nan)
    known = smoother.estimates(found, steps, smoothed(steps))
    for name in ("loads", "coefficients", "loads_std", "coefficients_std"):
        np.testing.assert_allclose(getattr(known, name)[-1], getattr(found, name)[-1], rtol=1e-6, err_msg=name)


def test_samples_that_the_core_does_not_filter_stay() -> None:
    """Those with a flow parameter of a stated deviation; before and behind them are segments of their own."""
    held = with_errors_of_parameters(with_parameter_tables(whole_flight_map()))
    samples = flown(random_flight(held, 9, seed=3))
    name = Estimator(held).parameters.names[0]
    std = np.full(9, np.nan)
    std[4:6] = 0.05
    found, known, steps = smoothed_samples(
        held, 1.0, parameters={name: np.zeros(9)}, parameters_std={name: std}, **samples
    )
    continues = np.array([one.continues for one in steps])
    assert not continues[4:7].any()
    assert [one.of_loads is None for one in steps] == [4 <= k < 6 for k in range(9)]
    np.testing.assert_array_equal(known.loads[4:6], found.loads[4:6])
    assert np.all(known.loads[:3] != found.loads[:3])
