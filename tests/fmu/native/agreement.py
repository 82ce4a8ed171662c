"""What native and numpy are compared with, and on which inputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from raw_fmu import GROUPS, N_OUTPUTS, WHOLE_OUTPUTS, outputs_of

from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.estimator.estimates.load_estimate import LoadEstimate
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.linear.masks import information_left
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.settings import EstimatorSettings, default_settings

TOLERANCE = 1e-12
"""Relative to the largest of a group of outputs of one unit. Sums of 54 terms in another order differ by 1e-15 of
the largest term, and terms are up to 100 times their sum."""


@dataclass(frozen=True, eq=False)
class Sample:
    """One set of inputs."""

    strain: np.ndarray
    valid: np.ndarray
    dynamic_pressure: float
    dynamic_pressure_std: float
    mach_number: float = np.nan
    altitude: float = np.nan

    @property
    def flow(self) -> tuple[float, float, float, float]:
        """In the order of the FMU's variables."""
        return self.dynamic_pressure, self.dynamic_pressure_std, self.mach_number, self.altitude


def strain_at(inverse_map: InverseMap, dynamic_pressure: float) -> np.ndarray:
    """(n_d,) strain of the mean pressure at ``dynamic_pressure``, at the nominal one where that says nothing."""
    if inverse_map.form == "absolute" or not 1.0 < dynamic_pressure < 1e8:
        return inverse_map.mean_strain
    fixed = np.zeros(inverse_map.n_gauges) if inverse_map.fixed_strain is None else inverse_map.fixed_strain
    return fixed + dynamic_pressure / inverse_map.nominal_dynamic_pressure * (inverse_map.mean_strain - fixed)


def random_samples(inverse_map: InverseMap, n: int, seed: int) -> Iterator[Sample]:
    """``n`` sets of inputs: a pool of masks with fresh ones between, outliers, broken gauges, broken pressure."""
    random = np.random.default_rng(seed)
    n_gauges, n_states = inverse_map.state_operator.shape
    pool = [np.ones(n_gauges, dtype=bool)]
    for k in range(n):
        if k % 25 == 0:
            maximum = n_gauges if k % 50 == 0 else 4
            pool.append(np.ones(n_gauges, dtype=bool))
            missing = random.integers(0, maximum) if k % 500 else n_gauges - 1
            pool[-1][random.choice(n_gauges, missing, replace=False)] = False
        valid = pool[random.integers(max(0, len(pool) - 6), len(pool))] if k % 3 else pool[0]
        noise = inverse_map.noise_std * random.normal(size=n_gauges)
        pressure = float(random.choice([1e5, 1e5, 1e6 * random.uniform(0.03, 1.0)]))
        if k % 11 == 0:
            pressure = float(random.choice([0.0, 1e-7, 1e-6, 1e7, 1.1e7, 9e9, np.nan, np.inf, -1.0]))
        mean = strain_at(inverse_map, pressure)
        strain = mean + 0.3 * inverse_map.state_operator @ random.normal(size=n_states) + noise
        if k % 4 == 0:
            strain[random.integers(n_gauges)] += (1e-4 if k % 8 else 1e-3) * random.normal()
        if k % 31 == 0:
            strain[random.integers(n_gauges)] = random.choice([np.nan, np.inf, -np.inf, 1.0, -1e300])
        deviation = float(random.choice([0.0, 1e3, np.nan])) if k % 13 else float(random.choice([-1.0, np.inf]))
        mach_number, altitude = _navigation(random, k, pressure)
        yield Sample(
            strain=strain,
            valid=valid,
            dynamic_pressure=pressure,
            dynamic_pressure_std=deviation,
            mach_number=mach_number,
            altitude=altitude,
        )


def _navigation(random: np.random.Generator, k: int, pressure: float) -> tuple[float, float]:
    """Mach number and altitude: not known, in agreement with the dynamic pressure or not, or none that can be."""
    if k % 3 == 0:
        return np.nan, np.nan
    if k % 7 == 0:
        broken = [np.nan, np.inf, -np.inf, -1.0, 0.0, 1e300, 8.0, 5.0, 20e3, 71e3, 71.1e3]
        return float(random.choice(broken)), float(random.choice(broken))
    altitude = float(random.uniform(12e3, 30e3))
    expected = np.sqrt(max(pressure, 0.0) / (0.7 * pressure_and_temperature(altitude)[0]))
    return float(expected * random.uniform(0.95, 1.05)), altitude


def estimated(estimator: Estimator, sample: Sample, **known: Any) -> LoadEstimate:
    """The estimate of ``sample`` as an FMU takes it; what else is ``known``, such as temperatures, as it is."""
    deviation = sample.dynamic_pressure_std
    return estimator.step(
        sample.strain,
        sample.dynamic_pressure,
        sample.valid,
        deviation if deviation > 0.0 else np.nan,
        mach_number=sample.mach_number,
        altitude=sample.altitude,
        **known,
    )


class Reference:
    """The numpy estimator, and how far native may be from it."""

    temperature: np.ndarray | None = None
    """(n_t,) readings of the temperature sensors [K] that it takes with every sample."""

    def __init__(self, inverse_map: InverseMap) -> None:
        self.estimator = Estimator(inverse_map)
        self.settings = default_settings(inverse_map)
        self._growth: dict[bytes, float] = {}

    def set(self, settings: EstimatorSettings) -> None:
        """Take other settings."""
        self.settings = settings
        self.estimator = self.estimator.with_settings(settings)

    def outputs(self, sample: Sample) -> np.ndarray:
        """(27,) outputs by value reference."""
        return outputs_of(estimated(self.estimator, sample, temperature=self.temperature))

    def growth(self, sample: Sample) -> float:
        """Largest growth of any state's deviation by the gauges missing: digits that both programs lose alike."""
        missing = ~(sample.valid & (np.abs(sample.strain) <= self.settings.sensor_range))
        if missing.all():
            return 1.0
        key = missing.tobytes()
        if key not in self._growth:
            parts = self.estimator._parts
            fraction = information_left(parts.gain_whitening, parts.noise_whitening, missing)
            self._growth[key] = 1.0 / np.sqrt(max(fraction, 1e-12))
        return self._growth[key]

    def cancelled(self, sample: Sample, chi_square: float) -> float:
        """What chi-square is the remainder of, per 100 of its round-off; at least 1, that of no degree of freedom.

        Each of its roots is a sum of 54 terms as large as the strains in sigmas, in an order of its own: 1e-14 of
        them is lost, twice the root in the square.
        """
        inverse_map = self.estimator.inverse_map
        sigmas = (sample.strain - strain_at(inverse_map, sample.dynamic_pressure)) / inverse_map.noise_std
        used = sample.valid & (np.abs(sample.strain) <= self.settings.sensor_range)
        return 1.0 + 1e-2 * 2.0 * np.sqrt(chi_square) * float(np.linalg.norm(sigmas[used]))

    def check(self, sample: Sample, native: np.ndarray) -> None:
        """Assert that ``native`` (27,) is what numpy gives: whole numbers and states of health exactly.

        The tolerance rises only where the gauges left hold less than 1e-4 of the information on a state.
        """
        expected = self.outputs(sample)
        assert native.shape == (N_OUTPUTS,)
        assert native[WHOLE_OUTPUTS].tolist() == expected[WHOLE_OUTPUTS].tolist()
        tolerance = TOLERANCE * max(1.0, 1e-2 * self.growth(sample))
        for name, group in GROUPS.items():
            ours, theirs = native[group], expected[group]
            if not np.isfinite(theirs).all():
                assert np.array_equal(ours, theirs, equal_nan=True), name
                continue
            scale = np.abs(theirs).max()
            if name == "chi-square":
                scale += self.cancelled(sample, theirs.max())
            if name.startswith("moment"):  # a moved moment is the difference of a moment and a force times its arm
                scale += np.abs(expected[GROUPS[name.replace("moment", "force")]]).max()
            if name == "envelope score":  # the difference of coefficients and limits, in deviations
                scale += np.max(np.abs(expected[:5])) / np.min(expected[5:10])
            assert np.abs(ours - theirs).max() <= tolerance * scale, (name, ours, theirs)
