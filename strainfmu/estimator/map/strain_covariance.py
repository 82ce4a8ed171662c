"""Covariance of strain about the tables at a flight state: noise, pressure off the tables, hardware errors."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.proportional_errors import PAIRS
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE, evaluate
from strainfmu.estimator.tables.manifold_map import ManifoldMap


def strain_covariance(
    manifold: ManifoldMap, pressure: FloatArray, strain: FloatArray, loads: FloatArray
) -> FloatArray:
    """Return S (k, n_d, n_d) [(m/m)^2] at ``pressure`` (k,) p_inf, ``strain`` (k, n_d) and ``loads`` (k, 5)."""
    square = (pressure * pressure)[:, None]
    c = np.hstack([np.ones((len(loads), 1)), loads / (pressure[:, None] * manifold.references)])
    first, second = np.array(PAIRS).T
    of_gauge = square * np.maximum((c[:, first] * c[:, second]) @ manifold.gauge_error_product, 0.0)
    gain = manifold.gain_std * strain
    columns = pressure[:, None, None] * np.einsum("ka,tan->knt", c, manifold.common_error)
    columns = np.concatenate([columns, (manifold.common_gain * strain)[:, :, None]], axis=2)
    covariance = manifold.gauge_covariance + square[:, :, None] * manifold.scaled_covariance
    covariance = covariance + columns @ np.swapaxes(columns, 1, 2)
    diagonal = np.arange(strain.shape[1])
    covariance[:, diagonal, diagonal] += of_gauge + gain * gain
    return covariance


def strain_covariance_at(manifold: ManifoldMap, state: FloatArray) -> FloatArray:
    """Return S (k, n_d, n_d) [(m/m)^2] at the flight states ``state`` (k, 4)."""
    value, n = evaluate(manifold.tables, state).value, manifold.tables.n_gauges
    return strain_covariance(
        manifold, pressure=np.exp(state[:, LOG_PRESSURE]), strain=value[:, :n], loads=value[:, n:]
    )
