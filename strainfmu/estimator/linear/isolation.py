"""Isolation of the gauge that is off: leave-one-out residuals, alarm level, ambiguous groups.

P (n_d, n_d) is the precision of the residual r = d - m. For gauge i, (P r)_i / P_ii is how far it reads from what
all others predict, with variance 1 / P_ii; so z_i = (P r)_i / sqrt(P_ii) is standard normal where all is well, and
a bias b of gauge i shifts it by b sqrt(P_ii). Source: Baarda, A testing procedure for use in geodetic networks
(1968), the w-test of "data snooping"; Rasmussen & Williams, section 5.4.2, for a Gaussian prior.
"""

from __future__ import annotations

import numpy as np

from strainfmu.estimator.alarm_limits import AMBIGUOUS_CORRELATION as AMBIGUOUS_CORRELATION
from strainfmu.estimator.alarm_limits import ambiguous_groups as ambiguous_groups
from strainfmu.estimator.alarm_limits import correlations as correlations
from strainfmu.estimator.alarm_limits import inverse_root as inverse_root
from strainfmu.estimator.alarm_limits import outlier_threshold as outlier_threshold


def suspects_by_gauge(
    n_gauges: int, groups: tuple[tuple[int, ...], ...]
) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
    """Return (n_gauges + 1,) the gauges to suspect where |z| of each is the largest, by index; the last is ().

    They are the gauge itself and its ambiguous group. Right for a single faulty gauge; of several at once the
    worst need not be one of them.
    """
    table = np.empty(n_gauges + 1, dtype=object)
    for gauge in range(n_gauges):
        table[gauge] = (gauge,)
    table[n_gauges] = ()
    for group in groups:
        for gauge in group:
            table[gauge] = group
    return table
