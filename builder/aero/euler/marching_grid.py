"""How finely a cross-plane is resolved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class MarchingGrid:
    """Resolution of the cross-plane.

    Attributes
    ----------
    n_radial : cells between body and outer boundary.
    n_circumferential : cells over the half body, leeward to windward.
    clustering : cells grow outward by exp(clustering) from the first to the last.
    conical_tolerance : relative change of wall pressure and shock radius, over a leg in which x grows by
        half, that ends the conical start.
    """

    n_radial: int = 24
    n_circumferential: int = 36
    clustering: float = 1.0
    conical_tolerance: float = 1e-3

    def spacing(self, n_radial: int) -> FloatArray:
        """Return (n_radial + 1,) vertex positions from 0 (wall) to 1 (outer boundary)."""
        t = np.linspace(0.0, 1.0, n_radial + 1)
        return np.expm1(self.clustering * t) / np.expm1(self.clustering) if self.clustering else t
