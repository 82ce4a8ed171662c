"""Readings become rows of the model: zero offsets, scales of auxiliary sensors, and temperature of the wall.

A gauge reads (1 + g B a) (strain / (1 + m B a) + Phi a + p(B a)) + zero while the temperature modes of the wall
have the amplitudes a. Temperature sensors read theta = C a + e: the update gives a, and its covariance P. Readings
are corrected at a, which is not linear in it; the rest of the modes adds Phi P Phi' to the covariance of rows.
"""

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import ThermalMap
from strainfmu.estimator.reference.update import Posterior, condition, model_of, prepare


def rows_of(
    inverse_map: InverseMap,
    readings: FloatArray,
    thrust: FloatArray,
    zeros: GaugeZeros | None = None,
    amplitude: FloatArray | None = None,
) -> FloatArray:
    """Return rows (k, n_d) [m/m] of ``readings`` (k, n_d) at the ``amplitude`` (k, n) of the temperature modes."""
    rows = inverse_map.sensors.without_thrust(readings, thrust) / inverse_map.sensors.scale
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


def row_noise(
    inverse_map: InverseMap,
    covariance: FloatArray,
    zeros: GaugeZeros | None = None,
    left: FloatArray | None = None,
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
    return covariance + np.pad(zeros.covariance, (0, inverse_map.n_gauges - len(zeros.value)))


def amplitudes(thermal: ThermalMap, temperature: FloatArray, known: BoolArray) -> Posterior:
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
    return condition(prepare(model, known), temperature, np.ones(len(temperature)))
