"""A wall of several thicknesses and materials with frames, on a clamp or a foundation, as it may be built."""

from typing import Any

import numpy as np
import pytest
from coarse_vehicle import COARSE

from builder.structure.as_built.as_built_structure import AsBuiltStructure, as_built_structure
from builder.structure.fourier.fourier_model import structural_model
from builder.structure.loads.applied import Load, PadForce, SectionLoad, Weight
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolutions

LAYOUT = "configuration_2"
PAD = PadForce(station=1.0, roll_angle=0.3, half_length=0.15, half_angle=0.9, force=(0.0, 300.0, -1500.0))


@pytest.fixture(scope="module")
def few_harmonics(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with a strain operator of few harmonics: the support changes each of them alike."""
    coarse = COARSE.model_copy(update={"harmonics": 4})
    return vehicle.model_copy(update={"resolution": Resolutions(map=coarse, truth=coarse)})


def layered(vehicle: Vehicle, factor: float = 1.0, **support: Any) -> Vehicle:
    """Return the vehicle with a thicker, stiffer aft part and two frames; walls are ``factor`` times as thick."""
    entry = vehicle.structure.model_dump(exclude_unset=True)
    own = entry["wall_thickness_mm"] * factor
    entry |= {
        "wall_thickness_mm": own,
        "wall_thickness_at": [{"x_m": 2.0, "thickness_mm": own}, {"x_m": 2.2, "thickness_mm": 1.5 * own}],
        "regions": [{"start_x_m": 2.9, "end_x_m": 3.4, "material": "steel"}],
        "frames": [
            {"x_m": 1.3, "width_mm": 20.0, "depth_mm": 25.0},
            {"x_m": 2.6, "width_mm": 20.0, "depth_mm": 25.0, "material": "steel"},
        ],
        **support,
    }
    whole = vehicle.model_dump(exclude_unset=True) | {"structure": entry}
    steel = {"youngs_modulus_GPa": 200.0, "poisson_ratio": 0.29, "density_kg_per_m3": 7850.0}
    whole["materials"] = {"steel": steel}
    whole["material"] = vehicle.material.model_dump(exclude_unset=True) | {"density_kg_per_m3": 4430.0}
    return Vehicle.model_validate(whole)


FOUNDATION = {
    "support": "elastic_foundation",
    "foundation_normal_N_per_m3": 2.0e12,
    "foundation_tangential_N_per_m3": 1.0e12,
}


@pytest.fixture(
    scope="module",
    params=[pytest.param({}, marks=pytest.mark.slow, id="clamp"), pytest.param(FOUNDATION, id="foundation")],
)
def wall(vehicle: Vehicle, request: pytest.FixtureRequest) -> tuple[Vehicle, AsBuiltStructure]:
    made = layered(vehicle, **request.param)
    return made, as_built_structure(made, LAYOUT, max_harmonic=10)


def test_the_wall_of_the_drawing_is_that_of_the_map(wall: tuple[Vehicle, AsBuiltStructure]) -> None:
    vehicle, structure = wall
    drawing = structure.exactly_built()
    z_p = structural_model(vehicle, vehicle.resolution.map, [LAYOUT]).strain_operator(LAYOUT)
    np.testing.assert_allclose(structure.strain_operator(drawing), z_p, atol=1e-12 * np.abs(z_p).max())
    whole = fourier_structure_of(vehicle, LAYOUT, max_harmonic=10)
    loads: tuple[Load, ...] = (PAD, Weight(up_roll_angle=1.0))
    for load in loads:
        expected = gauge_strain(whole, [load])
        np.testing.assert_allclose(
            structure.load_strain(drawing, [load]), expected, atol=1e-12 * np.abs(expected).max()
        )


def test_a_thicker_wall_is_a_wall_of_that_thickness(
    vehicle: Vehicle, wall: tuple[Vehicle, AsBuiltStructure]
) -> None:
    """All regions 1 % thicker, against a mesh of that wall; but for the depth of the frames and the tip."""
    made, structure = wall
    support = FOUNDATION if made.structure.support != "clamped_aft" else {}
    size, drawing = 0.01, structure.exactly_built()
    thicker = layered(vehicle, 1.0 + size, **support)
    changed = drawing.changed(wall_thickness=np.full(structure.n_regions, size))
    expected, before = (
        gauge_strain(fourier_structure_of(one, LAYOUT, max_harmonic=10), [PAD]) for one in (thicker, made)
    )
    change = structure.load_strain(changed, [PAD]) - structure.load_strain(drawing, [PAD])
    assert np.linalg.norm(change - (expected - before)) < 0.05 * np.linalg.norm(expected - before)


def test_a_softer_support_is_a_support_of_that_stiffness(few_harmonics: Vehicle) -> None:
    """A layer of 2 mm of the wall's material in series with the foundation, against a softer foundation."""
    made = layered(few_harmonics, **FOUNDATION)
    structure, length = as_built_structure(made, LAYOUT, max_harmonic=2), 1e-4
    modulus = 1e9 * made.material.youngs_modulus_GPa
    softer = {
        name: 1.0 / (1.0 / FOUNDATION[name] + length / modulus)
        for name in ("foundation_normal_N_per_m3", "foundation_tangential_N_per_m3")
    }
    other = as_built_structure(layered(few_harmonics, **(FOUNDATION | softer)), LAYOUT, max_harmonic=2)
    drawing = structure.exactly_built()
    expected = other.strain_operator(drawing) - structure.strain_operator(drawing)
    found = structure.strain_operator(drawing.changed(clamp_axial=length, clamp_transverse=length))
    change = found - structure.strain_operator(drawing)
    assert np.linalg.norm(change - expected) < 0.05 * np.linalg.norm(expected)


def test_a_vehicle_that_flies_free_is_held_in_its_test(few_harmonics: Vehicle) -> None:
    """In flight its strain is the free body's, also of a thicker wall; in the test the clamped body's."""
    free, clamped = (layered(few_harmonics, support=support) for support in ("free_flight", "clamped_aft"))
    structure, held = (as_built_structure(one, LAYOUT, max_harmonic=2) for one in (free, clamped))
    drawing = structure.exactly_built()
    expected = structural_model(free, free.resolution.map, [LAYOUT]).strain_operator(LAYOUT)
    found = structure.strain_operator(drawing)
    assert np.linalg.norm(found - expected) < 1e-6 * np.linalg.norm(expected)
    force = SectionLoad(station=0.6, force=(0.0, 0.0, 100.0))
    np.testing.assert_allclose(structure.load_strain(drawing, [force]), held.load_strain(drawing, [force]))
    thickness = np.full(drawing.n_regions, 0.02)
    thick = drawing.changed(wall_thickness=thickness)
    solved = as_built_structure(free, LAYOUT, max_harmonic=2, known_thickness=thickness)
    change, wanted = structure.strain_operator(thick) - found, solved.strain_operator(thick) - found
    assert np.linalg.norm(change - wanted) < 0.02 * np.linalg.norm(wanted)
