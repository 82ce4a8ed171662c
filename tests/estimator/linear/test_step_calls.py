"""What a step of the numpy estimator costs, in calls: on arrays this small calls are its time, on any machine."""

from __future__ import annotations

import sys
from types import FrameType

import pytest
from scaled_maps import whole_scaled_map

from strainfmu.estimator.linear.estimator import Estimator

pytestmark = pytest.mark.fast

LARGEST = 260
"""Calls of functions, Python's and C's, but not of operators; 210 with numpy 2.4."""


def test_a_step_makes_few_calls() -> None:
    inverse_map = whole_scaled_map(1, seed=4, n=54, n_states=5)
    estimator = Estimator(inverse_map)
    strain, q = inverse_map.mean_strain * 1.01, inverse_map.nominal_dynamic_pressure
    estimator.step(strain, q)  # computes the products of the level once
    calls = 0

    def count(frame: FrameType, event: str, _: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        estimator.step(strain, q)
    finally:
        sys.setprofile(before)
    assert calls <= LARGEST
