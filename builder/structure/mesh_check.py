"""A second discretisation of a structure: the difference of the two is what its strains are uncertain by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

CHECK_UNITS = {"factor": "1", "strain_operator": "1/Pa", "point": "m"}


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshCheck:
    """Z_p of the same gauges on another mesh.

    Attributes
    ----------
    against : what it is, in words.
    factor : error of the structure over the difference of the two.
    strain_operator : (n_d, n_q) strain per pressure at its nodes [1/Pa].
    point, triangle : (n_q, 3) [m], (n_t, 3) its surface; None where it is the surface of the structure.

    Raises
    ------
    InputError
        Shapes do not fit, or a value is not finite.
    """

    against: str
    factor: float
    strain_operator: FloatArray
    point: FloatArray | None = None
    triangle: IntArray | None = None

    def __post_init__(self) -> None:
        if self.point is not None and len(self.point) != self.strain_operator.shape[1]:
            raise InputError(f"check: {len(self.point)} nodes, strain_operator {self.strain_operator.shape}")
        if not (np.isfinite(self.strain_operator).all() and np.isfinite(self.factor)):
            raise InputError("check: not all values are finite")
