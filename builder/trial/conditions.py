"""Where vehicles fly in a trial: random conditions inside the envelope of a map, between its snapshots, and
beyond; and motion in time.

The envelope is the vehicle file's: Mach number and altitude from smallest to largest, and the total incidence up
to the largest of the conditions, at any roll angle of the wind where the map has full symmetry. Mach number and
altitude are uniform in their ranges; angles of a body of revolution are by :func:`held_out_conditions`, of any
other shape by :func:`conditions_in_ranges`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import degrees, pi, radians
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, NonNegativeFloat, model_validator

from builder.truth.flow_table import FlowTable, flow_states
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import Conditions
from builder.vehicle.toml.toml_sections import Altitude, Section
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import FlowReachError, InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, STATIC_PRESSURE
from strainfmu.flight_condition import CONDITION_NAMES, FlightCondition

ALTITUDES_KM = (12.0, 30.0)
"""Range [km] of altitudes that are drawn where a map holds at all."""

MACH_REACH, INCIDENCE_REACH = 0.22, 0.3
"""How far the flows of a trial go beyond the envelope, relative to its bounds."""

MACH_KNOTS, INCIDENCE_KNOTS = 7, 8
"""Knots of these flows. On the shipped vehicle each harmonic of the pressure between them differs from the
same of flows at 108 knots by 0.004 p_inf rms at most, and the undetected fractions by 0.1 %."""

LEAST_INCIDENCE = radians(1.0)
"""Taken as the largest total incidence [rad] of a vehicle that has none."""

FEWER_BEYOND = 4
"""Beyond the envelope of another shape than a body of revolution there are fewer conditions by this factor: each
needs a flow of its own."""


def _rising(pair: list[float]) -> list[float]:
    if pair[0] > pair[1]:
        raise ValueError(f"expected the smaller number first, got {pair}")
    return pair


TWO = Field(min_length=2, max_length=2), AfterValidator(_rising)
Pair = Annotated[list[NonNegativeFloat], *TWO]
"""Smallest and largest value."""


class Where(Section):
    """Where vehicles fly: inside the envelope, changed by each entry that is given.

    Attributes
    ----------
    altitudes : of the conditions of the vehicle file, or 12 to 30 km as far as the map holds there.
    altitudes_km : range that is drawn, as far as the map holds there.
    altitude_km : the same altitude for all.
    incidence : range of the total incidence of a body of revolution, over the largest of the envelope, at any roll
        angle of the wind.
    incidence_deg : the same [deg], as far as the envelope goes.
    edge : range of one angle, of attack or sideslip, of half its range off its middle, for shapes whose angles
        have ranges of their own. An end of a range at 0 is no edge: a symmetric body has mirror images there.
    mach : the Mach number, below 1 over the smallest and above 1 over the largest of the envelope.
    mirrored : whether angle of attack, sideslip or both have the other sign than listed.
    """

    altitudes: Literal["listed", "map"] = "listed"
    altitudes_km: Annotated[list[Altitude], *TWO] | None = None
    altitude_km: Altitude | None = None
    incidence: Pair | None = None
    incidence_deg: Pair | None = None
    edge: Pair | None = None
    mach: float | None = Field(default=None, gt=0.0)
    mirrored: bool = False

    @model_validator(mode="after")
    def _one_of_each(self) -> Where:
        for first, second in (("altitude_km", "altitudes_km"), ("incidence", "incidence_deg")):
            if getattr(self, first) is not None and getattr(self, second) is not None:
                raise ValueError(f"expected {first} or {second}, got both")
        return self

    @property
    def is_beyond(self) -> bool:
        """Whether another shape than a body of revolution has fewer conditions there."""
        return self.edge is not None or self.mach is not None


def flown_conditions(
    where: Where, vehicle: Vehicle, table: FlowTable | None, count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return ``count`` conditions; without a ``table`` of flows, of another shape than a body of revolution,
    beyond the envelope they are fewer by :data:`FEWER_BEYOND`.

    Raises
    ------
    FlowReachError
        The envelope does not go as far.
    """
    number = max(1, count // FEWER_BEYOND) if table is None and where.is_beyond else count
    conditions = _inside(where, vehicle, table, number, random)
    if where.edge is not None:
        conditions = [_at_edge(condition, vehicle, where.edge, random) for condition in conditions]
    if where.mirrored:
        conditions = [_mirrored(condition, vehicle, random) for condition in conditions]
    if (band := _incidences(where, vehicle)) is not None:
        conditions = [at_any_roll(condition, float(random.uniform(*band)), random) for condition in conditions]
    if where.mach is not None:
        listed = vehicle.conditions.mach_number
        mach = where.mach * (min(listed) if where.mach < 1.0 else max(listed))
        conditions = [replace(condition, mach_number=mach) for condition in conditions]
    if where.altitude_km is not None:
        conditions = [replace(condition, altitude=1e3 * where.altitude_km) for condition in conditions]
    return conditions


def _inside(
    where: Where, vehicle: Vehicle, table: FlowTable | None, count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return conditions inside the envelope, between the snapshots."""
    listed = where.altitudes == "listed"
    heights = range_of(vehicle.conditions.altitudes_km) if listed else drawn_altitudes_km(vehicle)
    if where.altitudes_km is not None:
        heights = drawn_altitudes_km(vehicle, (where.altitudes_km[0], where.altitudes_km[1]))
    if table is None:
        return conditions_in_ranges(vehicle.conditions, heights, count, random)
    conditions = held_out_conditions(vehicle, table, count, random)
    if not listed and where.altitudes_km is None:
        return conditions
    return [replace(condition, altitude=1e3 * float(random.uniform(*heights))) for condition in conditions]


def _incidences(where: Where, vehicle: Vehicle) -> tuple[float, float] | None:
    """Return the range of total incidences [rad]; None where nothing asks for it, and of another shape than a body
    of revolution.

    Raises
    ------
    FlowReachError
        The envelope does not go as far.
    """
    largest = envelope_incidence(vehicle)
    if not vehicle.is_axisymmetric:
        return None
    if where.incidence is not None:
        return where.incidence[0] * largest, where.incidence[1] * largest
    if where.incidence_deg is None:
        return None
    low, high = radians(where.incidence_deg[0]), radians(where.incidence_deg[1])
    if low >= largest:
        raise FlowReachError(f"total incidence [deg]: {degrees(low):g} needed, got {degrees(largest):.4g} at most")
    return low, min(high, largest)


def at_any_roll(condition: FlightCondition, incidence: float, random: np.random.Generator) -> FlightCondition:
    """Return ``condition`` at a total ``incidence`` [rad] and a roll angle of the wind that is drawn."""
    alpha, beta = wind_angles(incidence, float(random.uniform(0.0, 2.0 * pi)))
    return replace(condition, angle_of_attack=alpha, sideslip_angle=beta)


def _at_edge(
    condition: FlightCondition, vehicle: Vehicle, band: Pair, random: np.random.Generator
) -> FlightCondition:
    edges = edges_of(vehicle)
    name, middle, reach = edges[int(random.integers(len(edges)))]
    changed: dict[str, Any] = {name: radians(middle + float(random.uniform(band[0], band[1])) * reach)}
    return replace(condition, **changed)


def _mirrored(condition: FlightCondition, vehicle: Vehicle, random: np.random.Generator) -> FlightCondition:
    """Return a condition of the listed ranges whose angle of attack, sideslip or both have the other sign."""
    entry, incidence = vehicle.conditions, envelope_incidence(vehicle)
    of_alpha, of_beta = ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0))[int(random.integers(3))]

    def turned(alpha: float, beta: float) -> FlightCondition:
        angles = of_alpha * radians(alpha), of_beta * radians(beta)
        return replace(condition, angle_of_attack=angles[0], sideslip_angle=angles[1])

    ranges = [range_of(entry.angle_of_attack_deg), range_of(entry.sideslip_angle_deg)]
    (mirrored,) = uniform_conditions(
        1, random, ranges, turned, lambda condition: condition.total_incidence <= incidence
    )
    return mirrored


def edges_of(vehicle: Vehicle) -> list[tuple[str, float, float]]:
    """Return the ends of the ranges of both angles: the angle's name, the middle [deg], and from there to the end
    [deg]."""
    entry = vehicle.conditions
    both = (("angle_of_attack", entry.angle_of_attack_deg), ("sideslip_angle", entry.sideslip_angle_deg))
    return [
        (name, 0.5 * (min(listed) + max(listed)), end - 0.5 * (min(listed) + max(listed)))
        for name, listed in both
        for end in (min(listed), max(listed))
        if max(listed) > min(listed) and end != 0.0
    ]


def is_inside(where: Where, vehicle: Vehicle) -> bool:
    """Return whether the envelope of the map includes conditions at another altitude, or of other signs."""
    entry = vehicle.conditions
    if where.altitude_km is not None:
        low, high = drawn_altitudes_km(vehicle, vehicle.map.valid_altitude_km)
        return low <= where.altitude_km <= high
    both = (entry.angle_of_attack_deg, entry.sideslip_angle_deg)
    symmetric = vehicle.map.symmetry == "full" or all(np.isclose(min(angles), -max(angles)) for angles in both)
    return symmetric or not where.mirrored


def stress_knots(vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Return Mach numbers (n_M,) and positive total incidences (n_a,) [rad] of flows, beyond the envelope."""
    listed, largest = vehicle.conditions.mach_number, (1.0 + INCIDENCE_REACH) * envelope_incidence(vehicle)
    mach = np.linspace((1.0 - MACH_REACH) * min(listed), (1.0 + MACH_REACH) * max(listed), MACH_KNOTS)
    incidence = largest * np.arange(1, INCIDENCE_KNOTS + 1) / INCIDENCE_KNOTS
    return np.round(mach, 9), np.round(incidence, 9)


def envelope_incidence(vehicle: Vehicle) -> float:
    """Return the largest total incidence [rad] of the envelope, :data:`LEAST_INCIDENCE` at least."""
    return max(largest_incidence(vehicle), LEAST_INCIDENCE)


def largest_incidence(vehicle: Vehicle) -> float:
    """Return the largest total incidence [rad] of the vehicle's flight conditions."""
    return max(condition.total_incidence for condition in vehicle.flight_conditions())


def drawn_altitudes_km(vehicle: Vehicle, wanted_km: tuple[float, float] = ALTITUDES_KM) -> tuple[float, float]:
    """Return lowest and highest altitude [km] of ``wanted_km`` that the map holds at.

    They are its own where it holds at none of these; in form "absolute" the altitudes of the flight conditions.
    """
    if not vehicle.map.follows_pressure:
        return range_of(vehicle.conditions.altitudes_km)
    low, high = vehicle.map.valid_altitude_km
    bottom, top = max(wanted_km[0], low), min(wanted_km[1], high)
    return (bottom, top) if bottom <= top else (low, high)


def held_out_conditions(
    vehicle: Vehicle, table: FlowTable, count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return ``count`` conditions that map and ``table`` both cover.

    With full symmetry the total incidence is uniform from 0, and the roll angle of the wind is any; as listed,
    angle of attack and sideslip are uniform in their ranges.

    Raises
    ------
    InputError
        They have no Mach number in common.
    """
    entry, incidence = vehicle.conditions, min(largest_incidence(vehicle), float(table.incidence_knots[-1]))
    lowest = max(min(entry.mach_number), float(table.mach_knots[0]))
    highest = min(max(entry.mach_number), float(table.mach_knots[-1]))
    if lowest > highest:
        known = f"{table.mach_knots[0]:g} .. {table.mach_knots[-1]:g}, of the flows of the independent model"
        raise InputError(f"conditions.mach_number: expected some within {known}, got {entry.mach_number}")
    is_rolled, angles = vehicle.map.symmetry == "full", [(0.0, incidence), (0.0, 2.0 * pi)]
    if not is_rolled:
        angles = [range_of(entry.angle_of_attack_deg), range_of(entry.sideslip_angle_deg)]

    def made(first: float, second: float, mach: float, height: float) -> FlightCondition:
        alpha, beta = wind_angles(first, second) if is_rolled else (radians(first), radians(second))
        return FlightCondition(mach, alpha, beta, 1e3 * height)

    return uniform_conditions(
        count,
        random,
        ranges=[*angles, (lowest, highest), drawn_altitudes_km(vehicle)],
        made=made,
        is_inside=lambda condition: condition.total_incidence <= incidence,
    )


def conditions_in_ranges(
    entry: Conditions, altitudes_km: tuple[float, float], count: int, random: np.random.Generator
) -> list[FlightCondition]:
    """Return ``count`` conditions, uniform in what the file lists: Mach number, both angles, flow parameters.

    For vehicles of any shape: nothing is rolled.
    """
    heights = 1e3 * altitudes_km[0], 1e3 * altitudes_km[1]
    listed = [entry.mach_number, entry.angle_of_attack_deg, entry.sideslip_angle_deg]
    listed += [parameter.values for parameter in entry.parameters.values()]

    def made(mach: float, alpha: float, beta: float, *rest: float) -> FlightCondition:
        return FlightCondition(mach, radians(alpha), radians(beta), rest[-1], rest[:-1])

    return uniform_conditions(count, random, [*map(range_of, listed), heights], made)


def uniform_conditions(
    count: int,
    random: np.random.Generator,
    ranges: Sequence[tuple[float, float]],
    made: Callable[..., FlightCondition],
    is_inside: Callable[[FlightCondition], bool] = lambda condition: True,
) -> list[FlightCondition]:
    """Return ``count`` conditions, ``made`` of numbers that are uniform in ``ranges``; a condition that is not
    inside is drawn again."""
    (low, high), conditions = np.transpose(ranges), list[FlightCondition]()
    while len(conditions) < count:
        condition = made(*random.uniform(low, high).tolist())
        if is_inside(condition):
            conditions.append(condition)
    return conditions


def range_of(values: Sequence[float]) -> tuple[float, float]:
    """Return the smallest and the largest of ``values``."""
    return min(values), max(values)


QUANTITIES = (*CONDITION_NAMES, "total_incidence", "leeward_roll_angle", DYNAMIC_PRESSURE, STATIC_PRESSURE)
if TYPE_CHECKING:
    Quantity = str
else:  # types do not follow the names of a table
    Quantity = Literal[QUANTITIES]
"""Of a flight condition."""


def quantities(conditions: Sequence[FlightCondition], name: str) -> FloatArray:
    """Return (k,) a quantity of ``conditions`` by the name of an estimator's argument, or its own."""
    attribute = "ambient_pressure" if name == STATIC_PRESSURE else name
    return np.array([float(getattr(condition, attribute)) for condition in conditions])


def flight_states(conditions: Sequence[FlightCondition]) -> FloatArray:
    """Return (k, 4) the flight states of ``conditions``: M, u, w [rad] and ln p_inf, as tables over them have."""
    mach, incidence, roll = flow_states(conditions)
    pressure = np.log(quantities(conditions, STATIC_PRESSURE))
    return np.column_stack([mach, incidence * np.cos(roll), incidence * np.sin(roll), pressure])


def wind_angles(total_incidence: float, roll_angle: float) -> tuple[float, float]:
    """Return angle of attack and sideslip [rad] of a total incidence whose leeward meridian is at
    ``roll_angle``."""
    across = np.sin(total_incidence)
    beta = -np.arcsin(across * np.sin(roll_angle))
    alpha = np.arctan2(across * np.cos(roll_angle), np.cos(total_incidence))
    return float(alpha), float(beta)


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
        altitude = 1e3 * float(random.uniform(*range_of(vehicle.conditions.altitudes_km)))
        plane, phase = random.uniform(0.0, 2.0 * pi, 2).tolist()
        incidence = self._incidence(envelope_incidence(vehicle), phase)
        angles = [wind_angles(abs(angle), plane + (pi if angle < 0.0 else 0.0)) for angle in incidence.tolist()]
        return [FlightCondition(mach, *both, altitude) for both in angles]

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

    def gives(self, rows: FloatArray, random: np.random.Generator) -> BoolArray:
        """Return (n, n_d) whether each gauge, of ``rows`` (n_d,) [deg], gives a reading."""
        time, middle = self.time, 0.5 * self.seconds
        reads = np.ones((len(time), len(rows)), dtype=bool)
        if self.lost_rows:
            first = random.choice(np.unique(rows))
            opposite = np.abs(rows - first) == 180.0
            lost = (rows == first) | (opposite & (self.lost_rows > 1))
            reads[np.ix_(time >= middle, lost)] = False
        if self.no_strain > 0.0:
            reads[np.abs(time - middle) < 0.5 * self.no_strain] = False
        return reads
