"""Check loads: cases that were applied and not fitted, predicted by the calibrated vehicle; cross-validation: each
case that was fitted, predicted from the others.

The readings of a check load determine the factor on its loads that fits them best, by generalised least squares
with the covariance of the prediction: what the test left unknown, where the pads stand, noise. The factor over one
is the error of the predicted load. Source of the practice: Lokos and Stauf, NASA TM-2004-212853.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.regression import LoadEquation, applied_loads
from builder.calibration.ground_test.load_changes import cell_force
from strainfmu.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class CheckLoad:
    """One check load.

    Attributes
    ----------
    case : its name.
    applied : sum of the forces that load cells read [N]; 0 where they read none.
    difference : predicted over applied, less 1 [1]; NaN where no load cell reads.
    std : of that, the load cell's and the load's own error included [1].
    chi_square : of the readings, per reading [1].
    chance : probability that a sound test has as much.
    by_equations, loads : (5,) loads by the load equations, and as applied [N, N m]; NaN without a reading of a
        gauge of the equation.
    """

    case: str
    applied: float
    difference: float
    std: float
    chi_square: float
    chance: float
    by_equations: FloatArray
    loads: FloatArray

    @property
    def predicted(self) -> float:
        """The load by the calibrated vehicle [N]."""
        return self.applied * (1.0 + self.difference)


def check_loads(
    fit: Estimate, equations: Sequence[LoadEquation] = (), moment_station: float = 0.0
) -> list[CheckLoad]:
    """Return the check loads of a test; moments of ``equations`` are about ``moment_station`` [m].

    Gauges that the estimate left out are left out here as well.
    """
    model, rows = fit.model, list[CheckLoad]()
    if model.test.fitted.all():
        return rows
    readings, jacobian = model.jacobian(fit.vector)
    errors = model.errors(fit.vector)
    strain = (1.0 + errors.scale)[:, None] * model.load_strains(fit.parameters)
    loads = applied_loads(model, moment_station, float(fit.parameters.mass[0]))
    good = np.asarray(fit.used.any(axis=0))
    for k, case in enumerate(model.test.cases):
        if not case.check:
            continue
        used = good & np.isfinite(case.reading)
        columns = jacobian[k * good.size : (k + 1) * good.size].toarray()[used]
        covariance = columns @ fit.covariance @ columns.T + np.diag(case.reading_std[used] ** 2)
        root = np.linalg.cholesky(covariance)
        white = np.linalg.solve(root, (case.reading - readings[k])[used])
        square, count = float(white @ white), int(used.sum())
        on_cell = [n for n, (number, known) in enumerate(model.loads) if number == k and known.on_load_cell]
        difference = std = float("nan")
        if on_cell and count:
            # The covariance has the size of the loads as known to its own error: the prior of the factor is in it.
            along = np.linalg.solve(root, strain[on_cell].sum(axis=0)[used])
            std = 1.0 / float(np.sqrt(along @ along))
            difference = float(along @ white) * std**2
        without_zero = (case.reading - errors.zero[model.group_of_case[k]])[None]
        rows.append(
            CheckLoad(
                case=case.name,
                applied=float(sum(cell_force(model.loads[n][1].load) for n in on_cell)),
                difference=difference,
                std=std,
                chi_square=square / max(count, 1),
                chance=float(chdtrc(count, square)) if count else 1.0,
                by_equations=np.array(
                    [float(equation.value(without_zero)[0]) for equation in equations] or [np.nan] * 5
                ),
                loads=loads[k],
            )
        )
    return rows


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """One case predicted from all others.

    Attributes
    ----------
    case : its name.
    rms : of measured less predicted [m/m].
    stated : what that should be by the covariance without the case [m/m].
    chi_square : per reading [1].
    """

    case: str
    rms: float
    stated: float
    chi_square: float


def cross_validation(fit: Estimate) -> list[LeftOut]:
    """Return every used case, predicted by an estimate without it, with the derivatives of the whole one.

    It shows whether the calibration foretells what it has not seen.
    """
    model, used = fit.model, fit.used
    linear, of_case, rows = fit.linear, np.argwhere(used)[:, 0], list[LeftOut]()
    for k, case in enumerate(model.test.cases):
        rows_of_case = np.flatnonzero(of_case == k)
        if not len(rows_of_case):
            continue
        residual, covariance = linear.without(rows_of_case)
        noise = model.test.reading_stds[k, used[k]]
        rows.append(
            LeftOut(
                case=case.name,
                rms=float(np.sqrt(np.mean((noise * residual) ** 2))),
                stated=float(np.sqrt(np.mean(noise**2 * np.diag(covariance)))),
                chi_square=float(residual @ linear.weighted[rows_of_case]) / len(rows_of_case),
            )
        )
    return rows
