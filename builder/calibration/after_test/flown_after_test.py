"""Vehicles that one ground test allows, flying on the independent model: for the alarm levels of a calibrated map.

Each is drawn from the covariance after the test about the estimate. The strain of the drawing is the strain
of the independent model; its change by the vehicle is the map's own model's, to first order about the estimate.
The errors that no ground test knows are drawn as for the map of the drawing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.calibration.after_test.left_by_test import Remaining, blocks_of
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import AsBuilt, exactly_built, of_gauges, slices
from builder.trial.readings import World
from builder.truth.flow_table import FlowTable, by_parity, flow_states, knot_weights
from builder.truth.true_structure import TrueFlights, reading_of, strain_per_pressure
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.estimator.signal_names import ZERO
from strainfmu.flight_condition import FlightCondition


@dataclass(frozen=True, eq=False, kw_only=True)
class AllowedFlights(TrueFlights):
    """Flights of the drawing, read by vehicles that a test allows.

    Attributes
    ----------
    of_flow, of_unit : (k, n_d) and (n_d,) strain of the drawing by the flow per p_inf, and by a uniform outer
        pressure [1/Pa].
    change : (k, n_d) strain of the estimate less the strain of the drawing [m/m].
    by_gauge : (k, n_g, n_d) derivatives of that strain by the kinds of which every gauge has its own parameter
        [m/m per unit].
    by_all : (k, n_a, n_d) derivatives by the parameters that all gauges see [m/m per unit].
    factor : (n_d + n_g n_d + n_a, r) whose product with its transpose is the covariance after the test, of the
        zeros and then of those parameters.
    """

    of_flow: FloatArray
    of_unit: FloatArray
    change: FloatArray
    by_gauge: FloatArray
    by_all: FloatArray
    factor: FloatArray

    def read(
        self, built: AsBuilt, rows: slice = slice(None), random: np.random.Generator | None = None
    ) -> FloatArray:
        """Return (v, n_d) strain that v vehicles as ``built`` read in one flight; what the test leaves is
        drawn."""
        assert random is not None
        number = rows.start
        ambient, inside = self.ambient_pressure[rows], self.internal_pressure[rows]
        strain = reading_of(built, ambient, inside, self.of_flow[number], self.of_unit)
        error = random.standard_normal((len(strain), self.factor.shape[1])) @ self.factor.T
        _, n_g, n_d = self.by_gauge.shape
        # Zeros are taken off as estimated, so that their error is a reading of its own.
        zeros, single, common = np.split(error, [n_d, (1 + n_g) * n_d], axis=1)
        strain = strain + self.change[number] + zeros + common @ self.by_all[number]
        return np.asarray(
            strain + np.einsum("vgd,gd->vd", single.reshape(len(single), n_g, n_d), self.by_gauge[number])
        )


def allowed_flights(
    world: World, structure: AsBuiltStructure, remaining: Remaining, conditions: list[FlightCondition]
) -> AllowedFlights:
    """Return flights at ``conditions``, read by the vehicles that ``remaining`` allows.

    Parameters
    ----------
    world : of the calibrated vehicle, whose errors no ground test knows.
    structure : the map's, with what may differ from the drawing.
    remaining : what the test says.

    Raises
    ------
    InputError
        A condition is outside the flows of the independent model.
    """
    flights, table = world.fly(conditions), world.flows
    assert isinstance(flights, TrueFlights)
    assert isinstance(table, FlowTable)
    of_flow, of_unit = strain_per_pressure(flights, exactly_built(flights.counts))
    nominal = structure.strain_operator(structure.exactly_built())
    change = structure.strain_operator(remaining.parameters) - nominal
    keys = sorted(remaining.uncertain, key=lambda key: not of_gauges(key))
    first_common = 1 + sum(map(of_gauges, keys))
    strain = np.empty((len(conditions), 1 + len(keys), structure.n_gauges))
    for gauges in blocks_of(structure.n_gauges):
        slopes = structure.operator_slopes(remaining.parameters, keys, gauges)
        operators = [change[gauges], *(slopes[key] for key in keys)]
        of_block = strain_of_flows(operators, structure.surface, table, flights)
        strain[..., gauges] = of_block.reshape(len(conditions), len(operators), -1)
    where, place = slices(structure.counts), np.arange(len(remaining.covariance))
    rows = [place[where[ZERO]]]
    rows += [place[where[kind]] if of_gauges((kind, k)) else place[where[kind]][k : k + 1] for kind, k in keys]
    value, vector = np.linalg.eigh(remaining.covariance)
    return AllowedFlights(
        **vars(flights),
        of_flow=of_flow,
        of_unit=of_unit,
        change=strain[:, 0],
        by_gauge=strain[:, 1:first_common],
        by_all=strain[:, first_common:],
        # The symmetric root: eigenvectors alone have free signs, by which round-off would draw other vehicles.
        factor=vector[np.concatenate(rows)] * np.sqrt(np.maximum(value, 0.0)) @ vector.T,
    )


def strain_of_flows(
    operators: Sequence[FloatArray], grid: SurfaceGrid, table: FlowTable, flights: TrueFlights
) -> FloatArray:
    """Return (k, n_o) what the rows of ``operators`` (.., n_p) [1/Pa] on ``grid`` make of p - p_internal in every
    flight.

    The pressure is linear between the stations of ``table``. Strain is linear in the flows of the
    table, so that it is found for these and interpolated.
    """
    n_m, stations = table.harmonic.shape[-1], flights.structure.surface.x
    around = np.outer(grid.roll_angle, np.arange(n_m))
    between = np.array([np.interp(grid.x, stations, row) for row in np.eye(len(stations))])
    by_station = [operator.reshape(len(operator), len(grid.x), -1) for operator in operators]
    of_uniform = np.concatenate([operator.sum(axis=1) for operator in operators])
    mach, incidence, wind = flow_states(flights.conditions)
    phase = np.outer(wind, np.arange(n_m))
    ratio = np.zeros((len(wind), len(of_uniform)))
    for of_parity, weight in zip(by_parity(n_m), knot_weights(table, mach, incidence), strict=True):
        flows = np.einsum("abxm,xy->abym", table.harmonic[..., of_parity], between, optimize=True)
        for wave in (np.cos, np.sin):
            waves = wave(around[:, of_parity])
            rolled = np.concatenate([rows @ waves for rows in by_station])  # n_o, n_x, harmonics
            strain = np.einsum("oym,abym->mabo", rolled, flows, optimize=True)
            turned = wave(phase[:, of_parity])[:, :, None] * weight[:, None, :]
            ratio += turned.reshape(len(wind), -1) @ strain.reshape(-1, len(of_uniform))
    ambient, inside = flights.ambient_pressure, flights.internal_pressure
    return np.asarray(ambient[:, None] * ratio - np.outer(inside, of_uniform))
