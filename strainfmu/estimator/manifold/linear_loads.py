"""Loads of the linear map, for samples that do not fit the tables."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray
from strainfmu.estimator.estimates.load_estimate import LoadEstimates
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.manifold.inputs import EstimatorInputs

OF_LOADS = (
    "loads",
    "loads_std",
    "coefficients",
    "coefficients_std",
    "load_covariance",
    "coefficient_covariance",
    "further_loads",
    "further_loads_std",
    "further_coefficients",
    "further_coefficients_std",
)
"""Fields of estimates that are those of the linear map then."""


def fall_back(linear: Estimator, out: LoadEstimates, inputs: EstimatorInputs, off: BoolArray) -> BoolArray:
    """Give the samples ``off`` the tables the loads of the linear map, where it has some; return which."""
    q, std = inputs.navigation.value[:, 2], inputs.navigation.std[:, 2]
    rows = np.flatnonzero(off & np.isfinite(q))
    is_linear = np.zeros(len(off), dtype=bool)
    if len(rows):
        # Gauges are in range by what they read; less their zeros they need not be.
        found = linear.of_rows(inputs.strain[rows], inputs.used[rows], q[rows], std[rows])
        known = np.asarray(np.isfinite(found.coefficients).all(axis=1))
        for name in OF_LOADS:
            getattr(out, name)[rows[known]] = getattr(found, name)[known]
        is_linear[rows[known]] = True
    return is_linear
