"""Errors in proportion to strain at the current strain: gain, stiffness, wall, gauge position, layout roll.

The weights hold these errors at their mean over the snapshots. A flight at high incidence has larger ones, a
flight at low incidence smaller. The strain of an error is nearly linear in the coefficients C that the step has
estimated, so with c = [1, C] the covariance is the one in the weights plus

    s^2 sum_ab (c_a c_b - mean of c_a c_b) G H_ab G',   H_ab = diag(sum_t D_tai D_tbi) + sum_t E_ta E_tb',

D_t a term that is independent from gauge to gauge, E_t one that all gauges have in common, both per standard
deviation. The same sum with the precision P instead of G gives the expected chi-square. G and P change slowly
with the pressure ratio s: their products are computed at fixed levels and are linear in s between them.
"""

from __future__ import annotations

from dataclasses import dataclass

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap

PAIRS = tuple((a, b) for a in range(6) for b in range(a, 6))
"""The 21 products c_a c_b of c = [1, C_A, C_N, C_Y, M_P, M_Y], a <= b."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorModel:
    """Errors of one standard deviation per coefficient.

    Attributes
    ----------
    of_gauge : (21, n_d) sum over the terms of D_a D_b, doubled for a < b [(m/m)^2].
    common : (n_t, 6, n_d) E of each term that all gauges have in common [m/m].
    mean_product : (21,) mean of c_a c_b over the snapshots [1].
    """

    of_gauge: FloatArray
    common: FloatArray
    mean_product: FloatArray


def error_model(inverse_map: InverseMap) -> ErrorModel:
    """Return the errors of ``inverse_map`` that follow the current strain."""
    return ErrorModel(
        of_gauge=inverse_map.gauge_error_product,
        common=inverse_map.common_error,
        mean_product=inverse_map.mean_product,
    )
