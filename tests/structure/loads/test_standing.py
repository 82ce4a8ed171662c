"""A vehicle that stands on the ground: own weight and ambient pressure as the gauges read them."""

import numpy as np
import pytest

import builder
from builder.structure.loads.applied import Weight
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.loads.of_vehicle import fourier_structure_of, squeeze_strain, weight_strain
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


def vehicle(density: float | None) -> Vehicle:
    held = builder.load_vehicle(builder.IC3X)
    coarse = held.resolution.map.model_copy(
        update={"element_length_mm": 40.0, "surface_stations": 40, "harmonics": 6, "surface_roll_angles": 16}
    )
    return held.model_copy(
        update={
            "resolution": held.resolution.model_copy(update={"map": coarse}),
            "material": held.material.model_copy(update={"density_kg_per_m3": density}),
        }
    )


def test_weight_is_that_of_the_known_loads() -> None:
    held, weight = vehicle(4430.0), Weight(up_roll_angle=0.3)
    layout = held.gauges.layout
    whole = fourier_structure_of(held, layout, properties=LoadProperties(density=4430.0), max_harmonic=8)
    expected = gauge_strain(whole, [weight])
    found = weight_strain(held, layout, weight)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    assert 2e-6 < np.abs(found).max() < 3e-5


def test_weight_needs_a_density() -> None:
    with pytest.raises(InputError, match=r"material\.density_kg_per_m3: entry is missing"):
        weight_strain(vehicle(None), "configuration_45", Weight())


def test_one_bar_around_the_wall() -> None:
    """(1 - 0.62) 1e5 / 110e9."""
    assert squeeze_strain(vehicle(None), 1e5) == pytest.approx(-3.4545e-7, rel=1e-4)
