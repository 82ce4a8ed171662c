"""Manoeuvres of a stress test: flights over time, with what fails in them."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from math import pi, radians
from typing import Any

import numpy as np

from builder.stress.flights import envelope_incidence
from builder.stress.kind import SILENT_TARGET, KindClass
from builder.trial.conditions import listed_altitudes_km, wind_angles
from builder.vehicle.file import Vehicle
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.flight_condition import FlightCondition

SWING = 0.7
"""Largest incidence of a swing, and the one about which steps and gusts act, over the largest of the envelope."""

RISE = 0.1
"""Time [s] in which a gust rises, and falls."""


@dataclass(frozen=True, kw_only=True)
class Manoeuvre:
    """One flight over time; ``builder/stress/manoeuvres.toml`` says what its entries are."""

    error: str
    size: str
    group: KindClass
    what: str
    seconds: float
    turn_deg_s: float = 0.0
    step_deg: float = 0.0
    gust_deg: float = 0.0
    mach_drift: float = 0.0
    pressure_drift: float = 0.0
    lost_rows: int = 0
    no_strain: float = 0.0
    exact: bool = False
    ratio: float = 1.05

    @property
    def undetected_target(self) -> float:
        """Largest percentage of undetected samples that is aimed at."""
        return SILENT_TARGET[self.group]

    def conditions(self, vehicle: Vehicle, time: FloatArray, random: np.random.Generator) -> list[FlightCondition]:
        """Return the flight conditions at ``time`` (n,) [s]; Mach number, altitude, plane and phase are drawn."""
        listed = vehicle.conditions.mach_number
        mach = float(random.uniform(min(listed), max(listed)))
        altitude = 1e3 * float(random.uniform(*listed_altitudes_km(vehicle)))
        plane, phase = random.uniform(0.0, 2.0 * pi, 2).tolist()
        incidence = self._incidence(envelope_incidence(vehicle), phase, time)
        angles = [wind_angles(abs(one), plane + (pi if one < 0.0 else 0.0)) for one in incidence.tolist()]
        return [
            FlightCondition(mach_number=mach, angle_of_attack=alpha, sideslip_angle=beta, altitude=altitude)
            for alpha, beta in angles
        ]

    def _incidence(self, largest: float, phase: float, time: FloatArray) -> FloatArray:
        """Return (n,) signed incidence [rad] in the plane of the motion."""
        swing = SWING * largest
        if self.turn_deg_s > 0.0:
            return np.asarray(swing * np.sin(radians(self.turn_deg_s) / swing * time + phase))
        in_second = np.mod(time + phase, 1.0)
        rising = np.minimum(in_second, 2.0 * RISE - in_second) / RISE
        gust = radians(self.gust_deg) * np.maximum(rising, 0.0)
        step = radians(self.step_deg) * np.mod(np.floor(time + phase), 2.0)
        return np.asarray(swing * np.sin(phase) * 0.5 + gust + step)

    def gives(self, time: FloatArray, roll_angle: FloatArray, random: np.random.Generator) -> BoolArray:
        """Return (n, n_d) whether each gauge, at ``roll_angle`` (n_d,) [rad], gives a reading."""
        found = np.ones((len(time), len(roll_angle)), dtype=bool)
        middle = 0.5 * self.seconds
        if self.lost_rows:
            rows = np.round(np.mod(roll_angle, 2.0 * pi), 6)
            first = random.choice(np.unique(rows))
            opposite = np.isclose(np.cos(rows - first), -1.0)
            lost = (rows == first) | (opposite & (self.lost_rows > 1))
            found[np.ix_(time >= middle, lost)] = False
        if self.no_strain > 0.0:
            found[np.abs(time - middle) < 0.5 * self.no_strain] = False
        return found


@dataclass(frozen=True, kw_only=True)
class ManoeuvreSet:
    """Manoeuvres, the time step and the time constants of the filter [s], and the coverage that is aimed at."""

    time_step: float
    time_constants: Sequence[float]
    coverage_percent: float
    manoeuvres: Sequence[Manoeuvre]


def manoeuvre_set() -> ManoeuvreSet:
    """Return the manoeuvres of ``manoeuvres.toml``."""
    text = resources.files("builder.stress").joinpath("manoeuvres.toml").read_text(encoding="utf-8")
    entry = tomllib.loads(text)

    def of(one: dict[str, Any]) -> Manoeuvre:
        return Manoeuvre(group=one["class"], **{name: value for name, value in one.items() if name != "class"})

    return ManoeuvreSet(
        time_step=entry["time_step"],
        time_constants=tuple(entry["time_constants"]),
        coverage_percent=entry["coverage_percent"],
        manoeuvres=tuple(map(of, entry["manoeuvre"])),
    )
