"""Pressure off the tables: interpolation, fractions of the snapshots' spread and level, and a Gaussian process.

Each is a set of pressure fields of one standard deviation, per p_inf; what the estimator needs are their strain
and loads.
"""

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.inverse.solution import Problem
from builder.vehicle.map_options import MapEntry
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.reference.nonlinear import strain_covariance

_NEGLIGIBLE = 1e-3
"""Eigenvalue relative to the largest below which a shape of the Gaussian process is left out."""

_LEFT_OF_VARIANCE = 0.02
"""Part of the variance of the process on a surface that may be missing at any node."""


def gaussian_process_shapes(grid: SurfaceGrid, entry: MapEntry) -> tuple[FloatArray, FloatArray]:
    """Return shapes (n_x, a) along and (n_roll, b) round the body whose products have unit variance in the sum.

    The correlation of pressure at two points is exp(-(dx / l_x)^2 / 2 - (dphi / l_phi)^2 / 2). The section [map]
    states l_x over the length of the body, and l_phi.
    """
    axial_length = entry.discrepancy_length * float(grid.x[-1])
    along = np.exp(-0.5 * ((grid.x[:, None] - grid.x) / axial_length) ** 2)
    difference = np.angle(np.exp(1j * (grid.roll_angle[:, None] - grid.roll_angle)))
    around = np.exp(-0.5 * (difference / float(np.deg2rad(entry.discrepancy_roll_deg))) ** 2)
    return _factor(along), _factor(around)


def _factor(correlation: FloatArray) -> FloatArray:
    value, vector = np.linalg.eigh(correlation)
    significant = value > _NEGLIGIBLE * value[-1]
    return np.asarray(vector[:, significant] * np.sqrt(value[significant]))


def response_of_shapes(operator: FloatArray, along: FloatArray, around: FloatArray) -> FloatArray:
    """Return (n, a b) of ``operator`` (n, n_p) to all products of shapes ``along`` (n_x, a), ``around``
    (n_roll, b)."""
    rings = operator.reshape(len(operator), len(along), len(around))
    return np.einsum("nxr,xa,rb->nab", rings, along, around, optimize=True).reshape(len(operator), -1)


def process_on_surface(mesh: SurfaceMesh, entry: MapEntry) -> FloatArray:
    """Return fields (n_p, k) of a Gaussian process of unit variance on any surface, by pivoted Cholesky.

    The correlation is exp(-|e - e'|^2 / 2) of e = (x / (l_x L), [r, n] / (sqrt(2) l_phi)), r the unit vector from
    the axis and n the normal: on a round body the correlation of :func:`gaussian_process_shapes`, while the two
    sides of a fin are apart. Lengths as there, L the length of the surface.

    Source: Harbrecht, Peters and Schneider, Appl. Numer. Math. 62 (2012) 428.
    """
    across = mesh.point[:, 1:]
    distance = np.linalg.norm(across, axis=1, keepdims=True)
    radial = across / np.where(distance > 0.0, distance, 1.0)
    length = entry.discrepancy_length * float(np.ptp(mesh.point[:, 0]))
    roll_angle = float(np.deg2rad(entry.discrepancy_roll_deg))
    place = np.hstack([radial, mesh.node_normal]) / (np.sqrt(2.0) * roll_angle)
    place = np.column_stack([mesh.point[:, 0] / length, place])
    remaining, columns = np.ones(len(place)), np.zeros((len(place), 0))
    while remaining.max() > _LEFT_OF_VARIANCE:
        pivot = int(np.argmax(remaining))
        column = np.exp(-0.5 * np.sum((place - place[pivot]) ** 2, axis=1)) - columns @ columns[pivot]
        column /= np.sqrt(remaining[pivot])
        columns = np.column_stack([columns, column])
        remaining = np.maximum(remaining - column * column, 0.0)
    return columns


def process_size(problem: Problem) -> float:
    """Return the standard deviation of the Gaussian process over p_inf [1]."""
    mach = np.array([condition.mach_number for condition in problem.ensemble.conditions])
    dynamic = 0.5 * HEAT_CAPACITY_RATIO * float(np.average(mach**2, weights=problem.ensemble.weight))
    return problem.model_form.process_at(dynamic)


TESTED = 6
"""Shapes of pressure off the tables that are tested, together."""


def tested_shapes(manifold: ManifoldMap) -> FloatArray:
    """Return the strain (n_d, n_s) of the shapes of pressure off the tables that gauges see best.

    Chi-square spreads over all gauges the strain that such a pressure causes in a few directions, and hardly
    changes. The directions have the largest variance relative to the variance of all else, in the middle of the
    ranges; shapes below it are left out.
    """
    state = np.zeros((1, 4))
    state[0, MACH], state[0, U] = manifold.mach_range.mean(), 0.5 * manifold.incidence_limit
    state[0, LOG_PRESSURE] = np.log(manifold.pressure_range).mean()
    covariance = strain_covariance(manifold, manifold.gauge_covariance, state)[0]
    considered = manifold.considered_columns[: manifold.n_gauges]
    of_shapes = float(np.exp(2.0 * state[0, LOG_PRESSURE])) * (
        manifold.scaled_covariance + considered @ considered.T
    )
    root = np.linalg.cholesky(covariance - of_shapes)
    half = np.linalg.solve(root, of_shapes)
    value, vector = np.linalg.eigh(np.linalg.solve(root, half.T))
    largest = np.argsort(-value)[:TESTED]
    largest = largest[value[largest] > 1.0]
    return np.asarray(root @ vector[:, largest])
