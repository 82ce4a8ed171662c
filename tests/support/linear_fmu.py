"""The native library with a linear map and its filter, and random flights of the map's own model."""

from dataclasses import dataclass

import numpy as np
from raw_fmu import OK, Fmu2, first_zero
from scaled_maps import NOMINAL

from strainfmu.estimator.map.inverse_map import InverseMap


@dataclass(frozen=True, kw_only=True)
class LinearSample:
    """One set of inputs [m/m, Pa]."""

    strain: np.ndarray
    valid: np.ndarray
    pressure: float
    deviation: float = 0.0


def linear_flight(inverse_map: InverseMap, steps: int, seed: int, poor: bool = True) -> list[LinearSample]:
    """States that wander slowly, q_inf that changes, noise; ``poor`` loses gauges, whole samples and q_inf."""
    random, samples = np.random.default_rng(seed), []
    covariance, errors = inverse_map.gauge_covariance, inverse_map.error_strain
    columns, n = np.hstack([inverse_map.state_operator, errors]), inverse_map.n_gauges
    root = np.linalg.cholesky(covariance)
    fixed = inverse_map.fixed_strain
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

    def filter(self, time_constant: float) -> int:
        """Set the filter's time constant [s]; the status."""
        return self.set_reals([first_zero(self.n) + 2 * self.n + 1], [time_constant])

    def give(self, sample: LinearSample) -> None:
        """Set all inputs."""
        self.set_strain(sample.strain)
        self.set_valid(sample.valid)
        assert self.set_scalars(0, sample.pressure, sample.deviation) == OK

    def advance(self, sample: LinearSample, time: float = 0.0, size: float = 0.01) -> np.ndarray:
        """All outputs after a step over ``size`` from ``time`` [s]."""
        self.give(sample)
        assert self.step(time, size) == OK, self.messages
        return self.all_outputs()

    def all_outputs(self) -> np.ndarray:
        """The outputs of any map: a linear one has no others."""
        return self.outputs()
