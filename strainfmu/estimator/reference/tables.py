"""Strain and loads over the flight state x = (M, u, w, ln p_inf), and their errors, as rows of the update.

Rows of the tables (:mod:`strainfmu.estimator.tables.flight_tables`) are the n_d strains, then the m outputs: five
loads, rolling moment and section loads.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.tables import flight_tables
from strainfmu.estimator.tables.flight_tables import LOG_PRESSURE as LOG_PRESSURE
from strainfmu.estimator.tables.flight_tables import MACH as MACH
from strainfmu.estimator.tables.flight_tables import MIN_INCIDENCE as MIN_INCIDENCE
from strainfmu.estimator.tables.flight_tables import N_STATES as N_STATES
from strainfmu.estimator.tables.flight_tables import FlightTables
from strainfmu.estimator.tables.flight_tables import U as U
from strainfmu.estimator.tables.flight_tables import W as W
from strainfmu.estimator.tables.manifold_map import ManifoldMap
from strainfmu.estimator.tables.parameter_tables import with_known


@dataclass(frozen=True, kw_only=True, eq=False)
class Tables:
    """Tables of n_d + m rows, and the errors of pressure about them, per p_inf.

    ``rows`` are the tables, ``fixed`` (n_d + m,) what does not follow p_inf. Pressure off the tables has the
    strain columns ``error_strain`` (n_d, k) per standard deviation, covariances ``cross`` (n_d, m) with the
    outputs and ``output_variance`` (m, m) of them.
    """

    rows: FlightTables
    fixed: FloatArray
    error_strain: FloatArray
    cross: FloatArray
    output_variance: FloatArray


def tables_of(inverse_map: InverseMap) -> Tables:
    """Return the tables of a nonlinear map."""
    assert inverse_map.manifold is not None
    return _rows_of(inverse_map.manifold)


def with_known_parameters(inverse_map: InverseMap, tables: Tables, value: FloatArray, std: FloatArray) -> Tables:
    """Return ``tables`` where flow parameters are known: ``value`` and ``std`` (n_p,), NaN of one that is not."""
    assert inverse_map.manifold is not None
    if not np.any(np.isfinite(value) & np.isfinite(std)):
        return tables
    return _rows_of(with_known(inverse_map.manifold, value, std))


def evaluate(tables: Tables, state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rows (n_d + m,) at the flight ``state`` (4,), and their derivatives (n_d + m, 4)."""
    value, jacobian = flight_tables.evaluate(tables.rows, state[None])
    return value[0], jacobian[0]


def _rows_of(manifold: ManifoldMap) -> Tables:
    rows = manifold.tables_of(manifold.n_loads)
    return Tables(
        rows=rows,
        fixed=rows.fixed_response,
        error_strain=manifold.error_strain,
        cross=manifold.load_strain_covariance.T,
        output_variance=manifold.load_covariance,
    )
