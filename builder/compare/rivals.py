"""Learning estimators of scikit-learn: regression tree, random forest, gradient boosting, multi-layer perceptron.

They have no covariance. Their bands come from split conformal prediction (Lei et al., J. Am. Stat. Assoc. 113,
2018): the quantile of the absolute residual over flights that they were not trained on.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from typing import Any

import numpy as np

from builder.compare.candidate import AIR_DATA, GIVEN, Answer, median_microseconds
from builder.compare.flights import Readings, one_condition
from builder.compare.training import TrainingFlights
from builder.processors import one_thread_of_blas
from strainfmu.arrays import FloatArray

LEVEL = 0.9973
"""Probability of 3 sigma of a normal error."""


def _tree(seed: int) -> Any:
    from sklearn.tree import DecisionTreeRegressor

    return DecisionTreeRegressor(min_samples_leaf=3, random_state=seed)


def _forest(seed: int) -> Any:
    from sklearn.ensemble import RandomForestRegressor

    return RandomForestRegressor(n_estimators=50, max_features=0.3, min_samples_leaf=2, random_state=seed)


def _boosting(seed: int) -> Any:
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.multioutput import MultiOutputRegressor

    return MultiOutputRegressor(HistGradientBoostingRegressor(max_iter=200, random_state=seed))


def _perceptron(seed: int) -> Any:
    from sklearn.neural_network import MLPRegressor

    return MLPRegressor(
        hidden_layer_sizes=(64, 64), max_iter=150, tol=1e-6, early_stopping=True, random_state=seed
    )


RIVALS: dict[str, Callable[[int], Any]] = {
    "regression tree": _tree,
    "random forest": _forest,
    "gradient boosting": _boosting,
    "multi-layer perceptron": _perceptron,
}
"""Each takes a seed and returns a regression with ``fit`` and ``predict``."""


def conformal_half_width(residual: FloatArray) -> FloatArray:
    """Return (m,) half-widths of bands that hold a new value with :data:`LEVEL`; ``residual`` is (n, m).

    With fewer than 370 residuals there is no such band: it is infinite.
    """
    rank = ceil((len(residual) + 1) * LEVEL)
    if rank > len(residual):
        return np.full(residual.shape[1], np.inf)
    return np.asarray(np.sort(np.abs(residual), axis=0)[rank - 1])


class RivalCandidate:
    """A regression on strain over q_inf, ln q_inf and, where navigation is given, Mach number."""

    has_field, takes_one_reading = False, True

    def __init__(
        self, name: str, training: TrainingFlights, calibration: TrainingFlights, navigation: str, seed: int
    ) -> None:
        """Train the rival ``name`` and set its bands on ``calibration``."""
        self.name, self._with_mach = name, navigation == GIVEN
        features = self._features(training)
        self._feature_mean, self._feature_std = features.mean(axis=0), features.std(axis=0)
        self._mean, self._std = training.target.mean(axis=0), training.target.std(axis=0)
        self._model = RIVALS[name](seed)
        with one_thread_of_blas():
            self._model.fit(self._scaled(features), (training.target - self._mean) / self._std)
            residual = calibration.target - self._predicted(self._features(calibration))
        self.half_width = conformal_half_width(residual)

    def _features(self, read: TrainingFlights | Readings) -> FloatArray:
        strain = read.last if isinstance(read, Readings) else read.strain
        q = read.dynamic_pressure[:, None]
        columns = [strain / q, np.log(q)]
        if self._with_mach:
            columns.append(read.mach_number[:, None])
        return np.hstack(columns)

    def _scaled(self, features: FloatArray) -> FloatArray:
        return np.asarray((features - self._feature_mean) / self._feature_std)

    def _predicted(self, features: FloatArray) -> FloatArray:
        return np.asarray(self._mean + self._std * self._model.predict(self._scaled(features)))

    def answer(self, read: Readings, navigation: str) -> Answer:
        """Return coefficients and the two angles; ``navigation`` is as in the training."""
        with one_thread_of_blas():
            found = self._predicted(self._features(read))
        air = np.full((len(found), len(AIR_DATA)), np.nan)
        air[:, :2] = found[:, 5:]
        std = np.broadcast_to(self.half_width[:5] / 3.0, (len(found), 5))
        return Answer(coefficients=found[:, :5], std=std, air_data=air)

    def step_microseconds(self, read: Readings, navigation: str) -> float:
        """Return the median time of one prediction."""
        features = self._features(one_condition(read))
        with one_thread_of_blas():
            return median_microseconds(lambda: self._predicted(features))
