"""Smoothing of recorded steps: each law with what later samples say of it.

Source: Rauch, Tung & Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3 (1965).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from strainfmu.estimator.filter.kalman import Law, Transition


class Recorded(Protocol):
    """What smoothing needs of a step; see :class:`~strainfmu.estimator.filter.flight_track.FilteredStep`."""

    @property
    def before(self) -> Law:
        """Law before the sample."""

    @property
    def after(self) -> Law:
        """Law after the sample."""

    @property
    def transition(self) -> Transition:
        """From the last step to this one."""

    @property
    def continues(self) -> bool:
        """Whether ``before`` follows from the last step."""


def smoothed(steps: Sequence[Recorded]) -> list[Law]:
    """Return the laws of ``steps`` given all of their samples; the last one is as it was filtered."""
    out: list[Law] = []
    for i in range(len(steps) - 1, -1, -1):
        later = steps[i + 1] if i + 1 < len(steps) else None
        if later is None or not later.continues:
            out.append(steps[i].after)
        else:
            out.append(_smoothed(steps[i].after, later, out[-1]))
    return out[::-1]


def _smoothed(law: Law, later: Recorded, known: Law) -> Law:
    """Return ``law`` given that the step after it, ``later``, has the law ``known``."""
    size = np.sqrt(np.diagonal(later.before.covariance))
    # States have units of their own: equal diagonals keep the digits.
    scaled = later.before.covariance / (size[:, None] * size)
    back = (np.linalg.solve(scaled, (later.transition.matrix @ law.covariance) / size[:, None]) / size[:, None]).T
    covariance = law.covariance + back @ (known.covariance - later.before.covariance) @ back.T
    return Law(
        mean=law.mean + back @ (known.mean - later.before.mean),
        covariance=0.5 * (covariance + covariance.T),
        cross=law.cross,
    )
