"""Inertia of a vehicle file: its modes, errors of masses, and their place in the noise."""

from dataclasses import replace

import numpy as np
import pytest

import builder
from builder.inverse.noise.inertia import (
    NAME,
    VIBRATION_MODES,
    InertiaStrain,
    inertia_map,
    inertia_terms,
    strain_by_inertia,
)
from builder.inverse.noise.model import fixed_covariance, gauge_noise
from builder.structure.loads.applied import Acceleration
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.vehicle.file import Vehicle
from builder.vehicle.structure_section import CoverEntry, Mass, PointMassEntry
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast
ENTRY = Mass(structure_percent=3.0, equipment_percent=5.0, unlisted_kg=0.5, unit_x_m=0.0)
SUPPORTS = ("clamped_aft", "free_flight")


def with_entry(**structure: object) -> Vehicle:
    held = builder.load_vehicle(builder.IC3X)
    coarse = held.resolution.map.model_copy(update={"element_length_mm": 40.0, "wall_layers": 1})
    resolution = held.resolution.model_copy(update={"map": coarse})
    changed = held.structure.model_copy(update=structure)
    return held.model_copy(update={"mass": ENTRY, "resolution": resolution, "structure": changed})


@pytest.fixture(scope="module")
def equipped() -> Vehicle:
    return with_entry(
        point_masses=[PointMassEntry(x_m=1.0, mass_kg=4.0), PointMassEntry(x_m=2.0, mass_kg=3.0)],
        covers=[CoverEntry(start_x_m=0.5, end_x_m=3.0, mass_kg_per_m2=2.0)],
    )


@pytest.fixture(scope="module")
def strain(equipped: Vehicle) -> InertiaStrain:
    return strain_by_inertia(equipped, ENTRY)


def test_the_bare_wall_is_that_of_known_loads() -> None:
    vehicle = with_entry()
    found = strain_by_inertia(vehicle, ENTRY).of_listed
    structure = fourier_structure_of(vehicle, vehicle.gauges.layout, max_harmonic=2)
    expected = gauge_strain(structure, [Acceleration(linear=(0.0, 0.3, 1.0))])
    np.testing.assert_allclose(
        0.3 * found[:, 1] + found[:, 2], expected, rtol=1e-6, atol=1e-6 * abs(expected).max()
    )


def test_every_mass_is_a_part(equipped: Vehicle, strain: InertiaStrain) -> None:
    assert [*strain.by_part][:3] == ["structure", "equipment 1", "equipment 2"]
    bare = strain_by_inertia(with_entry(), ENTRY).by_part["structure"]
    assert np.abs(strain.by_part["structure"][:, 2]).max() > 1.1 * np.abs(bare[:, 2]).max()
    half = with_entry(point_masses=[PointMassEntry(x_m=1.0, mass_kg=2.0)])
    other = strain_by_inertia(half, ENTRY).by_part["equipment 1"]
    np.testing.assert_allclose(strain.by_part["equipment 1"], 2.0 * other, rtol=1e-9, atol=1e-15)
    assert strain.of_listed == pytest.approx(sum(list(strain.by_part.values())[:3]))


def test_terms_are_modes_and_errors_of_masses(strain: InertiaStrain) -> None:
    inertia = inertia_map(strain)
    assert inertia is not None
    force = 9.80665 * 5.0
    np.testing.assert_allclose(inertia.prior_std[:3], force)
    assert inertia.vehicle_mass is None
    stated = inertia_map(replace(strain, entry=ENTRY.model_copy(update={"vehicle_kg": 150.0})))
    assert stated is not None
    assert stated.vehicle_mass == 150.0
    modes, vibration, errors, theory = inertia_terms(inertia, strain)
    assert (modes.name, vibration.name) == (NAME, VIBRATION_MODES)
    np.testing.assert_allclose(modes.strain, inertia.mode_strain * inertia.prior_std)
    assert np.abs(vibration.strain).max() == pytest.approx(2.5e-6)
    np.testing.assert_allclose(errors.strain[:, :3], 0.03 * force * strain.by_part["structure"][:, :3])
    np.testing.assert_allclose(errors.strain[:, 3:6], 0.05 * force * strain.by_part["equipment 1"][:, :3])
    np.testing.assert_allclose(errors.strain[:, 9:12], 0.5 * force * strain.by_part["unlisted 1"][:, :3])
    of_mode = 0.05 * force * inertia.mode_strain[:, :3]
    alike = (strain.section[:, None] == strain.section) + np.eye(len(of_mode)) + 1.0
    np.testing.assert_allclose(theory.covariance, 0.5 * alike * (of_mode @ of_mode.T), atol=1e-22)
    assert np.bincount(strain.section)[np.unique(strain.section)].tolist() == 9 * [6]
    noise = gauge_noise(1e-14 * np.eye(len(inertia.mode_strain)))
    rest = fixed_covariance((noise, modes, vibration, errors, theory), (NAME, VIBRATION_MODES))
    expected = np.sum([one.covariance for one in (noise, errors, theory)], axis=0)
    np.testing.assert_allclose(rest, expected, rtol=1e-9)


def test_in_free_flight_the_motion_of_the_load_counts_once() -> None:
    points = [PointMassEntry(x_m=1.0, mass_kg=4.0)]
    held = strain_by_inertia(with_entry(point_masses=points), ENTRY)
    free = strain_by_inertia(with_entry(point_masses=points, support="free_flight"), ENTRY)
    assert np.abs(free.of_listed[:, :5]).max() < 1e-6 * np.abs(held.of_listed[:, :5]).max()
    assert np.abs(free.by_part["unlisted 3"][:, 2]).max() > 0.01 * np.abs(held.by_part["unlisted 3"][:, 2]).max()


def test_strain_near_a_point_mass_is_an_error_of_theory() -> None:
    far, near = (
        [strain_by_inertia(with_entry(point_masses=points, support=support), ENTRY) for support in SUPPORTS]
        for points in ([PointMassEntry(x_m=1.3, mass_kg=4.0)], [PointMassEntry(x_m=1.5, mass_kg=4.0)])
    )
    for held, free in (far, near):
        assert free.held_by_part["equipment 1"] == pytest.approx(held.by_part["equipment 1"])
    assert not far[1].attached["equipment 1"].any()
    at = near[1].attached["equipment 1"]  # the gauges at x = 1.46 m: on all four rows along x, on two around it
    assert at.sum() == 6
    common, own = near[1].errors_of_theory(0.05, 3)
    assert own == pytest.approx(0.05 * near[0].of_listed[:, :3])
    assert common[-1] == pytest.approx(np.where(at[:, None], near[0].by_part["equipment 1"][:, :3], 0.0))


def test_without_the_section_there_is_nothing() -> None:
    assert inertia_map(None) is None
    assert inertia_terms(None, None) == []


def test_what_does_not_go_with_masses_is_refused(tmp_path) -> None:
    text = builder.IC3X.read_text(encoding="utf-8")
    path = tmp_path / "vehicle.toml"
    path.write_text(text.replace("density_kg_per_m3 = 4430.0", "") + "\n[mass]\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"\[mass\] needs material.density_kg_per_m3"):
        builder.load_vehicle(path)
    path.write_text(text.replace('model = "fourier" ', 'model = "solid" ') + "\n[mass]\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"mass: expected a profile and structure.model 'fourier'"):
        builder.load_vehicle(path)
