"""Readings become rows of the model: zero offsets, scales of auxiliary sensors, and temperature of the wall.

A gauge reads (1 + g B a) (strain / (1 + m B a) + Phi a + p(B a)) + zero while the temperature modes of the wall
have the amplitudes a. Temperature sensors read theta = C a + e: the update gives a, and its covariance P. Readings
are corrected at a, which is not linear in it; the rest of the modes adds Phi P Phi' to the covariance of rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import ThermalMap
from strainfmu.estimator.reference.update import condition, model_of, prepare


@dataclass(frozen=True, kw_only=True, eq=False)
class Zeros:
    """Zero offsets of the strain gauges: ``value`` and ``std`` (n_s,), ``common_std`` of all together [m/m]."""

    value: FloatArray
    std: FloatArray
    common_std: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Amplitudes:
    """Amplitudes ``mean`` (k, n) of the temperature modes [K], and their ``covariance`` (n, n)."""

    mean: FloatArray
    covariance: FloatArray


def without_thrust(inverse_map: InverseMap, readings: FloatArray, thrust: FloatArray) -> FloatArray:
    """Return ``readings`` (k, n_d) less their response to ``thrust`` (k,) [N]; NaN takes out what responds."""
    response = inverse_map.sensors.thrust_response
    return np.asarray(readings - np.where(response != 0.0, thrust[:, None] * response, 0.0))


def rows_of(
    inverse_map: InverseMap,
    readings: FloatArray,
    thrust: FloatArray,
    zeros: Zeros | None = None,
    amplitude: FloatArray | None = None,
) -> FloatArray:
    """Return rows (k, n_d) [m/m] of ``readings`` (k, n_d) at the ``amplitude`` (k, n) of the temperature modes."""
    rows = without_thrust(inverse_map, readings, thrust) / inverse_map.sensors.scale
    if zeros is not None:
        rows = rows - np.pad(zeros.value, (0, inverse_map.n_gauges - len(zeros.value)))
    if amplitude is None:
        return rows
    thermal = inverse_map.thermal_and_inertia
    warmer = amplitude @ thermal.gauge_operator.T
    apparent = sum(
        coefficient * warmer ** (power + 1) for power, coefficient in enumerate(thermal.apparent_strain)
    )
    by_load = rows / (1.0 + thermal.gauge_factor_slope * warmer) - amplitude @ thermal.mode_strain.T - apparent
    return np.asarray(by_load * (1.0 + thermal.modulus_slope * warmer))


def zero_columns(inverse_map: InverseMap, zeros: Zeros | None) -> FloatArray:
    """Return columns (n_d, n_s + 1) of the errors of ``zeros``, of each strain gauge alone, then of all together.

    There are none of None.
    """
    if zeros is None:
        return np.zeros((inverse_map.n_gauges, 0))
    n = len(zeros.value)
    both = np.column_stack([np.diag(zeros.std), np.full(n, zeros.common_std)])
    return np.pad(both, ((0, inverse_map.n_gauges - n), (0, 0)))


def row_noise(
    inverse_map: InverseMap, covariance: FloatArray, zeros: Zeros | None = None, left: FloatArray | None = None
) -> FloatArray:
    """Return ``covariance`` (n_d, n_d) of the map's rows with errors of ``zeros``.

    ``left`` (n, n) is the covariance of the temperature modes given the sensors; the map's covariance has their
    prior, so that the isothermal one counts then.
    """
    if left is not None:
        thermal = inverse_map.thermal_and_inertia
        strain = thermal.linear_strain
        covariance = thermal.isothermal_covariance + strain @ left @ strain.T
    if zeros is None:
        return covariance
    errors = zero_columns(inverse_map, zeros)
    return covariance + errors @ errors.T


def amplitudes(thermal: ThermalMap, temperature: FloatArray, known: BoolArray) -> Amplitudes:
    """Return the temperature modes by the sensors ``known`` (n_t,), which read ``temperature`` (k, n_t) [K]."""
    n_t, n = thermal.sensor_operator.shape
    model = model_of(
        n_t,
        n,
        fixed=np.full(n_t, thermal.reference_temperature),
        columns=thermal.sensor_operator * thermal.prior_std,
        noise=np.diag(thermal.sensor_std**2),
        output_columns=np.diag(thermal.prior_std),
    )
    posterior = condition(prepare(model, known), temperature, np.ones(len(temperature)))
    return Amplitudes(mean=posterior.mean, covariance=posterior.covariance[0])
