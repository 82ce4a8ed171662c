"""A map whose gauges err by more than it was built for, in ways that do not scale with the dynamic pressure.

Gamma grows by D, and in form "dynamic_pressure" the gauges' own Gamma_g as well: Gamma' = Gamma + D. Gain and
whitening are computed again. The load that no state holds keeps its covariance with strain, X. Of its own
covariance, what strain does not tell grows: S' = S + X' Gamma^-1 X - X' Gamma'^-1 X.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.further_errors import with_noise_of
from strainfmu.estimator.map.innovation import estimate_gain, innovation_whitening, inverse_cholesky
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.load_errors import LoadErrorModel, load_error_covariance, load_error_model, load_gain


def with_added_noise(inverse_map: InverseMap, covariance: FloatArray) -> InverseMap:
    """Return ``inverse_map`` for gauges with further errors of ``covariance`` (n_d, n_d) [(m/m)^2].

    Ranges and alarm scales stay. No further error gives the same map.

    Raises
    ------
    InputError
        The sum is no covariance.
    """
    if not covariance.any():
        return inverse_map
    own, flight, thermal = inverse_map.gauge_covariance, inverse_map.manifold, inverse_map.thermal
    found = _with_noise(
        inverse_map,
        inverse_map.noise_covariance + covariance,
        own=None if own is None else own + covariance,
        of_flight=None if flight is None else flight.gauge_covariance + covariance,
    )
    if thermal is None:
        return found
    isothermal = thermal.isothermal_covariance + covariance
    return replace(found, thermal=replace(thermal, isothermal_covariance=isothermal))


def with_gauge_covariance(inverse_map: InverseMap, own: FloatArray) -> InverseMap:
    """Return ``inverse_map`` for gauges whose errors that do not scale have the covariance ``own`` (n_d, n_d).

    Raises
    ------
    InputError
        The map is in form "absolute", or ``own`` is no covariance.
    """
    _, error, _ = inverse_map.scaled_parts
    return _with_noise(inverse_map, own + error @ error.T, own=own, of_flight=own)


def _with_noise(
    held: InverseMap, gamma: FloatArray, *, own: FloatArray | None, of_flight: FloatArray | None
) -> InverseMap:
    """Return ``held`` with the covariances Gamma, Gamma_g, and that of the gauges about the tables."""
    gain = estimate_gain(held.state_operator, gamma, held.regularisation)
    changed: dict[str, Any] = {
        "noise_covariance": gamma,
        "strain_gain": gain,
        "state_offset": -gain @ held.mean_strain,
        "residual_whitening": innovation_whitening(held.state_operator, gamma, float(held.case == 2)),
        "load_covariance": _load_covariance(held, gamma, gain),
    }
    if own is not None:
        changed["gauge_covariance"] = own
    if held.manifold is not None and of_flight is not None:
        changed["manifold"] = replace(held.manifold, gauge_covariance=of_flight)
    return with_noise_of(held, replace(held, **changed))


def _load_covariance(held: InverseMap, gamma: FloatArray, strain_gain: FloatArray) -> FloatArray:
    """Return (5, 5) the covariance of the loads with ``gamma`` (n_d, n_d) and the gain made for it."""
    cross = held.strain_load_covariance
    x = np.zeros((held.n_gauges, 5)) if cross is None else cross
    before = load_error_model(
        load_covariance=held.load_covariance,
        state_operator=held.state_operator,
        noise_covariance=held.noise_covariance,
        load_per_state=held.load_per_state,
        load_gain=held.load_gain,
        strain_load_covariance=cross,
        known_prior=held.case == 2,
    )
    whitening = inverse_cholesky(gamma)
    regression = (whitening @ x).T
    model = LoadErrorModel(
        noise_root=np.asarray(np.linalg.cholesky(gamma), dtype=np.float64),
        regression=regression,
        remainder=before.remainder + before.regression @ before.regression.T - regression @ regression.T,
        state_operator=held.state_operator,
        load_per_state=held.load_per_state,
        known_prior=held.case == 2,
    )
    gain = load_gain(
        load_per_state=held.load_per_state,
        strain_gain=strain_gain,
        state_operator=held.state_operator,
        noise_whitening=whitening,
        strain_load_covariance=cross,
    )
    return load_error_covariance(model, gain)
