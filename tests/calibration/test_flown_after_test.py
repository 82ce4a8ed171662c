"""Vehicles that a ground test allows, on the independent model: what they read, and the levels that follow."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from as_built_case import strain_covariances

from builder.calibration.after_test.calibrated_map import calibrated_vehicle
from builder.calibration.after_test.flown_after_test import allowed_flights, strain_of_flows
from builder.calibration.after_test.left_by_test import Remaining
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import as_built_std, draw_as_built
from builder.trial.conditions import held_out_conditions
from builder.trial.readings import World
from builder.truth import flights as truth_flights
from builder.truth.flights import Flights
from builder.truth.flow_table import FlowTable, ratio_at
from builder.truth.true_structure import TrueFlights, TrueStructure
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray

COUNT = 4000


@pytest.fixture(scope="module")
def tested(vehicle: Vehicle, as_built: AsBuiltStructure) -> Remaining:
    """An estimate, and a covariance in which the first gains go against the common one."""
    std = as_built_std(vehicle.calibration, as_built.counts)
    root = np.diag(0.05 * std.vector)
    root[: as_built.n_gauges, 0] -= 0.02 * std.vector[: as_built.n_gauges]
    built = draw_as_built(std, np.random.default_rng(6))
    return Remaining(parameters=built, covariance=root @ root.T)


@pytest.fixture(scope="module")
def table(vehicle: Vehicle, true_model: TrueStructure) -> FlowTable:
    """Pressure that grows with Mach number and rises towards windward with incidence; falls along the body."""
    mach, incidence = (np.array(one) for one in (vehicle.truth.mach_number, vehicle.truth.total_incidence_deg))
    along = 1.5 - true_model.surface.x / true_model.surface.x[-1]
    rise = np.zeros((len(incidence), true_model.n_harmonics))  # as many harmonics as the structure
    rise[:, :4] = np.deg2rad(incidence)[:, None] * np.array([1.0, -8.0, 3.0, -1.0]) + [1.0, 0.0, 0.0, 0.0]
    harmonic = np.einsum("i,jm,x->ijxm", mach**2 / 10.0, rise, along)
    harmonic[..., 0] += 2.0
    return FlowTable(
        vehicle=vehicle.name,
        mach_knots=mach,
        incidence_knots=np.deg2rad(incidence),
        harmonic=harmonic,
        provenance={},
    )


@pytest.fixture(scope="module")
def quiet(vehicle: Vehicle) -> Vehicle:
    """The vehicle without the errors that no ground test knows."""
    return vehicle.model_copy(update={"noise": vehicle.noise.without_hardware_errors()})


def calibrated_world(vehicle: Vehicle, true: TrueStructure, table: FlowTable) -> World:
    none: Any = None  # the map has no part in it
    return World(vehicle=calibrated_vehicle(vehicle), structure=true, flows=table, inverse_map=none)


def read(world: World, flights: Flights, number: int, count: int) -> FloatArray:
    """Return what vehicles read in a flight, all errors that are stated drawn."""
    random = np.random.default_rng(number)
    built = truth_flights.drawn_vehicle(world.vehicle.noise, flights.counts, random, count=count)
    return flights.read(built, slice(number, number + 1), random)


def net_pressure(
    structure: AsBuiltStructure, true: TrueStructure, table: FlowTable, flights: TrueFlights
) -> FloatArray:
    """Return (k, n_p) p - p_internal [Pa] on the nodes of ``structure``, linear between the table's stations."""
    grid = structure.surface
    between = np.array([np.interp(grid.x, true.surface.x, row) for row in np.eye(len(true.surface.x))]).T
    there = replace(table, harmonic=between @ table.harmonic)
    ratio = ratio_at(there, flights.conditions, grid.roll_angle)
    return np.asarray(flights.ambient_pressure[:, None] * ratio - flights.internal_pressure[:, None])


def test_they_scatter_about_the_estimate_as_the_test_says(
    quiet: Vehicle, as_built: AsBuiltStructure, tested: Remaining, true_model: TrueStructure, table: FlowTable
) -> None:
    conditions = held_out_conditions(quiet, table, 3, np.random.default_rng(2))
    world = calibrated_world(quiet, true_model, table)
    flown, drawing = allowed_flights(world, as_built, tested, conditions), world.fly(conditions)
    assert isinstance(drawing, TrueFlights)
    n = as_built.n_gauges
    pressures = net_pressure(as_built, true_model, table, drawing)
    nominal = as_built.strain_operator(as_built.exactly_built())
    found = strain_of_flows([nominal], as_built.surface, table, drawing)
    np.testing.assert_allclose(found, pressures @ nominal.T, rtol=0, atol=1e-12 * np.abs(found).max())
    covariances = strain_covariances(as_built, tested.parameters, tested.covariance, pressures)
    for number, (pressure, covariance) in enumerate(zip(pressures, covariances, strict=True)):
        strain, plain = (read(world, one, number, count) for one, count in ((flown, COUNT), (drawing, 1)))
        centre = plain[0] + flown.change[number]
        deviation = strain.std(axis=0)
        assert np.all(np.abs(strain.mean(axis=0) - centre) < 5.0 * deviation / np.sqrt(COUNT))
        np.testing.assert_allclose(nominal @ pressure, plain[0], atol=0.05 * np.abs(plain).max())  # the mesh
        expected = covariance + tested.covariance[5 * n : 6 * n, 5 * n : 6 * n]
        scale = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(
            np.cov(strain.T) / np.outer(scale, scale), expected / np.outer(scale, scale), atol=0.12
        )


def test_a_test_that_tells_all_leaves_the_estimate(
    quiet: Vehicle, as_built: AsBuiltStructure, tested: Remaining, true_model: TrueStructure, table: FlowTable
) -> None:
    known = Remaining(parameters=as_built.exactly_built(), covariance=np.zeros_like(tested.covariance))
    conditions = held_out_conditions(quiet, table, 2, np.random.default_rng(4))
    world = calibrated_world(quiet, true_model, table)
    flown, plain = allowed_flights(world, as_built, known, conditions), world.fly(conditions)
    for number in range(2):
        found, expected = (read(world, one, number, 3) for one in (flown, plain))
        np.testing.assert_array_equal(found, expected)
