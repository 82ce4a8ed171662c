"""Each load case predicted from the others: does the calibration foretell what it has not seen?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.calibration.estimate.estimated_vehicle import Estimate


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
    linear, of_case, rows = found.linear, np.argwhere(used)[:, 0], list[LeftOut]()
    for k, case in enumerate(model.test.cases):
        at = np.flatnonzero(of_case == k)
        if not len(at):
            continue
        left, covariance = linear.without(at)
        noise = model.test.reading_stds[k, used[k]]
        rows.append(
            LeftOut(
                case=case.name,
                rms=float(np.sqrt(np.mean((noise * left) ** 2))),
                stated=float(np.sqrt(np.mean(noise**2 * np.diag(covariance)))),
                chi_square=float(left @ linear.weighted[at]) / len(at),
            )
        )
    return rows
