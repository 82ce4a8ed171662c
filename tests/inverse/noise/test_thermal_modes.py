"""Temperature modes of a vehicle file: what they strain, what sensors see, and their place in the noise."""

from dataclasses import replace

import numpy as np
import pytest

import builder
from builder.inverse.noise.model import fixed_covariance, gauge_noise
from builder.inverse.noise.thermal import (
    HARMONICS,
    gauge_rise,
    modulus_std,
    thermal_map,
    thermal_modes,
    thermal_terms,
)
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.structure.loads.temperature import uniform_temperature
from builder.vehicle.file import Vehicle
from builder.vehicle.structure_section import Temperature, TemperatureSensor
from strainfmu.estimator.map.sensors import ThermalMap
from strainfmu.estimator.reference.readings import amplitudes

pytestmark = pytest.mark.fast

ENTRY = Temperature(
    expansion_um_per_m_per_K=9.0,
    compensation_um_per_m_per_K=8.0,
    apparent_strain_um_per_m=(0.2, -0.001),
    apparent_strain_scatter_um_per_m_per_K=0.01,
    modulus_percent_per_100K=-4.5,
    sensor=[
        TemperatureSensor(name="a", x_m=0.9, std_K=0.5),
        TemperatureSensor(name="b", x_m=2.25, roll_angle_deg=90.0, surface="outer"),
    ],
)


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    held = builder.load_vehicle(builder.IC3X)
    coarse = held.resolution.map.model_copy(
        update={"element_length_mm": 40.0, "surface_stations": 40, "harmonics": 6, "surface_roll_angles": 16}
    )
    return held.model_copy(
        update={"temperature": ENTRY, "resolution": held.resolution.model_copy(update={"map": coarse})}
    )


@pytest.fixture(scope="module")
def thermal(vehicle: Vehicle) -> ThermalMap:
    found = thermal_map(vehicle)
    assert found is not None
    return found


def test_hats_of_one_kind_are_the_uniform_temperature(vehicle: Vehicle, thermal: ThermalMap) -> None:
    structure = fourier_structure_of(vehicle, vehicle.gauges.layout, max_harmonic=HARMONICS)
    expected = gauge_strain(structure, [uniform_temperature(1.0)])
    np.testing.assert_allclose(thermal.mode_strain[:, :5].sum(axis=1), expected, atol=1e-12)
    np.testing.assert_allclose(thermal.gauge_operator[:, :5].sum(axis=1), 1.0, atol=1e-12)
    far = np.median(expected)  # away from the clamped ring: free expansion less compensation
    assert far == pytest.approx(1e-6, rel=0.05)


def test_sensors_see_the_modes_where_they_are(thermal: ThermalMap, vehicle: Vehicle) -> None:
    modes = thermal_modes(ENTRY, vehicle.body().length)
    assert len(modes) == len(thermal.prior_std) == 5 * (1 + 1 + 2 + 2 + 2)
    a, b = thermal.sensor_operator
    np.testing.assert_allclose(a[:5], [0.0, 1.0, 0.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(b[:5], [0.0, 0.0, 0.5, 0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(a[5:10], [0.0, -0.5, 0.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(b[5:10], [0.0, 0.0, 0.25, 0.25, 0.0], atol=1e-12)


def test_modes_are_a_term_of_the_noise_that_sensors_lessen(thermal: ThermalMap, vehicle: Vehicle) -> None:
    own = gauge_noise(1e-14 * np.eye(54))
    terms = thermal_terms(vehicle.temperature, thermal)
    assert [term.name for term in terms] == ["temperature", "apparent strain with temperature"]
    assert not any(term.scales for term in terms)
    held = replace(thermal, isothermal_covariance=fixed_covariance((own, *terms), ("temperature",)))
    scatter = 1e-8 * gauge_rise(thermal)
    np.testing.assert_allclose(held.isothermal_covariance, 1e-14 * np.eye(54) + np.diag(scatter**2), rtol=1e-12)
    strain = held.linear_strain
    at_rest = np.full((1, 2), held.reference_temperature)
    left = (amplitudes(held, at_rest, np.full(2, known)).covariance[0] for known in (False, True))
    none, both = (held.isothermal_covariance + strain @ one @ strain.T for one in left)
    whole = sum(term.covariance for term in (own, *terms))
    np.testing.assert_allclose(none, whole, rtol=1e-10, atol=1e-22)
    assert np.all(np.linalg.eigvalsh(none - both) > -1e-20)
    assert np.trace(both) < 0.9 * np.trace(none)


def test_without_a_section_there_is_nothing(vehicle: Vehicle, thermal: ThermalMap) -> None:
    cold = vehicle.model_copy(update={"temperature": None})
    assert thermal_map(cold) is None
    assert thermal_terms(cold.temperature, None) == []
    assert modulus_std(None) == 0.0
    assert modulus_std(thermal) == pytest.approx(4.5e-4 * np.median(gauge_rise(thermal)))
    assert modulus_std(replace(thermal, modulus_slope=0.0)) == 0.0


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"stations_m": [1.0, 0.5]}, "stations_m: expected increasing stations"),
        ({"sensor": [{"name": "a", "x_m": 1.0}, {"name": "a", "x_m": 2.0}]}, "expected names once each"),
        ({"rise_K": 0, "side_K": 0, "second_harmonic_K": 0, "through_wall_K": 0}, "expected some mode above 0"),
    ],
)
def test_entries_that_cannot_be(entries: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Temperature(expansion_um_per_m_per_K=9.0, **entries)
