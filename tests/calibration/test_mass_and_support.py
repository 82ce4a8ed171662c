"""Mass, support and modulus by region of a vehicle as built: against closed forms and a solved support."""

import numpy as np
import pytest
from as_built_case import LAYOUT, TITANIUM

from builder.inverse.noise.hardware_errors import strain_derivatives
from builder.structure.as_built.as_built_structure import AsBuiltStructure, as_built_structure
from builder.structure.as_built.wall_changes import CLAMP_LENGTH, ElasticClamp, solved
from builder.structure.fourier.fourier_elasticity import assemble_stiffness, factor_harmonic
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.fourier.shell_mesh import yielding_clamp
from builder.structure.fourier.strain_operator import strain_rows
from builder.structure.loads.applied import Acceleration, Load, PadForce, SectionLoad, Weight
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolution
from strainfmu.errors import InputError

PAD = PadForce(station=2.9, roll_angle=0.3, half_length=0.05, half_angle=0.5, force=(100.0, 200.0, -1500.0))
WEIGHTS: tuple[Load, ...] = (Weight(up_roll_angle=1.0), Acceleration(linear=(3.0, 0.0, -20.0)))


def test_mass_scales_weight_and_inertia_alone(as_built: AsBuiltStructure) -> None:
    nominal, n_r = as_built.exactly_built(), as_built.n_regions
    heavier = nominal.changed(mass=np.array([0.05]))
    in_parts = nominal.changed(region_mass=np.full(n_r, 0.05))
    for load in WEIGHTS:
        plain = as_built.load_strain(nominal, [load])
        for one in (heavier, in_parts):
            found = as_built.load_strain(one, [load])
            np.testing.assert_allclose(found, 1.05 * plain, atol=1e-12 * np.abs(plain).max())
    for one in (heavier, in_parts):
        np.testing.assert_array_equal(as_built.load_strain(one, [PAD]), as_built.load_strain(nominal, [PAD]))
        np.testing.assert_array_equal(as_built.strain_operator(one), as_built.strain_operator(nominal))


def test_weight_in_any_attitude_is_that_of_gravity_along_the_axes(as_built: AsBuiltStructure) -> None:
    """The responses to accelerations along the axes serve all attitudes, on walls that differ as well."""
    random = np.random.default_rng(4)
    built = as_built.exactly_built().changed(
        mass=np.array([0.03]),
        wall_thickness=0.03 * random.standard_normal(as_built.n_regions),
        wall_cosine=0.02 * random.standard_normal(as_built.n_regions),
    )
    for weight in (Weight(up_roll_angle=0.7, nose_elevation=0.4), Weight(up_roll_angle=np.pi)):
        x, y, z = (-weight.acceleration).tolist()
        expected = as_built.load_strain(built, [Acceleration(linear=(x, y, z))])
        found = as_built.load_strain(built, [weight])
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    none = as_built.load_strain(built, [Weight(gravity=0.0)])
    np.testing.assert_array_equal(none, np.zeros(as_built.n_gauges))


def test_mass_of_a_region_strains_what_is_aft_of_it(as_built: AsBuiltStructure) -> None:
    nominal = as_built.exactly_built()
    last = np.eye(as_built.n_regions)[-1] * 0.05
    change = as_built.load_strain(nominal.changed(region_mass=last), WEIGHTS) - as_built.load_strain(
        nominal, WEIGHTS
    )
    fore = as_built.placed.x < 2.0
    assert np.abs(change[fore]).max() < 0.02 * np.abs(change).max()


def test_a_clamp_that_yields_is_an_elastic_foundation(vehicle: Vehicle, as_built: AsBuiltStructure) -> None:
    """Against the ring on springs, solved; a rotation and a shift of the whole ring strain nothing."""
    mesh, material, x = as_built.states.forces[0].mesh, wall_of(vehicle).material, np.array([3.0, 3.5])
    stiffness, clamp = assemble_stiffness(mesh, material), ElasticClamp(mesh, material)
    length, stiff = CLAMP_LENGTH, 1e-7
    for n in (0, 2, 5):
        rows = strain_rows(mesh, x, n)
        solver = factor_harmonic(mesh, stiffness, n, twist=True)
        along, across = clamp.adjoints(stiffness, solver, rows, n)
        for found, lengths in ((along, (length, stiff)), (across, (stiff, length))):
            held = yielding_clamp(mesh, material, *lengths)
            yields = factor_harmonic(held, assemble_stiffness(held, material), n, twist=True)
            change = (solved(yields, rows) - solved(solver, rows)) / length
            np.testing.assert_allclose(found, change, atol=0.01 * np.abs(change).max())
    nominal, bent = as_built.exactly_built(), SectionLoad(station=0.5, force=(0.0, 0.0, -1e3))
    softer = nominal.changed(clamp_axial=np.array([0.002]), clamp_transverse=np.array([0.002]))
    fore = as_built.placed.x < 2.5
    plain, found = (as_built.load_strain(one, [bent])[fore] for one in (nominal, softer))
    assert np.abs(found - plain).max() < 2e-4 * np.abs(plain).max()


def test_a_clamp_that_yields_in_flight_is_that_of_the_error_columns(
    vehicle: Vehicle, as_built: AsBuiltStructure, structure: StructuralModel
) -> None:
    """The derivative of the calibration is that of a map's error columns, by a ring on springs."""
    nominal = as_built.exactly_built()
    z = as_built.strain_operator(nominal)
    keys = [("clamp_axial", 0), ("clamp_transverse", 0)]
    for (kind, _), expected in strain_derivatives(vehicle, structure, LAYOUT, keys).items():
        found = (as_built.strain_operator(nominal.changed(**{kind: np.array([CLAMP_LENGTH])})) - z) / CLAMP_LENGTH
        np.testing.assert_allclose(found, expected, atol=0.01 * np.abs(expected).max())


def test_a_row_turns_as_its_gauges_do(as_built: AsBuiltStructure) -> None:
    nominal, number = as_built.exactly_built(), as_built.on_wall.row
    assert as_built.counts.row == 4
    turned = 0.02 * (np.arange(4) == 2)
    by_row = nominal.changed(row_orientation=turned)
    by_gauge = nominal.changed(orientation=turned[number])
    found, expected = (as_built.load_strain(one, [PAD]) for one in (by_row, by_gauge))
    np.testing.assert_array_equal(found, expected)
    assert np.abs(as_built.placed.roll_angle[number == 2] - np.pi).max() < 1e-6


def test_the_modulus_of_all_regions_is_that_of_the_wall(vehicle: Vehicle, as_built: AsBuiltStructure) -> None:
    coarse = Resolution(
        radial_cells=12,
        circumferential_cells=16,
        surface_stations=24,
        surface_roll_angles=16,
        harmonics=4,
        element_length_mm=80.0,
        wall_layers=1,
    )
    joints = {"joint_stations_m": (1.2, 2.5), "joint_softness_mm": 5.0}
    entry = vehicle.calibration.model_copy(update={"region_modulus_percent": 2.0, **joints})
    unknown = vehicle.model_copy(update={"calibration": entry})
    structure = as_built_structure(unknown, LAYOUT, coarse, TITANIUM, max_harmonic=4)
    nominal = structure.exactly_built()
    assert not structure.operator_slopes(nominal, [("mass", 0)])["mass", 0].any()
    stiffer = nominal.changed(region_modulus=np.full(structure.n_regions, 0.03))
    for load in (SectionLoad(station=2.0, force=(0.0, 0.0, -1e3)), WEIGHTS[0]):
        plain, found = (structure.load_strain(one, [load]) for one in (nominal, stiffer))
        np.testing.assert_allclose(found, plain / 1.03, atol=3e-4 * np.abs(plain).max())
    z, changed = structure.strain_operator(nominal), structure.strain_operator(stiffer)
    np.testing.assert_allclose(changed, z / 1.03, atol=3e-4 * np.abs(z).max())
    _check_joints(structure)
    with pytest.raises(InputError, match="region_modulus_percent is 0"):
        as_built.load_strain(as_built.exactly_built().changed(region_modulus=np.full(4, 0.01)), [PAD])


def _check_joints(structure: AsBuiltStructure) -> None:
    """A joint that is softer strains the wall beside it, and what is aft of a bent body or fore of it hardly."""
    nominal = structure.exactly_built()
    assert structure.counts.joint == 2
    softer = nominal.changed(joint_softness=np.array([0.0, 0.01]))
    change = np.abs(structure.strain_operator(softer) - structure.strain_operator(nominal)).max(axis=1)
    beside = np.abs(structure.placed.x - 2.5) < 0.4
    assert change[beside].max() > 3.0 * change[~beside].max() > 0.0
