"""The linear estimator without a compiled core, by the reference, on the golden streams of linear maps."""

from __future__ import annotations

import numpy as np
import pytest
from comparison import differences
from estimator_carrier import by_estimator, estimator_for
from inputs import recorded
from kinds import KINDS, OF_DIGITS, map_of_kind
from numpy_core import ByNumpy

pytestmark = pytest.mark.fast


SAMPLES = 30
"""First ones of a stream: the reference estimates one after another."""


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if not kind.is_nonlinear])
def test_linear_maps_by_numpy(kind: str) -> None:
    """Loads, deviations, chi-square and z to 1e-9, or the digits of the map; its limit to 1e-8; health equal."""
    estimator, streams = ByNumpy(map_of_kind(kind)), 0
    close = ["loads", "coefficients", "chi_square", "standardised_residual", "other_loads"]
    close += ["loads_std", "coefficients_std", "chi_square_limit"]
    for one in recorded(kind).values():
        if "each" not in one.results:
            continue
        expected = {name: values[:SAMPLES] for name, values in one.results["each"].items()}
        inputs = one.inputs.rows(slice(SAMPLES))
        found = by_estimator(estimator_for(estimator, inputs), inputs, "each", 1.0)
        apart = differences(expected, found)
        for name in close:
            tolerance = max(1e-8 if name == "chi_square_limit" else 1e-9, OF_DIGITS * KINDS[kind].digits)
            assert np.nanmax(apart.get(name, 0.0), initial=0.0) <= tolerance, name
        np.testing.assert_array_equal(found["health"], expected["health"])
        streams += 1
    assert streams >= 1
