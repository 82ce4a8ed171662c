"""Pressure on a body of revolution over the flight state, and its covariance with strain about the tables.

The pressure at station x and roll angle phi is p = p_inf sum_m P_m(x; M, a_T) cos m(phi - phi_T). A residual
r = d - y(x) of strain corrects it as it corrects the loads: p + C S^-1 r, C the covariance of the pressure off the
tables with its strain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightField:
    """Pressure at n_x stations times n_roll roll angles; node = station number * n_roll + roll number.

    Attributes
    ----------
    station, radius : (n_x,) [m], outer radius.
    roll_angle : (n_roll,) from +z towards +y [rad].
    amplitude : (n_M + 2, n_a + 2, n_x, n_m) spline coefficients of P_m [1], on the knots of the tables.
    strain_covariance : (n_x, n_h, 2, n_d) covariance C with strain of pressure off the tables, per p_inf^2: cosine
        and sine of m phi [1/Pa].
    error_std : (n_x,) standard deviation of pressure off the tables at any roll angle, per p_inf [1].
    table_error_std : (n_x, n_roll) the same of interpolation and of higher harmonics, at phi - phi_T [1].
    """

    station: FloatArray
    radius: FloatArray
    roll_angle: FloatArray
    amplitude: NDArray[np.float32]
    strain_covariance: NDArray[np.float32]
    error_std: FloatArray
    table_error_std: NDArray[np.float32]

    def __post_init__(self) -> None:
        n_x, n_roll = len(self.station), len(self.roll_angle)
        shapes = {
            "radius": (n_x,),
            "amplitude": (*self.amplitude.shape[:2], n_x, *self.amplitude.shape[3:4]),
            "strain_covariance": (n_x, *self.strain_covariance.shape[1:2], 2, *self.strain_covariance.shape[3:4]),
            "error_std": (n_x,),
            "table_error_std": (n_x, n_roll),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise InputError(f"pressure_field: {name}: expected finite values of {shape}, got {value.shape}")

    @property
    def n_nodes(self) -> int:
        """Number of nodes n_p."""
        return len(self.station) * len(self.roll_angle)


UNITS = {
    "station": "m",
    "radius": "m",
    "roll_angle": "rad",
    "strain_covariance": "1/Pa",
}
