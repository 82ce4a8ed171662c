"""How far stations belong to regions of the wall, and a taper over each."""

from itertools import pairwise

import numpy as np
import pytest

from builder.structure.as_built.wall_regions import BLEND, WallRegions

pytestmark = pytest.mark.fast


def test_a_taper_runs_from_minus_one_to_one_over_its_region() -> None:
    end = np.array([0.1, 1.1, 1.6, 3.1])
    regions, blend = WallRegions(end=end), BLEND * 3.0
    for k, (fore, aft) in enumerate(pairwise(end)):
        x = np.linspace(fore + blend, aft - blend, 7)
        expected = np.zeros((7, 3))
        expected[:, k] = 2.0 * (x - fore) / (aft - fore) - 1.0
        np.testing.assert_allclose(regions.slope(x), expected, atol=1e-13)
    np.testing.assert_allclose(regions.share(np.linspace(0.1 + blend, 3.1, 50)).sum(axis=1), 1.0, atol=1e-13)
