"""Checked inputs of the nonlinear estimator."""

from __future__ import annotations

from dataclasses import dataclass

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
    """

    strain: FloatArray
    used: BoolArray
    navigation: Navigation
    parameter_score: FloatArray

    def rows(self, rows: slice | IntArray) -> EstimatorInputs:
        """Return the samples ``rows``."""
        return EstimatorInputs(
            strain=self.strain[rows],
            used=self.used[rows],
            navigation=self.navigation.rows(rows),
            parameter_score=self.parameter_score[rows],
        )
