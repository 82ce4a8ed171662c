"""Flights of a vehicle of any shape: strain as built, coefficients, pressure at the nodes of another surface."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from shape_case import N_D, flown, grid_conditions, shape_vehicle
from shape_truth import beam, flights_at

from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.loads.sections import six_loads
from builder.aero.shapes import sections_mesh
from builder.campaign.snapshots import Snapshots
from builder.structure.as_built.displaced import refuse_others
from builder.structure.as_built.vehicle import AsBuilt, Counts, exactly_built
from builder.trial.conditions import conditions_in_ranges
from builder.truth.flights import drawn
from builder.truth.shape import ShapeFlights, on_nodes, refuse_without_other_model
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.errors import InputError

CONDITIONS = grid_conditions((6.0, 6.7), (-3.0, 1.0), (0.5, 1.5))


@cache
def flows() -> Snapshots:
    return flown(CONDITIONS)


@cache
def flights() -> ShapeFlights:
    return flights_at(CONDITIONS)


def built(**errors: Any) -> AsBuilt:
    return exactly_built(N_D).changed(**errors)


def test_hardware_errors_act_on_the_strain_of_the_net_pressure() -> None:
    structure, read = beam(flows().surface), flights().read
    net = flows().pressure - flows().internal_pressure[:, None]
    straight, aft, around, turned, across = (net @ way.T for way in structure.operator)
    np.testing.assert_allclose(read(built()), straight, rtol=1e-9, atol=1e-15)
    shift, gain = np.linspace(-1e-3, 2e-3, N_D), np.linspace(-0.02, 0.01, N_D)
    one = built(
        axial_shift=shift,
        circumferential_shift=2.0 * shift,
        orientation=3.0 * shift,
        layout_roll=0.01,
        gauge_gain=gain,
        common_gain=0.02,
        wall_thickness=-0.05,
        apparent_strain=np.full(N_D, 1e-6),
        transverse_sensitivity=4.0 * shift,
    )
    moved = straight + shift * aft + (2.0 * shift + 0.01 * structure.gauges.radius) * around
    moved += 3.0 * shift * turned + 4.0 * shift * across
    np.testing.assert_allclose(read(one), (1.0 + gain) * 1.02 / 0.95 * moved + 1e-6, rtol=1e-9)
    ambient = flights().ambient_pressure[:, None]
    more = read(built(internal_pressure=0.1)) - read(built())
    np.testing.assert_allclose(more, -0.1 * ambient * structure.operator[0].sum(axis=1), rtol=1e-6)
    # A row turns as its gauges do.
    row, counts = flights().gauges.row, flights().counts
    assert counts == Counts(gauge=N_D, row=4)
    turn = np.linspace(-0.01, 0.02, counts.row)
    by_row = read(exactly_built(counts).changed(row_orientation=turn))
    np.testing.assert_array_equal(by_row, read(built(orientation=turn[row])))


def test_many_vehicles_at_once_are_each_on_its_own() -> None:
    """Errors that no displaced gauge shows are refused."""
    noise = load_vehicle(VEHICLES / "elliptic_cone.toml").noise
    many = drawn(noise, N_D, np.random.default_rng(3), count=4)
    for flight in (0, 5):
        found = flights().read(many, slice(flight, flight + 1))
        for vehicle in range(4):
            alone = flights().read(many.one_of(vehicle))[flight]
            np.testing.assert_allclose(found[vehicle], alone, rtol=1e-12)
    refuse_others(noise)
    for entry in ("clamp_compliance_mm", "region_modulus_percent"):
        with pytest.raises(InputError, match=f"noise.{entry}: expected 0"):
            refuse_others(noise.model_copy(update={entry: 1.0}))


def test_coefficients_are_those_of_the_snapshots_and_the_rolling_moment_comes_besides() -> None:
    net, found, reference = flows().pressure, flights(), shape_vehicle().reference_quantities()
    np.testing.assert_allclose(found.coefficients, flows().coefficients(), rtol=1e-9, atol=1e-12)
    net = net - flows().internal_pressure[:, None]
    moment = net @ six_loads(flows().surface, reference.moment_station)[5]
    expected = moment / (found.dynamic_pressure * reference.area * reference.length)
    np.testing.assert_allclose(found.rolling, expected, rtol=1e-12)
    assert np.abs(found.rolling).max() > 1e-4


def test_pressure_goes_to_the_nodes_of_the_map() -> None:
    """Linear over triangles: a coarser surface gets it within what the flow bends between nodes."""
    nodes = sections_mesh(shape_vehicle().sectioned_body(), 15, 36)
    engine, ratio = NewtonianEngine(nodes), []
    for one in flows().conditions():
        ratio.append(engine.pressure_ratio(engine.solve(engine.flow_key(one)), one) * one.ambient_pressure)
    there = replace(flows(), pressure=np.array(ratio), point=nodes.point, triangle=nodes.triangle)
    off = np.abs(on_nodes(flows(), nodes) / on_nodes(there, nodes) - 1.0)[:, nodes.point[:, 0] > 0.2]
    assert off.max() < 0.05
    assert np.median(off) < 5e-3


@pytest.mark.fast
def test_conditions_are_inside_all_ranges_of_the_file() -> None:
    vehicle = load_vehicle(VEHICLES / "finned_body.toml")
    found = conditions_in_ranges(vehicle, (15.0, 28.0), 200, np.random.default_rng(1))
    rows = np.array([one.as_row() for one in found])
    rows[:, 1:3] = np.degrees(rows[:, 1:3])
    low, high = np.array([5.0, -6.0, -4.0, 15e3, -4.0]), np.array([6.0, 6.0, 4.0, 28e3, 4.0])
    assert np.all((rows >= low) & (rows <= high))
    assert np.all(np.ptp(rows, axis=0) > 0.9 * (high - low))
    fewer = conditions_in_ranges(vehicle, (15.0, 28.0), 20, np.random.default_rng(1))
    assert fewer == found[:20]  # so that more conditions keep the flows of fewer


@pytest.mark.fast
def test_a_vehicle_without_another_model_is_refused() -> None:
    finned = load_vehicle(VEHICLES / "finned_body.toml")
    refuse_without_other_model(finned)
    parameters = {
        name: one.model_copy(update={"surfaces": []}) for name, one in finned.conditions.parameters.items()
    }
    of_table = {"aerodynamics": {"engine": "table"}, "conditions": {"parameters": parameters}}
    of_code = {"structure": {"influence": "influence.csv", "checked_by": None}}
    for changes, message in (
        (of_table, "aerodynamics.engine: expected 'euler' or 'newtonian'"),
        ({"structure": {"checked_by": None}}, "structure.checked_by: entry is missing"),
        (of_code, "structure.influence: expected none"),
    ):
        sections = {name: getattr(finned, name).model_copy(update=entry) for name, entry in changes.items()}
        with pytest.raises(InputError, match=message):
            refuse_without_other_model(finned.model_copy(update=sections))
