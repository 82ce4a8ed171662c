"""What flies, made once for cases that share it: conditions, vehicles as built, bounds; and what is read: the
strain of flights with noise and faults, and the air data that are given with it.

Every sample has a vehicle of its own, but with auxiliary sensors, and with gauges that freeze at the strain of
another flight: there a few vehicles fly all conditions. Samples of one vehicle resemble each other, so that rates
and rms errors over sigma are then a ninth as precise.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.processors import processors
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built_kinds import KINDS
from builder.trial.bound import cramer_rao_bound
from builder.trial.cases import Air, Built, Case
from builder.trial.conditions import flight_states, flown_conditions, quantities
from builder.trial.faults import MICRO, AddedStrain, Gauges, heated, temperature_of
from builder.trial.flows import Flow
from builder.truth.flights import Flights, drawn_vehicle
from builder.truth.flow_table import FlowTable, flow_states, harmonics_at, knot_weights
from builder.truth.shape import ShapeStructure, at_conditions, on_nodes_of, shape_flights
from builder.truth.true_structure import (
    FlyingSensors,
    TrueStructure,
    flights_of_flows,
    without_faint_harmonics,
)
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import Noise
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, LAYERS, static_pressure_at
from strainfmu.estimator.air_inputs import (
    ALTITUDE,
    ANGLE_ERROR,
    DYNAMIC_PRESSURE,
    MACH_NUMBER,
    MEASURED_ANGLES,
    MEASURED_MOTION,
    Q_SOURCE,
    STATIC_PRESSURE,
    VIBRATION,
    QSource,
)
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import values
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.signal_names import STRAIN, TEMPERATURE
from strainfmu.flight_condition import FlightCondition

Made = TypeVar("Made")


@dataclass(eq=False, kw_only=True)
class Shared:
    """What is made once for cases that share it."""

    _made: dict[Hashable, Any] = field(default_factory=dict)

    def once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """Return what ``make`` returned first for ``key``."""
        if key not in self._made:
            self._made[key] = make()
        made: Made = self._made[key]
        return made


@dataclass(eq=False, kw_only=True)
class World(Shared):
    """The independent model of a vehicle and the map under trial.

    Attributes
    ----------
    vehicle : with the estimator and the ranges of the map.
    structure, flows : of the independent model: a table of flows of a body of revolution; of any other shape a
        flow at every Mach number, incidence and parameter that is flown; None where flights are given.
    inverse_map : under trial.
    sensors : auxiliary ones; None of a vehicle without.
    conditions, seed : number of conditions of each case, and the seed that they are drawn with.
    """

    vehicle: Vehicle
    structure: TrueStructure | ShapeStructure
    flows: FlowTable | Snapshots | None
    inverse_map: InverseMap
    sensors: FlyingSensors | None = None
    conditions: int = 200
    seed: int = 1

    @cached_property
    def gauges(self) -> Gauges:
        """The strain gauges."""
        n, structure = self.inverse_map.n_strain_gauges, self.structure
        if isinstance(structure, ShapeStructure):
            station, roll_angle = structure.position[:, 0], structure.gauges.roll_angle
        else:
            station, roll_angle = structure.placed.x, structure.placed.roll_angle
        return Gauges(station, roll_angle, self.inverse_map.noise_std[:n])

    @cached_property
    def noise_std(self) -> FloatArray:
        """Of gauges [m/m] and auxiliary sensors [their units]."""
        return np.asarray(self.inverse_map.noise_std * self.inverse_map.sensors.scale)

    @cached_property
    def added(self) -> AddedStrain:
        return AddedStrain(self.vehicle)

    @cached_property
    def _as_mapped(self) -> Vehicle:
        """The vehicle with the symmetry of the map: one whose snapshots could not be rolled holds as listed."""
        entry = self.vehicle.map
        symmetry = self.inverse_map.provenance.get("symmetry", entry.symmetry)
        if symmetry == entry.symmetry:
            return self.vehicle
        changed: dict[str, Any] = {"symmetry": symmetry, "estimator": "linear"}
        return self.vehicle.model_copy(update={"map": entry.model_copy(update=changed)})

    def flights(self, case: Case) -> Flights:
        """Return the flights of ``case``; cases of one place and flow share them."""
        random = np.random.default_rng(self.seed)
        return self.once(
            f"{case.where}{case.flow}", lambda: self.fly(self.drawn_conditions(case, random), case.flow, random)
        )

    def drawn_conditions(self, case: Case, random: np.random.Generator) -> list[FlightCondition]:
        """Return conditions of ``case``."""
        table = self.flows if isinstance(self.flows, FlowTable) else None
        return flown_conditions(case.where, self._as_mapped, table, self.conditions, random)

    def fly(
        self,
        conditions: list[FlightCondition],
        flow: Flow | None = None,
        random: np.random.Generator | None = None,
    ) -> Flights:
        """Return the flights at ``conditions``, under another pressure if there is a ``flow``; ``random`` draws
        it."""
        vehicle, flows, structure = self.vehicle, self.flows, self.structure
        if isinstance(structure, ShapeStructure):
            assert isinstance(flows, Snapshots)
            known = at_conditions(flows, conditions)
            if flow is not None:
                pressure, share = known.pressure, flow.share(len(known.pressure), random)
                change = flow.surface(vehicle, known).pressure - pressure
                known = replace(known, pressure=pressure + share * change)
            return shape_flights(vehicle, structure, known, operator=self._operator)
        assert isinstance(flows, FlowTable)
        mach, incidence, _ = flow_states(conditions)
        table, solved, weights = flows, flows.flows, knot_weights(flows, mach, incidence)
        if flow is not None:
            table, share = flow.table(vehicle, flows), flow.share(len(conditions), random)
            solved = np.concatenate([solved, table.flows])
            even, odd = (np.hstack([(1.0 - share) * weight, share * weight]) for weight in weights)
            weights = even, odd
        flown = flights_of_flows(vehicle, structure, solved, weights, conditions)
        harmonic = None if self.sensors is None else harmonics_at(table, mach, incidence)
        return replace(without_faint_harmonics(flown), sensors=self.sensors, harmonic=harmonic)

    @cached_property
    def _operator(self) -> FloatArray:
        assert isinstance(self.structure, ShapeStructure)
        assert isinstance(self.flows, Snapshots)
        return on_nodes_of(self.structure, self.flows)

    def as_built(self, entry: Built, random: np.random.Generator, count: int | None = None) -> AsBuilt:
        """Return one vehicle, or ``count`` of them at once."""
        counts, lead = self.structure.counts, () if count is None else (count,)
        vehicle = entry.with_errors(drawn_vehicle(self.vehicle.noise, counts, random, entry.stated, count), random)
        station = self.gauges.station
        third = np.ptp(station) / 3.0
        middle = (station >= station.min() + third) & (station <= station.max() - third)
        for name, value in entry.middle.items():
            vehicle = vehicle.changed(
                **{name: np.where(middle, KINDS[name].scale * value, np.zeros((*lead, len(station))))}
            )
        return vehicle

    def bound(self, case: Case, estimator: str = "") -> FloatArray | None:
        """Return (k, 5) the Cramer-Rao bound of one reading in each flight; None of a filter, of lost gauges, of
        other air data than exact ones, and of a map without tables."""
        air = case.air
        if case.over_time or case.motion or case.lost or air.source or air.angles or air.inertial:
            return None
        known = (*((MACH_NUMBER, STATIC_PRESSURE) if air.navigation else ()), DYNAMIC_PRESSURE)
        return self.once(
            (f"{case.where}{case.flow}", known),
            lambda: cramer_rao_bound(self.inverse_map, self.flights(case).conditions, known),
        )


BATCH, LARGEST_BATCH = 20_000, 20_000 * 128
"""Samples that are read and estimated together, and the largest number of their readings: work for all processors,
in memory that does not grow."""

ANGLES = ("angle_of_attack", "sideslip_angle")

Column = Callable[[str], FloatArray]
"""Returns a quantity of the flight condition of each sample (n,), by its name."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Readings:
    """What is read in n samples, and the truth.

    Attributes
    ----------
    strain : (n, n_d) readings [m/m], of auxiliary sensors in units of their own; (n, s, n_d) where each sample is
        the last of s readings in a flight of its own.
    known : what else is known: arguments of :meth:`strainfmu.estimator.estimator.Estimator.estimate` by name,
        each (n,), (n, k), or a mapping of such. Where p_inf and altitude are both given, an estimator takes the
        one that it knows.
    truth : (n, m) of what is scored.
    vehicle, flight : (n,) numbers of what a sample is of: samples of one resemble each other.
    bound : (n, 5) Cramer-Rao bound of the coefficients [1]; None where it is not known.
    time : [s], (s,) of the readings of a flight; (n,) where the samples are a flight in time, each vehicle from
        its start. None where each sample is one reading.
    conditions : of the flights by their numbers, as far as they are of interest.
    quiet : (n, n_d) strain without noise, where rms errors are about the estimates of these.
    name : what is lost, where gauges are.
    """

    strain: FloatArray
    known: Mapping[str, Any]
    truth: FloatArray
    vehicle: IntArray
    flight: IntArray
    bound: FloatArray | None = None
    time: FloatArray | None = None
    conditions: tuple[FlightCondition, ...] = ()
    quiet: FloatArray | None = None
    name: str = ""

    @property
    def states(self) -> FloatArray:
        """(n, 4) true flight states of the samples."""
        return flight_states(self.conditions)[self.flight]

    @property
    def last(self) -> FloatArray:
        """(n, n_d) the last reading of each sample."""
        return self.strain if self.strain.ndim == 2 else self.strain[:, -1]

    def rows(self, rows: IntArray | slice) -> Readings:
        """Return the samples ``rows`` alone."""
        return replace(self, **{name: chosen(getattr(self, name), rows) for name in OF_SAMPLES})


OF_SAMPLES = (STRAIN, "known", "truth", "vehicle", "flight", "bound", "quiet")
"""Attributes of readings that are per sample."""


def chosen(value: Any, rows: IntArray | slice | int) -> Any:
    """Return the samples ``rows`` of a ``value``: an array, a mapping or pair of such, or None."""
    return _of_each([value], lambda array: array[rows])


def stacked(values: Sequence[Any]) -> Any:
    """Return ``values`` of parts, each as :func:`chosen` takes it, one after another."""
    return _of_each(values, lambda *arrays: np.concatenate(arrays))


def _of_each(values: Sequence[Any], function: Callable[..., FloatArray]) -> Any:
    """Return ``function`` of the arrays of ``values``, which are alike: mappings and pairs of arrays, or None."""
    first = values[0]
    if first is None:
        return None
    if isinstance(first, Mapping):
        return {name: _of_each([value[name] for value in values], function) for name in first}
    if isinstance(first, tuple):
        return tuple(_of_each(entries, function) for entries in zip(*values, strict=True))
    return function(*values)


def joined(parts: Sequence[Readings]) -> Readings:
    """Return the samples of ``parts`` one after another; what is known in them has the same names."""
    first = parts[0]
    if len(parts) == 1:
        return first
    names = (*OF_SAMPLES, "time") if first.strain.ndim == 2 else OF_SAMPLES  # one time of all short flights
    return replace(first, **{name: stacked([getattr(part, name) for part in parts]) for name in names})


def read_case(
    world: World,
    case: Case,
    flights: Flights,
    *,
    number: int,
    random: np.random.Generator,
    rows: slice = slice(None),
    vehicles: int | None = None,
) -> Readings:
    """Return what vehicle ``number`` reads in the flights ``rows``; or ``vehicles`` in one flight, numbered from
    there.

    Draws come from ``random``, first the errors of the vehicle.
    """
    vehicle = world.as_built(case.as_built, random, vehicles)
    exact = not (case.as_built.stated or case.as_built.set or case.as_built.middle)
    gauges, conditions = world.gauges, flights.conditions[rows]
    strain = flights.read(vehicle, rows, None if exact else random)
    n, n_d = len(strain), len(gauges.station)

    repeats = n // len(conditions)
    inertia, how = case.inertia, case.over_time

    def column(name: str) -> FloatArray:
        return np.repeat(quantities(conditions, name), repeats)

    leeward, dynamic = column("leeward_roll_angle"), column(DYNAMIC_PRESSURE)
    force = np.zeros((n, 2)) if inertia is None else inertia.force(leeward, random)
    known = navigation_at(conditions, repeats) if case.air.navigation else {}
    if case.air.parameters_percent:
        true = np.repeat([condition.parameters for condition in conditions], repeats, axis=0)
        known |= _parameters(world.inverse_map, case.air, true, random)
    known[DYNAMIC_PRESSURE] = dynamic * (1.0 + np.reshape(vehicle.dynamic_pressure, -1))
    known = _given(world.vehicle, case.air, known, column, force, random)
    if case.friction:
        strain[:, :n_d] += world.added.friction(case.friction, dynamic)
    if case.heating is not None:
        entry, end = (
            temperature_of(world.vehicle),
            world.once(case.heating, partial(case.heating.at_end, world.vehicle)),
        )
        scatter = random.standard_normal((vehicles or 1, n_d))
        strain[:, :n_d], warm = heated(entry, end, strain[:, :n_d], scatter, random)
        if world.inverse_map.has_temperature:
            known[TEMPERATURE] = warm if case.air.temperature else np.full_like(warm, np.nan)
    time, quiet, shape = None, strain, strain.shape
    if how is not None:
        of_noise = float(np.mean(gauges.noise_std))
        zero, common = how.zero * of_noise, how.common_zero * of_noise
        strain[:, :n_d] += zero * random.standard_normal((vehicles or 1, n_d))
        strain[:, :n_d] += common * random.standard_normal((vehicles or 1, 1))
        strain, shape = strain[:, None], (n, how.steps, strain.shape[1])
        time = how.time_step * np.arange(float(how.steps))
    strain = strain + world.noise_std * random.standard_normal(shape)
    if case.air.drawn:
        known = _with_errors(known, world.vehicle.noise, random)
    if case.fault is not None:
        part, failing = slice(n_d), gauges
        if case.fault.sensors:  # which have no place
            part, std = slice(n_d, None), world.noise_std[n_d:]
            failing = Gauges(0.0 * std, 0.0 * std, std)
        strain[:, part] = case.fault.readings(strain[:, part], failing, leeward, random)
    if inertia is not None:
        strain[:, :n_d] += world.added.inertia(inertia, force, leeward, random)
    made = Readings(
        strain=strain,
        known=known,
        truth=np.repeat(flights.coefficients[rows], repeats, axis=0),
        vehicle=np.full(n, number) if vehicles is None else number + np.arange(n),
        flight=np.repeat(np.arange(len(flights.conditions))[rows], repeats),
        time=time,
        conditions=tuple(flights.conditions),
        quiet=quiet if case.motion is not None and exact else None,
    )
    return with_map_errors(world.inverse_map, made, random) if case.map_errors else made


def with_map_errors(inverse_map: InverseMap, read: Readings, random: np.random.Generator) -> Readings:
    """Return ``read`` with errors of pressure and numerics drawn in every sample, as the tables of the map have
    them: strain, and what they change of the true loads.

    Pressure off the tables, another flow model, internal pressure, and numerics of the build.
    """
    manifold = inverse_map.manifold
    assert manifold is not None
    strain, loads = field_errors(manifold, read.states, random)
    q = quantities(read.conditions, DYNAMIC_PRESSURE)[read.flight, None]
    truth = read.truth.copy()
    truth[:, : loads.shape[1]] += loads / (q * manifold.references)
    return replace(read, strain=read.strain + strain, truth=truth)


def field_errors(
    manifold: ManifoldMap, states: FloatArray, random: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return errors of pressure and numerics, drawn, at ``states`` (n, 4): of strain (n, n_d), of loads (n, 5)."""
    followed = np.vstack([manifold.error_strain, manifold.error_load])
    columns = np.hstack([followed, manifold.considered_columns])
    errors = np.exp(states[:, 3:]) * (random.standard_normal((len(states), columns.shape[1])) @ columns.T)
    if (tables := manifold.considered_tables) is not None:
        errors += random.standard_normal((len(states), 1)) * values(tables, states)
    n_d = manifold.n_gauges
    return errors[:, :n_d], errors[:, n_d : n_d + len(manifold.references)]


def read_own_vehicles(
    world: World, case: Case, flights: Flights, vehicles: int, random: np.random.Generator
) -> Iterator[Readings]:
    """Yield what as many ``vehicles`` read in each flight of a ``case``, in blocks of flights; each flight has a
    generator of its own."""
    generators = random.spawn(len(flights.conditions))

    def of_flight(number: int) -> Readings:
        row, generator = slice(number, number + 1), generators[number]
        first = number * vehicles
        return read_case(world, case, flights, number=first, random=generator, rows=row, vehicles=vehicles)

    block = max(1, min(BATCH, LARGEST_BATCH // len(world.noise_std)) // vehicles)
    with ThreadPoolExecutor(processors()) as pool:
        for first in range(0, len(generators), block):
            yield joined(list(pool.map(of_flight, range(first, min(first + block, len(generators))))))


def read_motion(world: World, case: Case, number: int, random: np.random.Generator) -> Readings:
    """Return what vehicle ``number`` reads in the motion of a ``case``; motion, vehicle and noise are drawn."""
    motion = case.motion
    assert motion is not None
    conditions = motion.conditions(world.vehicle, random)
    read = read_case(world, case, world.fly(conditions), number=number, random=random)
    n, time, known = len(conditions), motion.time, dict(read.known)
    strain = read.strain.copy()
    strain[:, : len(world.gauges.station)][~motion.gives(world.gauges.row, random)] = np.nan
    if motion.no_strain > 0.0:
        strain[np.isnan(strain).any(axis=1)] = np.nan
    known[MACH_NUMBER] = known[MACH_NUMBER] + motion.mach_drift * time
    known[STATIC_PRESSURE] = known[STATIC_PRESSURE] * (1.0 + motion.pressure_drift * time)
    angles = [quantities(conditions, name) for name in ANGLES]
    truth, flight = np.column_stack([read.truth, *angles]), np.full(n, number)
    return replace(read, strain=strain, known=known, truth=truth, flight=flight, time=time, conditions=())


def navigation_at(conditions: Sequence[FlightCondition], repeats: int = 1) -> dict[str, Any]:
    """Return exact Mach number, p_inf and altitude, each ``repeats`` times.

    Each is a measurement of its own, and so is the dynamic pressure that is given with them.
    """
    names = (MACH_NUMBER, STATIC_PRESSURE, ALTITUDE)
    known = {name: np.repeat(quantities(conditions, name), repeats) for name in names}
    return {**known, Q_SOURCE: np.full(repeats * len(conditions), float(QSource.INDEPENDENT))}


def _with_errors(known: dict[str, Any], noise: Noise, random: np.random.Generator) -> dict[str, Any]:
    """Return navigation with errors of M and p_inf of the stated sizes."""
    error = random.standard_normal((2, len(known[MACH_NUMBER])))
    of_pressure = 0.01 * noise.navigation_static_pressure_percent * error[1]
    return {
        **known,
        MACH_NUMBER: known[MACH_NUMBER] + noise.navigation_mach_number * error[0],
        STATIC_PRESSURE: known[STATIC_PRESSURE] * (1.0 + of_pressure),
    }


def _given(
    vehicle: Vehicle,
    air: Air,
    known: dict[str, Any],
    column: Column,
    force: FloatArray,
    random: np.random.Generator,
) -> dict[str, Any]:
    """Return what is given otherwise, or in addition to what is ``known``; ``force`` (n, 2) is the specific force
    across the axis [m/s2]."""
    if air.source is not None:
        known = _computed(air, vehicle.noise, column, random)
    if air.angles:
        for name, angle in zip(MEASURED_ANGLES, ANGLES, strict=True):
            known[name] = column(angle) + ANGLE_ERROR * random.standard_normal(len(force))
    if air.inertial:
        known |= _inertial(vehicle, force, random)
        if air.vibration_um_per_m:
            known[VIBRATION] = np.full(len(force), MICRO * air.vibration_um_per_m)
    return known


def _computed(air: Air, noise: Noise, column: Column, random: np.random.Generator) -> dict[str, Any]:
    """Return M, p_inf or altitude, and q_inf that is computed of them."""
    height = np.arange(0.0, LAYERS[-1][0], 5.0)
    standard = -np.log(static_pressure_at(height))
    altitude = np.interp(-np.log(column(STATIC_PRESSURE) / air.day), standard, height) + air.altitude_off
    exact = {MACH_NUMBER: column(MACH_NUMBER) + air.mach_off, STATIC_PRESSURE: static_pressure_at(altitude)}
    known = _with_errors(exact, noise, random)
    if air.source == ALTITUDE:
        known = {MACH_NUMBER: known[MACH_NUMBER], ALTITUDE: altitude}
    static = known.get(STATIC_PRESSURE, exact[STATIC_PRESSURE])
    return {**known, DYNAMIC_PRESSURE: 0.5 * HEAT_CAPACITY_RATIO * known[MACH_NUMBER] ** 2 * static}


def _inertial(vehicle: Vehicle, force: FloatArray, random: np.random.Generator) -> dict[str, Any]:
    """Return what an inertial unit measures under a specific ``force`` (n, 2) across the axis, with its errors."""
    entry = vehicle.mass
    assert entry is not None
    true = np.zeros((len(force), len(MEASURED_MOTION)))
    true[:, 1:3] = force
    stds = {
        "m/s2": entry.specific_force_std_m_per_s2,
        "rad/s": entry.angular_rate_std_rad_per_s,
        "rad/s2": entry.angular_acceleration_std_rad_per_s2,
    }
    std = np.array([stds[signal.unit] for signal in MEASURED_MOTION])
    measured = true + std * random.standard_normal(true.shape)
    return dict(zip([signal.name for signal in MEASURED_MOTION], measured.T, strict=True))


def _parameters(
    inverse_map: InverseMap, air: Air, true: FloatArray, random: np.random.Generator
) -> dict[str, Any]:
    """Return flow parameters with errors, ``true`` (n, p), and their standard deviations."""
    parameters = Estimator(inverse_map).parameters
    std = 0.01 * air.parameters_percent * parameters.span
    stated = true + std * (air.parameters_off + random.standard_normal(true.shape))
    stds = {name: np.full(len(true), size) for name, size in zip(parameters.names, std.tolist(), strict=True)}
    return {"parameters": dict(zip(parameters.names, stated.T, strict=True)), "parameters_std": stds}
