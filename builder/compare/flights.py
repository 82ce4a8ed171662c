"""Flights of a comparison: random conditions inside the envelope, and what gauges and navigation read there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import cos, hypot, radians

import numpy as np

from builder.structure.as_built.vehicle import AsBuilt, exactly_built
from builder.trial.conditions import (
    conditions_in_ranges,
    drawn_altitudes_km,
    drawn_conditions,
    largest_incidence,
)
from builder.truth.as_built import drawn
from builder.truth.flights import Flights
from builder.truth.revolution.flows import with_knots
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import MapEntry
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map_checks import PER_PRESSURE
from strainfmu.flight_condition import FlightCondition

GAUGE_NOISE, HARDWARE = "gauge noise", "hardware"
ERRORS = (GAUGE_NOISE, HARDWARE)
"""What the readings are wrong by: noise of the gauges alone, or also the errors of the section [noise]."""

MACH_KNOTS, INCIDENCE_KNOTS = 7, 8
"""Knots of the flows, over the Mach numbers of the map and total incidences up to those that are drawn."""

ANGLES = 0.8
"""Largest angle of attack and sideslip that are drawn, over the largest listed ones."""

ALTITUDES_KM = (15.0, 28.0)
"""Altitudes that are drawn [km], where the map holds at them."""

EXAMPLE_DRAWS, EXAMPLE_ALTITUDE_KM = 100, 20.0
"""Draws of noise, and altitude, of the example."""

VEHICLES = 10
"""Vehicles of each draw: each flies a part of the conditions. Errors of one vehicle are the same in its flights:
the mean square depends on the number of vehicles more than on the number of conditions."""

CYCLES = 20
"""Readings of each flight, one after another at the same condition. Filters take all, the others the last one."""

DISCREPANCY_PERCENT, DISCREPANCY_OF_PRIOR_PERCENT = 0.8, 1.0
"""Pressure off the tables in the map that knows of gauge noise alone."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """The size of a comparison.

    Attributes
    ----------
    conditions : flight conditions.
    draws : draws of noise, and of the vehicle as built, at every condition.
    seed : of all draws.
    training : flights that each learning estimator is trained on; a third as many are for its bands.
    """

    conditions: int = 300
    draws: int = 8
    seed: int = 1
    training: int = 12_000


def with_errors(vehicle: Vehicle, errors: str, case: int) -> Vehicle:
    """Return ``vehicle`` with a map of ``case`` that holds the tables and the field, and knows of ``errors``."""
    entry = vehicle.map.model_dump()
    entry.update(
        case=case,
        form=PER_PRESSURE,
        symmetry="full" if vehicle.is_of_revolution else "listed",
        estimator="nonlinear",
        gamma=1.0,
        keep_field=True,
    )
    noise = vehicle.noise
    if errors == GAUGE_NOISE:
        noise = noise.without_hardware_errors()
        entry.update(
            discrepancy_percent=DISCREPANCY_PERCENT,
            discrepancy_of_prior_percent=DISCREPANCY_OF_PRIOR_PERCENT,
            discrepancy_of_overpressure_percent=DISCREPANCY_OF_PRIOR_PERCENT,
            discrepancy_of_leeward_percent=DISCREPANCY_OF_PRIOR_PERCENT,
        )
    return vehicle.model_copy(update={"map": MapEntry(**entry), "noise": noise})


def drawn_angle(vehicle: Vehicle) -> float | None:
    """Return the largest angle of attack and sideslip that are drawn [rad]; None for the disc of the envelope."""
    entry = vehicle.conditions
    largest = min(
        max(map(abs, entry.angle_of_attack_deg), default=0.0), max(map(abs, entry.sideslip_angle_deg), default=0.0)
    )
    return radians(ANGLES * largest) if largest > 0.0 else None


def drawn_incidence(vehicle: Vehicle) -> float:
    """Return the largest total incidence that is drawn [rad]."""
    angle = drawn_angle(vehicle)
    return largest_incidence(vehicle) if angle is None else float(np.arccos(cos(angle) ** 2))


def vehicle_that_flies(vehicle: Vehicle) -> Vehicle:
    """Return ``vehicle`` whose independent model has flows where the conditions of the comparison are."""
    listed = vehicle.conditions.mach_number
    mach = np.round(np.linspace(min(listed), max(listed), MACH_KNOTS), 9)
    largest = 1.01 * drawn_incidence(vehicle)
    return with_knots(vehicle, mach, largest * np.arange(1, INCIDENCE_KNOTS + 1) / INCIDENCE_KNOTS)


def altitudes_km(vehicle: Vehicle) -> tuple[float, float]:
    """Return lowest and highest altitude that are drawn [km]: every map of a comparison scales with pressure."""
    return drawn_altitudes_km(with_errors(vehicle, HARDWARE, 1), ALTITUDES_KM)


def random_conditions(vehicle: Vehicle, count: int, random: np.random.Generator) -> list[FlightCondition]:
    """Return conditions uniform in Mach number, altitude and both angles, or in the disc of total incidence.

    Of another shape than a profile they are uniform in the ranges of the file, flow parameters too.
    """
    if not vehicle.is_of_revolution:
        return conditions_in_ranges(vehicle, altitudes_km(vehicle), count, random)
    listed, angle, largest = vehicle.conditions.mach_number, drawn_angle(vehicle), largest_incidence(vehicle)
    half = angle if angle is not None else largest

    def angles() -> tuple[float, float]:
        alpha, beta = random.uniform(-half, half, 2).tolist()
        return alpha, beta

    return drawn_conditions(
        count,
        random,
        angles=angles,
        mach_numbers=(min(listed), max(listed)),
        altitudes_km=altitudes_km(vehicle),
        is_inside=lambda one: angle is not None or hypot(one.angle_of_attack, one.sideslip_angle) <= largest,
    )


def example_conditions(vehicle: Vehicle) -> list[FlightCondition]:
    """Return :data:`EXAMPLE_DRAWS` times one condition that linear maps find hard: M5, a6, b6 of the source.

    On other vehicles it is the smallest Mach number, and three quarters of the largest angles that are drawn; of
    another shape than a profile three quarters of the way from the middle of each range to its end.
    """
    if not vehicle.is_of_revolution:
        return [_example_of_shape(vehicle)] * EXAMPLE_DRAWS
    angle = drawn_angle(vehicle)
    half = 0.75 * (largest_incidence(vehicle) / np.sqrt(2.0) if angle is None else angle)
    one = FlightCondition(
        mach_number=min(vehicle.conditions.mach_number),
        angle_of_attack=float(half),
        sideslip_angle=float(half),
        altitude=_example_altitude(vehicle),
    )
    return [one] * EXAMPLE_DRAWS


def _example_of_shape(vehicle: Vehicle) -> FlightCondition:
    entry = vehicle.conditions
    listed = [entry.angle_of_attack_deg, entry.sideslip_angle_deg]
    listed += [one.values for one in entry.parameters.values()]
    alpha, beta, *parameters = (0.125 * min(one) + 0.875 * max(one) for one in listed)
    angles = radians(alpha), radians(beta)
    return FlightCondition(min(entry.mach_number), *angles, _example_altitude(vehicle), tuple(parameters))


def _example_altitude(vehicle: Vehicle) -> float:
    return 1e3 * float(np.clip(EXAMPLE_ALTITUDE_KM, *altitudes_km(vehicle)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Readings:
    """What is read at k conditions.

    Attributes
    ----------
    strain : (CYCLES, k, n_d) [m/m].
    dynamic_pressure : (k,) stated q_inf [Pa].
    dynamic_pressure_std : its standard deviation [Pa], NaN for the map's own.
    mach_number, static_pressure : (k,) M [1] and p_inf [Pa] of navigation.
    """

    strain: FloatArray
    dynamic_pressure: FloatArray
    dynamic_pressure_std: float
    mach_number: FloatArray
    static_pressure: FloatArray

    @property
    def last(self) -> FloatArray:
        """(k, n_d) the last strain of each condition."""
        return self.strain[-1]


def readings(
    vehicle: Vehicle,
    flights: Flights,
    *,
    errors: str,
    noise_std: FloatArray,
    draws: int,
    random: np.random.Generator,
) -> Iterator[Readings]:
    """Return ``draws`` readings of all conditions, each by :data:`VEHICLES` vehicles.

    Their errors are drawn at the sizes of the section [noise]. ``noise_std`` (n_d,) is the noise of the gauges
    [m/m].
    """
    n_d, k = len(noise_std), len(flights.conditions)
    mach = np.array([one.mach_number for one in flights.conditions])
    navigation, exact = vehicle.noise, errors == GAUGE_NOISE
    groups = np.array_split(np.arange(k), 1 if exact else min(VEHICLES, k))
    for _ in range(draws):
        strain, dynamic = np.empty((k, n_d)), flights.dynamic_pressure.copy()
        for rows in groups:
            built: AsBuilt = exactly_built(flights.counts) if exact else drawn(navigation, flights.counts, random)
            own = slice(int(rows[0]), int(rows[-1]) + 1)
            strain[own] = flights.read(built, own)
            dynamic[own] *= 1.0 + built.dynamic_pressure.item()
        pressure_error = 0.01 * navigation.navigation_static_pressure_percent * random.standard_normal(k)
        yield Readings(
            strain=strain + noise_std * random.standard_normal((CYCLES, k, n_d)),
            dynamic_pressure=dynamic,
            dynamic_pressure_std=0.0 if exact else np.nan,
            mach_number=mach + navigation.navigation_mach_number * random.standard_normal(k),
            static_pressure=flights.ambient_pressure * (1.0 + pressure_error),
        )


def one_condition(read: Readings) -> Readings:
    """Return the readings of the first condition alone, for the cost of a step."""
    return replace(
        read,
        strain=read.strain[:, :1],
        dynamic_pressure=read.dynamic_pressure[:1],
        mach_number=read.mach_number[:1],
        static_pressure=read.static_pressure[:1],
    )
