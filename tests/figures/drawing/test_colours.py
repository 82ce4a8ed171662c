"""Ends of a colour scale: peaks on a small area do not take it from the rest."""

from __future__ import annotations

import numpy as np
import pytest

from builder.aero.surface.mesh import SurfaceMesh
from builder.figures.drawing.colours import colour_ends

pytestmark = pytest.mark.fast


def strip(n: int = 200) -> SurfaceMesh:
    """Return a strip of n squares along x, two triangles each; nodes of y = 0 first."""
    x = np.arange(n + 1.0)
    point = np.concatenate([np.stack([x, np.full(n + 1, y), np.zeros(n + 1)], axis=1) for y in (0.0, 1.0)])
    i = np.arange(n)
    triangle = np.concatenate([np.stack([i, i + 1, i + n + 1], 1), np.stack([i + 1, i + n + 2, i + n + 1], 1)])
    return SurfaceMesh(point, triangle)


@pytest.mark.parametrize(
    ("peak", "low", "vmax"),
    [(40.0, 1.0, 3.0), (10.0, 1.0, 10.0), (40.0, 2.95, 40.0)],
    ids=["a tip far above the rest", "a tip not far above", "nothing to tell apart without the tip"],
)
def test_peaks_on_a_small_area_have_one_colour(peak: float, low: float, vmax: float) -> None:
    surface = strip()
    values = low + (3.0 - low) * surface.point[:, 0] / surface.point[:, 0].max()
    values[surface.point[:, 0] < 1.5] = peak
    found = colour_ends(surface, values)
    assert found["vmin"] == pytest.approx(values.min())
    assert found["vmax"] == pytest.approx(vmax, rel=0.03)
