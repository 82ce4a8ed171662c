"""The independent model of a stress test: of a body of revolution, and of any other shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.pipeline.built_sensors import FlownSensors
from builder.stress.kind import Kind
from builder.structure.as_built.vehicle import AsBuilt, Counts
from builder.truth.flights import Flights, RevolvedFlights
from builder.truth.revolution.flow_table import FlowTable, harmonics_at
from builder.truth.revolution.sensors import sensor_readings
from builder.truth.revolution.strain import TrueStructure, true_flights, without_faint_harmonics
from builder.truth.shape.flights import at_conditions, shape_flights
from builder.truth.shape.structure import ShapeStructure, on_nodes_of
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError


class Model(Protocol):
    """An independent model.

    Attributes
    ----------
    station, roll_angle : (n_d,) of the gauges [m], [rad].
    counts : numbers of what has errors of its own.
    """

    @property
    def station(self) -> FloatArray: ...

    @property
    def counts(self) -> Counts: ...

    @property
    def roll_angle(self) -> FloatArray: ...

    def flights(self, kind: Kind, count: int, random: np.random.Generator) -> Flights:
        """Return flights of ``kind``, ``count`` of them inside the envelope.

        Raises
        ------
        FlowReachError
            The flows do not go as far.
        """
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class SensedFlights(RevolvedFlights):
    """Flights of a body of revolution with auxiliary ``sensors``; ``harmonic`` (k, n_x, n_m) of p / p_inf."""

    sensors: FlownSensors
    harmonic: FloatArray

    def sense(self, built: AsBuilt, random: np.random.Generator | None) -> FloatArray:
        """Return (k, n_s) readings, without noise, of a vehicle as ``built``.

        ``random`` draws errors of the sensors themselves; None has none.
        """
        return sensor_readings(self.sensors.built(built, random), self.harmonic, self.conditions)


@dataclass(frozen=True, eq=False, kw_only=True)
class RevolvedModel:
    """A body of revolution, with ``sensors`` or None; ``table`` holds flows inside the envelope and beyond it."""

    vehicle: Vehicle
    structure: TrueStructure
    table: FlowTable
    sensors: FlownSensors | None = None

    @property
    def station(self) -> FloatArray:
        return self.structure.placed.x

    @property
    def roll_angle(self) -> FloatArray:
        return self.structure.placed.roll_angle

    @property
    def counts(self) -> Counts:
        return self.structure.counts

    def flights(self, kind: Kind, count: int, random: np.random.Generator) -> Flights:
        conditions = kind.flights(self.vehicle, self.table, count, random)
        table = self.table if kind.flow is None else kind.flow.on_table(self.vehicle, self.table)
        flown = without_faint_harmonics(true_flights(self.vehicle, self.structure, table, conditions))
        if self.sensors is None:
            return RevolvedFlights(structure=self.structure, flown=flown)
        mach, incidence = np.array([(one.mach_number, one.total_incidence) for one in conditions]).T
        harmonic = harmonics_at(table, mach, incidence)
        return SensedFlights(structure=self.structure, flown=flown, sensors=self.sensors, harmonic=harmonic)


@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeModel:
    """Any other shape; ``flows`` holds one at every Mach number, incidence and parameter that is flown."""

    vehicle: Vehicle
    structure: ShapeStructure
    flows: Snapshots

    @property
    def station(self) -> FloatArray:
        return self.structure.position[:, 0]

    @property
    def roll_angle(self) -> FloatArray:
        return self.structure.gauges.roll_angle

    @property
    def counts(self) -> Counts:
        return self.structure.counts

    @cached_property
    def _operator(self) -> FloatArray:
        return on_nodes_of(self.structure, self.flows)

    def flights(self, kind: Kind, count: int, random: np.random.Generator) -> Flights:
        flows = at_conditions(self.flows, kind.flights(self.vehicle, None, count, random))
        if flows is None:
            raise FlowReachError("none of its flows is within the solver's reach")
        if kind.flow is not None:
            flows = kind.flow.on_surface(self.vehicle, flows)
        return shape_flights(self.vehicle, self.structure, flows, operator=self._operator)
