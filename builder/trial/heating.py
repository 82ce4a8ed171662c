"""A wall that warms: strain and readings of temperature sensors, on the mesh of the independent model.

Time in the heating is drawn. The rise grows evenly with it, from nose to base in a straight line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import Field

from builder.inverse.noise.thermal import thermal_structure
from builder.structure.loads.gauge_strain import gauge_strain, gauge_temperature
from builder.structure.loads.temperature import temperature_mode
from builder.trial.faults import MICRO
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolutions
from builder.vehicle.structure.temperature import Temperature, TemperatureSensor
from builder.vehicle.toml.sections import Section
from strainfmu.arrays import FloatArray

PER_100K, CELSIUS = 1e-4, 273.15

SENSOR_STATIONS = (0.11, 0.36, 0.61, 0.86)
"""Of the standard sensors, over the length of the body; one on each surface of the wall."""


class AtEnd(NamedTuple):
    """The end of a heating: strain [m/m] and rise [K] of the gauges (n_d,), and rise at the sensors (n_t,) [K]."""

    strain: FloatArray
    rise: FloatArray
    at_sensors: FloatArray


class Heating(Section):
    """Rise at the end of the heating.

    Attributes
    ----------
    nose_K, aft_K : of the wall at nose and base [K].
    through_wall_K : outer less inner surface at the nose [K].
    side_percent : what one side is warmer by, of the rise.
    """

    nose_K: float = Field(default=0.0, ge=0.0)
    aft_K: float = Field(default=0.0, ge=0.0)
    through_wall_K: float = 0.0
    side_percent: float = 0.0

    def at_end(self, vehicle: Vehicle) -> AtEnd:
        """Return what gauges and sensors get at the end of it."""
        entry = temperature_of(vehicle)
        resolution = Resolutions(map=vehicle.resolution.truth, truth=vehicle.resolution.truth)
        structure = thermal_structure(vehicle.model_copy(update={"resolution": resolution}), entry)
        ends = np.array([0.0, vehicle.body().length])
        rise, through = np.array([self.nose_K, self.aft_K]), np.array([self.through_wall_K, 0.0])
        fields = [
            temperature_mode(ends, rise, through_wall=through),
            temperature_mode(ends, 0.01 * self.side_percent * rise, harmonic=1, roll_angle=0.7),
        ]
        x = np.array([sensor.x_m for sensor in entry.sensor])
        roll = np.radians([sensor.roll_angle_deg for sensor in entry.sensor])
        depth = np.array([float(sensor.surface == "outer") for sensor in entry.sensor])
        return AtEnd(
            strain=gauge_strain(structure, fields),
            rise=np.sum([gauge_temperature(structure, field) for field in fields], axis=0),
            at_sensors=np.sum([field.at(x, roll, depth) for field in fields], axis=0),
        )


def standard_temperature(length: float) -> Temperature:
    """Return a section [temperature] with eight sensors for a body of ``length`` [m]."""
    sensors = [
        TemperatureSensor(name=f"{surface} {part:g}", x_m=part * length, surface=surface)
        for part in SENSOR_STATIONS
        for surface in ("inner", "outer")
    ]
    return Temperature(
        expansion_um_per_m_per_K=9.0,
        modulus_percent_per_100K=-4.5,
        gauge_factor_percent_per_100K=-1.0,
        apparent_strain_um_per_m=(0.05, -0.002),
        apparent_strain_scatter_um_per_m_per_K=0.01,
        sensor=sensors,
    )


def temperature_of(vehicle: Vehicle) -> Temperature:
    """Return the section [temperature] of a vehicle; the standard one where it has none."""
    return vehicle.temperature or standard_temperature(vehicle.body().length)


def heated(
    entry: Temperature, end: AtEnd, strain: FloatArray, scatter: FloatArray, random: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return readings (n, n_d) [m/m] of a wall that warms instead of isothermal ``strain``, and the temperature
    (n, n_t) that sensors measure [K]; ``scatter`` (n or 1, n_d) are standard normal numbers of the gauges."""
    time = random.uniform(0.0, 1.0, (len(strain), 1))
    warm = time * end.rise
    per_kelvin = MICRO * entry.apparent_strain_scatter_um_per_m_per_K * scatter
    powers = [MICRO * c * warm**k for k, c in enumerate(entry.apparent_strain_um_per_m, start=1)]
    sheet = sum(powers, start=per_kelvin * warm)
    softer = 1.0 + PER_100K * entry.modulus_percent_per_100K * warm
    factor = 1.0 + PER_100K * entry.gauge_factor_percent_per_100K * warm
    noise = [sensor.std_K for sensor in entry.sensor] * random.standard_normal((len(strain), len(entry.sensor)))
    measured = entry.reference_degC + CELSIUS + time * end.at_sensors + noise
    return np.asarray(factor * (strain / softer + time * end.strain + sheet)), measured
