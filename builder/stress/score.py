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
from builder.truth.as_built import AsBuilt
from builder.truth.flights import Flights
from builder.truth.levels.read_flights import gauge_noise
from builder.vehicle.file import Vehicle
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros
from strainfmu.flight_condition import FlightCondition

COEFFICIENTS = ("coefficients", "coefficients_std")

SIGMAS = 3.0
"""An estimate is wrong where a coefficient is further from the truth than this many of its standard deviations, or
is none."""


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
class Score:
    """What became of one kind of error; shares in percent of ``samples``.

    Attributes
    ----------
    kind : the error.
    flagged : health is not OK.
    silent : health is OK, and a coefficient is outside 3 sigma.
    wrong : a coefficient is outside 3 sigma, or there is none, whatever health says.
    health : each state that occurred.
    """

    kind: Kind
    conditions: int
    samples: int
    flagged: float
    silent: float
    wrong: float
    health: dict[str, float]

    @property
    def missed(self) -> tuple[str, ...]:
        """The targets that are not met, as text."""
        kind, outside = self.kind, self.health.get(HealthState.OUTSIDE.name, 0.0)
        found = []
        if kind.silent_target is not None and self.silent > kind.silent_target:
            found.append(f"undetected {self.silent:.2f} %, at most {kind.silent_target:g} % aimed at")
        if kind.flagged_target is not None and self.flagged < kind.flagged_target:
            found.append(f"detected {self.flagged:.2f} %, at least {kind.flagged_target:g} % aimed at")
        if kind.outside_target is not None and outside > kind.outside_target:
            found.append(f"OUTSIDE {outside:.3g} %, at most {kind.outside_target:g} % aimed at")
        return tuple(found)

    def entry(self) -> dict[str, Any]:
        """Return the entry of ``stress.json``; former names of keys stand at its end."""
        kind = self.kind
        targets = {
            "undetected_percent_at_most": kind.silent_target,
            "detected_percent_at_least": kind.flagged_target,
            "outside_percent_at_most": kind.outside_target,
        }
        return {
            "error": kind.error,
            "size": kind.size,
            "detected_percent": round(self.flagged, 4),
            "undetected_percent": round(self.silent, 4),
            "class": kind.group,
            "wrong_percent": round(self.wrong, 4),
            "health": {name: round(share, 4) for name, share in self.health.items()},
            "conditions": self.conditions,
            "samples": self.samples,
            "what": kind.what,
            "targets": {name: value for name, value in targets.items() if value is not None},
            "missed": list(self.missed),
            "flagged_percent": round(self.flagged, 4),
            "silent_percent": round(self.silent, 4),
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
        )
        scale, first = inverse_map.sensors.scale, inverse_map.n_strain_gauges
        none = np.zeros(inverse_map.n_gauges - first)
        self.sensors = Hardware(
            noise=vehicle.noise,
            station=none,
            roll_angle=none,
            noise_std=(scale * inverse_map.noise_std)[first:],
        )
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

    def score(self, kind: Kind) -> Score:
        """Fly ``kind`` and return its score; errors as :meth:`flights`.

        Draws depend on the kind's own name and size, so that another kind beside it changes nothing.
        """
        flights = self.flights(kind)
        random = np.random.default_rng([self.effort.seed, crc32(f"{kind.error} {kind.size}".encode())])
        count = max(1, round(self.effort.draws * kind.draws))
        found = [self._one_vehicle(kind, flights, kind.build(self.hardware, random), random) for _ in range(count)]
        wrong = np.concatenate([one for one, _ in found])
        health = np.concatenate([one for _, one in found])
        flagged = health != HealthState.OK
        return Score(
            kind=kind,
            conditions=len(flights.conditions),
            samples=len(health),
            flagged=_percent(flagged),
            silent=_percent(wrong & ~flagged),
            wrong=_percent(wrong),
            health={HealthState(i).name: _percent(health == i) for i in np.unique(health)},
        )

    def _one_vehicle(
        self, kind: Kind, flights: Flights, built: AsBuilt, random: np.random.Generator
    ) -> tuple[BoolArray, IntArray]:
        """Return (k,) whether the estimate is wrong, and health, of one vehicle at all flights."""
        strain = flights.read(built)
        if isinstance(flights, SensedFlights):
            # Errors of the sensors come with those of the gauges.
            sensed = flights.sense(built, None if kind.build is exact else random)
            strain = np.hstack([strain, sensed])
        navigation = self._navigation(flights.conditions) if kind.navigation else {}
        navigation |= self._parameters(kind.parameters, flights.conditions, random)
        navigation["dynamic_pressure"] = flights.dynamic_pressure * (
            1.0 + np.asarray(built.dynamic_pressure, dtype=float)
        )
        if kind.filtered is None:
            read, n = strain + self._noise(random, strain.shape), self.hardware.n_gauges
            wind = np.array([[condition.leeward_roll_angle] for condition in flights.conditions])
            parts = [kind.readings(read[:, :n], wind, self.hardware, random)]
            if self.sensors.n_gauges:
                parts.append(kind.sensor_readings(read[:, n:], wind, self.sensors, random))
            read = np.hstack(parts)
            estimate = self.estimator.estimate(read, **navigation)
            found, std, health = estimate.coefficients, estimate.coefficients_std, np.asarray(estimate.health)
        else:
            found, std, health = self._filtered(kind.filtered, strain, navigation, random)
        error: FloatArray = np.abs(found - flights.coefficients)
        with np.errstate(invalid="ignore"):
            right = np.all(error <= SIGMAS * std, axis=1)  # false for NaN
        return ~right, health

    def _filtered(
        self, how: Filtered, strain: FloatArray, navigation: dict[str, Any], random: np.random.Generator
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """Return (k, 5) coefficients and their deviations, and (k,) health, at the end of a flight at each
        condition."""
        n, noise = self.hardware.n_gauges, float(np.mean(self.hardware.noise_std))
        std, common = np.full(n, how.zero * noise), how.common * noise
        zeros = GaugeZeros(value=np.zeros(n), std=std, common_std=common)
        wrong = np.zeros(strain.shape[1])
        wrong[:n] = std * random.standard_normal(n) + common * random.standard_normal()
        estimator = self.estimator.with_zeros(zeros).filter(how.time_constant)
        time, last = how.time_step * np.arange(how.steps), []
        for k, one in enumerate(strain):
            estimator.restart()
            read = one + wrong + self._noise(random, (how.steps, len(one)))
            of_one: dict[str, Any] = {
                name: {each: float(of[k]) for each, of in value.items()}
                if isinstance(value, dict)
                else float(np.broadcast_to(value, len(strain))[k])
                for name, value in navigation.items()
            }
            last.append(estimator.track(read, time=time, **of_one)[-1])
        coefficients, deviations = ([getattr(one, name) for one in last] for name in COEFFICIENTS)
        return np.array(coefficients), np.array(deviations), np.array([int(one.health) for one in last])

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

    def _navigation(self, conditions: Sequence[FlightCondition]) -> dict[str, Any]:
        """Return Mach number and altitude, p_inf in place of the latter for the nonlinear estimator."""
        mach = np.array([one.mach_number for one in conditions])
        if self.inverse_map.manifold is None:
            return {"mach_number": mach, "altitude": np.array([one.altitude for one in conditions])}
        return {"mach_number": mach, "static_pressure": np.array([one.ambient_pressure for one in conditions])}


def _percent(share: BoolArray) -> float:
    return 100.0 * float(np.mean(share))
