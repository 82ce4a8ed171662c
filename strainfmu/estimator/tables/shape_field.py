"""Pressure on the surface of any shape over the flight state, and its covariance with strain about the tables.

p = p_inf (1 + V c(x)) at the nodes, c the tables of amplitudes of modes V. A residual r = d - y(x) of strain
corrects it as it corrects the loads: p + C S^-1 r, C the covariance of pressure off the tables with its strain.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.estimator.tables.flight_tables import FlightTables
from strainfmu.estimator.tables.parameter_tables import Powers, known_powers
from strainfmu.records import inner_record


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldParameters:
    """What J powers of n_p flow parameters change of the amplitudes of n_q modes.

    Attributes
    ----------
    slope : (n_M + 2, n_a + 2, J, n_q, n_m, 2) spline coefficients per unit of a power [1].
    unit_error : (J, n_q, k) errors per unit of a power, over the states of the snapshots [1].
    spread_error : (n_p, n_q, k) errors of a parameter that is not known, which the field's own ones hold [1].
    strain : (n_d, n_q) strain of each mode, per p_inf [1/Pa].
    """

    slope: NDArray[np.float32]
    unit_error: FloatArray
    spread_error: FloatArray
    strain: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeField:
    """Pressure at the n_p nodes of the map.

    Attributes
    ----------
    modes : (n_p, n_q) of p / p_inf - 1 [1].
    amplitude : (n_M + 2, n_a + 2, n_q, n_m, 2) spline coefficients of their amplitudes, on the tables' knots.
    strain_covariance : (n_p, n_d) covariance C with strain of pressure off the tables, per p_inf^2 [1/Pa].
    error_std : (n_p,) standard deviation of pressure off the tables, per p_inf [1].
    parameters : what flow parameters change; None where the map holds none.
    """

    modes: NDArray[np.float32]
    amplitude: FloatArray
    strain_covariance: NDArray[np.float32]
    error_std: FloatArray
    parameters: FieldParameters | None = field(
        default=None, metadata=inner_record(FieldParameters, {STRAIN: "1/Pa"})
    )

    def __post_init__(self) -> None:
        n_p, n_q = self.modes.shape
        shapes = {
            "amplitude": (*self.amplitude.shape[:2], n_q, *self.amplitude.shape[3:4], 2),
            "strain_covariance": (n_p, *self.strain_covariance.shape[1:2]),
            "error_std": (n_p,),
        }
        values = {name: getattr(self, name) for name in shapes}
        held = self.parameters
        if held is not None:
            n_j = len(held.unit_error)
            shapes |= {
                "slope": (*self.amplitude.shape[:2], n_j, *self.amplitude.shape[2:]),
                "unit_error": (n_j, n_q, *held.unit_error.shape[2:3]),
                "spread_error": (*held.spread_error.shape[:1], n_q, *held.spread_error.shape[2:3]),
                STRAIN: (*self.strain_covariance.shape[1:2], n_q),
            }
            values |= {name: getattr(held, name) for name in ("slope", "unit_error", "spread_error", STRAIN)}
        for name, shape in shapes.items():
            value = values[name]
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


def field_with_known(shape_field: ShapeField, powers: Powers, value: FloatArray, std: FloatArray) -> ShapeField:
    """Return ``shape_field`` where parameters of the flow are known; ``value`` and ``std`` as of
    :func:`~strainfmu.estimator.tables.parameter_tables.with_known`.

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


UNITS = {"strain_covariance": "1/Pa"}
