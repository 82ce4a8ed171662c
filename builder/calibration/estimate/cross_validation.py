"""Each load case predicted from the others: does the calibration foretell what it has not seen?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.calibration.estimate.vehicle import Estimate
from strainfmu.arrays import FloatArray


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


def cross_validation(found: Estimate) -> list[LeftOut]:
    """Return every used case, predicted by an estimate without it, with the derivatives of the whole one."""
    model, used = found.model, found.used
    free = model.std > 0.0
    noise = model.test.reading_stds
    _, jacobian = model.jacobian(found.vector)
    scaled = jacobian[:, :, free] * model.std[free]
    target = model.test.readings - found.after + scaled @ (found.vector[free] / model.std[free])
    parts = [_normal(scaled[k][used[k]], target[k][used[k]], noise[k][used[k]]) for k in range(len(used))]
    precision = np.eye(int(free.sum())) + sum(part[0] for part in parts)
    right = sum(part[1] for part in parts)
    rows = []
    for k, case in enumerate(model.test.cases):
        if not used[k].any():
            continue
        covariance = np.linalg.inv(precision - parts[k][0])
        own = scaled[k][used[k]]
        left = target[k][used[k]] - own @ (covariance @ (right - parts[k][1]))
        stated = own @ covariance @ own.T + np.diag(noise[k][used[k]] ** 2)
        rows.append(
            LeftOut(
                case=case.name,
                rms=float(np.sqrt(np.mean(left**2))),
                stated=float(np.sqrt(np.mean(np.diag(stated)))),
                chi_square=float(left @ np.linalg.solve(stated, left)) / len(left),
            )
        )
    return rows


def _normal(rows: FloatArray, target: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    weighted = rows / noise[:, None]
    return weighted.T @ weighted, weighted.T @ (target / noise)
