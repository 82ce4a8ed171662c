"""The score of a kind of error: how often health shows it, and how often an estimate is wrong without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from builder.stress.flights import DrawConditions
from builder.stress.flows import OtherFlow
from builder.stress.kind import Filtered, Hardware, Kind, KnownParameters, exact
from builder.stress.model import Model, SensedFlights
from builder.structure.as_built.vehicle import AsBuilt, Counts
from builder.trial.bound import cramer_rao_bound
from builder.trial.readings import Readings, gauge_noise, navigation_at
from builder.trial.run import trial_score
from builder.trial.score import Score, by_name, rounded
from builder.truth.flights import Flights
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros
from strainfmu.flight_condition import FlightCondition


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How many flights and vehicles a kind is tried on.

    Attributes
    ----------
    conditions : flight conditions.
    draws : vehicles, each with noise of its own, at every condition.
    seed : of all draws.
    """

    conditions: int = 200
    draws: int = 20
    seed: int = 1


@dataclass(frozen=True, eq=False, kw_only=True)
class KindScore:
    """The score of one ``kind`` of error, flown at ``conditions`` flight conditions."""

    kind: Kind
    conditions: int
    score: Score

    @property
    def missed(self) -> tuple[str, ...]:
        """The targets that are not met, as text."""
        kind, outside = self.kind, 100.0 * self.score.health.get(HealthState.OUTSIDE.name, 0.0)
        detected, undetected = 100.0 * self.score.detected, 100.0 * self.score.undetected
        found = []
        if kind.silent_target is not None and undetected > kind.silent_target:
            found.append(f"undetected {undetected:.2f} %, at most {kind.silent_target:g} % aimed at")
        if kind.flagged_target is not None and detected < kind.flagged_target:
            found.append(f"detected {detected:.2f} %, at least {kind.flagged_target:g} % aimed at")
        if kind.outside_target is not None and outside > kind.outside_target:
            found.append(f"OUTSIDE {outside:.3g} %, at most {kind.outside_target:g} % aimed at")
        return tuple(found)

    def entry(self) -> dict[str, Any]:
        """Return the entry of ``stress.json``; former names of keys stand at its end."""
        kind, score = self.kind, self.score
        targets = {
            "undetected_percent_at_most": kind.silent_target,
            "detected_percent_at_least": kind.flagged_target,
            "outside_percent_at_most": kind.outside_target,
        }
        of_loads = {
            "rms": score.rms,
            "bound": score.bound,
            "bias": score.bias,
            "rms_z": score.rms_z,
            "coverage_1_percent": 100.0 * score.coverage_1,
            "coverage_percent": 100.0 * score.coverage_3,
        }
        return {
            "error": kind.error,
            "size": kind.size,
            "detected_percent": _percent(score.detected),
            "undetected_percent": _percent(score.undetected),
            "class": kind.group,
            "wrong_percent": _percent(score.wrong),
            "health": {name: _percent(part) for name, part in score.health.items()},
            "conditions": self.conditions,
            "samples": score.samples,
            "what": kind.what,
            "targets": {name: value for name, value in targets.items() if value is not None},
            "missed": list(self.missed),
            "false_alarms_percent": _percent(score.false_alarms),
            **{name: by_name(score.names, value, rounded) for name, value in of_loads.items()},
            "flagged_percent": _percent(score.detected),
            "silent_percent": _percent(score.undetected),
        }


class Range:
    """The independent model of a vehicle and the estimator under test; sets of flights are made once."""

    def __init__(self, vehicle: Vehicle, model: Model, inverse_map: InverseMap, effort: Effort) -> None:
        self.vehicle, self.model, self.effort = vehicle, model, effort
        self.inverse_map, self.estimator = inverse_map, Estimator(inverse_map)
        self.hardware = Hardware(
            noise=vehicle.noise,
            station=model.station,
            roll_angle=model.roll_angle,
            noise_std=inverse_map.noise_std[: inverse_map.n_strain_gauges],
            counts=model.counts,
        )
        scale, first = inverse_map.sensors.scale, inverse_map.n_strain_gauges
        none = np.zeros(inverse_map.n_gauges - first)
        self.sensors = Hardware(
            noise=vehicle.noise,
            station=none,
            roll_angle=none,
            noise_std=(scale * inverse_map.noise_std)[first:],
            counts=Counts(gauge=len(none)),
        )
        self._bounds: dict[tuple[tuple[FlightCondition, ...], bool], FloatArray | None] = {}
        self._flights: dict[tuple[DrawConditions, OtherFlow | None], Flights] = {}

    def flights(self, kind: Kind) -> Flights:
        """Return the flights of ``kind``.

        Raises
        ------
        FlowReachError
            The flows do not go as far.
        """
        key = kind.flights, kind.flow
        if key not in self._flights:
            random = np.random.default_rng(self.effort.seed)
            self._flights[key] = self.model.flights(kind, self.effort.conditions, random)
        return self._flights[key]

    def score(self, kind: Kind) -> KindScore:
        """Fly ``kind`` and return its score; errors as :meth:`flights`.

        Draws depend on the kind's own name and size, so that another kind next to it changes nothing.
        """
        flights = self.flights(kind)
        random = np.random.default_rng([self.effort.seed, crc32(f"{kind.error} {kind.size}".encode())])
        count = max(1, round(self.effort.draws * kind.draws))
        built = (kind.build(self.hardware, random) for _ in range(count))
        read = (self.readings(kind, flights, one, random) for one in built)
        found = trial_score(self._estimator(kind.filtered), read, flights.coefficients, self._bound(kind, flights))
        return KindScore(kind=kind, conditions=len(flights.conditions), score=found)

    def _bound(self, kind: Kind, flights: Flights) -> FloatArray | None:
        """Return (k, 5) the Cramer-Rao bound of a reading in each flight; None for filters, other air data, and
        without tables."""
        if kind.filtered is not None or kind.air_data is not None:
            return None
        conditions = tuple(flights.conditions)
        key = conditions, kind.navigation
        if key not in self._bounds:
            known = (*((MACH_NUMBER, STATIC_PRESSURE) if kind.navigation else ()), DYNAMIC_PRESSURE)
            self._bounds[key] = cramer_rao_bound(self.inverse_map, conditions, known)
        return self._bounds[key]

    def _estimator(self, how: Filtered | None) -> Estimator:
        """Return the estimator, with a filter over time where ``how`` states one."""
        if how is None:
            return self.estimator
        n, (std, common) = self.hardware.n_gauges, self._zeros(how)
        zeros = GaugeZeros(value=np.zeros(n), std=std, common_std=common)
        return self.estimator.with_zeros(zeros).filter(how.time_constant)

    def _zeros(self, how: Filtered) -> tuple[FloatArray, float]:
        """Return the standard deviations of the zeros: (n_d,) of each gauge, and in common [m/m]."""
        noise = float(np.mean(self.hardware.noise_std))
        return np.full(self.hardware.n_gauges, how.zero * noise), how.common * noise

    def readings(
        self, kind: Kind, flights: Flights, built: AsBuilt, random: np.random.Generator, noise: bool = True
    ) -> Readings:
        """Return what one vehicle reads in all flights, with the ``noise`` of gauges and sensors or without."""
        strain = flights.read(built)
        if isinstance(flights, SensedFlights):
            # Errors of the sensors come with those of the gauges.
            sensed = flights.sense(built, None if kind.build is exact else random)
            strain = np.hstack([strain, sensed])
        is_nonlinear = self.estimator.is_nonlinear
        known: dict[str, Any] = navigation_at(flights.conditions, is_nonlinear) if kind.navigation else {}
        known |= self._parameters(kind.parameters, flights.conditions, random)
        stated = 1.0 + np.asarray(built.dynamic_pressure, dtype=float)
        known[DYNAMIC_PRESSURE] = flights.dynamic_pressure * stated
        if kind.air_data is not None:
            other = kind.air_data.known(flights.conditions, self.hardware.noise, random)
            known = other if DYNAMIC_PRESSURE in other else known | other
        n, how = self.hardware.n_gauges, kind.filtered
        if kind.added is not None:
            strain[:, :n] += kind.added.strain(flights.conditions)
        if how is not None:
            std, common = self._zeros(how)
            strain[:, :n] += std * random.standard_normal(n) + common * random.standard_normal()
            read = strain[:, None] + self._noise(random, (len(strain), how.steps, strain.shape[1]))
            return Readings(strain=read, known=known, time=how.time_step * np.arange(float(how.steps)))
        read = strain + self._noise(random, strain.shape) if noise else strain
        wind = np.array([[condition.leeward_roll_angle] for condition in flights.conditions])
        parts = [kind.readings(read[:, :n], wind, self.hardware, random)]
        if self.sensors.n_gauges:
            parts.append(kind.sensor_readings(read[:, n:], wind, self.sensors, random))
        return Readings(strain=np.hstack(parts), known=known)

    def _noise(self, random: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
        """Return draws of the noise of gauges [m/m] and auxiliary sensors [their units], last axis all rows."""
        return gauge_noise(self.inverse_map, random, shape) * self.inverse_map.sensors.scale

    def _parameters(
        self, known: KnownParameters | None, conditions: Sequence[FlightCondition], random: np.random.Generator
    ) -> dict[str, Any]:
        """Return flow parameters with errors, and standard deviations, as arguments of the estimator."""
        if known is None:
            return {}
        held = self.estimator.parameters
        std = known.std * held.span
        true = np.array([one.parameters for one in conditions])
        given = true + std * (known.off + random.standard_normal(true.shape))
        stds = {name: np.full(len(true), one) for name, one in zip(held.names, std.tolist(), strict=True)}
        return {"parameters": dict(zip(held.names, given.T, strict=True)), "parameters_std": stds}


def _percent(fraction: float) -> float:
    return round(100.0 * fraction, 4)
