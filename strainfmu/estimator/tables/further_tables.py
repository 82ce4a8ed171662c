"""Tables of the loads of sections along a body of revolution over the flight state, and their errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.other_loads import SECTION_LOADS, is_moment
from strainfmu.estimator.tables.flight_tables import FlightTables


@dataclass(frozen=True, eq=False, kw_only=True)
class FurtherTables:
    """Tables and errors of m = 1 + 6 n_s further loads, in the order of
    :func:`~strainfmu.estimator.other_loads.other_load_names`.

    Attributes
    ----------
    response : (n_M + 2, n_a + 2, m, n_m, 2) spline coefficients per p_inf, on the knots of the tables [m2, m3].
    fixed_response : (m,) what does not follow p_inf [N, N m].
    strain_covariance : (m, n_d) Gamma_Fd, covariance with strain of pressure off the tables, per p_inf^2.
    variance : (m,) of their loads, per p_inf^2.
    """

    response: FloatArray
    fixed_response: FloatArray
    strain_covariance: FloatArray
    variance: FloatArray

    def check(self, tables: FlightTables) -> None:
        """Check shapes against those of the tables of strain, and that every number is finite.

        Raises
        ------
        InputError
            A shape is wrong or a value is not finite.
        """
        m, shape = len(self.variance), tables.response.shape
        expected = {
            "response": (*shape[:2], m, *shape[3:]),
            "fixed_response": (m,),
            "strain_covariance": (m, tables.n_gauges),
            "variance": (m,),
        }
        for name, wanted in expected.items():
            value = getattr(self, name)
            if value.shape != wanted or not np.all(np.isfinite(value)):
                raise InputError(f"further tables: {name}: expected finite values of {wanted}, got {value.shape}")

    def tables(self, of_strain: FlightTables) -> FlightTables:
        """Return the further loads as tables on the knots ``of_strain``."""
        return FlightTables(
            mach_knots=of_strain.mach_knots,
            incidence_knots=of_strain.incidence_knots,
            response=self.response,
            fixed_response=self.fixed_response,
        )

    def references(self, area: float, length: float) -> FloatArray:
        """Return (m,) S of forces and S L of moments [m2, m3]."""
        n_sections = (len(self.variance) - 1) // len(SECTION_LOADS)
        return area * np.where(is_moment(n_sections), length, 1.0)


UNITS = {
    "response": "m2, m3",
    "fixed_response": "N, N.m",
    "strain_covariance": "m2/Pa, m3/Pa",
    "variance": "m4, m6",
}
