"""One cause of readings that do not fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from strainfmu.arrays import FloatArray, IntArray

Where = Literal["vehicle", "noise", "load", "gauge", "case"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Cause:
    """One cause.

    Attributes
    ----------
    where : what differs: the vehicle or the whole test, the noise, a load, a gauge or a case.
    kind : of the vehicle or the test "direction", "rig", "pad size", "load cell", "support", "joint", "modulus",
        "taper", "second harmonic", "drift" or "hysteresis"; of a gauge "gain" or "gauge"; the kind of ``where``
        otherwise.
    number : of the load cell, joint, load, gauge or case.
    entries : of the vector that are set free; empty where scatter is added.
    wide : (n,) their standard deviations.
    factor : of the noise; of a gauge or a case without entries what its scatter adds to its noise, over it.
    together : whether the entries go together, as ``wide`` and its opposite: one quantity, not each on its own.
    """

    where: Where
    kind: str
    number: int = 0
    entries: IntArray
    wide: FloatArray
    factor: float = 1.0
    together: bool = False
