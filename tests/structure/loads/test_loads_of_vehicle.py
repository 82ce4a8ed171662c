"""Known loads on the shipped vehicle."""

import numpy as np
import pytest

import builder
from builder.structure.fourier.fourier_model import structural_model
from builder.structure.loads.applied import PadPressure, PointForce, SectionLoad, SurfacePressure, Weight
from builder.structure.loads.fourier import FourierStructure
from builder.structure.loads.gauge_strain import gauge_strain, load_resultant
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.structure.loads.solid import solid_structure_of
from builder.structure.loads.temperature import temperature_mode, uniform_temperature
from builder.structure.solid.mesh_choice import MeshChoice
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolution
from strainfmu.errors import InputError

LAYOUT = "configuration_45"
PROPERTIES = LoadProperties(density=4430.0, expansion=9e-6, compensation=9e-6)


def at_30_mm(vehicle: Vehicle) -> Resolution:
    return vehicle.resolution.map.model_copy(
        update={"element_length_mm": 30.0, "surface_stations": 40, "harmonics": 6, "surface_roll_angles": 16}
    )


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return builder.load_vehicle(builder.IC3X)


@pytest.fixture(scope="module")
def structure(vehicle: Vehicle) -> FourierStructure:
    return fourier_structure_of(vehicle, LAYOUT, at_30_mm(vehicle), PROPERTIES, max_harmonic=12)


def test_outer_pressure_is_that_of_the_strain_operator(vehicle: Vehicle, structure: FourierStructure) -> None:
    z = structural_model(vehicle, at_30_mm(vehicle), [LAYOUT]).strain_operator(LAYOUT)
    found = gauge_strain(structure, [SurfacePressure(surface="outer", pressure=1e5)])
    np.testing.assert_allclose(found, 1e5 * z.sum(axis=1), atol=1e-8 * np.abs(found).max())


def test_internal_pressure_pushes_the_closed_nose_forwards(structure: FourierStructure) -> None:
    """Axial resultant -p pi r^2 with the inner radius at the base; without the tip's face it would lack 0.07 %."""
    inside = structure.mesh.node[structure.mesh.inner_edge[-1, -1], 1]
    found = load_resultant(structure, [SurfacePressure(surface="inner", pressure=1e5)])
    np.testing.assert_allclose(found[0], -1e5 * np.pi * inside**2, rtol=1e-9)
    outer = load_resultant(structure, [SurfacePressure(surface="outer", pressure=1e5)])
    np.testing.assert_allclose(
        outer[0], 1e5 * np.pi * structure.outer_radius(structure.outer_span[1]) ** 2, rtol=1e-9
    )


def test_weight_has_the_mass_of_the_wall(structure: FourierStructure) -> None:
    """Mass by slicing the wall and the tip, 0.2 %."""
    x = np.linspace(0.0, 3.6, 40001)
    outside = np.where(x < 1.75, x * np.tan(np.deg2rad(5.0)), 0.0)
    outside = np.where(x < 1.75, outside, 1.75 * np.tan(np.deg2rad(5.0)) + (x - 1.75) * np.tan(np.deg2rad(1.0)))
    slope = np.where(x < 1.75, np.deg2rad(5.0), np.deg2rad(1.0))
    inside = np.where(x < 0.1, 0.0, outside - 0.004 / np.cos(slope))
    mass = 4430.0 * np.trapezoid(np.pi * (outside**2 - inside**2), x)
    found = load_resultant(structure, [Weight(gravity=10.0)])
    np.testing.assert_allclose(found[:3], [0.0, 0.0, -10.0 * mass], atol=2e-3 * 10.0 * mass)


def test_force_on_the_nose_bends_as_a_beam(structure: FourierStructure) -> None:
    """Axial gauges behind x = 1 m: M r / (E I) of the section, 2 % (the wall tapers)."""
    found = gauge_strain(structure, [SectionLoad(station=0.0, force=(0.0, 0.0, -100.0))])
    gauge = structure.gauges
    far = (gauge.meridional > 0.99) & (gauge.x > 2.0) & (gauge.x < 3.0)
    outside = 1.75 * np.tan(np.deg2rad(5.0)) + (gauge.x - 1.75) * np.tan(np.deg2rad(1.0))
    inside = outside - 0.004 / np.cos(np.deg2rad(1.0))
    inertia = np.pi * (outside**4 - inside**4) / 4.0
    expected = 100.0 * gauge.x * inside * np.cos(gauge.roll_angle) / (110e9 * inertia)
    assert far.sum() >= 8
    np.testing.assert_allclose(found[far], expected[far], atol=0.02 * np.abs(expected[far]).max())


@pytest.mark.slow
def test_two_models_of_the_vehicle_agree(vehicle: Vehicle, structure: FourierStructure) -> None:
    """Coarse swept hexahedra against the Fourier model: 2 % in the norm over 54 gauges."""
    solid = solid_structure_of(vehicle, LAYOUT, MeshChoice(resolution="coarse"), PROPERTIES)
    ends = np.array([0.0, 3.6])
    cases = [
        [Weight(up_roll_angle=0.4)],
        [SurfacePressure(surface="inner", pressure=1e5)],
        [PadPressure(station=1.55, roll_angle=0.5, half_length=0.1, half_angle=0.6, push=1500.0)],
        [temperature_mode(ends, np.array([80.0, 10.0]), harmonic=2, roll_angle=0.2)],
    ]
    for loads in cases:
        expected, found = gauge_strain(structure, loads), gauge_strain(solid, loads)
        assert np.linalg.norm(found - expected) < 0.02 * np.linalg.norm(expected), loads


def test_uniform_temperature_is_hardly_read_by_compensated_gauges(structure: FourierStructure) -> None:
    """Clamped aft alone, the vehicle expands freely but near its clamp: less than 0.1 % of alpha T elsewhere."""
    found = gauge_strain(structure, [uniform_temperature(50.0)])
    ahead = structure.gauges.x < 3.0
    assert np.abs(found[ahead]).max() < 1e-3 * 50.0 * 9e-6


def test_free_flight(vehicle: Vehicle) -> None:
    """Nothing holds the vehicle: no weight is felt; forces on the nose are."""
    entry = vehicle.structure.model_copy(update={"support": "free_flight"})
    flying = vehicle.model_copy(update={"structure": entry})
    structure = fourier_structure_of(flying, LAYOUT, at_30_mm(vehicle), PROPERTIES, max_harmonic=2)
    pushed = gauge_strain(structure, [PointForce(station=0.5, roll_angle=0.3, force=(0.0, 0.0, 100.0))])
    assert np.abs(pushed).max() > 1e-6
    np.testing.assert_allclose(gauge_strain(structure, [Weight()]), 0.0, atol=1e-6 * np.abs(pushed).max())


def test_refusals(vehicle: Vehicle) -> None:
    with pytest.raises(InputError, match="layout 'none' found"):
        fourier_structure_of(vehicle, "none")
