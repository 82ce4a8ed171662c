"""Loads and coefficients of a solution about the moment point and at the references of the settings."""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import BoolArray
from strainfmu.estimator.estimates.load_estimate import LoadEstimates, empty_estimates
from strainfmu.estimator.estimates.pressure_field import FieldInputs
from strainfmu.estimator.linear.moment_point import moment_transfer
from strainfmu.estimator.manifold.solve import FlightSolution
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.settings import EstimatorSettings, default_settings
from strainfmu.estimator.tables.manifold_map import ManifoldMap


class ReferenceLoads:
    """Turns loads and coefficients from the references of a map to those of settings."""

    def __init__(self, inverse_map: InverseMap, manifold: ManifoldMap, settings: EstimatorSettings) -> None:
        """Prepare the change of references; ``manifold`` are the tables of ``inverse_map``."""
        self._transfer = moment_transfer(settings.moment_station - default_settings(inverse_map).moment_station)
        area, length = settings.reference_area, settings.reference_length
        reference = area * np.array([1.0, 1.0, 1.0, length, length])
        self._turn = self._transfer * manifold.references / reference[:, None]
        self._sections, self._further_turn = None, np.zeros(0)
        if inverse_map.further is not None:
            self._sections = inverse_map.further.section_station
        if manifold.further is not None:
            own = manifold.further.references(manifold.reference_area, manifold.reference_length)
            self._further_turn = own / manifold.further.references(area, length)

    def estimates(
        self, found: FlightSolution, used: BoolArray, field_inputs: FieldInputs | None, n_parameters: int
    ) -> LoadEstimates:
        """Return estimates with the loads and coefficients of ``found``; the rest is still empty.

        Parameters
        ----------
        used : (k, n_d) rows that were used.
        field_inputs : what the pressure field is estimated from; None for a map without it.
        n_parameters : further parameters of the flow.
        """
        out = empty_estimates(
            len(used),
            used.shape[1],
            field_inputs=field_inputs,
            section_station=self._sections,
            n_parameters=n_parameters,
        )
        of_load = self._transfer @ found.load_covariance @ self._transfer.T
        of_coefficient = self._turn @ found.coefficient_covariance @ self._turn.T
        out.valid[:] = used
        out.loads[:], out.load_covariance[:] = found.loads @ self._transfer.T, of_load
        out.loads_std[:] = np.sqrt(np.diagonal(of_load, axis1=1, axis2=2))
        out.coefficients[:], out.coefficient_covariance[:] = found.coefficients @ self._turn.T, of_coefficient
        out.coefficients_std[:] = np.sqrt(np.diagonal(of_coefficient, axis1=1, axis2=2))
        if len(self._further_turn):
            turn = self._further_turn
            out.further_loads[:], out.further_loads_std[:] = found.further_loads, np.sqrt(found.further_variance)
            out.further_coefficients[:] = turn * found.further_coefficients
            out.further_coefficients_std[:] = turn * np.sqrt(found.further_coefficient_variance)
        return out
