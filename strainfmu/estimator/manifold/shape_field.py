"""Pressure on the surface of any shape over the flight state, and its covariance with strain about the tables.

p = p_inf (1 + V c(x)) at the nodes, c the tables of amplitudes of modes V. A residual r = d - y(x) of strain
corrects it as it corrects the loads: p + C S^-1 r, C the covariance of pressure off the tables with its strain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.manifold.flight_tables import FlightTables


@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeField:
    """Pressure at the n_p nodes of the map.

    Attributes
    ----------
    modes : (n_p, n_q) of p / p_inf - 1 [1].
    amplitude : (n_M + 2, n_a + 2, n_q, n_m, 2) spline coefficients of their amplitudes, on the tables' knots.
    strain_covariance : (n_p, n_d) covariance C with strain of pressure off the tables, per p_inf^2 [1/Pa].
    error_std : (n_p,) standard deviation of pressure off the tables, per p_inf [1].
    """

    modes: NDArray[np.float32]
    amplitude: FloatArray
    strain_covariance: NDArray[np.float32]
    error_std: FloatArray

    def __post_init__(self) -> None:
        n_p, n_q = self.modes.shape
        shapes = {
            "amplitude": (*self.amplitude.shape[:2], n_q, *self.amplitude.shape[3:4], 2),
            "strain_covariance": (n_p, *self.strain_covariance.shape[1:2]),
            "error_std": (n_p,),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise InputError(f"shape_field: {name}: expected finite values of {shape}, got {value.shape}")

    @property
    def n_nodes(self) -> int:
        """Number of nodes n_p."""
        return len(self.modes)

    def tables(self, of_strain: FlightTables) -> FlightTables:
        """Return the amplitudes as tables on the knots of ``of_strain``."""
        return FlightTables(
            mach_knots=of_strain.mach_knots,
            incidence_knots=of_strain.incidence_knots,
            response=self.amplitude,
            fixed_response=np.zeros(self.modes.shape[1]),
        )


UNITS = {"strain_covariance": "1/Pa"}
