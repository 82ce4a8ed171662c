"""Flights of the independent model of a shape that is no body of revolution, its structure a closed form."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from shape_case import N_D, flown, grid_conditions, shape_vehicle
from shape_truth import beam

from builder.campaign.snapshots import Snapshots
from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts, exactly_built
from builder.structure.as_built.displaced_structure import refuse_others
from builder.truth.flights import drawn_vehicle
from builder.truth.shape import ShapeFlights, refuse_without_independent_model, shape_flights
from builder.vehicle.file import VEHICLES, load_vehicle
from strainfmu.errors import InputError


@cache
def flows() -> Snapshots:
    return flown(grid_conditions((6.0, 6.7), (-3.0, 1.0), (0.5, 1.5)))


@cache
def flights() -> ShapeFlights:
    return shape_flights(shape_vehicle(), beam(flows().surface), flows())


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
    more = read(built(internal_pressure=0.1)) - read(built())
    expected = -0.1 * flights().ambient_pressure[:, None] * structure.operator[0].sum(axis=1)
    np.testing.assert_allclose(more, expected, rtol=1e-6)
    # A row turns as its gauges do.
    row, counts = flights().gauges.row, flights().counts
    assert counts == Counts(gauge=N_D, row=4)
    turn = np.linspace(-0.01, 0.02, counts.row)
    by_row = read(exactly_built(counts).changed(row_orientation=turn))
    np.testing.assert_array_equal(by_row, read(built(orientation=turn[row])))


def test_many_vehicles_at_once_are_each_on_its_own() -> None:
    noise = load_vehicle(VEHICLES / "elliptic_cone.toml").noise
    many = drawn_vehicle(noise, N_D, np.random.default_rng(3), count=4)
    for flight in (0, 5):
        found = flights().read(many, slice(flight, flight + 1))
        alone = [flights().read(many.one_of(vehicle))[flight] for vehicle in range(4)]
        np.testing.assert_allclose(found[:, 0] if found.ndim == 3 else found, alone, rtol=1e-12)


@pytest.mark.fast
def test_errors_that_no_displaced_gauge_shows_and_a_vehicle_without_another_model_are_refused() -> None:
    noise = load_vehicle(VEHICLES / "elliptic_cone.toml").noise
    refuse_others(noise)
    for entry in ("clamp_compliance_mm", "region_modulus_percent"):
        with pytest.raises(InputError, match=f"noise.{entry}: expected 0"):
            refuse_others(noise.model_copy(update={entry: 1.0}))
    finned = load_vehicle(VEHICLES / "finned_body.toml")
    refuse_without_independent_model(finned)
    parameters = {
        name: one.model_copy(update={"surfaces": []}) for name, one in finned.conditions.parameters.items()
    }
    of_table = {"aerodynamics": {"engine": "table"}, "conditions": {"parameters": parameters}}
    of_code = {"structure": {"influence": "influence.csv", "checked_by": None}}
    unchecked = {"structure": {"checked_by": None}}
    for changes, message in (
        (of_table, "aerodynamics.engine: expected 'euler' or 'newtonian'"),
        (of_code, "structure.influence: expected none"),
        (unchecked, "structure.checked_by: entry is missing"),
    ):
        sections = {name: getattr(finned, name).model_copy(update=entry) for name, entry in changes.items()}
        with pytest.raises(InputError, match=message):
            refuse_without_independent_model(finned.model_copy(update=sections))
    with pytest.raises(InputError, match=r"structure\.checked_by: expected another mesh"):
        load_vehicle(VEHICLES / "finned_body.toml", {"structure.checked_by": "finned_body.vtu"})
