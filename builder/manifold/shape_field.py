"""Pressure on the surface of any shape over the flight state, and how far it may be off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.error_list import PROCESS, SPREAD, parts_of
from builder.inverse.noise.flow_models import LEVEL
from builder.inverse.noise.flows_between import FlowsBetween
from builder.inverse.noise.leeward import LEEWARD_PRESSURE
from builder.inverse.solution import Problem
from builder.manifold.condition_tables import condition_tables
from builder.manifold.discrepancy import process_size
from builder.manifold.parameter_slopes import ParameterSlopes
from builder.vehicle.file import Vehicle
from builder.vehicle.map.model_form import model_form
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.nonlinear_map import FieldParameters, ShapeField

_NEGLIGIBLE = 1e-3
"""Singular value, relative to the largest, below which a mode of the snapshots is left out."""


def shape_field(
    vehicle: Vehicle,
    snapshots: Snapshots,
    problem: Problem,
    process: FloatArray,
    overpressure: FloatArray,
    between: FlowsBetween | None,
) -> ShapeField:
    """Return the field at the nodes of ``snapshots``.

    Parameters
    ----------
    process : (n_p, k) fields of the Gaussian process at unit variance.
    overpressure : (n_p,) p / p_inf - 1 at the smallest incidence.
    between : flows between the snapshots; None where they are not known.
    """
    ambient = np.array([condition.ambient_pressure for condition in snapshots.conditions()])
    ratio = snapshots.pressure / ambient[:, None] - 1.0
    _, size, transposed = np.linalg.svd(ratio, full_matrices=False)
    modes = transposed[size > _NEGLIGIBLE * size[0]].T
    tables = condition_tables(snapshots, modes.T, True, between)
    rest = ratio - (ratio @ modes) @ modes.T
    variance = np.mean(rest**2, axis=0)
    if problem.off_the_snapshots is not None:
        variance += np.sum((problem.off_the_snapshots / problem.ensemble.mean_ambient_pressure) ** 2, axis=0)
    covariance = np.zeros((len(modes), len(problem.strain_operator)))
    expected = model_form(vehicle.map, vehicle.noise)
    fields = [(name, modes @ columns) for name, columns in tables.errors.items()]
    fields += [(PROCESS, process_size(vehicle, problem) * process)]
    fields += [(SPREAD, expected.of_prior * columns) for columns in _spread(problem)]
    if problem.leeward is not None:
        fields += [(LEEWARD_PRESSURE, problem.leeward.T / problem.ensemble.mean_ambient_pressure)]
    fields += [(LEVEL, expected.of_overpressure * overpressure[:, None])]
    for name, columns in fields:
        part = parts_of(name, problem.sensors is not None)[0]
        if part > 0.0:
            covariance += part**2 * (columns @ (problem.strain_operator @ columns).T)
        variance += np.sum(columns**2, axis=1)
    return ShapeField(
        modes=modes.astype(np.float32),
        amplitude=tables.coefficients,
        strain_covariance=covariance.astype(np.float32),
        error_std=np.sqrt(variance),
        parameters=_parameters(tables.slopes, problem.strain_operator @ modes),
    )


def _parameters(slopes: ParameterSlopes | None, strain: FloatArray) -> FieldParameters | None:
    """Return the ``slopes`` of modes whose strain per p_inf is ``strain`` (n_d, n_q)."""
    if slopes is None:
        return None
    unit, spread = slopes.compressed_errors()
    return FieldParameters(
        slope=slopes.slope.astype(np.float32), unit_error=unit, spread_error=spread, strain=strain
    )


def _spread(problem: Problem) -> Iterator[FloatArray]:
    """Yield fields (n_p, N) of the flows' difference from their mean, per p_inf."""
    ensemble, pressure = problem.ensemble, problem.ensemble.mean_ambient_pressure
    first, share = 0, np.sqrt(ensemble.member_weight) / pressure
    for block in ensemble.members():
        yield (share[first : first + len(block), None] * (block - ensemble.mean())).T
        first += len(block)
