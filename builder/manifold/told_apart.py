"""Whether gauges distinguish winds from different sides.

Gauges in one plane through the axis read the same of a wind and of its mirror image: strain then has two
solutions, and the covariance of the one that is found knows nothing of the other.
"""

from __future__ import annotations

import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W, evaluate
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.reference.nonlinear import strain_covariance

ROLLS = 24
"""Roll angles of the wind that are compared."""

APART = np.radians(45.0)
"""Smallest difference of two roll angles that counts."""

TOLD, EXPLAINED = 9.0, 25.0
"""Square of the distance in strain, in standard deviations, from which two winds are distinguished, and by how
much more the linearised problem, from which the sigmas of the estimate follow, may have between them."""


def check_told_apart(manifold: ManifoldMap) -> None:
    """Refuse tables with winds that gauges read alike, far apart though they are by the estimate's own sigmas.

    Raises
    ------
    InputError
        Names two such winds, in the middle of the ranges.
    """
    angles = winds_read_alike(manifold)
    if angles is not None:
        first, second = (round(float(np.degrees(angle))) for angle in angles)
        raise InputError(
            f"gauges: expected some off one plane through the axis for the nonlinear estimator, got wind at roll "
            f"angle {first} deg and at {second} deg that strain all of them alike; or map.estimator = 'linear'"
        )


def winds_read_alike(manifold: ManifoldMap) -> tuple[float, float] | None:
    """Return the roll angles [rad] of two winds that gauges do not distinguish, where the linearised problem does.

    They are those that it has farthest apart, None where there are none.
    """
    n_d = manifold.tables.n_gauges
    roll = 2.0 * np.pi * np.arange(ROLLS) / ROLLS
    middle, half = manifold.crossflow
    state = np.zeros((ROLLS, N_STATES))
    state[:, MACH], state[:, LOG_PRESSURE] = manifold.mach_range.mean(), np.log(manifold.pressure_range).mean()
    state[:, U], state[:, W] = (
        centre + 0.5 * size * wave
        for centre, size, wave in zip(middle, half, (np.cos(roll), np.sin(roll)), strict=True)
    )
    response = evaluate(manifold.tables, state)
    factors = np.linalg.cholesky(strain_covariance(manifold, manifold.gauge_covariance, state))
    far = np.abs(np.angle(np.exp(1j * (roll[:, None] - roll)))) >= APART
    worst, pair = 0.0, None
    for i, factor in enumerate(factors):
        strain = np.linalg.solve(factor, (response.value[:, :n_d] - response.value[i, :n_d]).T)
        slope = np.linalg.solve(factor, response.jacobian[i, :n_d])
        distance, linear = np.sum(strain**2, axis=0), np.sum((slope @ (state - state[i]).T) ** 2, axis=0)
        alike = far[i] & (distance < TOLD) & (linear - distance > EXPLAINED)
        j = int(np.argmax(np.where(alike, linear - distance, 0.0)))
        if alike[j] and linear[j] - distance[j] > worst:
            worst, pair = float(linear[j] - distance[j]), (float(roll[min(i, j)]), float(roll[max(i, j)]))
    return pair
