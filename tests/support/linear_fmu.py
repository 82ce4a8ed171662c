"""The native library with a linear map and its filter, and random flights of the map's own model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from raw_fmu import GROUPS, OK, WHOLE_OUTPUTS, Fmu2, first_zero, outputs_of
from scaled_maps import NOMINAL

from strainfmu.estimator.estimates.load_estimate import LoadEstimate
from strainfmu.estimator.filter.switched_linear import SwitchedLinearFilter, TimedLaw
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap


@dataclass(frozen=True, kw_only=True)
class LinearSample:
    """One set of inputs [m/m, Pa]."""

    strain: np.ndarray
    valid: np.ndarray
    pressure: float
    deviation: float = 0.0
    temperature: np.ndarray | None = None


def linear_flight(inverse_map: InverseMap, steps: int, seed: int, poor: bool = True) -> list[LinearSample]:
    """States that wander slowly, q_inf that changes, noise; ``poor`` loses gauges, whole samples and q_inf."""
    random, samples = np.random.default_rng(seed), []
    own, errors = inverse_map.gauge_covariance, inverse_map.error_strain
    columns, n = np.hstack([inverse_map.state_operator, errors]), inverse_map.n_gauges
    root = np.linalg.cholesky(own)
    fixed = np.zeros(n) if inverse_map.fixed_strain is None else inverse_map.fixed_strain
    state, valid = random.standard_normal(columns.shape[1]), np.ones(n, dtype=bool)
    for k in range(steps):
        state = 0.999 * state + np.sqrt(1.0 - 0.999**2) * random.standard_normal(len(state))
        ratio = 0.8 + 0.5 * np.sin(0.03 * k)
        strain = fixed + ratio * (inverse_map.mean_strain - fixed + columns @ state)
        strain = strain + root @ random.standard_normal(n)
        if poor and k % 5 == 0:
            valid = random.random(n) > 0.05 * (k % 4)
        lost = poor and k % 29 > 26
        pressure = np.nan if poor and k % 37 == 36 else ratio * NOMINAL
        deviation = float(random.choice([1e-6, 0.01])) * NOMINAL
        samples.append(
            LinearSample(strain=strain, valid=valid & (not lost), pressure=pressure, deviation=deviation)
        )
    return samples


class LinearFmu(Fmu2):
    """An instance whose map is linear and has a filter."""

    n_t = 0
    """Number of temperature sensors."""

    def filter(self, time_constant: float) -> int:
        """Set the filter's time constant [s]; the status."""
        return self.set_reals([first_zero(self.n) + 2 * self.n + 1 + self.n_t], [time_constant])

    def give(self, sample: LinearSample) -> None:
        """Set all inputs."""
        self.set_strain(sample.strain)
        self.set_valid(sample.valid)
        assert self.set_scalars(0, sample.pressure, sample.deviation) == OK
        if sample.temperature is not None:
            first = first_zero(self.n) + 2 * self.n + 1
            assert self.set_reals(range(first, first + self.n_t), sample.temperature) == OK

    def advance(self, sample: LinearSample, time: float, size: float) -> np.ndarray:
        """All outputs after a step over ``size`` from ``time`` [s]."""
        self.give(sample)
        assert self.step(time, size) == OK, self.messages
        return self.outputs()


class LinearReference:
    """The same by numpy."""

    def __init__(self, estimator: Estimator, time_constant: float) -> None:
        self.estimator, self.last = estimator, TimedLaw()
        self.switched = SwitchedLinearFilter(estimator, time_constant)

    def advance(self, sample: LinearSample, time: float) -> tuple[LoadEstimate, LoadEstimate]:
        """The estimate of the sample at ``time`` [s], and that of it alone."""
        warm = sample.temperature
        inputs = (sample.strain, sample.pressure, sample.valid, sample.deviation)
        static = self.estimator.step(*inputs, temperature=warm)
        found, self.last = self.switched.step(static, sample.strain, sample.pressure, self.last, time, warm)
        return found, static


def differences(native: np.ndarray, estimate: LoadEstimate) -> dict[str, float]:
    """Largest difference by group of outputs, relative to the largest of the group; whole numbers are equal."""
    expected = outputs_of(estimate)
    assert native[WHOLE_OUTPUTS].tolist() == expected[WHOLE_OUTPUTS].tolist()
    found = {}
    for name, group in GROUPS.items():
        ours, theirs = native[group], expected[group]
        assert np.isnan(ours).tolist() == np.isnan(theirs).tolist(), name
        known = np.isfinite(theirs)
        size = np.max(np.abs(theirs[known]), initial=1e-300)
        found[name] = float(np.max(np.abs(ours - theirs)[known], initial=0.0) / size)
    return found


def largest(found: Iterable[dict[str, float]]) -> dict[str, float]:
    """The largest of each group."""
    every = list(found)
    return {name: max(one[name] for one in every) for name in every[0]}
