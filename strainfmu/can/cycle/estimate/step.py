"""The step of the estimator with the strains of one cycle, and the quality of what it puts out."""

from __future__ import annotations

from math import isfinite, isnan

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.can.cycle.estimate.held_flow import FlowState
from strainfmu.can.cycle.estimate.result import quality_of_step
from strainfmu.can.cycle.states.quality import Cause, Quality
from strainfmu.can.wire.frame_layout import NAVIGATION, InputLayout
from strainfmu.cosim.estimators.step import (
    Step,
    StepRefused,
    StepResult,
    needs_pressure,
    other_inputs,
    takes_mask,
)

_LONGEST_STEP = 100
"""Maximum number of cycles in one step of the FMU."""


class EstimatorStep:
    """Steps an estimator by whole cycles.

    Parameters
    ----------
    layout : the frames of the input.
    step : the estimator.
    """

    def __init__(self, layout: InputLayout, step: Step) -> None:
        self._step, self._is_protected, self._period = step, layout.is_protected, layout.cycle_time
        self._needs_pressure, self._takes_mask = needs_pressure(step), takes_mask(step)
        self._navigation = tuple(name for name in NAVIGATION if name in other_inputs(step))
        self._others: dict[str, float] = {}
        self._last: float | None = None

    def __call__(
        self, strain: FloatArray, valid: BoolArray, flow: FlowState, now: float, causes: Cause
    ) -> tuple[StepResult | None, Quality, Cause]:
        """Return the outputs at ``now`` [s], None if the estimator refused; their quality, and the causes.

        Parameters
        ----------
        strain : (n_d,) of a cycle [m/m], NaN for gauges that are not valid.
        valid : (n_d,) gauges that are.
        causes : noted before.
        """
        others = self._others
        if flow.other_inputs:
            others.update(flow.other_inputs)
        for name in self._navigation:
            others[name] = getattr(flow, name)
        try:
            if self._takes_mask:
                step = self._step(strain, flow.dynamic_pressure, self._size(now), valid.tobytes(), **others)
            else:
                step = self._step(strain, flow.dynamic_pressure, self._size(now), **others)
        except StepRefused:
            return None, Quality.INVALID, causes | Cause.STEP_FAILED
        quality, causes = self._quality_of(step, causes)
        if quality.has_coefficients and not self._is_finite(step):
            quality, causes = Quality.INVALID, causes | Cause.STEP_FAILED
        if isnan(flow.dynamic_pressure):
            quality = self._without_pressure(quality, causes)
        return step, quality, causes

    def _without_pressure(self, quality: Quality, causes: Cause) -> Quality:
        """Return the quality of outputs without q_inf: the nonlinear estimator has some, with a larger sigma."""
        if self._needs_pressure:
            return Quality.INVALID
        is_lost = bool(causes & Cause.DYNAMIC_PRESSURE)
        return Quality.DEGRADED if is_lost and quality in (Quality.VALID, Quality.UNPROTECTED) else quality

    def _quality_of(self, step: StepResult, causes: Cause) -> tuple[Quality, Cause]:
        """Return the quality of a step's outputs, and the causes with the causes of the estimator's health."""
        return quality_of_step(step, causes, self._is_protected)

    def _is_finite(self, step: StepResult) -> bool:
        """Return whether coefficients and their standard deviations are finite."""
        # A sum of products is finite only of finite numbers. Of huge ones it need not be.
        if isfinite(step.coefficients.dot(step.coefficients_std)):
            return True
        return bool(np.isfinite(step.coefficients).all() and np.isfinite(step.coefficients_std).all())

    def _size(self, now: float) -> float:
        """Return the time since the last step [s], in whole cycles."""
        period, cycles = self._period, 1
        if self._last is not None:
            cycles = round((now - self._last) / period)
        self._last = now
        return period if cycles <= 1 else min(cycles, _LONGEST_STEP) * period
