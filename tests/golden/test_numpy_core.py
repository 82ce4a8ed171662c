"""The linear estimator without a compiled core, by the reference, on the golden streams of linear maps."""

from __future__ import annotations

import numpy as np
import pytest
from comparison import differences
from estimator_carrier import by_estimator, estimator_for
from inputs import recorded
from kinds import KINDS, map_of_kind

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.numpy_core import NumpyCore

pytestmark = pytest.mark.fast

OF_LEVELS = 0.2
"""Relative difference of deviations and limits of maps with errors in proportion to strain: the core takes these
linear between levels of the dynamic pressure, numpy has them exactly."""


class ByNumpy(Estimator):
    """An estimator on a machine without a compiled core."""

    def _new_core(self, resource: bytes) -> NumpyCore:
        return NumpyCore(self.inverse_map, resource)


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if not kind.is_nonlinear])
def test_linear_maps_by_numpy(kind: str) -> None:
    """Loads, chi-square and z to 1e-9, deviations where no error follows strain; health equal."""
    held = map_of_kind(kind)
    estimator, streams = ByNumpy(held), 0
    close = ["loads", "coefficients", "chi_square", "standardised_residual", "further_loads"]
    near = ["loads_std", "coefficients_std", "chi_square_limit"]
    for one in recorded(kind).values():
        if "each" not in one.results:
            continue
        expected = one.results["each"]
        found = by_estimator(estimator_for(estimator, one.inputs), one.inputs, "each", 1.0)
        apart = differences(expected, found)
        for name in (*close, *near):
            of_levels = name in near and held.common_error is not None
            largest = np.nanmax(apart[name], initial=0.0) if name in apart else 0.0
            assert largest <= (OF_LEVELS if of_levels else 1e-9), name
        np.testing.assert_array_equal(found["health"], expected["health"])
        streams += 1
    assert streams >= 1
