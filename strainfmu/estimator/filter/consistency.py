"""Consistency over a window: normalised innovations in their band, a wider discrepancy where they leave it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

from strainfmu.estimator.policies import BAND as BAND
from strainfmu.estimator.policies import LARGEST_WIDENING as LARGEST
from strainfmu.estimator.policies import NARROW as NARROW
from strainfmu.estimator.policies import WIDEN as WIDEN
from strainfmu.estimator.policies import WINDOW as WINDOW


@dataclass(frozen=True, kw_only=True)
class Consistency:
    """Mean of the normalised innovations squared over their degrees of freedom, and what follows from it.

    Attributes
    ----------
    mean : of the window; 1 if all is as expected.
    steps : number of steps that it has seen.
    widening : factor on the variance of the discrepancy, at least 1.
    """

    mean: float = 1.0
    steps: int = 0
    widening: float = 1.0


def band(degrees_of_freedom: float) -> float:
    """Return by how much the mean of a full window may differ from 1: 99 % of means stay inside."""
    return BAND * sqrt(2.0 / (degrees_of_freedom * (2.0 * WINDOW - 1.0)))


def noted(held: Consistency, chi_square: float, degrees_of_freedom: float) -> Consistency:
    """Return ``held`` with one more normalised innovation.

    The discrepancy becomes wider while the mean of a full window is above its band. One sample never widens it:
    what it counts in the mean is at most half of the band.
    """
    if degrees_of_freedom <= 0.0:
        return held
    ratio = min(chi_square / degrees_of_freedom, 1.0 + 0.5 * WINDOW * band(degrees_of_freedom))
    mean = held.mean + (ratio - held.mean) / WINDOW
    steps, widening = held.steps + 1, held.widening
    if steps >= WINDOW and mean > 1.0 + band(degrees_of_freedom):
        widening = min(WIDEN * widening, LARGEST)
    elif mean < 1.0:
        widening = max(NARROW * widening, 1.0)
    return replace(held, mean=mean, steps=steps, widening=widening)
