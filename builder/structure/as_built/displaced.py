"""What gauges as built read on a structure of any shape: by the strain of displaced ones.

Shifts and turns of gauges act to first order, the wall's thickness inversely.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built.gauge_strain_terms import gain_of, rows_of, turn_of
from builder.structure.as_built_kinds import AS_BUILT, IN_NOISE
from builder.structure.solid.gauge_layouts import (
    AFT,
    AROUND,
    BACK,
    FORE,
    STEP,
    TURNED_AROUND,
    TURNED_BACK,
)
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

WAYS = 5
"""Gauges in place, what they read more per metre aft, per metre around, per radian turned, and strain across."""

KNOWN = (
    "gauge_gain",
    "common_gain",
    "axial_shift",
    "circumferential_shift",
    "orientation",
    "row_orientation",
    "transverse_sensitivity",
    "layout_roll",
    "wall_thickness",
)
"""Kinds that these act by; the pressure's and the readings' own come besides."""


def ways_of(own: FloatArray, moved: Callable[[str], FloatArray] | None) -> FloatArray:
    """Return the parts (n_w, n_d, ..) of :data:`WAYS` from the strain ``own`` (n_d, ..) of gauges in place.

    ``moved`` returns the strain of gauges displaced in a way; None where no gauge is.
    """
    found = np.zeros((WAYS, *own.shape))
    found[0] = own
    if moved is not None:
        found[1] = (moved(AFT) - moved(FORE)) / (2.0 * STEP)
        found[2] = (moved(AROUND) - moved(BACK)) / (2.0 * STEP)
        found[3] = moved(TURNED_AROUND) - moved(TURNED_BACK)
        found[4] = moved(TURNED_AROUND) + moved(TURNED_BACK) - own  # normals at right angles add up alike
    return found


@dataclass(frozen=True, eq=False)
class DisplacedGauges:
    """Gauges at ``position`` (n_d, 3) [m] of a structure of any shape."""

    position: FloatArray

    @cached_property
    def radius(self) -> FloatArray:
        """(n_d,) distance of the gauges from the axis [m]."""
        return np.hypot(self.position[:, 1], self.position[:, 2])

    @cached_property
    def roll_angle(self) -> FloatArray:
        """(n_d,) [rad]."""
        return np.arctan2(self.position[:, 1], self.position[:, 2])

    @cached_property
    def row(self) -> IntArray:
        """(n_d,) number of the row of each gauge: those at one roll angle."""
        return rows_of(self.roll_angle)

    def as_built(self, parts: FloatArray, built: AsBuilt) -> FloatArray:
        """Return (.., n_d) what gauges as ``built`` read, from ``parts`` (n_w, .., n_d), see :data:`WAYS`.

        Of v vehicles at once, ``parts`` are (n_w, 1, n_d) or (n_w, n_d).
        """
        around = built.circumferential_shift + built.layout_roll * self.radius
        turn = turn_of(built, self.row)
        moved = parts[0] + built.axial_shift * parts[1] + around * parts[2] + turn * parts[3]
        moved = moved + built.transverse_sensitivity * parts[4]
        return np.asarray(gain_of(built) / (1.0 + built.of_all("wall_thickness")) * moved)


def refuse_others(noise: Noise) -> None:
    """Refuse errors that displaced gauges do not show.

    Raises
    ------
    InputError
        Names the entry of [noise].
    """
    for kind in IN_NOISE:
        if kind in AS_BUILT and kind.name not in KNOWN and kind.std(noise) > 0.0:
            raise InputError(f"noise.{kind.entry}: expected 0 but for a body of revolution that is clamped aft")
