"""What vehicles read on flights of the independent model, errors of hardware, gauges and navigation drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from builder.processors import processors
from builder.trial.conditions import held_out_conditions
from builder.trial.vehicles import FlownVehicles, Fly
from builder.truth.revolution.flow_table import FlowTable
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import (
    ALTITUDE,
    DYNAMIC_PRESSURE,
    MACH_NUMBER,
    Q_SOURCE,
    STATIC_PRESSURE,
    QSource,
)
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.flight_condition import FlightCondition

CONDITIONS, VEHICLES = 4000, 50
"""Flight conditions, and vehicles that fly at each, every one with its own errors and noise.

Samples of one vehicle resemble each other, so that every sample gets a vehicle of its own. False alarms gather at
some conditions: levels of 200,000 samples at 1,000 conditions give 1.1 to 1.5 times the stated rate on other
flows, at 4,000 conditions 1.1 to 1.5 times.
"""

SEED = 20260


@dataclass(frozen=True, eq=False, kw_only=True)
class Readings:
    """What is read in n samples.

    Attributes
    ----------
    strain : (n, n_d) readings [m/m], of auxiliary sensors in units of their own; (n, s, n_d) where each sample is
        the last of s readings in a flight of its own.
    known : what else is known: arguments of :meth:`strainfmu.estimator.estimator.Estimator.estimate` by name,
        each one value for all samples, (n,), or a mapping of such.
    time : (s,) of the readings of a flight [s]; None where each sample is one reading.
    """

    strain: FloatArray
    known: Mapping[str, Any]
    time: FloatArray | None = None


def joined(parts: Sequence[Readings]) -> Readings:
    """Return the samples of ``parts`` one after another; what is known in them has the same names."""
    if len(parts) == 1:
        return parts[0]

    def one(values: Sequence[Any]) -> Any:
        if isinstance(values[0], Mapping):
            return {name: one([value[name] for value in values]) for name in values[0]}
        counts = [len(part.strain) for part in parts]
        return np.concatenate([np.broadcast_to(value, n) for value, n in zip(values, counts, strict=True)])

    return replace(
        parts[0],
        strain=np.concatenate([part.strain for part in parts]),
        known={name: one([part.known[name] for part in parts]) for name in parts[0].known},
    )


def navigation_at(conditions: Sequence[FlightCondition], is_nonlinear: bool) -> dict[str, Any]:
    """Return exact Mach number and p_inf as the nonlinear estimator takes them, altitude for a linear one.

    Each is a measurement of its own, and so is the dynamic pressure that is given with them.
    """
    last = (STATIC_PRESSURE, "ambient_pressure") if is_nonlinear else (ALTITUDE, ALTITUDE)
    named = ((MACH_NUMBER, MACH_NUMBER), last)
    found: dict[str, Any] = {name: np.array([getattr(one, of) for one in conditions]) for name, of in named}
    return {**found, Q_SOURCE: float(QSource.INDEPENDENT)}


@dataclass(frozen=True, eq=False, kw_only=True)
class ReadFlights(Readings):
    """Readings of n samples: as many vehicles at each of f ``conditions``, one flight after another.

    ``coefficients`` (f, 5) are the true ones of the flights [1].
    """

    conditions: tuple[FlightCondition, ...]
    coefficients: FloatArray

    @property
    def vehicles(self) -> int:
        """Number of vehicles in each flight."""
        return len(self.strain) // len(self.conditions)


def read_flights(
    inverse_map: InverseMap,
    vehicle: Vehicle,
    table: FlowTable,
    fly: Fly,
    *,
    seed: int | list[int] = SEED,
    vehicles: int = VEHICLES,
    conditions: int = CONDITIONS,
) -> ReadFlights:
    """Return what ``vehicles`` read at each of ``conditions`` that ``vehicle`` and the flows ``table`` cover.

    ``fly`` lets them fly there. Each flight has a generator of its own.

    Raises
    ------
    InputError
        The Fourier model cannot do the vehicle.
    """
    random = np.random.default_rng(seed)
    # A map whose snapshots could not be rolled holds for the listed angles alone; conditions need no estimator.
    symmetry = inverse_map.provenance.get("symmetry", vehicle.map.symmetry)
    entry = vehicle.map.model_copy(update={"symmetry": symmetry, "estimator": "linear"})
    as_mapped = vehicle.model_copy(update={"map": entry})
    flown = fly(held_out_conditions(as_mapped, table, conditions, random))
    return readings(inverse_map, vehicle.noise, flown, random, vehicles)


def readings(
    inverse_map: InverseMap, noise: Noise, flown: FlownVehicles, random: np.random.Generator, vehicles: int
) -> ReadFlights:
    """Return what ``vehicles`` read in each flight of ``flown``, navigation erring by the sizes of ``noise``."""
    own = random.spawn(len(flown.conditions))

    def of_flight(number: int) -> tuple[FloatArray, ...]:
        condition, random = flown.conditions[number], own[number]
        strain, stated = flown.read(number, vehicles, random)
        strain = strain + gauge_noise(inverse_map, random, strain.shape)
        error = random.standard_normal((2, vehicles))
        of_pressure = 0.01 * noise.navigation_static_pressure_percent * error[1]
        return (
            strain,
            flown.dynamic_pressure[number] * stated,
            condition.mach_number + noise.navigation_mach_number * error[0],
            condition.ambient_pressure * (1.0 + of_pressure),
        )

    with ThreadPoolExecutor(processors()) as pool:
        found = list(pool.map(of_flight, range(len(flown.conditions))))
    strain, dynamic, mach, static = (np.concatenate(part) for part in zip(*found, strict=True))
    known = {
        DYNAMIC_PRESSURE: dynamic,
        MACH_NUMBER: mach,
        STATIC_PRESSURE: static,
        Q_SOURCE: np.full(len(mach), float(QSource.INDEPENDENT)),
    }
    return ReadFlights(
        conditions=tuple(flown.conditions), coefficients=flown.coefficients, strain=strain, known=known
    )


def gauge_noise(inverse_map: InverseMap, random: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    """Return draws of the gauges' own noise [m/m], last axis the gauges."""
    return np.asarray(inverse_map.noise_std * random.standard_normal(shape))
