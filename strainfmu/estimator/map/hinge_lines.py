"""Hinge lines of parts of the surface, whose hinge moments a map gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

UNITS = {"point": "m"}


@dataclass(frozen=True, kw_only=True, eq=False)
class HingeLines:
    """n hinge lines, each of a region of the surface.

    Attributes
    ----------
    name : n names, unique.
    region : n names of the regions by the vehicle file.
    point : (n, 3) a point of each line in body axes [m].
    direction : (n, 3) its direction, a unit vector in body axes; moments are right-handed about it.

    Raises
    ------
    InputError
        Shapes or values are wrong.
    """

    name: tuple[str, ...]
    region: tuple[str, ...]
    point: FloatArray
    direction: FloatArray

    def __post_init__(self) -> None:
        n = len(self.name)
        if not n or not all(self.name) or len(set(self.name)) != n or len(self.region) != n:
            raise InputError("hinge_lines: expected names, none empty or twice, and as many regions")
        for name in ("point", "direction"):
            value = getattr(self, name)
            if value.shape != (n, 3) or not np.all(np.isfinite(value)):
                raise InputError(f"hinge_lines: {name} has shape {value.shape}, must be ({n}, 3) finite numbers")
        if not np.allclose(np.linalg.norm(self.direction, axis=1), 1.0, rtol=0.0, atol=1e-9):
            raise InputError("hinge_lines: direction must hold unit vectors")
