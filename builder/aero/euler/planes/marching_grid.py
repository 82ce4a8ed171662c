"""Resolution of a cross-plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from builder.vehicle.model_entries import Resolution
from strainfmu.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class MarchingGrid:
    """Resolution of the cross-plane.

    Attributes
    ----------
    n_radial : cells between body and outer boundary.
    n_circumferential : cells over half a turn: over the half body, leeward to windward.
    clustering : cells grow outward by exp(clustering) from the first to the last: at high incidence the vortical
        layer on the leeward side is thin, and the grid converges cleanly only if it is resolved.
    conical_tolerance : change of wall pressure (relative to its mean) and shock radius while x grows by half,
        imbalance of wall force and momentum, and ten times the imbalance of mass, that end the conical start.
    corner : how a convex corner of a body of revolution is passed. ``fan``: by a centred expansion
        (:mod:`~builder.aero.euler.bodies.corner`). ``marched``: by the march alone, which leaves the pressure
        behind the corner 0.5 to 1 % off on every grid and makes it swing by some percent.
    """

    n_radial: int = 24
    n_circumferential: int = 36
    clustering: float = 2.5
    conical_tolerance: float = 3e-4
    corner: Literal["fan", "marched"] = "fan"

    def spacing(self, n_radial: int) -> FloatArray:
        """Return (n_radial + 1,) vertex positions from 0 (wall) to 1 (outer boundary)."""
        t = np.linspace(0.0, 1.0, n_radial + 1)
        return np.expm1(self.clustering * t) / np.expm1(self.clustering) if self.clustering else t


def marching_grid_of(resolution: Resolution) -> MarchingGrid:
    """Return the grid of a resolution in a vehicle file."""
    return MarchingGrid(n_radial=resolution.radial_cells, n_circumferential=resolution.circumferential_cells)


GRID_LEVELS = {
    "coarse": MarchingGrid(n_radial=16, n_circumferential=24),
    "medium": MarchingGrid(n_radial=24, n_circumferential=36),
    "fine": MarchingGrid(n_radial=36, n_circumferential=54),
}
"""Grids by name, each 1.5 times finer than the one before; ``coarse`` is the default of a vehicle file.

Errors of C_N and C_A for the shipped vehicle against the value extrapolated from the three grids, and CPU time:

======  ==============  ==============  ===============  ===============  ==============
level   M 5, 8.478 deg  M 5, 8.478 deg  M 7, 14.106 deg  M 7, 14.106 deg  CPU s per flow
        C_N             C_A             C_N              C_A              0 .. 14 deg
======  ==============  ==============  ===============  ===============  ==============
coarse  0.2 %           1.0 %           1.0 %            < 0.1 %          0.04 .. 0.08
medium  0.1 %           0.4 %           0.6 %            < 0.1 %          0.1 .. 0.2
fine    < 0.1 %         0.2 %           0.4 %            < 0.1 %          0.2 .. 0.4
======  ==============  ==============  ===============  ===============  ==============
"""
