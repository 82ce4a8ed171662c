"""Motion in time: a vehicle in a manoeuvre, with what fails and drifts meanwhile."""

from __future__ import annotations

from math import pi, radians

import numpy as np
from pydantic import Field

from builder.trial.conditions import envelope_incidence, listed_altitudes_km, wind_angles
from builder.vehicle.file import Vehicle
from builder.vehicle.toml.sections import Section
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.flight_condition import FlightCondition

SWING = 0.7
"""Largest incidence of a swing, and the one about which steps and gusts act, over the largest of the envelope."""

RISE = 0.1
"""Time [s] in which a gust rises, and falls."""


class Motion(Section):
    """One flight over time.

    Attributes
    ----------
    seconds, time_step : length of the flight, and between samples [s].
    turn_deg_s : largest rate of the flow direction, which swings in a plane through the axis.
    step_deg, gust_deg : change of the incidence every second.
    mach_drift, pressure_drift : rate of an error of the given M [1/s], and of the given p_inf over it [1/s].
    lost_rows : opposite rows of gauges without a reading from the middle of the flight on.
    no_strain : seconds in the middle of the flight without any reading.
    """

    seconds: float = Field(gt=0.0)
    time_step: float = Field(default=0.01, gt=0.0)
    turn_deg_s: float = 0.0
    step_deg: float = 0.0
    gust_deg: float = 0.0
    mach_drift: float = 0.0
    pressure_drift: float = 0.0
    lost_rows: int = Field(default=0, ge=0, le=2)
    no_strain: float = 0.0

    @property
    def time(self) -> FloatArray:
        """(n,) of the samples [s]."""
        return self.time_step * np.arange(float(round(self.seconds / self.time_step)))

    def conditions(self, vehicle: Vehicle, random: np.random.Generator) -> list[FlightCondition]:
        """Return the flight conditions in time; Mach number, altitude, plane and phase are drawn."""
        listed = vehicle.conditions.mach_number
        mach = float(random.uniform(min(listed), max(listed)))
        altitude = 1e3 * float(random.uniform(*listed_altitudes_km(vehicle)))
        plane, phase = random.uniform(0.0, 2.0 * pi, 2).tolist()
        incidence = self._incidence(envelope_incidence(vehicle), phase)
        angles = [wind_angles(abs(angle), plane + (pi if angle < 0.0 else 0.0)) for angle in incidence.tolist()]
        return [
            FlightCondition(mach_number=mach, angle_of_attack=alpha, sideslip_angle=beta, altitude=altitude)
            for alpha, beta in angles
        ]

    def _incidence(self, largest: float, phase: float) -> FloatArray:
        """Return (n,) signed incidence [rad] in the plane of the motion."""
        swing, time = SWING * largest, self.time
        if self.turn_deg_s > 0.0:
            return np.asarray(swing * np.sin(radians(self.turn_deg_s) / swing * time + phase))
        in_second = np.mod(time + phase, 1.0)
        rising = np.minimum(in_second, 2.0 * RISE - in_second) / RISE
        gust = radians(self.gust_deg) * np.maximum(rising, 0.0)
        step = radians(self.step_deg) * np.mod(np.floor(time + phase), 2.0)
        return np.asarray(swing * np.sin(phase) * 0.5 + gust + step)

    def gives(self, roll_angle: FloatArray, random: np.random.Generator) -> BoolArray:
        """Return (n, n_d) whether each gauge, at ``roll_angle`` (n_d,) [rad], gives a reading."""
        time, middle = self.time, 0.5 * self.seconds
        given = np.ones((len(time), len(roll_angle)), dtype=bool)
        if self.lost_rows:
            rows = np.round(np.mod(roll_angle, 2.0 * pi), 6)
            first = random.choice(np.unique(rows))
            opposite = np.isclose(np.cos(rows - first), -1.0)
            lost = (rows == first) | (opposite & (self.lost_rows > 1))
            given[np.ix_(time >= middle, lost)] = False
        if self.no_strain > 0.0:
            given[np.abs(time - middle) < 0.5 * self.no_strain] = False
        return given
