"""Vehicles that one ground test allows, flying on the independent model: for the alarm levels of a calibrated map.

Each is drawn from the covariance after the test about the estimate. The strain of the drawing is the strain
of the independent model; its change by the vehicle is the map's own model's, to first order about the estimate.
The errors that no ground test knows are drawn as for the map of the drawing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from builder.calibration.after_test.calibrated_map import calibrated_vehicle
from builder.calibration.after_test.left_by_test import Remaining
from builder.structure.as_built.derivatives import Key, of_gauges
from builder.structure.as_built.structure import AsBuiltStructure
from builder.structure.as_built.vehicle import exactly_built, slices
from builder.trial.vehicles import DrawnVehicles, drawn_vehicles
from builder.truth.as_built import drawn_many
from builder.truth.flights import RevolvedFlights
from builder.truth.revolution.flow_table import FlowTable, flow_states, harmonics_at, ratio_on
from builder.truth.revolution.strain import TrueStructure, reading_of, strain_per_pressure
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.estimator.signal_names import ZERO
from strainfmu.flight_condition import FlightCondition


@dataclass(frozen=True, eq=False, kw_only=True)
class AllowedVehicles:
    """Vehicles that a test allows at k conditions, as :class:`~builder.trial.vehicles.FlownVehicles`.

    Attributes
    ----------
    drawing : flights of the drawing, and the errors that no ground test knows.
    of_flow, of_unit : (k, n_d) and (n_d,) strain of the drawing by the flow per p_inf, and by a uniform outer
        pressure [1/Pa].
    change : (k, n_d) strain of the estimate less the strain of the drawing [m/m].
    slope : (k, n_d) derivatives of that strain by every key [m/m per unit].
    factor : (n, r) whose product with its transpose is the covariance after the test.
    where : place of every kind in the vector of parameters.
    """

    drawing: DrawnVehicles
    of_flow: FloatArray
    of_unit: FloatArray
    change: FloatArray
    slope: Mapping[Key, FloatArray]
    factor: FloatArray
    where: Mapping[str, slice]

    @property
    def conditions(self) -> Sequence[FlightCondition]:
        return self.drawing.conditions

    @property
    def dynamic_pressure(self) -> FloatArray:
        return self.drawing.dynamic_pressure

    @property
    def coefficients(self) -> FloatArray:
        return self.drawing.coefficients

    def read(self, number: int, count: int, random: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        flights = self.drawing.flights
        built = drawn_many(self.drawing.noise, flights.counts, count, random)
        one = slice(number, number + 1)
        ambient, inside = flights.ambient_pressure[one], flights.internal_pressure[one]
        strain = reading_of(built, ambient, inside, self.of_flow[number], self.of_unit)
        error = random.standard_normal((count, self.factor.shape[1])) @ self.factor.T
        # Zeros are taken off as estimated, so that their error is a reading of its own.
        strain = strain + self.change[number] + error[:, self.where[ZERO]]
        for key, slope in self.slope.items():
            start = self.where[key[0]].start
            own = error[:, self.where[key[0]]] if of_gauges(key) else error[:, [start + key[1]]]
            strain += slope[number] * own
        return strain, 1.0 + np.reshape(built.dynamic_pressure, -1)


def allowed_vehicles(
    vehicle: Vehicle,
    structure: AsBuiltStructure,
    remaining: Remaining,
    true: TrueStructure,
    table: FlowTable,
    conditions: list[FlightCondition],
) -> AllowedVehicles:
    """Return the vehicles that ``remaining`` allows at ``conditions``.

    Parameters
    ----------
    vehicle : the vehicle file.
    structure : the map's, with what may differ from the drawing.
    remaining : what the test says.
    true, table : structure and flows of the independent model.

    Raises
    ------
    InputError
        A condition is outside the table.
    """
    drawing = drawn_vehicles(calibrated_vehicle(vehicle), true, table, conditions)
    assert isinstance(drawing.flights, RevolvedFlights)
    of_flow, of_unit = strain_per_pressure(true, drawing.flights.flown, exactly_built(drawing.flights.counts))
    pressure = net_pressure(structure, true, table, drawing).T
    nominal = structure.strain_operator(structure.exactly_built())
    change = (structure.strain_operator(remaining.parameters) - nominal) @ pressure
    slope = structure.operator_slopes(remaining.parameters, remaining.uncertain)
    value, vector = np.linalg.eigh(remaining.covariance)
    return AllowedVehicles(
        drawing=drawing,
        of_flow=of_flow,
        of_unit=of_unit,
        change=change.T,
        slope={key: np.ascontiguousarray((one @ pressure).T) for key, one in slope.items()},
        factor=vector * np.sqrt(np.maximum(value, 0.0)),
        where=slices(structure.counts),
    )


def net_pressure(
    structure: AsBuiltStructure, true: TrueStructure, table: FlowTable, drawing: DrawnVehicles
) -> FloatArray:
    """Return (k, n_p) p - p_internal [Pa] on the nodes of ``structure``, linear between the table's stations."""
    conditions, grid = drawing.conditions, structure.surface
    mach, incidence, wind = flow_states(conditions)
    between = np.array([np.interp(grid.x, true.surface.x, row) for row in np.eye(len(true.surface.x))])
    harmonic = np.einsum("kxm,xy->kym", harmonics_at(table, mach, incidence), between, optimize=True)
    ratio = ratio_on(harmonic, wind, grid.roll_angle)
    flights = drawing.flights
    return np.asarray(flights.ambient_pressure[:, None] * ratio - flights.internal_pressure[:, None])
