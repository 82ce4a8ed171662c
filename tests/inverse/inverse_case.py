"""The numbers that the tests of the inverse problem share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.reduction import PressureModes


@dataclass(frozen=True)
class Case:
    """What the algebra of the inverse problem works on."""

    strain_operator: np.ndarray
    loads: np.ndarray
    modes: PressureModes
    noise_std: np.ndarray
    internal_pressure: float
