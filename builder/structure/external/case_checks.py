"""Check of strains per load case against each other: each case is predicted from all the others.

Pressures of flight conditions are nearly combinations of each other, so that the smallest operator of some cases
predicts the strain of another one. A wrong case is off its prediction, and it spoils the predictions that it takes
part in; the predictions are therefore judged by the predictions of the cases that remain without it.

Source: leave-one-out errors of kernel ridge regression, (K^-1 s)_j / (K^-1)_jj with K = P P^T (Rasmussen and
Williams, Gaussian Processes for Machine Learning, 2006, eqs. 5.10 to 5.12).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

RIDGE = 1e-7
"""Added to K, relative to its largest eigenvalue: strains with four digits pass, in float64 K has an inverse."""

ODD = 0.1
"""Difference from the prediction, over the larger of the two strains, from which a case is refused."""

ODD_OVER_USUAL = 10.0
"""Score of a refused case over the usual one of the others; of right strains it is 1.5 to 7.5."""

FEWEST = 8
"""Cases below which none is judged."""

EXCHANGED = 2
"""Cases left out before the usual score is measured: an exchange spoils two."""


@dataclass(frozen=True, eq=False)
class Predictions:
    """Cases predicted from each other.

    Attributes
    ----------
    inverse : (n, n) K^-1.
    amplitude : (n, k) K^-1 s, k gauges.
    """

    inverse: FloatArray
    amplitude: FloatArray

    @cached_property
    def score(self) -> FloatArray:
        """(n,) error of each prediction over its standard deviation, up to a common factor.

        A single wrong case has the largest, by the inequality of Cauchy and Schwarz.
        """
        return np.asarray(np.linalg.norm(self.amplitude, axis=1) / np.sqrt(np.diag(self.inverse)))

    @property
    def worst(self) -> int:
        """Place of the case with the largest score."""
        return int(self.score.argmax())

    def error(self, place: int) -> FloatArray:
        """Return the strain (k,) of a case less the one that the others predict."""
        return np.asarray(self.amplitude[place] / self.inverse[place, place])

    def without_worst(self) -> Predictions:
        """Return the predictions of the other cases from each other."""
        j = self.worst
        kept = np.delete(np.arange(len(self.inverse)), j)
        share = self.inverse[kept, j] / self.inverse[j, j]
        return Predictions(
            self.inverse[np.ix_(kept, kept)] - np.outer(share, self.inverse[j, kept]),
            self.amplitude[kept] - np.outer(share, self.amplitude[j]),
        )


def check_cases(pressure: FloatArray, strain: FloatArray, names: tuple[str, ...], n_flown: int) -> None:
    """Refuse a load case without strain, or one of a flight condition that is out of line with all others.

    A fault that all cases have in common shows nowhere, and flight conditions do not predict the uniform case.

    Parameters
    ----------
    pressure : (n, n_p) net pressure [Pa].
    strain : (n, k) [m/m].
    names : of the cases, for messages.
    n_flown : the first so many cases are flight conditions.

    Raises
    ------
    InputError
        Names the case.
    """
    size = np.linalg.norm(pressure, axis=1, keepdims=True)
    for name, loaded, row in zip(names, size[:, 0] > 0.0, strain, strict=True):
        if loaded and not row.any():
            raise InputError(f"{name}: expected strain under its load, got 0 at every gauge")
    if n_flown < FEWEST:
        return
    size[size == 0.0] = 1.0
    shape, found = (pressure / size)[:n_flown], (strain / size)[:n_flown]
    predictions = predicted(shape, found)
    worst, others = predictions.worst, predictions
    for _ in range(EXCHANGED):
        others = others.without_worst()
    error = predictions.error(worst)
    larger = max(float(np.linalg.norm(one)) for one in (found[worst], found[worst] - error))
    odd = float(np.linalg.norm(error)) / max(larger, 1e-300)
    if odd > ODD and predictions.score[worst] > ODD_OVER_USUAL * float(np.median(others.score)):
        raise InputError(
            f"{names[worst]}: expected the strain that the other cases predict, within {100.0 * ODD:g} %, got one "
            f"{100.0 * odd:.3g} % off: a wrong load, sign or unit, or exchanged with another case?"
        )


def predicted(pressure: FloatArray, strain: FloatArray) -> Predictions:
    """Return the predictions of ``strain`` (n, k) under ``pressure`` (n, n_p), both over the pressure's size."""
    kernel = pressure @ pressure.T
    ridge = RIDGE * float(np.linalg.eigvalsh(kernel)[-1])
    inverse = np.asarray(np.linalg.inv(kernel + ridge * np.eye(len(kernel))), dtype=np.float64)
    return Predictions(inverse, inverse @ strain)
