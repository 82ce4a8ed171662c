"""Loads about a moment point other than the map's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.linear.loads_from_strain import LoadsFromStrain


def moment_transfer(shift: float) -> FloatArray:
    """Return (5, 5) B, loads to loads about a moment point ``shift`` [m] further aft.

    M_P' = M_P + shift F_N and M_Y' = M_Y + shift F_Y: a force ahead of the point turns the nose its way, with an
    arm that the shift lengthens.
    """
    transfer = np.eye(5)
    transfer[3, 1] = transfer[4, 2] = shift
    return transfer


def about_point(found: LoadsFromStrain, transfer: FloatArray | None) -> LoadsFromStrain:
    """Return ``found`` about another moment point; ``transfer`` is None for the map's own."""
    if transfer is None:
        return found
    return replace(
        found,
        loads=found.loads @ transfer.T,
        load_covariance=transfer @ found.load_covariance @ transfer.T,
        load_per_pressure=found.load_per_pressure @ transfer.T,
    )
