"""Ends of a colour scale: a blunt tip or an edge of a fin does not take it from the rest of the body."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray

SHOWN_SHARE = 0.98
"""Of the area, whose values the colours tell apart where the others are peaks."""
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


def beyond(drawn: Any, values: FloatArray) -> Literal["max", "neither"]:
    """Return which end of the colour bar of ``drawn`` marks values beyond it."""
    return "max" if values.max() > drawn.get_clim()[1] else "neither"
