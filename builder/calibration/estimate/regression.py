"""Loads as sums of gauge readings by least squares, with standard errors: the classical load equations.

    L = sum beta_g mu_g,  beta = (mu' mu)^-1 mu' L,  cov(beta) = s^2 (mu' mu)^-1,  s^2 = |L - mu beta|^2 / (n - k).

Gauges of an equation are all that may be used, or chosen by T, the coefficient over its standard error: gauges of
the largest correlation come in while cases suffice, then the one of the smallest T leaves until all are at least
:data:`LEAST_T`. A ridge lambda |beta|^2, in units of each gauge's own size, has the lambda of the smallest
generalised cross-validation.

Source: Skopinski, Aiken and Huston, NACA Report 1178 (1954); Golub, Heath and Wahba, Technometrics 21 (1979).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.ground_test.equations_file import Method
from builder.calibration.ground_test.load_changes import scaled
from builder.structure.as_built.as_built_structure import OF_MASS
from builder.structure.loads.applied import Load
from builder.structure.loads.gauge_strain import load_resultant
from builder.structure.loads.temperature import TemperatureField
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import LOAD_NAMES

LEAST_T = 4.0

CASES_PER_GAUGE = 2.0
"""Load cases that each gauge of an equation needs, where gauges are chosen."""

ROUNDING = 1e-12
"""Singular value over the largest below which gauges read the same."""

RIDGES = np.logspace(-10.0, 2.0, 61)
"""Weights of a ridge that are compared, over the largest eigenvalue of the gauges' products [1]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadEquation:
    """One load as a sum of readings.

    Attributes
    ----------
    load : its name, one of a map's loads.
    gauges : (k,) numbers of the gauges.
    coefficient, standard_error : (k,) [N or N m per m/m].
    residual_std : of the cases [N or N m].
    left_out : (n,) load of each case less its prediction by the equation of all other cases [N or N m].
    """

    load: str
    gauges: tuple[int, ...]
    coefficient: FloatArray
    standard_error: FloatArray
    residual_std: float
    left_out: FloatArray

    def value(self, strain: FloatArray) -> FloatArray:
        """Return the load (n,) of strains (n, n_d)."""
        return np.asarray(strain[:, list(self.gauges)] @ self.coefficient)


def load_equation(
    name: str, strain: FloatArray, load: FloatArray, gauges: Sequence[int], method: Method, known: int = 0
) -> LoadEquation:
    """Return the equation of a load (n,) by the ``gauges`` among strains (n, n_d), zeros taken off.

    ``known`` is the number of constants that were taken off with the zeros, by which freedom is less.
    """
    chosen = _selected(strain, load, list(gauges)) if method == "selected" else list(gauges)
    a, n = strain[:, chosen], len(load)
    coefficient, spread, leverage = _least_squares(a, load, method == "ridge")
    rest = load - a @ coefficient
    freedom = max(n - known - float(leverage.sum()), 1.0)
    variance = float(rest @ rest) / freedom
    return LoadEquation(
        load=name,
        gauges=tuple(chosen),
        coefficient=coefficient,
        standard_error=np.sqrt(np.maximum(variance * spread, 1e-300)),
        residual_std=float(np.sqrt(variance)),
        left_out=rest / np.maximum(1.0 - leverage - known / n, 1e-3),
    )


def _least_squares(
    a: FloatArray, load: FloatArray, with_ridge: bool = False
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return coefficients (k,), their variances over the noise's (k,), and the leverage of each case (n,)."""
    if not a.shape[1]:
        return np.zeros(0), np.zeros(0), np.zeros(len(a))
    size = np.maximum(np.linalg.norm(a, axis=0), 1e-300)
    u, s, rows = np.linalg.svd(a / size, full_matrices=False)
    some = s > ROUNDING * s[0]
    u, s, rows = u[:, some], s[some], rows[some]
    along, n = u.T @ load, len(load)
    outside = float(load @ load - along @ along)

    def score(weight: float) -> float:
        filtered = s**2 / (s**2 + weight)
        return (outside + float(np.sum(((1.0 - filtered) * along) ** 2))) / (n - float(filtered.sum())) ** 2

    weight = min(RIDGES * s[0] ** 2, key=score) if with_ridge else 0.0
    part = s / (s**2 + weight)
    spread = np.sum((rows.T * part) ** 2, axis=1) / size**2
    return rows.T @ (part * along) / size, spread, np.sum(u**2 * (s * part), axis=1)


def _selected(strain: FloatArray, load: FloatArray, available: list[int]) -> list[int]:
    """Return the gauges of an equation by their T values."""
    chosen: list[int] = []
    while len(chosen) < min(len(load) / CASES_PER_GAUGE, len(available)):
        residual = load - strain[:, chosen] @ _least_squares(strain[:, chosen], load)[0]
        columns = strain[:, available]
        if chosen:
            q, _ = np.linalg.qr(strain[:, chosen])
            columns = columns - q @ (q.T @ columns)
        size = np.linalg.norm(columns, axis=0)
        size[np.isin(available, chosen) | (size < 1e-12 * size.max())] = np.inf
        chosen.append(available[int(np.argmax(np.abs(columns.T @ residual) / size))])
    while chosen:
        a = strain[:, chosen]
        coefficient, spread, _ = _least_squares(a, load)
        variance = float(np.sum((load - a @ coefficient) ** 2)) / max(len(load) - len(chosen), 1)
        t = np.abs(coefficient) / np.sqrt(np.maximum(variance * spread, 1e-300))
        if t.min() >= LEAST_T:
            break
        del chosen[int(t.argmin())]
    return chosen


def load_equations(fit: Estimate, moment_station: float) -> list[LoadEquation]:
    """Return the equation of each load from the cases that were used; zeros are taken off.

    The loads are the forces and moments of what was applied, weight included, about ``moment_station`` [m].
    """
    model, used = fit.model, fit.used
    good = np.asarray(used.any(axis=0))
    rows = np.asarray(used[:, good].all(axis=1))
    errors = model.errors(fit.vector)
    strain = (model.test.readings - errors.zero[model.group_of_case])[rows]
    loads = applied_loads(model, moment_station, float(fit.parameters.mass[0]))[rows]
    gauges = np.flatnonzero(good).tolist()
    return [load_equation(name, strain, loads[:, k], gauges, "selected") for k, name in enumerate(LOAD_NAMES)]


def applied_loads(model: ReadingsModel, moment_station: float, mass: float = 0.0) -> FloatArray:
    """Return the five loads (n_cases, 5) of every case as stated [N, N m]; ``mass`` is the vehicle's error [1]."""
    structure = model.structure.loaded
    resultant = np.zeros((len(model.test.cases), 5))
    for k, case in enumerate(model.test.cases):
        acting: list[Load] = [
            scaled(known.load, 1.0 + mass) if isinstance(known.load, OF_MASS) else known.load
            for known in case.loads
            if not isinstance(known.load, TemperatureField)
        ]
        x, y, z, _, about_y, about_z = load_resultant(structure, acting)
        nose_up, nose_port = about_y + moment_station * z, about_z - moment_station * y
        resultant[k] = x, z, y, nose_up, -nose_port
    return resultant
