"""Figures of a score on numbers known by hand, and on draws of a known law."""

from __future__ import annotations

import numpy as np
import pytest

from builder.trial.score import by_name, is_within, score_of
from strainfmu.estimator.health import HealthState

pytestmark = pytest.mark.fast

OK, SUSPECT, DEGRADED = HealthState.OK, HealthState.SUSPECT, HealthState.DEGRADED


def test_every_figure_of_five_samples() -> None:
    """Errors 0, 2, 4 of sigma 1, one that is wrong in the other load, and a sample without an estimate."""
    error = np.array([[0.0, 0.1], [2.0, 0.1], [-4.0, 0.1], [0.0, 0.9], [np.nan, np.nan]])
    std = np.tile([1.0, 0.1], (5, 1))
    std[4] = np.nan
    health = [OK, SUSPECT, OK, DEGRADED, OK]
    truth, bound = np.arange(10.0).reshape(5, 2), np.array([[3.0], [4.0]])
    found = score_of(("a", "b"), error, std, truth=truth, health=health, bound=bound)
    assert (found.samples, found.healthy, found.detected) == (5, 0.6, 0.4)
    np.testing.assert_allclose(found.rms, [np.sqrt(5.0), np.sqrt(0.21)])
    np.testing.assert_allclose(found.bias, [-0.5, 0.3])
    np.testing.assert_allclose(found.mean_std, [1.0, 0.1])
    np.testing.assert_allclose(found.coverage_1, [0.4, 0.6])
    np.testing.assert_allclose(found.coverage_3, [0.6, 0.6])
    np.testing.assert_allclose(found.rms_z, [np.sqrt(5.0), np.sqrt(21.0)])
    np.testing.assert_allclose(found.rms_of_range, found.rms / 8.0)
    np.testing.assert_allclose(found.undetected_of_load, [0.4, 0.2])
    assert (found.wrong, found.undetected, found.alarms, found.false_alarms) == (0.6, 0.4, 0.2, 0.2)
    assert found.health == {"OK": 0.6, "DEGRADED": 0.2, "SUSPECT": 0.2}
    assert found.bound is not None
    assert found.rms_of_bound is not None
    np.testing.assert_allclose(found.bound, [np.sqrt(12.5), np.nan])
    np.testing.assert_allclose(found.rms_of_bound[0], np.sqrt(5.0 / 12.5))


def test_normal_errors_of_the_stated_size() -> None:
    random = np.random.default_rng(1)
    std = random.uniform(0.5, 2.0, (200_000, 2))
    found = score_of(("a", "b"), std * random.standard_normal(std.shape), std)
    np.testing.assert_allclose(found.coverage_1, 0.6827, atol=0.005)
    np.testing.assert_allclose(found.coverage_3, 0.9973, atol=0.0005)
    np.testing.assert_allclose(found.rms_z, 1.0, atol=0.01)
    assert found.bound is found.rms_of_bound is None
    assert np.isnan([found.detected, found.undetected, found.false_alarms, *found.rms_of_range]).all()


def test_nothing_is_known_of_no_estimate() -> None:
    unknown = np.full((3, 1), np.nan)
    found = score_of(("a",), unknown, unknown, health=np.zeros(3))
    assert by_name(found.names, found.rms) == {"a": None} == by_name(("a",), None)
    assert (found.coverage_3[0], found.wrong, found.undetected) == (0.0, 1.0, 1.0)
    assert not is_within(unknown, 1.0).any()
