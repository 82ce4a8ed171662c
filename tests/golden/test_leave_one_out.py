"""The standardised residual of a gauge is its distance from what the others predict, by estimates without it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from estimator_carrier import arguments
from inputs import Inputs, recorded
from kinds import KINDS, map_of_kind

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

LINEAR = ("few_gauges", "absolute_gamma_1", "scaled_case_1", "scaled_case_2", "scaled_sensors")
OTHER_PRIOR = "absolute_gamma_1e-6"
"""Its states are estimated with another prior than the one that residuals are judged by."""
NONLINEAR = ("revolution", "surface")


def good_sample(kind: str) -> Inputs:
    """Return a sample of the flight of which all sensors are valid and in order."""
    one = recorded(kind)["flight"]
    health = one.results["each"]["health"]
    whole = one.inputs.valid.all(axis=1) & np.isfinite(one.inputs.strain).all(axis=1) & (health == HealthState.OK)
    return one.inputs.rows(np.flatnonzero(whole)[3:4])


def without_considered(inverse_map: InverseMap) -> InverseMap:
    """``inverse_map`` without considered errors, by which residuals are judged and no estimate is made."""
    manifold = inverse_map.manifold
    if manifold is None:
        return inverse_map
    none = {"considered_strain": None, "considered_load": None, "considered_common": None}
    return replace(inverse_map, manifold=replace(manifold, **none))


class Rows:
    """One sample, as many times as it has sensors, of which row i moves or lacks sensor i."""

    def __init__(self, kind: str) -> None:
        sample = good_sample(kind)
        self.estimator = Estimator(without_considered(map_of_kind(kind)))
        self.n = sample.strain.shape[1]
        self.strain = np.repeat(sample.strain, self.n, axis=0)
        self.known = arguments(self.estimator, sample.rows(np.zeros(self.n, dtype=int)))

    def moved(self, reading: np.ndarray) -> Estimate:
        """Return the estimates whose row i has ``reading`` (n,) i of sensor i."""
        strain = self.strain.copy()
        np.fill_diagonal(strain, reading)
        return self.estimate(strain)

    def without(self) -> Estimate:
        """Return the estimates whose row i lacks sensor i."""
        return self.estimate(self.strain, valid=~np.eye(self.n, dtype=bool))

    def estimate(self, strain: np.ndarray, **changed: Any) -> Estimate:
        return self.estimator.estimate(strain, **(self.known | changed))

    def predicted(self, iterations: int) -> tuple[np.ndarray, np.ndarray]:
        """Return (n,) the reading of each sensor whose residual is 0, and d z / d reading there."""
        reading = np.diagonal(self.strain).copy()
        z, step, slope = self.residual(reading), 1e-3 * np.abs(reading), np.zeros(self.n)
        for _ in range(iterations):
            slope = (self.residual(reading + step) - z) / step
            reading, step = reading - z / slope, 1e-2 / slope
            z = self.residual(reading)
        return reading, slope

    def residual(self, reading: np.ndarray) -> np.ndarray:
        """Return (n,) the residual of sensor i with ``reading`` (n,) i."""
        return np.diagonal(self.moved(reading).standardised_residual)


@pytest.mark.parametrize("kind", [*LINEAR, *NONLINEAR])
def test_a_reading_as_the_others_predict_it_changes_nothing(kind: str) -> None:
    """The estimate with the reading whose residual is 0 is the one without the sensor."""
    rows, tolerance = Rows(kind), 1e-9
    reading, slope = rows.predicted(iterations=2)
    found, without = rows.moved(reading), rows.without()
    assert np.all(slope > 0.0)
    assert np.max(np.abs(found.loads - without.loads) / without.loads_std) < tolerance
    np.testing.assert_allclose(found.chi_square, without.chi_square, rtol=tolerance)


@pytest.mark.parametrize("kind", [*LINEAR, *NONLINEAR, OTHER_PRIOR])
def test_the_residual_is_the_distance_from_the_prediction(kind: str) -> None:
    """In standard deviations; its square is what the sensor adds to chi-square. Tables are bent within them."""
    rows = Rows(kind)
    read = np.diagonal(rows.strain)
    reading, slope = rows.predicted(iterations=2)
    z, added = rows.residual(read), rows.estimate(rows.strain).chi_square - rows.without().chi_square
    tolerance = 1e-2 if KINDS[kind].is_nonlinear else 1e-9
    assert np.abs(z).max() > 0.9
    np.testing.assert_allclose(slope * (read - reading), z, rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(z * z, added, rtol=tolerance, atol=tolerance)
