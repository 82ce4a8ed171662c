"""Colours: ends of a scale that a blunt tip or an edge of a fin does not shift, and one for each of many parts."""

from __future__ import annotations

from colorsys import hls_to_rgb
from typing import Any, Literal

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray

SHOWN_SHARE = 0.98
"""Of the area, whose values the colours distinguish where the others are peaks."""
PEAK = 4.0
"""Highest value over the highest of :data:`SHOWN_SHARE` from which it is a peak, drawn in the last colour."""
LEAST_SPREAD = 0.1
"""Of the highest value shown; a body that is more alike, as a blunt cone without incidence, shows its tip."""


def colour_ends(surface: SurfaceMesh, values: FloatArray) -> dict[str, float]:
    """Return ``vmin`` and ``vmax`` of values (n_p,) at the nodes of a surface."""
    mean, area = values[surface.triangle].mean(axis=1), surface.area
    rising = np.argsort(mean)
    below = int(np.searchsorted(np.cumsum(area[rising]), SHOWN_SHARE * area.sum()))
    low, top, high = values.min(), values.max(), mean[rising[min(below, len(mean) - 1)]]
    peaked = top > PEAK * high and high - low > LEAST_SPREAD * high
    return {"vmin": float(low), "vmax": float(high if peaked else top)}


def ends_beyond(image: Any, values: FloatArray) -> Literal["max", "neither"]:
    """Return which end of the colour bar of ``image`` marks values beyond it."""
    return "max" if values.max() > image.get_clim()[1] else "neither"


_DARK = "1f77b4 ff7f0e 2ca02c d62728 9467bd 8c564b e377c2 7f7f7f bcbd22 17becf"
_LIGHT = "aec7e8 ffbb78 98df8a ff9896 c5b0d5 c49c94 f7b6d2 c7c7c7 dbdb8d 9edae5"
GOLDEN_ANGLE, LIGHTNESS = 0.618034, (0.35, 0.55, 0.75)


def part_colours(count: int) -> list[str]:
    """Return ``count`` colours as "#rrggbb", no two of them equal: matplotlib's tab20, then hues in between."""
    colours = f"{_DARK} {_LIGHT}".split()
    for k in range(count - len(colours)):
        colour = hls_to_rgb(GOLDEN_ANGLE * k % 1.0, LIGHTNESS[k % len(LIGHTNESS)], 0.65)
        colours.append("".join(f"{round(255.0 * part):02x}" for part in colour))
    return [f"#{colour_shown}" for colour_shown in colours[:count]]
