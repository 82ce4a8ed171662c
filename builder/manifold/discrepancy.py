"""Pressure off the tables: interpolation, a fraction of the snapshots' spread, and a Gaussian process.

Each is a set of pressure fields of one standard deviation, per p_inf; what the estimator needs are their strain
and loads.
"""

from __future__ import annotations

import numpy as np

from builder.vehicle.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray

_NEGLIGIBLE = 1e-3
"""Eigenvalue relative to the largest below which a shape of the Gaussian process is left out."""


def gaussian_process_shapes(
    grid: SurfaceGrid, length: float, axial_length: float, roll_angle: float
) -> tuple[FloatArray, FloatArray]:
    """Return shapes (n_x, a) along and (n_roll, b) round the body whose products have unit variance in the sum.

    The correlation of pressure at two points is exp(-(dx / l_x)^2 / 2 - (dphi / l_phi)^2 / 2).

    Parameters
    ----------
    length : of the body [m].
    axial_length : l_x over the length of the body [1].
    roll_angle : l_phi [rad].
    """
    along = np.exp(-0.5 * ((grid.x[:, None] - grid.x) / (axial_length * length)) ** 2)
    difference = np.angle(np.exp(1j * (grid.roll_angle[:, None] - grid.roll_angle)))
    around = np.exp(-0.5 * (difference / roll_angle) ** 2)
    return _factor(along), _factor(around)


def _factor(correlation: FloatArray) -> FloatArray:
    value, vector = np.linalg.eigh(correlation)
    kept = value > _NEGLIGIBLE * value[-1]
    return np.asarray(vector[:, kept] * np.sqrt(value[kept]))


def response_of_shapes(operator: FloatArray, along: FloatArray, around: FloatArray) -> FloatArray:
    """Return (n, a b) of ``operator`` (n, n_p) to all products of shapes ``along`` (n_x, a), ``around``
    (n_roll, b)."""
    rings = operator.reshape(len(operator), len(along), len(around))
    return np.einsum("nxr,xa,rb->nab", rings, along, around, optimize=True).reshape(len(operator), -1)
