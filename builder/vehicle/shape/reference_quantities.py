"""Reference area, length and moment point of the coefficients."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReferenceQuantities:
    """What coefficients are referred to: S [m2], L [m] and the moment point on the axis [m from the tip]."""

    area: float
    length: float
    moment_station: float
