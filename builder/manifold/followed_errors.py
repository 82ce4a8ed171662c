"""Hardware errors that follow the flight state: their strain as quadratic forms of the loads.

The estimator holds the variance of the error of each gauge as c' Q c, c = [1, C_A, C_N, C_Y, M_P, M_Y], see
:class:`~strainfmu.estimator.map.nonlinear_map.ManifoldMap`. The strain of an error is regressed on c. What is
left, above all of hoop gauges shifted round the body next to the leeward meridian, grows with the square of the
incidence and depends on where the wind comes from: its square is fitted by squares of combinations of c.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import nnls

from builder.inverse.noise.error_list import error_named
from builder.inverse.solution import Problem
from builder.manifold.sensor_tables import friction_error
from builder.structure.as_built_kinds import Role
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import PAIRS
from strainfmu.estimator.other_loads import FIVE_LOADS

DIRECTIONS = 12
"""Roll angles of the combinations that look into one direction."""

_FIRST, _SECOND = np.array(PAIRS).T
_TWICE = np.where(_FIRST == _SECOND, 1.0, 2.0)


def followed_errors(vehicle: Vehicle, problem: Problem) -> dict[str, Any]:
    """Return a map's fields of errors that follow strain, but for gains: of each gauge (21, n_d), and common ones
    (n_t, 6, n_d) that are estimated and considered."""
    reference, ensemble = vehicle.reference_quantities(), problem.ensemble
    n_d = len(problem.strain_operator)
    scale = reference.area * np.array([1.0, 1.0, 1.0, reference.length, reference.length])
    pressure = np.tile(ensemble.ambient_pressure, ensemble.rolls)[:, None]
    loads = ensemble.responses(problem.load_operator[FIVE_LOADS]) / pressure / scale
    c = np.hstack([np.ones((len(loads), 1)), loads])
    root = np.sqrt(ensemble.member_weight)[:, None]
    products, square = np.zeros((len(PAIRS), n_d)), np.zeros((len(c), n_d))
    common: dict[Role, list[FloatArray]] = {"estimated": [], "considered": []}
    for error in [*problem.errors, *friction_error(vehicle, problem)]:
        if error.name in ("gauge gain", "common gain", "sensor gain"):
            continue
        strain = error.strain / pressure
        slope = np.linalg.lstsq(root * c, root * strain, rcond=1e-10)[0]
        if not error.common or error.with_rest:
            square += (strain - c @ slope) ** 2
        if error.common:
            common[error_named(error.name).role].append(slope)
            continue
        products += _TWICE[:, None] * slope[_FIRST] * slope[_SECOND]
    estimated, considered = (np.array(slopes).reshape(-1, 6, n_d) for slopes in common.values())
    return {
        "gauge_error_product": products + squares_fitted(c, square, ensemble.member_weight),
        "common_error": estimated,
        "considered_common": considered,
    }


def squares_fitted(c: FloatArray, square: FloatArray, weight: FloatArray) -> FloatArray:
    """Return (21, n_d) products whose quadratic form in ``c`` (n, 6) fits ``square`` (n, n_d), and is nowhere
    negative.

    The form is a sum of squares of combinations of c, with factors by non-negative least squares of ``weight``
    (n,).
    """
    combinations = _combinations(c)
    root = np.sqrt(weight)[:, None]
    size = np.maximum(square.max(axis=0), 1e-300)
    of_combination = (c @ combinations.T) ** 2
    # The triangular factor in place of all members: the same least squares, at a fraction of the size.
    basis, triangle = np.linalg.qr(root * of_combination)
    target = basis.T @ (root * square / size)
    factor = np.array([nnls(triangle, column)[0] for column in target.T]).T * size
    return np.asarray((_TWICE[:, None] * (combinations[:, _FIRST] * combinations[:, _SECOND]).T) @ factor)


def _combinations(c: FloatArray) -> FloatArray:
    """Return (k, 6) combinations of ``c`` (n, 6): the mean, what C_A rises by, forces and moments across into all
    directions, and sums of these with the rise of C_A."""
    rise = np.zeros(len(PAIRS[:6]))
    low, high = c[:, 1].min(), c[:, 1].max()
    rise[:2] = np.array([-low, 1.0]) / (high - low) if high > low else 0.0
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    directions = [np.eye(6)[0], rise]
    for first in (2, 4):
        largest = np.hypot(c[:, first], c[:, first + 1]).max()
        across = np.zeros((DIRECTIONS, 6))
        if largest > 0.0:
            across[:, first], across[:, first + 1] = np.cos(angle) / largest, np.sin(angle) / largest
        directions += [*across[: DIRECTIONS // 2], *(across + rise)]
    return np.array(directions)
