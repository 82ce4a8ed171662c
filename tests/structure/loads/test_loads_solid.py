"""Known loads on the three-dimensional model against the Fourier model, and what they add up to."""

from dataclasses import replace

import numpy as np
import pytest
from solid_bodies import swept_meridian

from builder.structure.fourier.inner_surface import place_gauges
from builder.structure.fourier.meridian_mesh import tube_mesh
from builder.structure.loads.applied import (
    Acceleration,
    DistributedForce,
    Load,
    PadForce,
    PadPressure,
    PointForce,
    SectionLoad,
    SurfaceForce,
    SurfacePressure,
    Weight,
)
from builder.structure.loads.fourier import FourierStructure, fourier_structure
from builder.structure.loads.gauge_strain import gauge_strain, load_resultant
from builder.structure.loads.loaded_structure import LoadProperties, PointMass
from builder.structure.loads.solid import SolidStructure, solid_structure
from builder.structure.loads.temperature import temperature_mode, uniform_temperature
from builder.structure.solid.gauge_rows import gauges_at
from builder.structure.solid.solid_mesh import SUPPORT
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import full_mesh
from builder.structure.wall import Material

METAL = Material(110e9, 0.31)
LENGTH = 0.5
ENDS = np.array([0.0, LENGTH])
INSIDE, OUTSIDE = np.array([0.088, 0.100]), np.array([0.094, 0.106])  # a cone
PROPERTIES = LoadProperties(
    density=4430.0,
    expansion=9e-6,
    compensation=5e-6,
    masses=(PointMass(station=0.15, roll_angle=1.0, mass=2.0),),
)


def gauge_positions() -> tuple[np.ndarray, np.ndarray]:
    """Axial, hoop and 45 deg gauges at two stations and three roll angles, position and direction."""
    position, direction = [], []
    slope = np.arctan2(INSIDE[1] - INSIDE[0], LENGTH)
    for x in (0.26, 0.34):
        r = np.interp(x, ENDS, INSIDE)
        for phi in np.deg2rad([0.0, 50.0, 230.0]):
            radial, around = np.array([0.0, np.sin(phi), np.cos(phi)]), np.array([0.0, np.cos(phi), -np.sin(phi)])
            along = np.array([np.cos(slope), 0.0, 0.0]) + np.sin(slope) * radial
            position += [np.array([x, 0.0, 0.0]) + r * radial] * 3
            direction += [along, around, along + around]
    return np.array(position), np.array(direction)


def both(held: bool) -> tuple[FourierStructure, SolidStructure]:
    end = "clamped" if held else "free"
    position, direction = gauge_positions()
    fine = tube_mesh(ENDS, INSIDE, OUTSIDE, element_length=0.01, n_layers=2, front="free", aft=end)
    fourier = fourier_structure(
        mesh=fine,
        material=METAL,
        gauges=place_gauges(fine, position, direction),
        properties=PROPERTIES,
        max_harmonic=14,
    )
    mesh = full_mesh(swept_meridian(tube_mesh(ENDS, INSIDE, OUTSIDE, 0.0167, 1, "free", end), 32))
    supports = [Clamped(SUPPORT)] if held else None
    return fourier, solid_structure(mesh, METAL, gauges_at(position, direction), supports, PROPERTIES)


@pytest.fixture(scope="module")
def clamped() -> tuple[FourierStructure, SolidStructure]:
    return both(held=True)


@pytest.fixture(scope="module")
def free() -> tuple[FourierStructure, SolidStructure]:
    return both(held=False)


PAD = {"station": 0.14, "roll_angle": 0.6, "half_length": 0.1, "half_angle": 0.8}
LOADS: dict[str, Load] = {
    "pad force": PadForce(**PAD, force=(300.0, -500.0, 800.0)),
    "pad pressure": PadPressure(**PAD, push=900.0),
    "point force": PointForce(station=0.07, roll_angle=2.0, force=(100.0, 200.0, -300.0)),
    "internal pressure": SurfacePressure(surface="inner", pressure=1e5),
    "surface force": SurfaceForce(surface="outer", force=(100.0, 200.0, 300.0)),
    "distributed force": DistributedForce(
        station=np.array([0.0, 0.43]), force_per_length=np.array([[10.0, 20, 30]] * 2)
    ),
    "section load": SectionLoad(station=0.06, force=(500.0, 200.0, -100.0), moment=(80.0, 60.0, -50.0)),
    "weight": Weight(up_roll_angle=0.8, nose_elevation=0.3),
    "acceleration": Acceleration(linear=(3.0, -20.0, 10.0), angular=(50.0, 20.0, -30.0)),
    "uniform temperature": uniform_temperature(40.0),
    "temperature mode": temperature_mode(
        ENDS, np.array([60.0, 10.0]), harmonic=2, roll_angle=0.3, through_wall=np.array([20.0, 10.0])
    ),
}


@pytest.mark.parametrize("name", LOADS)
def test_two_models_of_a_clamped_cone_agree(clamped: tuple[FourierStructure, SolidStructure], name: str) -> None:
    fourier, solid = clamped
    expected, found = (gauge_strain(one, [LOADS[name]]) for one in clamped)
    assert np.linalg.norm(found - expected) < 0.01 * np.linalg.norm(expected)
    resultant = load_resultant(fourier, [LOADS[name]])
    size = max(np.abs(resultant).max(), 1e-3)
    np.testing.assert_allclose(load_resultant(solid, [LOADS[name]]), resultant, atol=2e-3 * size)


@pytest.mark.parametrize("name", ["pad force", "section load", "temperature mode", "internal pressure"])
def test_two_models_of_a_free_cone_agree(free: tuple[FourierStructure, SolidStructure], name: str) -> None:
    expected, found = (gauge_strain(one, [LOADS[name]]) for one in free)
    assert np.linalg.norm(found - expected) < 0.01 * np.linalg.norm(expected)


def test_free_solid_does_not_feel_weight(free: tuple[FourierStructure, SolidStructure]) -> None:
    solid = free[1]
    size = np.abs(gauge_strain(solid, [LOADS["section load"]])).max()
    np.testing.assert_allclose(gauge_strain(solid, [Weight(up_roll_angle=0.7)]), 0.0, atol=1e-7 * size)
    whole = replace(solid, properties=replace(PROPERTIES, compensation=0.0))
    np.testing.assert_allclose(gauge_strain(whole, [uniform_temperature(40.0)]), 40.0 * 9e-6, rtol=1e-6)


def test_a_named_surface_takes_a_force(clamped: tuple[FourierStructure, SolidStructure]) -> None:
    by_name = SurfaceForce(surface="external", force=(100.0, 200.0, 300.0))
    np.testing.assert_allclose(
        gauge_strain(clamped[1], [by_name]), gauge_strain(clamped[1], [LOADS["surface force"]])
    )
