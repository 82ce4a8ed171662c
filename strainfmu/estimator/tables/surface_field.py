"""Pressure on the surface over the flight state, and its covariance with strain about the tables.

On a body of revolution the pressure at station x and roll angle phi is p = p_inf sum_m P_m(x; M, a_T)
cos m(phi - phi_T), on any other shape p = p_inf (1 + V c(x)) at the nodes, c the tables of amplitudes of
modes V. A residual r = d - y(x) of strain corrects it as it corrects the loads: p + C S^-1 r,
C the covariance of pressure off the tables with its strain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import FloatArray
from strainfmu.estimator.tables.flight_tables import FlightTables
from strainfmu.estimator.tables.parameter_tables import Powers, known_powers
from strainfmu.estimator.tables.schema import Sizes, check, described, entry


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class FlightField:
    """Pressure at n_x stations times n_roll roll angles; node = station number * n_roll + roll number."""

    # fmt: off
    station: FloatArray = entry("n_x", "m", "of the nodes")
    radius: FloatArray = entry("n_x", "m", "outer radius")
    roll_angle: FloatArray = entry("n_roll", "rad", "from +z towards +y")
    amplitude: NDArray[np.float32] = entry("n_M+2 n_a+2 n_x n_m", "1",
        "spline coefficients of P_m, on the knots of the tables")
    strain_covariance: NDArray[np.float32] = entry("n_x n_h 2 n_d", "1/Pa",
        "C with strain of pressure off the tables, per p_inf^2: cosine and sine of m phi")
    error_std: FloatArray = entry("n_x", "1",
        "standard deviation of pressure off the tables at any roll angle, per p_inf")
    table_error_std: NDArray[np.float32] = entry("n_x n_roll", "1",
        "the same of interpolation and of higher harmonics, at phi - phi_T")
    # fmt: on

    def __post_init__(self) -> None:
        check(self, "pressure_field")

    @property
    def n_nodes(self) -> int:
        """Number of nodes n_p."""
        return len(self.station) * len(self.roll_angle)


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class FieldParameters:
    """What J powers of n_p flow parameters change of the amplitudes of n_q modes."""

    # fmt: off
    slope: NDArray[np.float32] = entry("n_M+2 n_a+2 J n_q n_m 2", "1", "spline coefficients per unit of a power")
    unit_error: FloatArray = entry("J n_q k_unit", "1",
        "errors per unit of a power, over the states of the snapshots")
    spread_error: FloatArray = entry("n_params n_q k_spread", "1",
        "errors of a parameter that is not known, part of the field's own")
    strain: FloatArray = entry("n_d n_q", "1/Pa", "strain of each mode, per p_inf")
    # fmt: on


@described
@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeField:
    """Pressure at the n_p nodes of the map."""

    # fmt: off
    modes: NDArray[np.float32] = entry("n_p n_q", "1", "of p / p_inf - 1")
    amplitude: FloatArray = entry("n_M+2 n_a+2 n_q n_m 2", "1",
        "spline coefficients of their amplitudes, on the knots of the tables")
    strain_covariance: NDArray[np.float32] = entry("n_p n_d", "1/Pa",
        "C with strain of pressure off the tables, per p_inf^2")
    error_std: FloatArray = entry("n_p", "1", "standard deviation of pressure off the tables, per p_inf")
    parameters: FieldParameters | None = entry(unit="", meaning="what flow parameters change; None for nothing",
        default=None, record=FieldParameters)
    # fmt: on

    def __post_init__(self) -> None:
        sizes: Sizes = check(self, "shape_field")
        if self.parameters is not None:
            check(self.parameters, "shape_field: parameters", **sizes)

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


def field_with_known(shape_field: ShapeField, powers: Powers, value: FloatArray, std: FloatArray) -> ShapeField:
    """Return ``shape_field`` where parameters of the flow are known; ``value`` and ``std`` as of
    :func:`~strainfmu.estimator.tables.manifold_map.with_known`.

    Its errors are less by the errors of their spread, and hold what is left.
    """
    held = shape_field.parameters
    if held is None:
        return shape_field
    known = known_powers(powers, value, std)
    spread, left = np.hstack([*held.spread_error]), np.hstack(known.errors(held.unit_error, held.spread_error))
    of_modes = left @ left.T - spread @ spread.T
    modes = shape_field.modes.astype(float)
    change = modes @ of_modes
    variance = shape_field.error_std**2 + np.einsum("pq,pq->p", change, modes)
    return replace(
        shape_field,
        amplitude=shape_field.amplitude + np.tensordot(held.slope, known.shift, axes=(2, 0)),
        strain_covariance=(shape_field.strain_covariance + change @ held.strain.T).astype(np.float32),
        # Where the spread is nearly all of it, rounding leaves less.
        error_std=np.sqrt(np.maximum(variance, 0.0)),
        parameters=None,
    )
