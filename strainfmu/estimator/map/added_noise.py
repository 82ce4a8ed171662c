"""A map whose gauges have other errors than it was built for, which do not scale with the dynamic pressure.

Gamma_g changes, and all that follows from it: Gamma, gain, residual whitening, the covariance of the loads.
"""

from __future__ import annotations

from dataclasses import replace

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap


def with_gauge_covariance(
    inverse_map: InverseMap, own: FloatArray, of_tables: FloatArray | None = None
) -> InverseMap:
    """Return ``inverse_map`` for gauges whose errors that do not scale have the covariance ``own`` (n_d, n_d).

    ``of_tables`` (n_d, n_d) is their covariance about the tables; None for the same. Ranges and alarm scales stay.

    Raises
    ------
    InputError
        One of them is no covariance.
    """
    flight = inverse_map.manifold
    if flight is not None:
        flight = replace(flight, gauge_covariance=own if of_tables is None else of_tables)
    return replace(inverse_map, gauge_covariance=own, manifold=flight)
