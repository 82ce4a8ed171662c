"""Coefficients in wind and stability axes, where the angles of the flow are known.

The wind seen by the body is V (cos a cos b, -sin b, sin a cos b). Drag acts along it, lift upward in the plane of
symmetry and normal to it, the wind-axis side force to starboard and normal to both. Stability axes are the wind
axes of b = 0: their side force is the body's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import FloatArray, float_or_array
from strainfmu.estimator.estimates.load_estimate import ShownEstimate


@dataclass(frozen=True, eq=False)
class TurnedCoefficients:
    """Drag, side force and lift coefficient [1], (.., 3), and their standard deviations."""

    values: FloatArray
    std: FloatArray

    @property
    def C_D(self) -> Any:
        """Drag coefficient [1], positive along the wind."""
        return float_or_array(self.values[..., 0])

    @property
    def C_S(self) -> Any:
        """Side force coefficient [1] of these axes, positive to starboard."""
        return float_or_array(self.values[..., 1])

    @property
    def C_L(self) -> Any:
        """Lift coefficient [1], positive up."""
        return float_or_array(self.values[..., 2])


def in_wind_axes(
    estimate: ShownEstimate,
    angle_of_attack: ArrayLike,
    sideslip_angle: ArrayLike,
    angle_std: ArrayLike = 0.0,
) -> TurnedCoefficients:
    """Return C_D, C_S and C_L of ``estimate`` in wind axes.

    Parameters
    ----------
    estimate : of one sample or of k.
    angle_of_attack, sideslip_angle : of the wind [rad], one or one of each sample.
    angle_std : standard deviation of either angle's error [rad], which adds to the variances to first order.
    """
    a, b, std = (np.asarray(value, dtype=float) for value in (angle_of_attack, sideslip_angle, angle_std))
    return _turned(estimate, _axes(a, b), [(slope, std) for slope in _slopes(a, b)])


def in_stability_axes(
    estimate: ShownEstimate, angle_of_attack: ArrayLike, angle_std: ArrayLike = 0.0
) -> TurnedCoefficients:
    """Return C_D, C_S and C_L of ``estimate`` in stability axes; arguments as of :func:`in_wind_axes`."""
    a, std = np.asarray(angle_of_attack, dtype=float), np.asarray(angle_std, dtype=float)
    return _turned(estimate, _axes(a, np.zeros_like(a)), [(_slopes(a, np.zeros_like(a))[0], std)])


def _turned(
    estimate: ShownEstimate, turn: FloatArray, errors: list[tuple[FloatArray, FloatArray]]
) -> TurnedCoefficients:
    """Return the coefficients by ``turn`` (.., 3, 3); ``errors``: its slopes by angles, and the angles' std."""
    order = np.array([0, 2, 1])
    body = estimate.coefficients[..., order]
    covariance = estimate.coefficient_covariance[..., order[:, None], order]
    variance = np.einsum("...ij,...jk,...ik->...i", turn, covariance, turn)
    for slope, std in errors:
        variance = variance + (np.einsum("...ij,...j->...i", slope, body) * std[..., None]) ** 2
    return TurnedCoefficients(np.einsum("...ij,...j->...i", turn, body), np.sqrt(variance))


def _slopes(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of :func:`_axes` by a and b: a quarter turn further, less what does not turn."""
    by_a = _axes(a + 0.5 * np.pi, b) * np.array([[1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0]])
    by_b = _axes(a, b + 0.5 * np.pi) * np.array([[1.0], [1.0], [0.0]])
    return by_a, by_b


def _axes(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return (.., 3, 3) unit vectors of drag, side force and lift in body axes."""
    a, b = np.broadcast_arrays(a, b)
    zero = np.zeros_like(a)
    drag = np.stack([np.cos(a) * np.cos(b), -np.sin(b), np.sin(a) * np.cos(b)], axis=-1)
    side = np.stack([np.cos(a) * np.sin(b), np.cos(b), np.sin(a) * np.sin(b)], axis=-1)
    lift = np.stack([-np.sin(a), zero, np.cos(a)], axis=-1)
    return np.stack([drag, side, lift], axis=-2)
