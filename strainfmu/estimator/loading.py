"""The estimator of a map on file, linear or nonlinear as the map was built."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.settings import EstimatorSettings
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros


def load(
    path: str | PathLike[str], settings: EstimatorSettings | None = None, zeros: GaugeZeros | None = None
) -> Estimator | ManifoldEstimator:
    """Return the estimator of the map at ``path``; None takes the settings that the map was built with, and zeros
    of 0.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version, or ``zeros`` are of another number of
        gauges.
    """
    return estimator_of(load_inverse_map(Path(path)), settings, zeros)


def estimator_of(
    inverse_map: InverseMap, settings: EstimatorSettings | None = None, zeros: GaugeZeros | None = None
) -> Estimator | ManifoldEstimator:
    """Return the nonlinear estimator of a map with tables over the flight state, the linear one of any other."""
    kind = Estimator if inverse_map.manifold is None else ManifoldEstimator
    return kind(inverse_map, settings, zeros)
