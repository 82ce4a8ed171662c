"""Kinds of nonlinear maps, random samples of each, and what core and reference make of them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from flight_maps import whole_map, with_considered_columns, with_considered_error
from linear_kinds import in_use, known_sensors
from other_load_maps import with_further_tables
from parameter_maps import with_errors_of_parameters, with_parameter_tables
from sensor_maps import with_sensors
from shape_case import shape_map
from thermal_maps import with_temperature

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import with_known
from strainfmu.estimator.reference.air import AirInputs, air_inputs
from strainfmu.estimator.reference.nonlinear import NonlinearReference, Sample
from strainfmu.estimator.reference.readings import amplitudes, row_noise, rows_of
from strainfmu.estimator.settings import default_settings

AIR = ("mach_number", "static_pressure", "dynamic_pressure")
COLD_NOISE = 2e-7
"""Noise of gauges of a map with temperature modes, whose covariance has their prior, too [m/m]."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of map: what makes it, and whether its gauges have zero offsets of unknown errors."""

    make: Callable[[], InverseMap]
    has_zeros: bool = False


KINDS = {
    "revolution": Kind(make=whole_map),
    "surface": Kind(make=shape_map),
    "sections": Kind(make=lambda: with_further_tables(whole_map())),
    "temperature": Kind(make=lambda: with_temperature(whole_map())),
    "sensors_temperature": Kind(make=lambda: with_temperature(with_sensors(with_further_tables(whole_map())))),
    "zeros": Kind(make=whole_map, has_zeros=True),
    "considered": Kind(
        make=lambda: with_considered_columns(with_considered_error(with_further_tables(whole_map())))
    ),
    "parameters": Kind(
        make=lambda: with_errors_of_parameters(with_parameter_tables(with_further_tables(whole_map())))
    ),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Samples (k, ..) of a map: flight ``state`` (k, 4), readings, masks and everything else that is known."""

    state: np.ndarray
    readings: np.ndarray
    valid: np.ndarray
    air: np.ndarray
    air_std: np.ndarray
    altitude: np.ndarray
    zeros: GaugeZeros | None = None
    temperature: np.ndarray | None = None
    thrust: np.ndarray | None = None
    parameter: np.ndarray | None = None
    parameter_std: np.ndarray | None = None
    names: tuple[str, ...] = field(default=())

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of the core's estimator by name, but the readings."""
        found: dict[str, Any] = {"valid": self.valid, "altitude": self.altitude, "q_source": 1}
        for name, value, std in zip(AIR, self.air.T, self.air_std.T, strict=True):
            found |= {name: value, f"{name}_std": std}
        if self.temperature is not None:
            found["temperature"] = self.temperature
        if self.thrust is not None:
            found["thrust"] = self.thrust
        if self.parameter is not None and self.parameter_std is not None:
            found["parameters"] = dict(zip(self.names, self.parameter.T, strict=True))
            found["parameters_std"] = dict(zip(self.names, self.parameter_std.T, strict=True))
        return found


def drawn(m: InverseMap, kind: Kind, n: int, seed: int) -> Samples:
    """Return ``n`` samples by the tables and errors of ``m``; sensors and air data are missing or wrong."""
    random, manifold = np.random.default_rng(seed), m.manifold
    assert manifold is not None
    middle, half = (np.broadcast_to(one, 2) for one in manifold.crossflow)
    scale = 0.65 if manifold.crossflow_range is None else 1.0
    low, high = np.log([max(5.0 * manifold.pressure_range[0], 2e3), min(0.4 * manifold.pressure_range[1], 2.5e4)])
    part = random.uniform(-1.0, 1.0, (n, 4))
    state = np.column_stack(
        [
            manifold.mach_range.mean() + 0.5 * np.ptp(manifold.mach_range) * part[:, 0],
            middle + scale * half * part[:, 1:3],
            0.5 * (low + high) + 0.5 * (high - low) * part[:, 3],
        ]
    )
    more: dict[str, Any] = {}
    if manifold.parameters is not None:
        powers, names = manifold.parameters.powers, tuple(m.provenance["parameters"])
        value = powers.mean + powers.spread * random.uniform(-1.0, 1.0, (n, len(names)))
        std = random.choice([0.02, 0.1, 0.5, np.nan], value.shape, p=[0.3, 0.3, 0.2, 0.2])
        more |= {"parameter": value, "parameter_std": std, "names": names}
    noise = np.eye(m.n_gauges) * COLD_NOISE**2 if m.has_temperature else manifold.gauge_covariance
    rows = np.empty((n, m.n_gauges))
    for k, at in enumerate(state):
        known = manifold
        if "parameter" in more:
            known = with_known(manifold, more["parameter"][k], np.full(len(more["names"]), 1e-9))
        reference = NonlinearReference(m, known, noise)
        root = np.linalg.cholesky(reference.strain_covariance(at))
        rows[k] = reference.at(at)[0][: m.n_gauges] + root @ random.standard_normal(m.n_gauges)
    if m.has_temperature:
        rows, more["temperature"] = _warm(m, random, rows)
    if kind.has_zeros:
        own = m.noise_std[: m.n_strain_gauges]
        offsets = 20.0 * own * random.standard_normal(len(own))
        more["zeros"] = GaugeZeros(
            value=offsets, std=own * random.uniform(0.5, 1.5, len(own)), common_std=own.min()
        )
        rows[:, : len(own)] += offsets
    if m.has_auxiliary_sensors:
        more["thrust"] = random.choice([0.0, 300.0], n)
        rows = rows * m.sensors.scale + more["thrust"][:, None] * m.sensors.thrust_response
    rows[random.random(n) < 0.03, random.integers(m.n_strain_gauges)] = np.nan
    masks = random.random((6, m.n_gauges)) > np.linspace(0.0, 0.4, 6)[:, None]
    return Samples(
        state=state,
        readings=rows,
        valid=masks[random.integers(0, 6, n)],
        **_air_data(m, random, state),
        **more,
    )


def _warm(m: InverseMap, random: np.random.Generator, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what gauges read with temperature modes drawn, and what temperature sensors do."""
    thermal = m.thermal
    amplitude = thermal.prior_std * random.standard_normal((len(rows), len(thermal.prior_std)))
    rise = amplitude @ thermal.gauge_operator.T
    apparent = sum(one * rise ** (power + 1) for power, one in enumerate(thermal.apparent_strain))
    wall = amplitude @ thermal.mode_strain.T + apparent
    rows = (1.0 + thermal.gauge_factor_slope * rise) * (rows / (1.0 + thermal.modulus_slope * rise) + wall)
    read = thermal.reference_temperature + amplitude @ thermal.sensor_operator.T
    read += thermal.sensor_std * random.standard_normal(read.shape)
    read[random.random(read.shape) < 0.1] = np.nan
    return rows, read


def _air_data(m: InverseMap, random: np.random.Generator, state: np.ndarray) -> dict[str, np.ndarray]:
    """Return air data of which some are wrong, some are missing, and some have a stated standard deviation."""
    manifold, n = m.manifold, len(state)
    assert manifold is not None
    static = np.exp(state[:, 3])
    exact = np.column_stack([state[:, 0], static, 0.7 * state[:, 0] ** 2 * static])
    std = exact * [0.0, manifold.static_pressure_error, manifold.dynamic_pressure_error]
    std[:, 0] = manifold.mach_number_error
    value = exact + std * random.standard_normal((n, 3))
    value += std * np.where(random.random((n, 3)) < 0.05, random.choice([-7.0, 5.0, 15.0], (n, 3)), 0.0)
    value[random.random((n, 3)) < 0.2] = np.nan
    stated = np.where(random.random((n, 3)) < 0.3, std * random.choice([0.2, 3.0], (n, 3)), np.nan)
    altitude = np.where(random.random(n) < 0.1, 20e3, np.nan)
    return {"air": value, "air_std": stated, "altitude": altitude}


def by_core(m: InverseMap, samples: Samples, start: np.ndarray | None) -> Any:
    """Return what the compiled core makes of ``samples`` from ``start`` (k, 4), from its own search for None."""
    zeros = samples.zeros
    offsets = None
    if zeros is not None:
        offsets = GaugeZeros(value=zeros.value, std=zeros.std, common_std=zeros.common_std)
    return Estimator(m, zeros=offsets).estimate(samples.readings, start=start, **samples.arguments())


class ByReference:
    """The reference on samples of a map, one by one."""

    def __init__(self, m: InverseMap, samples: Samples) -> None:
        self._map, self._samples = m, samples
        self._kept: dict[bytes, NonlinearReference] = {}
        n = len(samples.readings)
        self._thrust = np.zeros(n) if samples.thrust is None else samples.thrust
        sensor_range = default_settings(m).sensor_range
        self._used = in_use(m, samples.readings, samples.valid, sensor_range, self._thrust)

    def air(self, k: int) -> AirInputs:
        """Return the air data of sample ``k``."""
        s = self._samples
        return air_inputs(self._map, s.air[k], s.air_std[k], float(s.altitude[k]))

    def sample(self, k: int) -> tuple[NonlinearReference, Sample]:
        """Return the estimator of sample ``k``, and the sample."""
        m, s, one = self._map, self._samples, slice(k, k + 1)
        assert m.manifold is not None
        amplitude = left = known = None
        if s.temperature is not None and m.has_temperature:
            known = known_sensors(m.thermal, s.temperature[one])[0]
            found = amplitudes(m.thermal, s.temperature[one], known)
            amplitude, left = found.mean, found.covariance[0]
        rows = rows_of(m, s.readings[one], self._thrust[one], s.zeros, amplitude)[0]
        sample = Sample(rows=np.where(self._used[k], rows, 0.0), used=self._used[k], air=self.air(k))
        parameter = s.parameter is not None and s.parameter_std is not None
        key = (k if parameter else 0, None if known is None else known.tobytes()).__repr__().encode()
        if key not in self._kept:
            tables = m.manifold
            if s.parameter is not None and s.parameter_std is not None:
                tables = with_known(tables, s.parameter[k], s.parameter_std[k])
            noise = row_noise(m, m.manifold.gauge_covariance, s.zeros, left)
            self._kept[key] = NonlinearReference(m, tables, noise)
        return self._kept[key], sample
