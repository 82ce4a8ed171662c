"""Ends of a colour scale: peaks on a small area do not take it from the rest. Every part has its own colour."""

from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex

from builder.aero.surface.mesh import SurfaceMesh
from builder.figures.drawing import colour_ends, part_colours
from builder.figures.uncertainty import coefficients

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


@pytest.mark.parametrize("count", [0, 1, 13, 60])
def test_no_two_parts_share_a_colour(count: int) -> None:
    """More than the ten of the usual cycle; the first stay where more are requested."""
    colours = part_colours(count)
    assert len(colours) == len(set(colours)) == count
    assert all(len(colour) == 7 and int(colour[1:], 16) >= 0 for colour in colours)
    assert part_colours(100)[:count] == colours


def numbers(n: int) -> dict[str, Any]:
    """Return what the figure of the coefficients draws of n sources alike."""
    limits = np.tile([0.0, 1.0], (5, 1))
    return {
        "of_variance": np.full((n, 5), 1.0 / n),
        "std": np.ones(5),
        "limits": limits,
        "std_of_range": np.ones(5),
    }


def test_sources_of_a_coefficient_have_a_colour_each() -> None:
    """Thirteen sources."""
    shown = coefficients(sources=[f"source {k}" for k in range(13)], **numbers(13), correlation=np.eye(5))
    drawn = [to_hex(bar.patches[0].get_facecolor()) for bar in shown.figure.axes[0].containers]
    assert len(set(drawn)) == 13


def test_a_correlation_that_rounds_to_zero_has_no_sign() -> None:
    values = np.eye(5)
    values[0, 1] = values[1, 0] = -1e-9
    shown = coefficients(sources=["noise"], **numbers(1), correlation=values)
    texts = [text.get_text() for axis in shown.figure.axes for text in axis.texts]
    assert "0.00" in texts
    assert "-0.00" not in texts
