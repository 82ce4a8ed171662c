"""Laws of the filters over time: states of linear and nonlinear maps, and the errors of what gauges read.

A filter estimates errors of pressure in the directions that gauges see, errors that gauges have in common and
errors of the amplitudes of temperature modes. Other errors that last are considered: they count in the gain and in
the covariance, and are never estimated. What is left is independent from sample to sample. Covariances of all
together are those that the estimator takes for the errors of one sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.proportional_errors import PAIRS
from strainfmu.estimator.numerics.fixed_order import product
from strainfmu.estimator.other_loads import FIVE_LOADS, OTHER_LOADS
from strainfmu.estimator.tables.manifold_map import ManifoldMap

LARGEST_NUMBER = 18
"""Directions of errors of pressure that are estimated over time."""

SMALLEST_SIZE = 0.2
"""Size of a direction in standard deviations of the other errors, below which it is not estimated."""

COMMON_SIZE, COMMON_FRACTION = 1.0, 0.3
"""Variance over that of the noise, and fraction of the sum of all, from which an error is one that gauges have in
common."""

_FAINT = 1e-9
"""Variance of an error over the largest, or over that of the noise, below which it is round-off."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenErrors:
    """Errors of pressure of unit variance that are estimated, and the covariance of the rest.

    Attributes
    ----------
    strain, load : (n_d, r), (5, r) per standard deviation of the r directions.
    rest_strain, rest_load : (n_d, n_d), (5, 5) covariances of the rest.
    rest_cross : (5, n_d) covariance of loads with strain of the rest.
    """

    strain: FloatArray
    load: FloatArray
    rest_strain: FloatArray
    rest_load: FloatArray
    rest_cross: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenOthers:
    """Errors of pressure in the m loads behind the five, by the directions that gauges see and the rest.

    Attributes
    ----------
    load : (m, r) per standard deviation of the r directions, per p_inf [m2, m3].
    rest_cross : (m, n_d) covariance with strain of the rest, per p_inf^2.
    rest_variance : (m,) of the rest, per p_inf^2.
    """

    load: FloatArray
    rest_cross: FloatArray
    rest_variance: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearLaw:
    """States and errors of a linear map; what scales with q_inf is at its nominal value.

    The states are s = (q, c, e, da): pressure states of the map, errors that scale with q_inf in the directions
    that gauges see, errors that gauges have in common and that do not scale, and errors of the amplitudes of
    temperature modes. Their stationary law is the prior of the map. The states of Case 1 have none: each takes the
    amplitude at which it alone reaches the largest strains of the snapshots.

    Attributes
    ----------
    std : (n,) of the stationary law of the states.
    scales : (n,) which states scale with q_inf.
    n_modes : number of temperature modes, the last states.
    strain, load : (n_d, n), (5, n) of each state.
    seen : errors that scale.
    noise : (n_d,) variance of what is independent from sample to sample.
    own : (n_d, k) errors that last, are not estimated and do not follow q_inf, of unit variance.
    rest : (n_d, k') those that follow it.
    """

    std: FloatArray
    scales: BoolArray
    n_modes: int
    strain: FloatArray
    load: FloatArray
    seen: SeenErrors
    noise: FloatArray
    own: FloatArray
    rest: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightLaw:
    """Errors of a nonlinear map, which with the flight state, its rates and errors of air data are its states.

    Attributes
    ----------
    seen : errors of pressure per p_inf [1/Pa, m2, m3].
    noise : (n_d, n_d) covariance of what does not scale and is independent from sample to sample.
    common : (n_d, c) errors that gauges have in common and that do not follow strain, those of modes last.
    n_modes : number of temperature modes.
    of_gauge : (n_d, t, 6) errors of each gauge that last, per p_inf and c of
        :class:`~strainfmu.estimator.tables.manifold_map.ManifoldMap` [1/Pa].
    own : (n_d,) standard deviation of what lasts in each gauge and does not follow strain.
    others : errors of the loads behind the five.
    """

    seen: SeenErrors
    noise: FloatArray
    common: FloatArray
    n_modes: int
    of_gauge: FloatArray
    own: FloatArray
    others: SeenOthers


def linear_law(inverse_map: InverseMap) -> LinearLaw:
    """Return the law of the filter of ``inverse_map``, a linear map."""
    thermal, modes = inverse_map.thermal, inverse_map.thermal.linear_strain
    noise, common, lasting = white_and_lasting(thermal.isothermal_covariance, inverse_map.noise_std)
    n_modes, common = modes.shape[1], np.hstack([common, modes])
    other = np.sqrt(noise + np.diagonal(lasting))
    seen = seen_errors(inverse_map.error_strain, inverse_map.error_load[FIVE_LOADS], 1.0, other)
    of_states, n_scaled = inverse_map.state_operator, inverse_map.state_operator.shape[1] + seen.strain.shape[1]
    std = np.ones(n_scaled + common.shape[1])
    if inverse_map.case == 1:
        reached = np.maximum(inverse_map.strain_range, inverse_map.noise_std)
        largest = np.max(np.abs(of_states) / reached[:, None], axis=0)
        std[: of_states.shape[1]] = 1.0 / largest
    std[len(std) - n_modes :] = thermal.prior_std
    none = np.zeros((5, common.shape[1]))
    return LinearLaw(
        std=std,
        scales=np.arange(len(std)) < n_scaled,
        n_modes=n_modes,
        strain=np.hstack([of_states, seen.strain, common]),
        load=np.hstack([inverse_map.load_per_state[FIVE_LOADS], seen.load, none]),
        seen=seen,
        noise=noise,
        own=_root(lasting, noise),
        rest=_root(seen.rest_strain, noise),
    )


def flight_law(inverse_map: InverseMap, manifold: ManifoldMap) -> FlightLaw:
    """Return the law of the filter of ``manifold``, the tables of ``inverse_map``."""
    thermal = inverse_map.thermal
    covariance = thermal.isothermal_covariance if inverse_map.has_temperature else manifold.gauge_covariance
    noise, common, lasting = white_and_lasting(covariance, inverse_map.noise_std)
    std = np.sqrt(noise + np.diagonal(lasting))
    # What is left beside a diagonal that dominates is a covariance (Gershgorin).
    beside = np.sum(np.abs(lasting), axis=1) - np.diagonal(lasting)
    own = np.sqrt(np.maximum(np.diagonal(lasting) - beside, 0.0))
    middle_pressure = float(np.exp(np.log(manifold.pressure_range).mean()))
    seen = seen_errors(manifold.error_strain, manifold.error_load[FIVE_LOADS], middle_pressure, std)
    modes = thermal.linear_strain
    return FlightLaw(
        seen=seen,
        noise=np.diag(noise - own**2) + lasting,
        common=np.hstack([common, modes]),
        n_modes=modes.shape[1],
        of_gauge=gauge_terms(manifold.gauge_error_product),
        own=own,
        others=seen_others(manifold, seen, std),
    )


def seen_errors(error_strain: FloatArray, error_load: FloatArray, scale: float, std: FloatArray) -> SeenErrors:
    """Split the errors ``error_strain`` (n_d, k), ``error_load`` (5, k) by what gauges see of them.

    ``scale`` times the errors is their usual size, ``std`` (n_d,) the standard deviation of the other errors of
    each gauge.
    """
    _, size, turn = np.linalg.svd(scale * error_strain / std[:, None], full_matrices=True)
    number = min(LARGEST_NUMBER, int(np.sum(size > SMALLEST_SIZE)))
    kept, rest = turn[:number].T, turn[number:].T
    strain, load = error_strain @ rest, error_load @ rest
    return SeenErrors(
        strain=error_strain @ kept,
        load=error_load @ kept,
        rest_strain=strain @ strain.T,
        rest_load=load @ load.T,
        rest_cross=load @ strain.T,
    )


def seen_others(manifold: ManifoldMap, seen: SeenErrors, std: FloatArray) -> SeenOthers:
    """Split the errors of the loads behind the five as ``seen`` splits those of strain.

    ``std`` (n_d,) is the argument of :func:`seen_errors`. The strains of its directions over it are orthogonal:
    the covariance of a load with strain gives the load of each direction.
    """
    direction = seen.strain / std[:, None]
    square = np.sum(direction * direction, axis=0)
    cross, variance = errors_of_others(manifold)
    load = (cross / std) @ (direction / np.where(square > 0.0, square, 1.0))
    return SeenOthers(
        load=load,
        rest_cross=cross - load @ seen.strain.T,
        # Of a load that the directions determine wholly, rounding leaves less.
        rest_variance=np.maximum(variance - np.sum(load * load, axis=1), 0.0),
    )


def errors_of_others(manifold: ManifoldMap) -> tuple[FloatArray, FloatArray]:
    """Return (m, n_d) covariance with strain, and (m,) variance, of the loads behind the five, per p_inf^2."""
    load = manifold.error_load[OTHER_LOADS]
    return product(load, manifold.error_strain.T), np.sum(load * load, axis=1)


def white_and_lasting(covariance: FloatArray, noise_std: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Split the gauges' ``covariance`` (n_d, n_d), noise of ``noise_std`` (n_d,) and errors that last.

    Returns the variances (n_d,) of the noise, columns (n_d, c) of errors that gauges have in common, and the
    covariance (n_d, n_d) of the other errors that last.
    """
    turned = covariance / (noise_std[:, None] * noise_std)
    size, vector = np.linalg.eigh(turned)
    # A covariance below that of the noise has less noise than stated.
    white = min(1.0, float(size[0]))
    size = np.maximum(size - white, 0.0)
    common = size > max(COMMON_SIZE, COMMON_FRACTION * float(size.sum()))
    columns = noise_std[:, None] * vector * np.sqrt(size)
    rest = columns[:, ~common]
    return white * noise_std**2, columns[:, common], rest @ rest.T


def gauge_terms(product: FloatArray) -> FloatArray:
    """Return (n_d, t, 6) errors D of each gauge whose products are ``product`` (21, n_d), see ``ManifoldMap``."""
    first, second = np.array(PAIRS).T
    whole = np.zeros((product.shape[1], 6, 6))
    half = np.where(first == second, 1.0, 0.5)[:, None] * product
    whole[:, first, second] = whole[:, second, first] = half.T
    size, vector = np.linalg.eigh(whole)
    terms = np.swapaxes(vector, 1, 2) * np.sqrt(np.maximum(size, 0.0))[:, :, None]
    seen = np.max(size, axis=0) > _FAINT * max(float(np.max(size, initial=0.0)), 1e-300)
    return np.asarray(terms[:, seen])


def _root(covariance: FloatArray, noise: FloatArray) -> FloatArray:
    """Return columns (n_d, k) whose products with themselves add up to ``covariance`` (n_d, n_d)."""
    std = np.sqrt(noise)
    size, vector = np.linalg.eigh(covariance / (std[:, None] * std))
    counts = size > _FAINT
    return np.asarray(std[:, None] * vector[:, counts] * np.sqrt(size[counts]))
