"""The classical way: loads as sums of bridge readings, by regression on the load cases of the same test.

Skopinski, Aiken and Huston, NACA Report 1178 (1954): L = sum beta_g mu_g with coefficients by least squares over
the cases. Gauges are chosen by their T values, coefficient over its standard error: gauges of the largest
correlation come in while cases suffice, then the one of the smallest T leaves until all are at least
:data:`LEAST_T`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.vehicle import Estimate
from builder.calibration.ground_test.load_changes import scaled
from builder.structure.as_built.structure import OF_MASS
from builder.structure.loads.applied import Load
from builder.structure.loads.gauge_strain import load_resultant
from builder.structure.loads.temperature import TemperatureField
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.inverse_map import LOAD_NAMES

LEAST_T = 4.0

CASES_PER_GAUGE = 2.0
"""Load cases that each gauge of an equation needs."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadEquation:
    """One load as a sum of readings.

    Attributes
    ----------
    load : one of :data:`~strainfmu.estimator.map.inverse_map.LOAD_NAMES`.
    gauges : (k,) numbers of the gauges.
    coefficient, standard_error : (k,) [N or N m per m/m].
    residual_std : of the cases [N or N m].
    """

    load: str
    gauges: tuple[int, ...]
    coefficient: FloatArray
    standard_error: FloatArray
    residual_std: float

    @property
    def least_t(self) -> float:
        """Least |T| of the coefficients; NaN for an equation without gauges."""
        if not self.gauges:
            return float("nan")
        return float(np.min(np.abs(self.coefficient / self.standard_error)))

    def value(self, strain: FloatArray) -> FloatArray:
        """Return the load (n,) of strains (n, n_d)."""
        return np.asarray(strain[:, list(self.gauges)] @ self.coefficient)


def load_equations(found: Estimate, moment_station: float) -> list[LoadEquation]:
    """Return the equation of each load from the cases that were used; zeros are taken off.

    The loads are the forces and moments of what was applied, weight included, about ``moment_station`` [m].
    """
    model, used = found.model, found.used
    good = np.asarray(used.any(axis=0))
    rows = np.asarray(used[:, good].all(axis=1))
    errors = model.errors(found.vector)
    group = [model.groups.index(case.group) for case in model.test.cases]
    strain = (model.test.readings - errors.zero[group])[rows]
    loads = applied_loads(model, moment_station, float(found.parameters.mass[0]))[rows]
    return [_equation(name, strain, loads[:, k], good) for k, name in enumerate(LOAD_NAMES)]


def applied_loads(model: ReadingsModel, moment_station: float, mass: float = 0.0) -> FloatArray:
    """Return the five loads (n_cases, 5) of every case as stated [N, N m]; ``mass`` is the vehicle's error [1]."""
    structure = model.structure.states.forces[0]
    found = np.zeros((len(model.test.cases), 5))
    for k, case in enumerate(model.test.cases):
        acting: list[Load] = [
            scaled(one.load, 1.0 + mass) if isinstance(one.load, OF_MASS) else one.load
            for one in case.loads
            if not isinstance(one.load, TemperatureField)
        ]
        x, y, z, _, about_y, about_z = load_resultant(structure, acting)
        nose_up, nose_port = about_y + moment_station * z, about_z - moment_station * y
        found[k] = x, z, y, nose_up, -nose_port
    return found


def _equation(name: str, strain: FloatArray, load: FloatArray, good: BoolArray) -> LoadEquation:
    chosen: list[int] = []
    available = np.flatnonzero(good).tolist()
    while len(chosen) < min(len(load) / CASES_PER_GAUGE, len(available)):
        left = load - _fit(strain, load, chosen)[2]
        columns = strain[:, available]
        if chosen:
            q, _ = np.linalg.qr(strain[:, chosen])
            columns = columns - q @ (q.T @ columns)
        size = np.linalg.norm(columns, axis=0)
        size[np.isin(available, chosen) | (size < 1e-12 * size.max())] = np.inf
        chosen.append(available[int(np.argmax(np.abs(columns.T @ left) / size))])
    while chosen:
        coefficient, error, _ = _fit(strain, load, chosen)
        t = np.abs(coefficient / error)
        if t.min() >= LEAST_T:
            break
        del chosen[int(t.argmin())]
    coefficient, error, fitted = _fit(strain, load, chosen)
    freedom = max(len(load) - len(chosen), 1)
    return LoadEquation(
        load=name,
        gauges=tuple(chosen),
        coefficient=coefficient,
        standard_error=error,
        residual_std=float(np.sqrt(np.sum((load - fitted) ** 2) / freedom)),
    )


def _fit(strain: FloatArray, load: FloatArray, chosen: list[int]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return coefficients and standard errors (k,) and the fitted load (n,)."""
    if not chosen:
        return np.zeros(0), np.zeros(0), np.zeros(len(load))
    a = strain[:, chosen]
    coefficient = np.linalg.lstsq(a, load, rcond=None)[0]
    fitted = a @ coefficient
    freedom = max(len(load) - len(chosen), 1)
    variance = np.sum((load - fitted) ** 2) / freedom
    error = np.sqrt(np.maximum(np.diag(np.linalg.pinv(a.T @ a)) * variance, 1e-300))
    return np.asarray(coefficient), np.asarray(error), np.asarray(fitted)
