"""Learning estimators of scikit-learn: regression tree, random forest, gradient boosting, multi-layer perceptron.

They have no covariance. Their bands come from split conformal prediction (Lei et al., J. Am. Stat. Assoc. 113,
2018): the quantile of the absolute residual over flights that they were not trained on.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from time import perf_counter
from typing import Any

import numpy as np

from builder.processors import one_thread_of_blas
from builder.trial.estimators import EstimateReadings, Estimates
from builder.trial.readings import ANGLES, Readings
from builder.trial.training_flights import training_flights
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER
from strainfmu.estimator.tables.manifold_map import ManifoldMap

LEVEL = 0.9973
"""Probability of 3 sigma of a normal error."""

COST_TRAINING, COST_STEPS, COST_ALTITUDES_KM = 500, 31, (15.0, 28.0)
"""Flights that each learns from where its time per step is measured, which hardly depends on them; and steps that
the time is the median of."""


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


REGRESSIONS: dict[str, Callable[[int], Any]] = {
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


def of_regression(name: str, training: Readings, calibration: Readings, seed: int) -> EstimateReadings:
    """Return a regression on strain over q_inf, ln q_inf and, where ``training`` gives it, Mach number; its bands
    are of ``calibration``. A third of a band stands for the standard deviation."""

    def features(read: Readings) -> FloatArray:
        q = np.asarray(read.known[DYNAMIC_PRESSURE])[:, None]
        mach = [np.asarray(read.known[MACH_NUMBER])[:, None]] if MACH_NUMBER in training.known else []
        return np.hstack([read.last / q, np.log(q), *mach])

    def scaled(read: Readings) -> FloatArray:
        return np.asarray((features(read) - feature_mean) / feature_std)

    def predicted(read: Readings) -> FloatArray:
        with one_thread_of_blas():
            return np.asarray(mean + std * model.predict(scaled(read)))

    def estimate(read: Readings) -> Estimates:
        value = predicted(read)
        bands = np.broadcast_to(half_width / 3.0, value.shape)
        angles = {name: (value[:, 5 + k], bands[:, 5 + k]) for k, name in enumerate(ANGLES)}
        return Estimates(value=value[:, :5], std=bands[:, :5], others=angles)

    known = features(training)
    feature_mean, feature_std = known.mean(axis=0), known.std(axis=0)
    mean, std, model = training.truth.mean(axis=0), training.truth.std(axis=0), REGRESSIONS[name](seed)
    with one_thread_of_blas():
        model.fit(scaled(training), (training.truth - mean) / std)
    half_width = conformal_half_width(calibration.truth - predicted(calibration))
    return estimate


def step_costs(manifold: ManifoldMap, seed: int = 1) -> dict[str, float]:
    """Return the median time per step [s] of each regression, in Python; needs scikit-learn."""
    random = np.random.default_rng(seed)
    training, calibration = (
        training_flights(manifold, COST_ALTITUDES_KM, count, random)
        for count in (COST_TRAINING, COST_TRAINING // 4)
    )
    one = calibration.rows(slice(1))

    def cost(name: str) -> float:
        estimate, times = of_regression(name, training, calibration, seed), list[float]()
        for _ in range(1 + COST_STEPS):
            start = perf_counter()
            estimate(one)
            times.append(perf_counter() - start)
        return float(np.median(times[1:]))

    return {f"{name} of scikit-learn, trained on {COST_TRAINING:,} flights": cost(name) for name in REGRESSIONS}
