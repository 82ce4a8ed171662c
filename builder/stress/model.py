"""The independent model of a stress test: of a body of revolution, and of any other shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.stress.kind import Kind
from builder.truth.flights import Flights, RevolvedFlights
from builder.truth.revolution.flow_table import FlowTable
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
    """

    @property
    def station(self) -> FloatArray: ...

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
class RevolvedModel:
    """A body of revolution; ``table`` holds flows inside the envelope and beyond it."""

    vehicle: Vehicle
    structure: TrueStructure
    table: FlowTable

    @property
    def station(self) -> FloatArray:
        return self.structure.placed.x

    @property
    def roll_angle(self) -> FloatArray:
        return self.structure.placed.roll_angle

    def flights(self, kind: Kind, count: int, random: np.random.Generator) -> Flights:
        conditions = kind.flights(self.vehicle, self.table, count, random)
        table = self.table if kind.flow is None else kind.flow.on_table(self.vehicle, self.table)
        flown = true_flights(self.vehicle, self.structure, table, conditions)
        return RevolvedFlights(structure=self.structure, flown=without_faint_harmonics(flown))


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
        return self.structure.roll_angle

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
