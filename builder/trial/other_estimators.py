"""Estimators that are no part of a map: a Kalman filter whose states walk at random, and learning estimators of
scikit-learn, which are trained on flights that the tables and errors of the nonlinear estimator give.

So every estimator of a comparison knows the same of flows and errors. The filter, on a linear map of Case 2, is
the estimator of load from strain that many works use: d = d_0 + s (m - d_0 + A q) + e with q + w in the next
cycle, e and w white. The states are standard normal when a flight begins. What is not white, as the error of a
gain, is the same in all cycles, and the filter takes it for noise that averages out.

Learning estimators have no covariance. Their bands come from split conformal prediction (Lei et al., J. Am. Stat.
Assoc. 113, 2018): the quantile of the absolute residual over flights that they were not trained on."""

from __future__ import annotations

from importlib import import_module
from math import ceil
from time import perf_counter
from typing import Any

import numpy as np

from builder.processors import one_thread_of_blas
from builder.trial.estimators import EstimateReadings, Estimates
from builder.trial.readings import ANGLES, Readings
from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, pressure_and_temperature
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.map.inverse_map import PAIRS, InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.air import air_data_at


def training_flights(
    manifold: ManifoldMap, altitudes_km: tuple[float, float], count: int, random: np.random.Generator
) -> Readings:
    """Return ``count`` flights, uniform in Mach number, ln p_inf and the disc of total incidence.

    Where the tables have ranges of u and w, it draws from these instead of the disc. ``altitudes_km`` are the
    lowest and highest. The truth (k, 7) is the coefficients [1], angle of attack and sideslip [rad].
    """
    state = np.empty((count, 4))
    if manifold.crossflow_range is None:
        incidence = manifold.incidence_limit * np.sqrt(random.uniform(0.0, 1.0, count))
        roll = random.uniform(0.0, 2.0 * np.pi, count)
        state[:, U], state[:, W] = incidence * np.cos(roll), incidence * np.sin(roll)
    else:
        low, high = manifold.crossflow_range.T
        state[:, [U, W]] = low + (high - low) * random.uniform(size=(count, 2))
    state[:, MACH] = random.uniform(manifold.mach_range[0], manifold.mach_range[1], count)
    high, low = (np.log(pressure_and_temperature(1e3 * height)[0]) for height in altitudes_km)
    state[:, LOG_PRESSURE] = random.uniform(low, high, count)
    response, n_d = evaluate(manifold.tables, state).value, manifold.tables.n_gauges
    pressure, mach = np.exp(state[:, LOG_PRESSURE]), state[:, MACH]
    strain, loads = with_drawn_errors(
        manifold=manifold,
        pressure=pressure,
        strain=response[:, :n_d],
        loads=response[:, n_d:],
        random=random,
    )
    dynamic = 0.5 * HEAT_CAPACITY_RATIO * mach**2 * pressure
    known = {
        DYNAMIC_PRESSURE: dynamic * (1.0 + manifold.dynamic_pressure_error * random.standard_normal(count)),
        MACH_NUMBER: mach + manifold.mach_number_error * random.standard_normal(count),
    }
    truth = np.hstack([loads / (dynamic[:, None] * manifold.references), air_data_at(state)[:, :2]])
    number = np.arange(count)
    return Readings(strain=strain, known=known, truth=truth, vehicle=number, flight=number)


def with_drawn_errors(
    manifold: ManifoldMap,
    pressure: FloatArray,
    strain: FloatArray,
    loads: FloatArray,
    random: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Return ``strain`` (k, n_d) and ``loads`` (k, 5) of the tables at ``pressure`` (k,) with all errors drawn.

    Strain then has the covariance of :func:`~strainfmu.estimator.reference.nonlinear.strain_covariance`.
    """
    k, n_d = strain.shape
    p = pressure[:, None]

    def normal(n: int) -> FloatArray:
        return random.standard_normal((k, n))

    discrepancy = normal(manifold.error_strain.shape[1])
    c = np.hstack([np.ones((k, 1)), loads / (p * manifold.references)])
    first, second = np.array(PAIRS).T
    of_gauge = np.sqrt(np.maximum((c[:, first] * c[:, second]) @ manifold.gauge_error_product, 0.0))
    common = np.einsum("ka,tan,kt->kn", c, manifold.common_error, normal(len(manifold.common_error)))
    root = np.linalg.cholesky(manifold.gauge_covariance)
    read = (
        strain * (1.0 + manifold.gain_std * normal(n_d) + manifold.common_gain * normal(1))
        + p * (of_gauge * normal(n_d) + common + discrepancy @ manifold.error_strain.T)
        + normal(n_d) @ root.T
    )
    return read, loads + p * (discrepancy @ manifold.error_load[FIVE_LOADS].T)


STEP_STD = 0.1
"""Standard deviation of the walk in one cycle, over the prior's: at 100 Hz it reaches the prior's in 1 s."""

State = tuple[FloatArray, FloatArray]
"""Mean (k, n_q) and covariance (k, n_q, n_q) of the states of k flights."""


def of_random_walk(inverse_map: InverseMap) -> EstimateReadings:
    """Return the filter on ``inverse_map``, of Case 2 and form "dynamic_pressure", fed with all readings of a
    flight; its estimates are the ones after the last."""

    def estimate(read: Readings) -> Estimates:
        q = np.asarray(read.known[DYNAMIC_PRESSURE])
        ratio, state = q / inverse_map.nominal_dynamic_pressure, before_readings(inverse_map, len(q))
        for strain in np.swapaxes(read.strain, 0, 1):
            state = after_reading(inverse_map, state, strain, ratio)
        return _loads_of(inverse_map, state, q)

    return estimate


def before_readings(inverse_map: InverseMap, k: int) -> State:
    """Return the states before the first reading of ``k`` flights."""
    n = inverse_map.state_operator.shape[1]
    return np.zeros((k, n)), np.broadcast_to(np.eye(n), (k, n, n))


def after_reading(inverse_map: InverseMap, state: State, strain: FloatArray, ratio: FloatArray) -> State:
    """Return the states after ``strain`` (k, n_d) at ``ratio`` (k,) of q_inf to the nominal one."""
    mean, s, fixed = state[0], ratio[:, None, None], inverse_map.fixed_strain
    operator, error = s * inverse_map.state_operator, inverse_map.error_strain
    covariance = state[1] + STEP_STD**2 * np.eye(mean.shape[1])
    cross = covariance @ np.swapaxes(operator, 1, 2)
    of_strain = operator @ cross + inverse_map.gauge_covariance + s * s * (error @ error.T)
    gain = np.swapaxes(np.linalg.solve(of_strain, np.swapaxes(cross, 1, 2)), 1, 2)
    expected = fixed + ratio[:, None] * (inverse_map.mean_strain - fixed) + (operator @ mean[:, :, None])[:, :, 0]
    mean = mean + (gain @ (strain - expected)[:, :, None])[:, :, 0]
    return mean, covariance - gain @ np.swapaxes(cross, 1, 2)


def _loads_of(inverse_map: InverseMap, state: State, q: FloatArray) -> Estimates:
    """Return the coefficients of states at a dynamic pressure ``q`` (k,) [Pa]."""
    mean, covariance = state
    s = (q / inverse_map.nominal_dynamic_pressure)[:, None]
    fixed, error = inverse_map.fixed_load[FIVE_LOADS], inverse_map.error_load[FIVE_LOADS]
    of_mean, per_state = inverse_map.load_of_mean[FIVE_LOADS], inverse_map.load_per_state[FIVE_LOADS]
    loads = fixed + s * (of_mean - fixed + mean @ per_state.T)
    of_loads = (s * s)[:, :, None] * (per_state @ covariance @ per_state.T + error @ error.T)
    scale = 1.0 / (q[:, None] * inverse_map.references[FIVE_LOADS])
    value = scale * loads
    variance = (
        scale**2 * np.diagonal(of_loads, axis1=1, axis2=2) + (inverse_map.dynamic_pressure_error * value) ** 2
    )
    return Estimates(value=value, std=np.sqrt(variance))


LEVEL = 0.9973
"""Probability of 3 sigma of a normal error."""

COST_TRAINING, COST_STEPS, COST_ALTITUDES_KM = 500, 31, (15.0, 28.0)
"""Flights that each learns from where its time per step is measured, which hardly depends on them; and steps that
the time is the median of."""


REGRESSIONS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "regression tree": ("tree", "DecisionTreeRegressor", {"min_samples_leaf": 3}),
    "random forest": (
        "ensemble",
        "RandomForestRegressor",
        {"n_estimators": 50, "max_features": 0.3, "min_samples_leaf": 2},
    ),
    "gradient boosting": ("ensemble", "HistGradientBoostingRegressor", {"max_iter": 200}),
    "multi-layer perceptron": (
        "neural_network",
        "MLPRegressor",
        {"hidden_layer_sizes": (64, 64), "max_iter": 150, "tol": 1e-6, "early_stopping": True},
    ),
}
"""Module and class of scikit-learn, and its arguments."""


def regression(name: str, seed: int) -> Any:
    """Return a regression of several values, with ``fit`` and ``predict``."""
    module, kind, arguments = REGRESSIONS[name]
    model = getattr(import_module(f"sklearn.{module}"), kind)(**arguments, random_state=seed)
    of_one_value = kind == "HistGradientBoostingRegressor"
    return import_module("sklearn.multioutput").MultiOutputRegressor(model) if of_one_value else model


def conformal_half_width(residual: FloatArray) -> FloatArray:
    """Return (m,) half-widths of bands that hold a new value with :data:`LEVEL`; ``residual`` is (n, m).

    With fewer than 370 residuals there is no such band: it is infinite.
    """
    rank = ceil((len(residual) + 1) * LEVEL)
    if rank > len(residual):
        return np.full(residual.shape[1], np.inf)
    return np.asarray(np.sort(np.abs(residual), axis=0)[rank - 1])


def of_regression(name: str, training: Readings, calibration: Readings, seed: int) -> EstimateReadings:
    """Return a regression on strain over q_inf, ln q_inf and, where ``training`` gives it, Mach number; its bands
    are of ``calibration``. A third of a band stands for the standard deviation."""

    def features(read: Readings) -> FloatArray:
        q = np.asarray(read.known[DYNAMIC_PRESSURE])[:, None]
        mach = [np.asarray(read.known[MACH_NUMBER])[:, None]] if MACH_NUMBER in training.known else []
        return np.hstack([read.last / q, np.log(q), *mach])

    def scaled(read: Readings) -> FloatArray:
        return np.asarray((features(read) - feature_mean) / feature_std)

    def predicted(read: Readings) -> FloatArray:
        with one_thread_of_blas():
            return np.asarray(mean + std * model.predict(scaled(read)))

    def estimate(read: Readings) -> Estimates:
        value = predicted(read)
        bands = np.broadcast_to(half_width / 3.0, value.shape)
        angles = {name: (value[:, 5 + k], bands[:, 5 + k]) for k, name in enumerate(ANGLES)}
        return Estimates(value=value[:, :5], std=bands[:, :5], others=angles)

    known = features(training)
    feature_mean, feature_std = known.mean(axis=0), known.std(axis=0)
    mean, std, model = training.truth.mean(axis=0), training.truth.std(axis=0), regression(name, seed)
    with one_thread_of_blas():
        model.fit(scaled(training), (training.truth - mean) / std)
    half_width = conformal_half_width(calibration.truth - predicted(calibration))
    return estimate


def step_costs(manifold: ManifoldMap, seed: int = 1) -> dict[str, float]:
    """Return the median time per step [s] of each regression, in Python; needs scikit-learn."""
    random = np.random.default_rng(seed)
    training, calibration = (
        training_flights(manifold, COST_ALTITUDES_KM, count, random)
        for count in (COST_TRAINING, COST_TRAINING // 4)
    )
    one = calibration.rows(slice(1))

    def cost(name: str) -> float:
        estimate, times = of_regression(name, training, calibration, seed), list[float]()
        for _ in range(1 + COST_STEPS):
            start = perf_counter()
            estimate(one)
            times.append(perf_counter() - start)
        return float(np.median(times[1:]))

    return {f"{name} of scikit-learn, trained on {COST_TRAINING:,} flights": cost(name) for name in REGRESSIONS}
