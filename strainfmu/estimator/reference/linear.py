"""A linear map as a model of the update, and the loads of samples by it.

Form "dynamic_pressure" is ``eq:scaled-model`` as it stands: the scale s is q_inf over the nominal one, states
are free (Case 1) or columns (Case 2), as are errors that grow with the pressure. In form "absolute" s is 1; its
gain assumes a prior of covariance 1 / gamma (``eq:ls-solution``), its truth a prior of 1, and they may differ.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.reference.update import Model, condition, joseph, model_of, prepare


class LinearEstimate(NamedTuple):
    """Estimates of k samples; outputs are the five loads, behind them rolling moment and section loads.

    ``loads`` (k, m) [N, N m] and ``coefficients``, over q_inf S, moments over q_inf S L, have covariances
    (k, m, m), of which behind the five the variances alone hold. ``chi_square``, ``degrees_of_freedom`` and
    ``expected_ratio`` of the two are (k,), leave-one-out residuals ``standardised`` (k, n_d).
    """

    loads: FloatArray
    covariance: FloatArray
    coefficients: FloatArray
    coefficient_covariance: FloatArray
    chi_square: FloatArray
    degrees_of_freedom: FloatArray
    expected_ratio: FloatArray
    standardised: FloatArray


def models(inverse_map: InverseMap, at_nominal: bool = False) -> tuple[Model, Model]:
    """Return the model that the gain of ``inverse_map`` is made for, and the truth.

    The states of the first have the prior covariance 1 / gamma, the states of the second 1. ``at_nominal`` holds
    at s = 1 alone: errors of one gauge are noise, not a column each.
    """
    truth = _model(inverse_map, at_nominal)
    if inverse_map.case == 1 or inverse_map.regularisation == 1.0:
        return truth, truth
    std = np.ones(truth.columns.shape[1])
    std[: inverse_map.n_states] = 1.0 / np.sqrt(inverse_map.regularisation)
    return replace(truth, columns=std * truth.columns, output_columns=std * truth.output_columns), truth


def estimate(
    inverse_map: InverseMap,
    rows: FloatArray,
    used: BoolArray,
    dynamic_pressure: FloatArray,
    pressure_std: FloatArray,
    noise: FloatArray | None = None,
) -> LinearEstimate:
    """Return the estimates of k samples with the same rows in use.

    ``rows`` (k, n_d) are the rows of the map [m/m], of which the ``used`` (n_d,) count, ``dynamic_pressure`` and
    ``pressure_std`` (k,) q_inf and its standard deviation [Pa]. The covariance of what does not scale is ``noise``
    (n_d, n_d), as of :func:`~strainfmu.estimator.reference.readings.row_noise`, None for the map's.
    """
    for_gain, truth = models(inverse_map)
    if noise is not None:
        for_gain, truth = replace(for_gain, noise=noise), replace(truth, noise=noise)
    is_scaled, nominal = inverse_map.follows_pressure, inverse_map.nominal_dynamic_pressure
    s = dynamic_pressure / nominal if is_scaled else np.ones(len(rows))
    posterior = condition(prepare(for_gain, used), rows, s)
    residual = condition(prepare(truth, used), rows, s)

    scale = 1.0 / (dynamic_pressure[:, None] * inverse_map.references)
    loads, coefficients = posterior.mean, scale * posterior.mean
    added = (s * s)[:, None, None] * excess_covariance(inverse_map, coefficients[:, FIVE_LOADS])
    covariance = joseph(truth, posterior.gain, s, added)
    # At fixed weights the loads follow q_inf by the mean alone.
    slope = (truth.output_mean - posterior.gain @ truth.mean) / nominal if is_scaled else np.zeros(loads.shape)
    of_pressure = slope * pressure_std[:, None]
    of_both = scale * of_pressure - coefficients * (pressure_std / dynamic_pressure)[:, None]
    freedom = inverse_map.residual_degrees_of_freedom - int(np.sum(~used))
    expected = 1.0 + np.einsum("kij,kji->k", residual.precision, added) / max(freedom, 1)
    of_coefficients = scale[:, :, None] * covariance * scale[:, None] + _outer(of_both)
    of_fit = residual.chi_square, np.full(len(rows), freedom), np.maximum(expected, POLICIES.min_expected_ratio)
    covariance = covariance + _outer(of_pressure)
    return LinearEstimate(loads, covariance, coefficients, of_coefficients, *of_fit, residual.standardised)


def excess_covariance(inverse_map: InverseMap, coefficients: FloatArray) -> FloatArray:
    """Return (k, n_d, n_d) what errors in proportion to strain add to the covariance of rows at s = 1.

    ``eq:proportional``: those at ``coefficients`` C (k, 5) less their mean over the snapshots, which the weights
    hold.
    """
    of_each_gauge, products = excess_parts(inverse_map, coefficients)
    common = inverse_map.common_error
    shared = np.einsum("kab,tai,tbj->kij", products, common, common, optimize=True)
    return np.asarray(shared + of_each_gauge[:, :, None] * np.eye(inverse_map.n_gauges))


def excess_parts(inverse_map: InverseMap, coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (k, n_d) what :func:`excess_covariance` has of the gauges' own errors, and (k, 6, 6) the products of
    [1, C] less their mean, by which each common error counts."""
    of_gauge, mean = inverse_map.gauge_error_product, inverse_map.mean_product
    c = np.hstack([np.ones((len(coefficients), 1)), coefficients])
    first, second = np.triu_indices(6)
    at_mean = np.zeros((6, 6))
    at_mean[first, second] = at_mean[second, first] = mean
    products = c[:, :, None] * c[:, None, :] - at_mean
    return products[:, first, second] @ of_gauge, products  # of_gauge counts pairs a < b twice


def _model(inverse_map: InverseMap, at_nominal: bool) -> Model:
    noise, by_gauge = inverse_map.gauge_covariance, inverse_map.own_error_strain
    errors, load_of_errors = inverse_map.error_strain, inverse_map.error_load
    states, load_of_states = inverse_map.state_operator, inverse_map.load_per_state
    if at_nominal:
        noise = noise.copy()
        noise[np.diag_indices(len(by_gauge))] += by_gauge**2
    elif by_gauge.any():
        errors = np.hstack([np.diag(by_gauge), errors])
        load_of_errors = np.pad(load_of_errors, ((0, 0), (len(by_gauge), 0)))
    fixed_load, fixed = inverse_map.fixed_load, inverse_map.fixed_strain
    parts = {"fixed": fixed, "mean": inverse_map.mean_strain - fixed, "noise": noise}
    parts |= {"output_fixed": fixed_load, "output_mean": inverse_map.load_of_mean - fixed_load}
    if inverse_map.case == 1:
        parts |= {"free": states, "output_free": load_of_states}
    else:
        errors, load_of_errors = np.hstack([states, errors]), np.hstack([load_of_states, load_of_errors])
    return model_of(len(states), inverse_map.n_loads, **parts, columns=errors, output_columns=load_of_errors)


def _outer(values: FloatArray) -> FloatArray:
    return values[:, :, None] * values[:, None, :]
