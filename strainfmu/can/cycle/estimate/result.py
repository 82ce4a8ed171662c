"""The result of one cycle, before it becomes frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.can.cycle.gauges.verdicts import GaugeVerdicts
from strainfmu.can.cycle.states.quality import Cause, Quality, is_usable
from strainfmu.cosim.estimators.step import StepResult
from strainfmu.estimator.health import HealthState


def no_numbers() -> FloatArray:
    """Return (5,) NaN."""
    return np.full(5, np.nan)


@dataclass(eq=False, slots=True, kw_only=True)  # not frozen: one is made for every cycle, and that costs thrice
class CycleResult:
    """One published result.

    Attributes
    ----------
    time : at which it was ready, local monotonic clock [s].
    quality, causes : how far to trust it, and what limits that.
    valid : (n_d,) gauges that were used.
    strain : (n_d,) strains that were used [m/m]; NaN where not valid.
    dynamic_pressure : q_inf that was used [Pa], or NaN.
    mach_number, altitude : by navigation at ``time`` [1] and [m], NaN where not known.
    other_inputs : what else of the flow was used, by name of the estimator's input, NaN where not known:
        temperatures [K], readings of auxiliary sensors, thrust [N], flow parameters, their standard deviations.
    age : of the strains at ``time`` [s]; NaN if there are none.
    age_uncertainty : by how much they may be older [s], as the sender's clock is not known better; NaN if nothing
        dates them.
    held : by how much the oldest strains that are held are older than the cycle's own [s]; a part of the age.
    sample_time : sender's clock at the sample [ticks], None if not known.
    counter : E2E counter of the cycle it answers, None if not known.
    coefficients, coefficients_std, chi_square, health : the estimate; NaN and None without one.
    envelope_score : standard deviations by which the coefficients leave what the map covers [1]; NaN if not known.
    arrival : of the last frame of the cycle [s], None of a status without frames.
    verdicts : what was found of each gauge; None if all are used, and of a status without frames.
    gap : how long nothing came, of the one result of a gap in a log [s]; NaN of all others.
    other_outputs : other outputs of the estimator that were asked for, by name; none without an estimate.
    """

    time: float
    quality: Quality
    causes: Cause
    valid: BoolArray
    strain: FloatArray
    dynamic_pressure: float = np.nan
    mach_number: float = np.nan
    altitude: float = np.nan
    age: float = np.nan
    age_uncertainty: float = np.nan
    held: float = 0.0
    sample_time: int | None = None
    counter: int | None = None
    coefficients: FloatArray = field(default_factory=no_numbers)
    coefficients_std: FloatArray = field(default_factory=no_numbers)
    chi_square: float = np.nan
    health: int | None = None
    envelope_score: float = np.nan
    arrival: float | None = None
    verdicts: GaugeVerdicts | None = None
    gap: float = np.nan
    other_outputs: Mapping[str, float] = field(default_factory=dict)
    other_inputs: Mapping[str, float] = field(default_factory=dict)

    @property
    def usable(self) -> bool:
        """Whether loads may be used with their standard deviations, by health and quality."""
        return is_usable(self.quality, self.health)


def result_without_fields() -> CycleResult:
    """Return a result whose fields are all still to be set: it takes a fifth of the time of making one by them."""
    return _new(CycleResult)


_new = object.__new__


def published(result: CycleResult, now: float, max_age: float) -> CycleResult:
    """Bring ``result`` up to the time ``now`` [s] at which it is sent, and return it.

    A bridge that stood still has judged strains that were fresh on reception. Strains older than ``max_age`` [s]
    by now are STALE all the same, and their coefficients are not sent; those held have time-outs of their own.
    """
    if now > result.time:
        result.age += now - result.time
        result.time = now
    if result.quality.has_coefficients and not result.age - result.held <= max_age:
        result.quality = Quality.STALE
        result.causes |= Cause.OLD | Cause.OVERLOAD
        result.coefficients, result.coefficients_std = no_numbers(), no_numbers()
    return result


_OK, _VALID = int(HealthState.OK), Quality.VALID
_NO_ESTIMATE = frozenset({HealthState.NO_COEFFICIENTS, HealthState.INVALID, HealthState.UNIDENTIFIED})
_SUSPECT = frozenset({HealthState.INCONSISTENT, HealthState.SUSPECT, HealthState.OUTSIDE})
"""The sigmas need not hold: OUTSIDE comes ahead of INCONSISTENT and SUSPECT, so it is no better than they."""
_UNCONFIRMED = (
    Cause.HIDDEN_DELAY | Cause.UNPROVEN_RESTART | Cause.SECOND_SENDER | Cause.SECOND_BRIDGE | Cause.PERIOD
)
_DEGRADING = (
    Cause.PARTIAL_CYCLE
    | Cause.GAUGE_INVALID
    | Cause.NOT_TRUSTED
    | Cause.SENDER_STATUS
    | Cause.OVERLOAD
    | Cause.BUS
)


def quality_of_step(step: StepResult, causes: Cause, protected: bool) -> tuple[Quality, Cause]:
    """Return the quality of a step's outputs, and the causes with what the estimator itself adds."""
    is_healthy = step.health == _OK
    if not is_healthy:
        causes |= Cause.HEALTH
        if step.health in _NO_ESTIMATE:
            return Quality.INVALID, causes
    if causes and causes & _UNCONFIRMED:
        return Quality.UNCONFIRMED, causes
    if not is_healthy:
        # An unknown state is never better than suspect.
        if step.health in _SUSPECT or step.health != HealthState.DEGRADED:
            return Quality.SUSPECT, causes
        return Quality.DEGRADED, causes
    if causes and causes & _DEGRADING:
        return Quality.DEGRADED, causes
    return (_VALID if protected else Quality.UNPROTECTED), causes
