"""What gauges as built read on a structure of any shape: by the strain of displaced ones.

Shifts and turns of gauges act to first order, the wall's thickness inversely.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from builder.structure.as_built.gauges import gain_of
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.solid.gauges.displaced_gauges import (
    AFT,
    AROUND,
    BACK,
    FORE,
    STEP,
    TURNED_AROUND,
    TURNED_BACK,
)
from strainfmu.arrays import FloatArray

WAYS = 4
"""Gauges in place, and what they read more per metre aft, per metre around and per radian turned."""

KNOWN = (
    "gauge_gain",
    "common_gain",
    "axial_shift",
    "circumferential_shift",
    "orientation",
    "layout_roll",
    "wall_thickness",
)
"""Kinds that these act by; the pressure's and the readings' own come besides."""


def ways_of(own: FloatArray, moved: Callable[[str], FloatArray] | None) -> FloatArray:
    """Return the parts (4, n_d, ..) of :data:`WAYS` from the strain ``own`` (n_d, ..) of gauges in place.

    ``moved`` gives that of gauges displaced in a way; None where no gauge is.
    """
    found = np.zeros((WAYS, *own.shape))
    found[0] = own
    if moved is not None:
        found[1] = (moved(AFT) - moved(FORE)) / (2.0 * STEP)
        found[2] = (moved(AROUND) - moved(BACK)) / (2.0 * STEP)
        found[3] = moved(TURNED_AROUND) - moved(TURNED_BACK)
    return found


def as_built(parts: FloatArray, built: AsBuilt, radius: FloatArray) -> FloatArray:
    """Return (.., n_d) what gauges as ``built`` read, from ``parts`` (4, .., n_d), see :data:`WAYS`.

    ``radius`` (n_d,) is that of the gauges [m]. Of v vehicles at once, ``parts`` are (4, 1, n_d) or (4, n_d).
    """
    around = built.circumferential_shift + built.layout_roll * radius
    moved = parts[0] + built.axial_shift * parts[1] + around * parts[2] + built.orientation * parts[3]
    return np.asarray(gain_of(built) / (1.0 + built.of_all("wall_thickness")) * moved)
