"""Strain and coefficients of the independent model against its parts: the operators of a structure solved for
each error, applied to the pressure field."""

from __future__ import annotations

from dataclasses import replace
from math import asin, atan2, cos, radians, sin
from typing import Any

import numpy as np
import pytest
from ensembles import listed_ensemble

from builder.aero.loads.operator import coefficients_of, load_operator
from builder.inverse.noise.hardware_errors import hardware_errors
from builder.structure.as_built.counts import counts_in_flight
from builder.structure.as_built.revolved import SHIFT
from builder.structure.as_built.vehicle import AsBuilt, Counts, exactly_built
from builder.structure.as_built_kinds import IN_NOISE
from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.model import structural_model
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import harmonic_response, strain_operator
from builder.structure.wall import wall_of
from builder.truth.flights import drawn
from builder.truth.revolution.flow_table import FlowTable, harmonics_at
from builder.truth.revolution.strain import (
    WALL_STEP,
    TrueFlights,
    TrueStructure,
    true_flights,
    true_structure,
)
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

N_GAUGES = 54


def condition_at(incidence_deg: float, roll: float, mach: float = 6.2, altitude: float = 18e3) -> FlightCondition:
    """Return the condition of a total incidence [deg] with the leeward meridian at ``roll`` [rad]."""
    total = radians(incidence_deg)
    return FlightCondition(
        mach_number=mach,
        angle_of_attack=atan2(sin(total) * cos(roll), cos(total)),
        sideslip_angle=-asin(sin(total) * sin(roll)),
        altitude=altitude,
    )


CONDITIONS = [
    condition_at(0.0, 0.0),
    condition_at(6.5, 0.4),
    condition_at(11.0, -2.2, 5.4, 24e3),
    condition_at(8.0, 1.9, 6.7, 14e3),
]


@pytest.fixture(scope="module")
def flights(vehicle: Vehicle, true_model: TrueStructure, table: FlowTable) -> TrueFlights:
    return true_flights(vehicle, true_model, table, CONDITIONS)


@pytest.fixture(scope="module")
def pressure(true_model: TrueStructure, table: FlowTable) -> FloatArray:
    """(k, n_p) absolute pressure of the flights at the nodes [Pa]."""
    mach = np.array([one.mach_number for one in CONDITIONS])
    incidence = np.array([one.total_incidence for one in CONDITIONS])
    harmonic = harmonics_at(table, mach, incidence)
    roll = true_model.surface.roll_angle
    fields = []
    for one, of_flow in zip(CONDITIONS, harmonic, strict=True):
        phase = np.outer(np.arange(harmonic.shape[2]), roll - one.leeward_roll_angle)
        fields.append(one.ambient_pressure * (of_flow @ np.cos(phase)).ravel())
    return np.array(fields)


def built(**errors: Any) -> AsBuilt:
    return exactly_built(N_GAUGES).changed(**errors)


def close(found: FloatArray, expected: FloatArray, tolerance: float = 1e-10) -> None:
    """Assert that strains agree to ``tolerance`` of the largest."""
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * np.abs(expected).max())


def test_coefficients_are_the_loads_of_the_pressure(
    vehicle: Vehicle, true_model: TrueStructure, flights: TrueFlights, pressure: FloatArray
) -> None:
    """C of the same pressure by the load operator, ambient pressure inside: 1e-10 of the largest."""
    reference = vehicle.reference_quantities()
    loads = load_operator(true_model.surface, reference.moment_station)
    inside = np.array([[one.ambient_pressure] for one in CONDITIONS])
    expected = coefficients_of(pressure - inside, loads, CONDITIONS, reference)
    for found, wanted in zip(flights.coefficients.T, expected.T, strict=True):
        close(found, wanted)


def test_coefficients_hold_a_stated_internal_pressure(
    vehicle: Vehicle, true_model: TrueStructure, table: FlowTable, pressure: FloatArray
) -> None:
    structure = vehicle.structure.model_copy(update={"internal_pressure_Pa": 2e4})
    closed = vehicle.model_copy(update={"structure": structure})
    reference = vehicle.reference_quantities()
    loads = load_operator(true_model.surface, reference.moment_station)
    expected = coefficients_of(pressure - 2e4, loads, CONDITIONS, reference)
    found = true_flights(closed, true_model, table, CONDITIONS)
    close(found.coefficients[:, 0], expected[:, 0])
    z_p = structural_model(vehicle, vehicle.resolution.truth, [vehicle.gauges.layout])
    strain = (pressure - 2e4) @ z_p.strain_operator(vehicle.gauges.layout).T
    close(found.read(exactly_built(N_GAUGES)), strain)


def test_exactly_built_reads_the_strain_operator_times_the_pressure(
    vehicle: Vehicle, true_model: TrueStructure, flights: TrueFlights, pressure: FloatArray
) -> None:
    layout = vehicle.gauges.layout
    z_p = structural_model(vehicle, vehicle.resolution.truth, [layout]).strain_operator(layout)
    inside = np.array([[one.ambient_pressure] for one in CONDITIONS])
    close(flights.read(exactly_built(N_GAUGES)), (pressure - inside) @ z_p.T)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_another_wall_is_the_structure_solved_with_it(
    sign: float, vehicle: Vehicle, true_model: TrueStructure, flights: TrueFlights, pressure: FloatArray
) -> None:
    """4 % thinner and thicker, pressure from both sides on the same wall: 1e-10."""
    layout, factor = vehicle.gauges.layout, 1.0 + sign * WALL_STEP
    thickness = factor * vehicle.structure.wall_thickness_mm
    structure = vehicle.structure.model_copy(update={"wall_thickness_mm": thickness})
    other = vehicle.model_copy(update={"structure": structure})
    model = structural_model(other, vehicle.resolution.truth, [layout])
    # The gauges' directions are those of the wall of the file: its inner surface has the same slopes.
    z_p = strain_operator(model.response, true_model.placed, model.surface)
    inside = np.array([[one.ambient_pressure] for one in CONDITIONS])
    found = flights.read(built(wall_thickness=sign * WALL_STEP))
    close(found, (pressure - inside) @ z_p.T)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_shifted_gauges_are_those_of_the_structure_solved_there(
    sign: float, vehicle: Vehicle, true_model: TrueStructure, flights: TrueFlights, pressure: FloatArray
) -> None:
    """1 mm along the meridian, by a line through both sides, and round the body: 1e-10 of the largest strain.

    Along the meridian 1e-3 at gauges beside the edge of an element, where strain has a kink that the line does not
    follow, and 2e-5 in nine of ten.
    """
    resolution, placed = vehicle.resolution.truth, true_model.placed
    wall = wall_of(vehicle)
    mesh = shell_mesh(vehicle.body(), wall, 1e-3 * resolution.element_length_mm, resolution.wall_layers)
    inside = np.array([[one.ambient_pressure] for one in CONDITIONS])
    along = sign * SHIFT * inner_surface_points(mesh, placed.x).tangent[:, 0]
    for shift, moved, tolerance in (
        ("axial_shift", replace(placed, x=placed.x + along), 1e-3),
        (
            "circumferential_shift",
            replace(placed, roll_angle=placed.roll_angle + sign * SHIFT / true_model.on_wall.radius),
            1e-10,
        ),
    ):
        response = harmonic_response(mesh, wall.material, moved.x, true_model.surface.x, resolution.harmonics)
        z_p = strain_operator(response, moved, true_model.surface)
        found = flights.read(built(**{shift: np.full(N_GAUGES, sign * SHIFT)}))
        expected = (pressure - inside) @ z_p.T
        close(found, expected, tolerance)
        assert np.quantile(np.abs(found - expected), 0.9) < 2e-5 * np.abs(expected).max()


def test_a_turned_layout_sees_the_wind_from_the_other_side(
    vehicle: Vehicle, true_model: TrueStructure, table: FlowTable
) -> None:
    """Gauges turned by 20 deg read what they read with the wind turned back: 1e-10."""
    turn = radians(20.0)
    ahead, behind = (
        true_flights(vehicle, true_model, table, [condition_at(9.0, roll)]) for roll in (0.5, 0.5 - turn)
    )
    found = ahead.read(built(layout_roll=turn))
    close(found, behind.read(exactly_built(N_GAUGES)))


def test_gauges_turned_by_a_right_angle_read_the_other_direction(
    vehicle: Vehicle, true_model: TrueStructure, flights: TrueFlights
) -> None:
    """Axial gauges become the hoop gauges at the same place, and those the axial ones."""
    layout = vehicle.gauges.layout
    names = structural_model(vehicle, vehicle.resolution.truth, [layout]).layouts[layout].names
    axial = [names.index(f"axial_180deg_{i}") for i in range(1, 10)]
    hoop = [names.index(f"hoop_180deg_{i}") for i in range(1, 10)]
    straight = flights.read(exactly_built(N_GAUGES))
    turned = flights.read(built(orientation=np.full(N_GAUGES, np.pi / 2.0)))
    close(turned[:, axial], straight[:, hoop])
    close(turned[:, hoop], straight[:, axial])


def test_gains_apparent_strain_and_internal_pressure_by_the_book(
    vehicle: Vehicle, true_model: TrueStructure, flights: TrueFlights
) -> None:
    layout = vehicle.gauges.layout
    z_p = structural_model(vehicle, vehicle.resolution.truth, [layout]).strain_operator(layout)
    straight = flights.read(exactly_built(N_GAUGES))
    gain = 0.01 * np.random.default_rng(1).standard_normal(N_GAUGES)
    found = flights.read(built(gauge_gain=gain, common_gain=0.02))
    close(found, straight * (1.0 + gain) * 1.02, 1e-14)
    apparent = np.full(N_GAUGES, 5e-6)
    close(flights.read(built(apparent_strain=apparent)), straight + apparent, 1e-14)
    found = flights.read(built(internal_pressure=0.05))
    close(found, straight - 0.05 * np.outer(flights.ambient_pressure, z_p.sum(axis=1)))


def test_many_vehicles_at_once_are_those_one_by_one(
    vehicle: Vehicle, true_model: TrueStructure, flights: TrueFlights
) -> None:
    """Every flight alone with 3 vehicles of all errors: 1e-12 of the largest strain."""
    entry = Noise(std_um_per_m=0.4)
    many = drawn(entry, N_GAUGES, np.random.default_rng(7), count=3)
    for number in range(len(CONDITIONS)):
        found = flights.read(many, slice(number, number + 1))
        for which in range(3):
            one = many.one_of(which)
            close(found[which], flights.read(one)[number], 1e-12)


def test_strain_of_uniform_pressure_is_that_of_the_vehicle_as_built(
    true_model: TrueStructure, flights: TrueFlights
) -> None:
    """5 % of p_inf more inside, on the wall as built: less of the gain, the strain of that pressure alone."""
    one = drawn(Noise(std_um_per_m=0.4), N_GAUGES, np.random.default_rng(8))
    more = one.changed(internal_pressure=one.internal_pressure + 0.05)
    difference = flights.read(more) - flights.read(one)
    of_unit = true_model.parts(one).even[:, 0].sum(axis=0)
    gain = (1.0 + one.gauge_gain) * (1.0 + one.common_gain)
    close(difference, -0.05 * np.outer(flights.ambient_pressure, gain * of_unit), 1e-8)


@pytest.mark.fast
def test_a_vehicle_is_drawn_at_the_stated_sizes() -> None:
    """Root mean square over 400 vehicles of 50 gauges: within 12 % (3 sigma of 400 draws), scale included."""
    entry, random = Noise(std_um_per_m=0.4, internal_pressure_percent=7.0), np.random.default_rng(5)
    vehicles = [drawn(entry, 50, random, scale=2.0) for _ in range(400)]
    for name, size in (
        ("gauge_gain", 0.01),
        ("common_gain", 0.01),
        ("axial_shift", 1e-3),
        ("circumferential_shift", 1e-3),
        ("orientation", radians(1.0)),
        ("layout_roll", radians(0.5)),
        ("wall_thickness", 0.01),
        ("apparent_strain", 5e-6),
        ("internal_pressure", 0.07),
        ("dynamic_pressure", 0.01),
    ):
        values = np.array([getattr(one, name) for one in vehicles])
        assert np.sqrt(np.mean(values**2)) == pytest.approx(2.0 * size, rel=0.12), name
    one = vehicles[0]
    assert np.ptp(one.apparent_strain) == 0.0
    assert np.ptp(one.gauge_gain) > 0.0
    none = drawn(entry.without_hardware_errors(), 50, random)
    assert not any(value.any() for value in none.errors.values())


def test_a_clamp_that_yields_is_drawn_flown_and_in_the_noise(
    vehicle: Vehicle, true_model: TrueStructure, table: FlowTable, flights: TrueFlights, pressure: FloatArray
) -> None:
    """Its error columns predict what a vehicle reads whose clamp yields; a structure without it refuses one."""
    layout = vehicle.gauges.layout
    noise = vehicle.noise.without_hardware_errors().model_copy(update={"clamp_compliance_mm": 2.0})
    yields = vehicle.model_copy(update={"noise": noise})
    drawn_one, same = (drawn(one, N_GAUGES, np.random.default_rng(4)) for one in (noise, vehicle.noise))
    assert 0.0 < abs(drawn_one.clamp_axial.item()) < 8e-3
    assert same.clamp_axial.item() == same.clamp_transverse.item() == 0.0
    model = structural_model(vehicle, vehicle.resolution.map, [layout])
    net = pressure - np.array([[one.ambient_pressure] for one in CONDITIONS])
    found = hardware_errors(yields, model, model.strain_operator(layout), listed_ensemble(net))
    assert [one.name for one in found] == ["clamp, along", "clamp, across"]
    structure = true_structure(yields)
    flown = true_flights(yields, structure, table, CONDITIONS)
    for one, kind in zip(found, ("clamp_axial", "clamp_transverse"), strict=True):
        change = flown.read(built(**{kind: 2e-3})) - flown.read(built())
        assert np.linalg.norm(one.strain - change) < 3e-3 * np.linalg.norm(change)
        assert np.linalg.norm(change) > 0.0
    with pytest.raises(InputError, match="clamp_compliance_mm is 0"):
        flights.read(built(clamp_axial=1e-3))


@pytest.mark.parametrize(
    ("name", "errors", "tolerance"),
    [
        ("gauge gain", {"gauge_gain": 0.01}, 1e-9),
        ("common gain", {"common_gain": 0.01}, 1e-9),
        ("wall thickness", {"wall_thickness": 0.01}, 3e-3),
        ("layout roll", {"layout_roll": radians(0.5)}, 3e-3),
        ("gauge position, axial", {"axial_shift": 1e-3}, 3e-3),
        ("gauge position, circumferential", {"circumferential_shift": 1e-3}, 3e-3),
        ("gauge orientation", {"orientation": radians(1.0)}, 3e-3),
        ("transverse sensitivity", {"transverse_sensitivity": 0.01}, 3e-3),
    ],
)
def test_operators_of_hardware_errors_predict_vehicles_built_so(
    name: str,
    errors: dict[str, float],
    tolerance: float,
    vehicle: Vehicle,
    true_model: TrueStructure,
    flights: TrueFlights,
    pressure: FloatArray,
) -> None:
    """One standard deviation of each error, gauges of random signs: change of strain, 3e-3 in norm."""
    layout = vehicle.gauges.layout
    model = structural_model(vehicle, vehicle.resolution.map, [layout])
    net = pressure - np.array([[one.ambient_pressure] for one in CONDITIONS])
    noise = vehicle.noise.model_copy(update={"transverse_sensitivity_percent": 1.0})
    stated = vehicle.model_copy(update={"noise": noise})
    found = hardware_errors(stated, model, model.strain_operator(layout), listed_ensemble(net))
    assert len(found) == 8
    error = next(one for one in found if one.name == name)
    (entry, size), sign = *errors.items(), np.ones(N_GAUGES)
    if not error.common:
        sign = np.random.default_rng(3).choice([-1.0, 1.0], N_GAUGES)
    value = size if error.common else size * sign
    # Half the difference of both signs: without what is of second order.
    above, below = (flights.read(built(**{entry: way * value})) for way in (1.0, -1.0))
    change = 0.5 * (above - below)
    # Beside the slope break strain bends within a step of any size.
    away = np.abs(true_model.placed.x - 1.75) > 0.1
    assert np.linalg.norm((sign * error.strain - change)[:, away]) < tolerance * np.linalg.norm(change[:, away])


def test_errors_by_region_row_and_joint_are_drawn_flown_and_in_the_noise(
    vehicle: Vehicle, table: FlowTable, pressure: FloatArray
) -> None:
    """Columns predict what vehicles read that are built so: 3 % in norm. Other numbers of a draw stay."""
    entries = {
        "row_orientation_deg": 1.0,
        "wall_harmonic_percent": 1.0,
        "wall_taper_percent": 1.0,
        "wall_second_harmonic_percent": 1.0,
        "region_modulus_percent": 1.0,
        "joint_softness_mm": 2.0,
    }
    noise = vehicle.noise.without_hardware_errors().model_copy(update=entries)
    joints = vehicle.calibration.model_copy(update={"joint_stations_m": (1.2,)})
    by_region = vehicle.model_copy(update={"noise": noise, "calibration": joints})
    structure = true_structure(by_region)
    assert structure.counts == Counts(gauge=N_GAUGES, region=4, row=4, joint=1)
    model = structural_model(vehicle, vehicle.resolution.map, [vehicle.gauges.layout])
    net = pressure - np.array([[one.ambient_pressure] for one in CONDITIONS])
    z = model.strain_operator(vehicle.gauges.layout)
    found = hardware_errors(by_region, model, z, listed_ensemble(net))
    kinds = [kind for kind in IN_NOISE if kind.noise in entries]
    keys = [(kind, k) for kind in kinds for k in range(structure.counts.of(kind))]
    assert [one.name for one in found] == [kind.in_words for kind, _ in keys]
    assert all(one.common for one in found)
    flown, exact = true_flights(by_region, structure, table, CONDITIONS), exactly_built(structure.counts)
    for error, (kind, k) in zip(found, keys, strict=True):
        size = kind.noise_std(noise) * np.eye(structure.counts.of(kind))[k]
        above, below = (flown.read(exact.changed(**{kind.name: sign * size})) for sign in (1.0, -1.0))
        change = 0.5 * (above - below)
        assert np.linalg.norm(error.strain - change) < 0.03 * np.linalg.norm(change), (kind.name, k)
    stated = noise.model_copy(update={"gauge_gain_percent": 1.0})
    one, plain = (drawn(of, structure.counts, np.random.default_rng(3)) for of in (stated, vehicle.noise))
    np.testing.assert_array_equal(one.gauge_gain, plain.gauge_gain)
    many = drawn(stated, structure.counts, np.random.default_rng(4), count=3)
    read = flown.read(many, slice(1, 2))
    for number in range(3):
        close(read[number], flown.read(many.one_of(number))[1], 1e-12)
    with pytest.raises(InputError, match=r"joint_softness_mm: expected 0 without joints"):
        counts_in_flight(vehicle.model_copy(update={"noise": noise}), structure.placed.roll_angle)
