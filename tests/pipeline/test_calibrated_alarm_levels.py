"""Without flows of the independent model a calibrated map has the alarm levels of the map as drawn."""

from dataclasses import replace

import pytest
from flight_maps import flight_map
from scaled_maps import scaled_map

from builder.pipeline.calibrate import with_levels_of


@pytest.mark.fast
def test_levels_are_those_of_the_drawing() -> None:
    made = replace(scaled_map(2, 1, 48), manifold=flight_map())
    levels = replace(flight_map(), chi_square_scale=1.2, outlier_scale=1.3, shape_scale=0.7)
    drawn = replace(made, manifold=levels, chi_square_scale=1.1, outlier_scale=1.4)
    found = with_levels_of(made, drawn)
    assert (found.chi_square_scale, found.outlier_scale) == (1.1, 1.4)
    assert found.manifold is not None
    assert (found.manifold.chi_square_scale, found.manifold.outlier_scale) == (1.2, 1.3)
    assert found.manifold.shape_scale == 0.7
    plain = with_levels_of(replace(made, manifold=None), drawn)
    assert plain.manifold is None
    assert plain.chi_square_scale == 1.1
