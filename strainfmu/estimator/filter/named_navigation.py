"""Navigation whose error changes in flight: the quantity is named, and stays out until it is known to be good.

The filter predicts what navigation reads far better than its deviation, since it knows the error that navigation
had. Readings far off that prediction are wrong, and stay wrong while the prediction forgets: each step without
them the flight state is known less, until any reading fits. So a quantity that is named returns where it fits and
where the error that named it would be named again, not before.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.filter.flight_model import ERRORS_OF_NAVIGATION
from strainfmu.estimator.filter.kalman import Law
from strainfmu.estimator.manifold.gauss_newton import Samples
from strainfmu.estimator.manifold.navigation import (
    NAVIGATION,
    NAVIGATION_ALARM,
    StateMeasurement,
    predicted,
)
from strainfmu.estimator.policies import FITS as FITS
from strainfmu.estimator.policies import NAMED_AFTER as NAMED_AFTER
from strainfmu.estimator.tables.flight_tables import N_STATES

_N = len(NAVIGATION)


@dataclass(frozen=True, kw_only=True, eq=False)
class NamedNavigation:
    """What is held against quantities of navigation.

    Attributes
    ----------
    apart : (3,) errors of those that are named, in deviations of navigation; 0 of one that is not named.
    alarms : (3,) steps in a row that one that is not named was left out with an alarm, negative where it reads
        less than predicted.
    """

    apart: FloatArray = field(default_factory=lambda: np.zeros(_N))
    alarms: FloatArray = field(default_factory=lambda: np.zeros(_N))

    def without_named(self, samples: Samples) -> Samples:
        """Return ``samples`` without the quantities that are named."""
        precision = samples.measured.precision.copy()
        precision[:, :_N] *= self.apart == 0.0
        return replace(samples, measured=replace(samples.measured, precision=precision))

    def after(
        self, law: Law, read: StateMeasurement, used: StateMeasurement, white: float
    ) -> tuple[NamedNavigation, FloatArray]:
        """Return what is held after a sample, and the distances (3,) of what was left out from its prediction.

        ``law`` is that after the sample, which has ``read`` and ``used`` navigation, of which the part ``white``
        of the variance is independent from sample to sample. Distances are in deviations, 0 of what was used.
        """
        innovation, std = _left_out(law, read, white)
        left_out = (read.precision[0, :_N] > 0.0) & (used.precision[0, :_N] == 0.0)
        distance = np.where(left_out, innovation / std, 0.0)
        size = np.abs(distance)
        named = self.apart > 0.0
        good = left_out & (size <= FITS) & (self.apart > (NAVIGATION_ALARM + FITS) * std)
        side = np.where(~named & (size > NAVIGATION_ALARM), np.sign(distance), 0.0)
        alarms = np.where(side * self.alarms > 0.0, self.alarms, 0.0) + side
        newly = np.abs(alarms) >= NAMED_AFTER
        apart = np.where(named & ~good, self.apart, np.where(newly, np.abs(innovation), 0.0))
        return NamedNavigation(apart=apart, alarms=np.where(newly, 0.0, alarms)), distance


def _left_out(law: Law, read: StateMeasurement, white: float) -> tuple[FloatArray, FloatArray]:
    """Return (3,) what was ``read`` less its prediction by ``law``, and its deviation, in those of navigation."""
    value, of_state = predicted(law.mean[None, :N_STATES])
    scale, lasting = np.sqrt(read.precision[0, :_N]), np.sqrt(1.0 - white)
    error = ERRORS_OF_NAVIGATION + np.arange(_N)
    row = np.zeros((_N, len(law.mean)))
    row[:, :N_STATES] = scale[:, None] * of_state[0, :_N]
    row[np.arange(_N), error] = lasting
    innovation = scale * (read.value[0, :_N] - value[0, :_N]) - lasting * law.mean[error]
    return innovation, np.sqrt(np.einsum("ix,xy,iy->i", row, law.covariance, row) + white)
