"""What flies: conditions of a case, vehicles as built, bounds; made once for cases that share them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built_kinds import KINDS
from builder.trial.added import AddedStrain
from builder.trial.bound import cramer_rao_bound
from builder.trial.cases import Built, Case
from builder.trial.conditions import flown_conditions
from builder.trial.faults import Gauges
from builder.trial.flows import Flow
from builder.truth.flights import Flights, drawn
from builder.truth.revolution.flow_table import FlowTable, flow_states, harmonics_at
from builder.truth.revolution.strain import (
    FlyingSensors,
    TrueStructure,
    flights_of_harmonics,
    true_flights,
    without_faint_harmonics,
)
from builder.truth.shape import ShapeStructure, at_conditions, on_nodes_of, shape_flights
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, STATIC_PRESSURE
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.flight_condition import FlightCondition


@dataclass(eq=False, kw_only=True)
class World:
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
    _flights: dict[str, Flights] = field(default_factory=dict)
    _bounds: dict[tuple[str, bool], FloatArray | None] = field(default_factory=dict)

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
    def sensor_gauges(self) -> Gauges:
        """The auxiliary sensors, which have no place."""
        noise_std = self.noise_std[self.inverse_map.n_strain_gauges :]
        return Gauges(0.0 * noise_std, 0.0 * noise_std, noise_std)

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
        key = f"{case.where}{case.flow}"
        if key not in self._flights:
            random = np.random.default_rng(self.seed)
            self._flights[key] = self.fly(self.drawn_conditions(case, random), case.flow, random)
        return self._flights[key]

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
            if known is None:
                raise FlowReachError("none of its flows is within the solver's reach")
            if flow is not None:
                pressure, share = known.pressure, _share(flow, known.pressure[:, :1], random)
                change = flow.surface(vehicle, known).pressure - pressure
                known = replace(known, pressure=pressure + share * change)
            return shape_flights(vehicle, structure, known, operator=self._operator)
        assert isinstance(flows, FlowTable)
        table = flows if flow is None else flow.table(vehicle, flows)
        mach, incidence, _ = flow_states(conditions)
        if flow is not None and flow.drawn:
            own, other = harmonics_at(flows, mach, incidence), harmonics_at(table, mach, incidence)
            share = _share(flow, own[:, :1, :1], random)
            flown = flights_of_harmonics(vehicle, structure, own + share * (other - own), conditions)
        else:
            flown = true_flights(vehicle, structure, table, conditions)
        harmonic = None if self.sensors is None else harmonics_at(table, mach, incidence)
        return replace(without_faint_harmonics(flown), sensors=self.sensors, harmonic=harmonic)

    @cached_property
    def _operator(self) -> FloatArray:
        assert isinstance(self.structure, ShapeStructure)
        assert isinstance(self.flows, Snapshots)
        return on_nodes_of(self.structure, self.flows)

    def built(self, entry: Built, random: np.random.Generator, count: int | None = None) -> AsBuilt:
        """Return one vehicle, or ``count`` of them at once."""
        counts, lead = self.structure.counts, () if count is None else (count,)
        vehicle = drawn(self.vehicle.noise, counts, random, entry.stated, count)
        for name, value in entry.set.items():
            size = (*lead, counts.in_flight(KINDS[name]))
            sign = random.choice([-1.0, 1.0], size=size) if entry.signs else np.ones(size)
            vehicle = vehicle.changed(**{name: KINDS[name].scale * value * sign})
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
        key = f"{case.where}{case.flow}", air.navigation
        if key not in self._bounds:
            known = (*((MACH_NUMBER, STATIC_PRESSURE) if air.navigation else ()), DYNAMIC_PRESSURE)
            self._bounds[key] = cramer_rao_bound(self.inverse_map, self.flights(case).conditions, known)
        return self._bounds[key]


def _share(flow: Flow, like: FloatArray, random: np.random.Generator | None) -> FloatArray | float:
    """Return the part of its difference that each flight has, in the shape of ``like``."""
    if not flow.drawn:
        return 1.0
    assert random is not None
    return flow.drawn * random.standard_normal(like.shape)
