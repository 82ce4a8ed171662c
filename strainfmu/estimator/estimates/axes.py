"""Coefficients in wind and stability axes, where the angles of the flow are known.

The wind seen by the body is V (cos a cos b, -sin b, sin a cos b). Drag acts along it, lift upward in the plane of
symmetry and normal to it, the wind-axis side force to starboard and normal to both. Stability axes are the wind
axes of b = 0: their side force is the body's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray, component


@dataclass(frozen=True, eq=False)
class TurnedCoefficients:
    """Drag, side force and lift coefficient [1], (.., 3), and their standard deviations."""

    values: FloatArray
    std: FloatArray

    C_D = component("values", 0, "Drag coefficient [1], positive along the wind.")
    C_S = component("values", 1, "Side force coefficient [1] of these axes, positive to starboard.")
    C_L = component("values", 2, "Lift coefficient [1], positive up.")


def turned(
    coefficients: FloatArray,
    covariance: FloatArray,
    angles: tuple[ArrayLike, ArrayLike],
    stds: tuple[ArrayLike, ArrayLike],
) -> TurnedCoefficients:
    """Return C_D, C_S and C_L of body ``coefficients`` (.., 5) with ``covariance`` (.., 5, 5).

    ``angles`` are a and b [rad], one or one of each sample; ``stds`` of their errors [rad] add to the variances to
    first order.
    """
    a, b = np.broadcast_arrays(*(np.asarray(angle, dtype=float) for angle in angles))
    turn, order = _axes(a, b), np.array([0, 2, 1])
    body, of_body = coefficients[..., order], covariance[..., order[:, None], order]
    variance = np.einsum("...ij,...jk,...ik->...i", turn, of_body, turn)
    # Derivatives by an angle: a quarter turn more, less what does not turn.
    by_a = _axes(a + 0.5 * np.pi, b) * np.array([[1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0]])
    by_b = _axes(a, b + 0.5 * np.pi) * np.array([[1.0], [1.0], [0.0]])
    for slope, std in zip((by_a, by_b), stds, strict=True):
        error = np.einsum("...ij,...j->...i", slope, body) * np.asarray(std, dtype=float)[..., None]
        variance = variance + error**2
    return TurnedCoefficients(np.einsum("...ij,...j->...i", turn, body), np.sqrt(variance))


def _axes(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return (.., 3, 3) unit vectors of drag, side force and lift in body axes."""
    drag = np.stack([np.cos(a) * np.cos(b), -np.sin(b), np.sin(a) * np.cos(b)], axis=-1)
    side = np.stack([np.cos(a) * np.sin(b), np.cos(b), np.sin(a) * np.sin(b)], axis=-1)
    lift = np.stack([-np.sin(a), np.zeros_like(a), np.cos(a)], axis=-1)
    return np.stack([drag, side, lift], axis=-2)
