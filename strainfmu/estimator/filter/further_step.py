"""Loads of sections in the filter of the nonlinear estimator, at the law of its states.

As the five loads: those of the tables, those of the discrepancy that is estimated, and what the residual of strain
says of the rest. No state is of sections alone: they change nothing of the other estimates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.filter.seen_errors import SeenErrors
from strainfmu.estimator.manifold.further_estimate import FurtherEstimate
from strainfmu.estimator.tables.flight_tables import N_STATES, evaluate
from strainfmu.estimator.tables.further_tables import FurtherTables
from strainfmu.estimator.tables.manifold_map import ManifoldMap


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenFurther:
    """What pressure off the tables does to m further loads, by the directions that gauges see and the rest.

    Attributes
    ----------
    load : (m, r) per standard deviation of the r directions, per p_inf [m2, m3].
    rest_cross : (m, n_d) covariance with strain of the rest, per p_inf^2.
    rest_variance : (m,) of the rest, per p_inf^2.
    """

    load: FloatArray
    rest_cross: FloatArray
    rest_variance: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class StrainRows:
    """What strain says at a law of n states, in the n_u gauges used.

    Attributes
    ----------
    errors : (n,) mean of the law, 0 for the flight state.
    residual : (n_u,) that all states leave of strain.
    jacobian : (n_u, n) of strain by the states.
    noise : (n_u, n_u) covariance of the residual at known states.
    """

    errors: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    noise: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class PressureRow:
    """q_inf at a law of n states.

    Attributes
    ----------
    static : p_inf [Pa].
    dynamic : q_inf [Pa].
    of_log : (n,) derivative of ln q_inf by the states.
    wider : variance that covers the error of q_inf, over that of ln q_inf.
    """

    static: float
    dynamic: float
    of_log: FloatArray
    wider: float


def seen_further(further: FurtherTables, seen: SeenErrors, std: FloatArray) -> SeenFurther:
    """Split the errors of ``further`` as ``seen`` splits those of strain.

    ``std`` (n_d,) is what :func:`~strainfmu.estimator.filter.seen_errors.seen_errors` had. The strains of its
    directions over it are orthogonal: the covariance of a load with strain gives the load of each direction.
    """
    direction = seen.strain / std[:, None]
    square = np.sum(direction * direction, axis=0)
    load = (further.strain_covariance / std) @ (direction / np.where(square > 0.0, square, 1.0))
    return SeenFurther(
        load=load,
        rest_cross=further.strain_covariance - load @ seen.strain.T,
        # Of a load that the directions tell wholly, rounding leaves less.
        rest_variance=np.maximum(further.variance - np.sum(load * load, axis=1), 0.0),
    )


def further_solution(
    manifold: ManifoldMap,
    seen: SeenFurther | None,
    covariance: FloatArray,
    state: FloatArray,
    *,
    used: BoolArray,
    strain: StrainRows,
    pressure: PressureRow,
    discrepancy: slice,
) -> FurtherEstimate:
    """Return the further loads, arrays with one row, m = 0 for none.

    Parameters
    ----------
    covariance : (n, n) of the states.
    state : (4,) flight state.
    used : (n_d,) of bool, gauges to use.
    discrepancy : the states of the directions that ``seen`` has.
    """
    further = manifold.further
    if further is None or seen is None:
        return FurtherEstimate(*(np.zeros((1, 0)) for _ in range(4)))
    response = evaluate(further.tables(manifold.tables), state[None])
    of_states = np.zeros((len(seen.load), len(covariance)))
    of_states[:, :N_STATES], of_states[:, discrepancy] = response.jacobian[0], pressure.static * seen.load
    cross = pressure.static**2 * seen.rest_cross[:, used]
    turned = np.linalg.solve(strain.noise, cross.T).T
    loads = response.value[0] + of_states @ strain.errors + turned @ strain.residual
    by_state = of_states - turned @ strain.jacobian
    remaining = np.maximum(pressure.static**2 * seen.rest_variance - np.sum(turned * cross, axis=1), 0.0)
    scale = 1.0 / (pressure.dynamic * further.references(manifold.reference_area, manifold.reference_length))
    coefficients = scale * loads
    of_coefficients = scale[:, None] * by_state - np.outer(coefficients, pressure.of_log)
    variance = np.sum(by_state @ covariance * by_state, axis=1) + remaining
    of_both = np.sum(of_coefficients @ covariance * of_coefficients, axis=1) + scale**2 * remaining
    return FurtherEstimate(
        loads=loads[None],
        variance=variance[None],
        coefficients=coefficients[None],
        coefficient_variance=(pressure.wider * of_both)[None],
    )
