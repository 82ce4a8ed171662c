"""Checked inputs of the nonlinear estimator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.manifold.navigation import Navigation


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimatorInputs:
    """Checked inputs of k samples.

    Attributes
    ----------
    strain, used : (k, n_d) readings less zeros, those of further sensors over their scale [m/m], and which to use.
    navigation : with a standard deviation for every value.
    parameter_score : (k, n_p) part of its range by which each further parameter of the flow leaves it [1].
    parameter_value, parameter_std : (k, n_p) of what is known of them with a deviation, NaN of all else.
    """

    strain: FloatArray
    used: BoolArray
    navigation: Navigation
    parameter_score: FloatArray
    parameter_value: FloatArray
    parameter_std: FloatArray

    @property
    def knows_parameters(self) -> bool:
        """Whether any further parameter is known with a deviation."""
        return bool(np.isfinite(self.parameter_std).any())

    def of_like_parameters(self) -> list[IntArray]:
        """Return the samples of each value and deviation of the further parameters."""
        stated = np.hstack([self.parameter_value, self.parameter_std])
        each = np.unique(np.where(np.isnan(stated), np.inf, stated), axis=0, return_inverse=True)[1].ravel()
        return [np.flatnonzero(each == one) for one in range(int(each.max()) + 1)]

    def rows(self, rows: slice | IntArray) -> EstimatorInputs:
        """Return the samples ``rows``."""
        return EstimatorInputs(
            strain=self.strain[rows],
            used=self.used[rows],
            navigation=self.navigation.rows(rows),
            parameter_score=self.parameter_score[rows],
            parameter_value=self.parameter_value[rows],
            parameter_std=self.parameter_std[rows],
        )
