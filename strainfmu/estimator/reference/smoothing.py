"""Smoothing over time: each law of a filter with what later samples say of it, from the last sample back.

Source: Rauch, Tung & Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3 (1965).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.reference.kalman import Law


class Filtered(Protocol):
    """A sample of a filter: laws ``before`` and ``after`` it, and the ``transition`` F (n, n) to it from the last.

    It ``continues`` where ``before`` follows from the last sample.
    """

    @property
    def before(self) -> Law: ...
    @property
    def after(self) -> Law: ...
    @property
    def transition(self) -> FloatArray: ...
    @property
    def continues(self) -> bool: ...


def smoothed(samples: Sequence[Filtered]) -> list[Law]:
    """Return the laws of ``samples`` given all of them; the last one is as it was filtered."""
    out: list[Law] = []
    for i in range(len(samples) - 1, -1, -1):
        later = samples[i + 1] if i + 1 < len(samples) else None
        if later is None or not later.continues:
            out.append(samples[i].after)
        else:
            out.append(_smoothed(samples[i].after, later, out[-1]))
    return out[::-1]


def _smoothed(law: Law, later: Filtered, known: Law) -> Law:
    """Return ``law`` given that the sample after it, ``later``, has the law ``known``: B = P F' (P-)^-1."""
    before = later.before
    size = np.sqrt(np.diag(before.covariance))
    # States have units of their own: equal diagonals keep the digits.
    scaled = before.covariance / np.outer(size, size)
    back = (np.linalg.solve(scaled, (later.transition @ law.covariance) / size[:, None]) / size[:, None]).T
    covariance = law.covariance + back @ (known.covariance - before.covariance) @ back.T
    mean = law.mean + back @ (known.mean - before.mean)
    return Law(mean, 0.5 * (covariance + covariance.T), law.cross)
