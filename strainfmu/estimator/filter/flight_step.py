"""One sample by the filter of the nonlinear estimator: iterations from a predicted law, and the estimate there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.filter.flight_model import (
    DISCREPANCY,
    ErrorColumns,
    FlightModel,
    SampleRows,
    error_columns,
    measurement,
)
from strainfmu.estimator.filter.further_step import PressureRow, StrainRows, further_solution
from strainfmu.estimator.filter.kalman import Law, Measurement, gain, given, measured
from strainfmu.estimator.manifold.gauss_newton import LARGEST_STEP, kept_in_reach
from strainfmu.estimator.manifold.load_solution import lognormal_std
from strainfmu.estimator.manifold.solve import FlightSolution
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, MACH, N_STATES, evaluate


@dataclass(frozen=True, kw_only=True, eq=False)
class FilteredSample:
    """A sample and what the filter makes of it.

    Attributes
    ----------
    law : of the states after the sample.
    solution : estimates, arrays with one row.
    """

    law: Law
    solution: FlightSolution


def filtered_sample(
    model: FlightModel,
    law: Law,
    sample: SampleRows,
    *,
    start: FloatArray,
    iterations: int,
    slopes: FloatArray | None = None,
) -> FilteredSample:
    """Return the estimate of ``sample`` from the predicted ``law``, by ``iterations`` from a flight state.

    ``start`` (4,) is that state, ``slopes`` (4,) that of the slopes; None for each iteration's own.

    As in the static estimator the errors are those at ``start``.
    """
    columns, state = error_columns(model, start), start
    for _ in range(iterations):
        rows = measurement(model, sample, columns, at=state, mean=law.mean, slopes=slopes)
        state = _stepped(model, law, rows, state)
    rows = measurement(model, sample, columns, at=state, mean=law.mean, slopes=slopes)
    update = measured(law, rows)
    mean, distance = given(update.law, N_STATES, state)
    found = Law(mean=mean, covariance=update.law.covariance, cross=update.law.cross)
    used, known = sample.used, sample.known
    residual, of_navigation = np.zeros(len(used)), np.zeros(len(known))
    standardised = update.weighted / np.sqrt(update.precision)
    residual[used], of_navigation[known] = np.split(standardised, [int(used.sum())])
    solution = flight_solution(
        model, found, sample, columns=columns, quality=(update.chi_square + distance, residual, of_navigation)
    )
    return FilteredSample(law=found, solution=solution)


def _stepped(model: FlightModel, law: Law, rows: Measurement, state: FloatArray) -> FloatArray:
    """Return (4,) the next flight state, its step limited as in the static estimator."""
    k, _ = gain(law, rows)
    step = law.mean[:N_STATES] + (k @ rows.innovation)[:N_STATES] - state
    size = float(np.max(np.abs(step) / LARGEST_STEP))
    return kept_in_reach(model.manifold, (state + step / max(size, 1.0))[None])[0]


def flight_solution(
    model: FlightModel,
    law: Law,
    sample: SampleRows,
    *,
    columns: ErrorColumns,
    quality: tuple[float, FloatArray, FloatArray],
) -> FlightSolution:
    """Return the estimates at ``law``, arrays with one row.

    Loads are those of the tables, those of the discrepancy that is estimated, and what the residual says of the
    rest. ``quality`` holds chi-square and the residuals of gauges and navigation.
    """
    manifold, used = model.manifold, sample.used
    n_d, n = manifold.tables.n_gauges, model.n_states
    state, covariance = law.mean[:N_STATES], law.covariance
    response, pressure = evaluate(manifold.tables, state[None]), float(np.exp(state[LOG_PRESSURE]))
    by_state = np.zeros((n_d + 5, n))
    by_state[:, :N_STATES] = response.jacobian[0]
    by_state[:n_d, DISCREPANCY:] = columns.strain
    by_state[n_d:, DISCREPANCY : model.hardware] = pressure * model.seen.load
    errors = law.mean.copy()
    errors[:N_STATES] = 0.0
    residual = (sample.strain - response.value[0, :n_d] - by_state[:n_d] @ errors)[used]
    noise = (columns.considered @ columns.considered.T + columns.noise)[np.ix_(used, used)]
    cross = pressure**2 * model.seen.rest_cross[:, used]
    turned = np.linalg.solve(noise, cross.T).T
    loads = response.value[0, n_d:] + by_state[n_d:] @ errors + turned @ residual
    of_loads = by_state[n_d:] - turned @ by_state[:n_d][used]
    remaining = pressure**2 * model.seen.rest_load - turned @ cross.T
    mach = float(state[MACH])
    dynamic = 0.5 * HEAT_CAPACITY_RATIO * mach * mach * pressure
    scale = 1.0 / (dynamic * manifold.references)
    coefficients = scale * loads
    of_pressure = np.zeros(n)
    of_pressure[MACH], of_pressure[LOG_PRESSURE] = 2.0 / mach, 1.0
    of_log = float(np.sqrt(of_pressure @ covariance @ of_pressure))
    # As in the static estimator: three deviations reach as far as those of ln q_inf.
    wider = float(lognormal_std(np.asarray(of_log)) / of_log) ** 2
    of_coefficients = scale[:, None] * of_loads - np.outer(coefficients, of_pressure)
    of_rest = scale[:, None] * remaining * scale
    chi_square, of_gauges, of_navigation = quality
    further = further_solution(
        manifold,
        model.further,
        covariance,
        state,
        used=used,
        strain=StrainRows(errors=errors, residual=residual, jacobian=by_state[:n_d][used], noise=noise),
        pressure=PressureRow(static=pressure, dynamic=dynamic, of_log=of_pressure, wider=wider),
        discrepancy=slice(DISCREPANCY, model.hardware),
    )
    return FlightSolution(
        state=state[None],
        state_covariance=covariance[None, :N_STATES, :N_STATES],
        loads=loads[None],
        load_covariance=(of_loads @ covariance @ of_loads.T + remaining)[None],
        coefficients=coefficients[None],
        coefficient_covariance=(wider * (of_coefficients @ covariance @ of_coefficients.T + of_rest))[None],
        chi_square=np.array([chi_square]),
        standardised_residual=of_gauges[None],
        navigation_residual=of_navigation[None],
        shape_residual=np.zeros((1, manifold.shapes.shape[1])),  # the filter estimates them
        rest=np.zeros(1),
        further_loads=further.loads,
        further_variance=further.variance,
        further_coefficients=further.coefficients,
        further_coefficient_variance=further.coefficient_variance,
    )
