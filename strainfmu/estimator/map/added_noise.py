"""A map whose gauges have larger errors than it was built for, which do not scale with the dynamic pressure.

Gamma_g grows by D, and all that follows from it: Gamma, gain, residual whitening, the covariance of the loads.
"""

from __future__ import annotations

from dataclasses import replace

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap


def with_added_noise(inverse_map: InverseMap, covariance: FloatArray) -> InverseMap:
    """Return ``inverse_map`` for gauges with further errors of ``covariance`` (n_d, n_d) [(m/m)^2].

    Ranges and alarm scales stay. No further error gives the same map.

    Raises
    ------
    InputError
        The sum is no covariance.
    """
    if not covariance.any():
        return inverse_map
    flight, thermal = inverse_map.manifold, inverse_map.thermal
    if flight is not None:
        flight = replace(flight, gauge_covariance=flight.gauge_covariance + covariance)
    thermal = replace(thermal, isothermal_covariance=thermal.isothermal_covariance + covariance)
    own = inverse_map.gauge_covariance + covariance
    return replace(inverse_map, gauge_covariance=own, manifold=flight, thermal=thermal)


def with_gauge_covariance(inverse_map: InverseMap, own: FloatArray) -> InverseMap:
    """Return ``inverse_map`` for gauges whose errors that do not scale have the covariance ``own`` (n_d, n_d).

    Raises
    ------
    InputError
        ``own`` is no covariance.
    """
    flight = inverse_map.manifold
    if flight is not None:
        flight = replace(flight, gauge_covariance=own)
    return replace(inverse_map, gauge_covariance=own, manifold=flight)
