"""States of the filter of a linear map, and what strain reads of them.

The states are s = (q, c, e, da): pressure states of the map, errors that scale with q_inf in the directions that
gauges see, errors that gauges have in common and that do not, and errors of the amplitudes of temperature modes.
Their stationary law is the prior of the map.
The states of Case 1 have none: each takes the amplitude at which it alone reaches the largest strains of the
snapshots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.filter.kalman import Law, Measurement, Transition
from strainfmu.estimator.filter.motion import decaying
from strainfmu.estimator.filter.seen_errors import SeenErrors, seen_errors, white_and_lasting
from strainfmu.estimator.filter.settings import SLOW, FilterSettings
from strainfmu.estimator.filter.warm import WarmSample, isothermal_covariance, mode_columns, not_warm
from strainfmu.estimator.map.inverse_map import InverseMap

_ROUND_OFF = 1e-9
"""Variance of an error over that of the noise below which it is round-off."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearModel:
    """States and errors of a linear map; what scales with q_inf is at its nominal value.

    Attributes
    ----------
    settings : of the filter.
    std : (n,) of the stationary law of the states.
    slow : (n,) which states last as hardware errors do.
    warm : what is known of the temperature modes without sensors; errors of their amplitudes are the last states.
    fixed : (n_d + 5,) strain and loads that do not follow q_inf.
    mean : (n_d + 5,) those of the mean pressure that do.
    scaled : (n_d + 5, n) of the states that scale with q_inf; zero for the others.
    common : (n_d, n) of those that do not.
    seen : errors that scale.
    noise : (n_d,) variance of what is independent from sample to sample.
    own : (n_d, k) errors that last, are not estimated and do not follow q_inf, of unit variance.
    rest : (n_d, k') those that follow it.
    """

    settings: FilterSettings
    std: FloatArray
    slow: BoolArray
    warm: WarmSample
    fixed: FloatArray
    mean: FloatArray
    scaled: FloatArray
    common: FloatArray
    seen: SeenErrors
    noise: FloatArray
    own: FloatArray
    rest: FloatArray

    @property
    def n_modes(self) -> int:
        """Number of temperature modes."""
        return len(self.warm.amplitude)

    @property
    def n_gauges(self) -> int:
        """Number of gauges n_d."""
        return len(self.noise)

    @property
    def n_considered(self) -> int:
        """Number of errors that are considered and not estimated."""
        return self.own.shape[1] + self.rest.shape[1]


def linear_model(inverse_map: InverseMap, settings: FilterSettings) -> LinearModel:
    """Return the model of ``inverse_map``.

    Raises
    ------
    InputError
        The map is in form "absolute".
    """
    errors, load_of_errors = inverse_map.error_strain, inverse_map.error_load
    noise, common, lasting = white_and_lasting(isothermal_covariance(inverse_map), inverse_map.noise_std)
    warm = not_warm(inverse_map.thermal)
    n_modes = len(warm.amplitude)
    common = np.hstack([common, mode_columns(inverse_map)])
    seen = seen_errors(errors, load_of_errors, 1.0, np.sqrt(noise + np.diagonal(lasting)))
    of_states, n_d = inverse_map.state_operator, inverse_map.n_gauges
    n_q, r, n_c = of_states.shape[1], seen.strain.shape[1], common.shape[1]
    std = np.ones(n_q + r + n_c)
    if inverse_map.case == 1:
        std[:n_q] = 1.0 / np.max(np.abs(of_states) / inverse_map.strain_range[:, None], axis=0)
    std[len(std) - n_modes :] = np.sqrt(np.diagonal(warm.covariance))
    scaled = np.zeros((n_d + 5, n_q + r + n_c))
    scaled[:n_d, :n_q], scaled[n_d:, :n_q] = of_states, inverse_map.load_per_state
    scaled[:n_d, n_q : n_q + r], scaled[n_d:, n_q : n_q + r] = seen.strain, seen.load
    of_common = np.zeros((n_d, n_q + r + n_c))
    of_common[:, n_q + r :] = common
    zero = np.zeros(n_d), np.zeros(5)
    fixed = [
        none if value is None else value
        for value, none in zip((inverse_map.fixed_strain, inverse_map.fixed_load), zero, strict=True)
    ]
    of_fixed = np.concatenate(fixed)
    return LinearModel(
        settings=settings,
        std=std,
        slow=(np.arange(len(std)) >= n_q + r) & (np.arange(len(std)) < len(std) - n_modes),
        warm=warm,
        fixed=of_fixed,
        mean=np.concatenate([inverse_map.mean_strain, inverse_map.load_of_mean]) - of_fixed,
        scaled=scaled,
        common=of_common,
        seen=seen,
        noise=noise,
        own=_root(lasting, noise),
        rest=_root(seen.rest_strain, noise),
    )


def _root(covariance: FloatArray, noise: FloatArray) -> FloatArray:
    """Return columns (n_d, k) whose products with themselves add up to ``covariance`` (n_d, n_d)."""
    std = np.sqrt(noise)
    size, vector = np.linalg.eigh(covariance / (std[:, None] * std))
    counts = size > _ROUND_OFF
    return np.asarray(std[:, None] * vector[:, counts] * np.sqrt(size[counts]))


def linear_transition(model: LinearModel, time_step: float, warm: WarmSample) -> Transition:
    """Return the step over ``time_step`` [s], to a sample of which ``warm`` is known of the temperature."""
    slow = SLOW * model.settings.time_constant
    time_constant = np.where(model.slow, slow, model.settings.time_constant)
    covariance, first = np.diag(model.std**2), len(model.std) - model.n_modes
    covariance[first:, first:] = warm.covariance
    return Transition(
        matrix=np.diag(decaying(time_constant, time_step)),
        mean=np.zeros(len(model.std)),
        covariance=covariance,
        considered=float(np.exp(-time_step / model.settings.time_constant)),
    )


def linear_measurement(
    model: LinearModel, strain: FloatArray, used: BoolArray, *, ratio: float, law: Law
) -> Measurement:
    """Return the rows of the gauges ``used`` (n_d,) of ``strain`` (n_d,), at ``ratio`` of q_inf to nominal."""
    n_d = model.n_gauges
    jacobian = ratio * model.scaled[:n_d] + model.common
    apart = strain - model.fixed[:n_d] - ratio * model.mean[:n_d] - jacobian @ law.mean
    # Each error keeps its columns at every q_inf, so that its covariance with the states goes on.
    return Measurement(
        innovation=apart[used],
        jacobian=jacobian[used],
        considered=np.hstack([model.own, ratio * model.rest])[used],
        noise=np.diag(model.noise[used]),
    )


def linear_loads(
    model: LinearModel, strain: FloatArray, used: BoolArray, *, ratio: float, law: Law
) -> tuple[FloatArray, FloatArray]:
    """Return loads (5,) and covariance (5, 5) at ``law``, about the moment point of the map."""
    n_d = model.n_gauges
    rows = linear_measurement(model, strain, used, ratio=ratio, law=law)
    cross = ratio**2 * model.seen.rest_cross[:, used]
    turned = np.linalg.solve(rows.considered @ rows.considered.T + rows.noise, cross.T).T
    by_state = ratio * model.scaled[n_d:]
    loads = model.fixed[n_d:] + ratio * model.mean[n_d:] + by_state @ law.mean + turned @ rows.innovation
    of_loads = by_state - turned @ rows.jacobian
    remaining = ratio**2 * model.seen.rest_load - turned @ cross.T
    return loads, of_loads @ law.covariance @ of_loads.T + remaining
