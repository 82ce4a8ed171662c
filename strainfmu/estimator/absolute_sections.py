"""Loads behind the five of a linear map of form "absolute", whose core has none."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.reference.linear import LOADS, estimate
from strainfmu.estimator.reference.readings import Zeros, row_noise, rows_of
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros

_NAMES = ("other_loads", "other_loads_std", "other_coefficients", "other_coefficients_std")


def _std(covariance: FloatArray) -> FloatArray:
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def other_loads(
    inverse_map: InverseMap,
    zeros: GaugeZeros,
    dynamic_pressure: FloatArray,
    pressure_std: FloatArray,
    *,
    readings: FloatArray,
    thrust: FloatArray,
    valid: BoolArray,
    area: float,
    length: float,
) -> dict[str, FloatArray]:
    """Return the loads behind the five of k samples by the field of an estimate, (k, n_f - 5).

    ``readings`` (k, n_d) less ``zeros`` and what sensors read of ``thrust`` (k,) count where ``valid`` (k, n_d);
    without any all is NaN. Coefficients are NaN where q_inf, the
    ``dynamic_pressure`` (k,), is; they refer to ``area`` S and ``length`` L. A ``pressure_std`` (k,) of NaN is the
    map's.
    """
    of_zeros = Zeros(value=zeros.value, std=zeros.std, common_std=zeros.common_std)
    rows = rows_of(inverse_map, readings, thrust, of_zeros)
    noise = row_noise(inverse_map, inverse_map.gauge_covariance, of_zeros)
    known = np.isfinite(dynamic_pressure)
    q = np.where(known, dynamic_pressure, 1.0)
    std = np.where(np.isnan(pressure_std), inverse_map.dynamic_pressure_error * q, pressure_std)
    scale = inverse_map.references[LOADS:] / (area * np.where(inverse_map.is_moment[LOADS:], length, 1.0))
    found = {name: np.full((len(rows), len(scale)), np.nan) for name in _NAMES}
    masks, which = np.unique(valid, axis=0, return_inverse=True)
    for number, used in enumerate(masks):
        of_mask = np.flatnonzero(which.reshape(-1) == number)
        if not used.any():
            continue
        read = np.where(used, rows[of_mask], 0.0)
        one = estimate(inverse_map, read, used, q[of_mask], std[of_mask], noise)
        for name, value, turn in (
            ("other_loads", one.loads, np.ones(1)),
            ("other_loads_std", _std(one.covariance), np.ones(1)),
            ("other_coefficients", one.coefficients, scale * np.where(known[of_mask], 1.0, np.nan)[:, None]),
            ("other_coefficients_std", _std(one.coefficient_covariance), scale),
        ):
            found[name][of_mask] = turn * value[:, LOADS:]
    found["other_coefficients_std"][~known] = np.nan
    return found
