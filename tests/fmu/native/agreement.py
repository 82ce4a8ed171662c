"""Inputs of FMUs of linear maps, and the numbers of the estimator in Python, which runs the same core."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from flight_fmu import FlightSample
from linear_fmu import LinearSample

from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.estimator_variables import output_values


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
    fixed = inverse_map.fixed_strain
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


def estimated(estimator: Estimator, sample: Sample, **known: Any) -> Estimate:
    """The estimate of ``sample`` as an FMU takes it; what else is ``known``, such as temperatures, as it is."""
    deviation = sample.dynamic_pressure_std
    return estimator.step(
        sample.strain,
        sample.dynamic_pressure,
        valid=sample.valid,
        dynamic_pressure_std=deviation if deviation > 0.0 else np.nan,
        mach_number=sample.mach_number,
        altitude=sample.altitude,
        **known,
    )


def tracked(
    estimator: Estimator, sample: FlightSample | LinearSample, time: float = 0.0, **known: Any
) -> Estimate:
    """The estimate of a sample of a flight from what the last one left; ``time`` [s] is that of a filter."""
    if isinstance(sample, FlightSample):
        flow = sample.flow
    else:
        deviation = sample.deviation if sample.deviation > 0.0 else np.nan
        flow = {"dynamic_pressure": sample.pressure, "dynamic_pressure_std": deviation}
    return estimator.track(sample.strain, valid=sample.valid, time=time, **flow, **known)


def assert_same(outputs: np.ndarray, estimate: Estimate) -> None:
    """Assert that the first ``outputs`` of an FMU, by value reference, are those of ``estimate`` to the bit."""
    np.testing.assert_array_equal(outputs, output_values(estimate)[: len(outputs)])
