"""Flights that learning estimators are trained on: drawn from the tables and errors of the nonlinear estimator.

So every estimator of a comparison knows the same of flows and errors.
"""

from __future__ import annotations

import numpy as np

from builder.trial.readings import Readings
from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, pressure_and_temperature
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER
from strainfmu.estimator.map.proportional_errors import PAIRS
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.air import air_data_at
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap


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
