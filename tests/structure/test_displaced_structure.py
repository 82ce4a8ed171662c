"""Ground tests of any structure: known loads, what may differ as built, and the map after a simulated test."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from small_ogive import SMALL, solved, write_vehicle

from builder.calibration.after_test.calibrated_map import calibrated_map, remaining_after
from builder.calibration.after_test.left_by_test import Remaining
from builder.calibration.estimate.ground_test_faults import calibrate_with_faults
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.ground_test.candidate_cases import LoadLimits, PlannedCase, candidate_cases, known_loads
from builder.calibration.ground_test.load_test import LoadCase, LoadErrors, LoadTest
from builder.calibration.score.simulated_test import simulate_ground_test
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.problem import on_structure
from builder.pipeline.stages import take_snapshots
from builder.structure.as_built.as_built_vehicle import draw_as_built
from builder.structure.as_built.displaced_structure import (
    DisplacedStructure,
    displaced_structure,
    refuse_untestable,
)
from builder.structure.external.external_structure import external_structure, written_influence
from builder.structure.loads.applied import Load, PadPressure, PointForce, SectionLoad, SurfacePressure, Weight
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.solid import solid_structure_of
from builder.structure.mapped_structure import mapped_structure
from builder.structure.solid.case import structure_case
from builder.structure.solid.mesh_choice import MeshChoice
from builder.vehicle.file import Vehicle, load_vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator

ROWS = """rows = [
    { roll_angle_deg = 0.0, directions = ["axial", "hoop"], x_m = [0.35, 0.5, 0.65] },
    { roll_angle_deg = 90.0, directions = ["axial", "hoop"], x_m = [0.35, 0.5, 0.65] },
    { roll_angle_deg = 180.0, directions = ["axial", "hoop"], x_m = [0.35, 0.5, 0.65] },
    { roll_angle_deg = 270.0, directions = ["axial", "hoop"], x_m = [0.35, 0.5, 0.65] },
]"""
CHANGES = (
    *SMALL[:-1],
    ('file = "gauges.csv"', ROWS),
    ("internal_pressure_Pa = 3000.0", 'model = "solid"\nresolution = "coarse"'),
    ("[noise]", '[aerodynamics]\nengine = "newtonian"\n\n[noise]'),
)
PAD = PadPressure(station=0.3, roll_angle=0.4, half_length=0.08, half_angle=0.8, push=500.0)
LOADS: tuple[Load, ...] = (
    PAD,
    PointForce(station=0.25, roll_angle=1.0, force=(30.0, -40.0, 100.0)),
    SectionLoad(station=0.3, force=(100.0, 20.0, -80.0), moment=(0.0, 15.0, -5.0)),
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    vehicle: Vehicle
    snapshots: Snapshots
    structure: DisplacedStructure


@pytest.fixture(scope="module")
def tested(tmp_path_factory: pytest.TempPathFactory) -> Case:
    path = write_vehicle(tmp_path_factory.mktemp("small") / "small.toml", *CHANGES)
    vehicle = load_vehicle(path)
    snapshots = take_snapshots(vehicle)
    structure = displaced_structure(vehicle, mapped_structure(solved(path), snapshots))
    return Case(vehicle=vehicle, snapshots=snapshots, structure=structure)


def test_loads_strain_what_they_strain_on_the_mesh(tested: Case) -> None:
    """Against the mesh itself, whose radius is linear between nodes; a pressure against the map's operator."""
    vehicle, structure = tested.vehicle, tested.structure
    mesh = solid_structure_of(vehicle, vehicle.gauges.layout, MeshChoice(resolution="coarse"))
    drawing = structure.exactly_built()
    for load in LOADS:
        expected = gauge_strain(mesh, [load])
        found = structure.load_strain(drawing, [load])
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=5e-4 * np.abs(expected).max())
    outside = SurfacePressure(surface="outer", pressure=1e4)
    expected = 1e4 * structure.strain_operator(drawing).sum(axis=1)
    found = structure.load_strain(drawing, [outside])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=2e-3 * np.abs(expected).max())


def test_loads_that_are_not_known_are_refused(tested: Case) -> None:
    for load in (Weight(), SurfacePressure(surface="inner", pressure=1e4)):
        with pytest.raises(InputError, match="expected loads on the outer surface alone"):
            tested.structure.response(load)
    entry = tested.vehicle.structure.model_copy(update={"support": "free_flight"})
    vehicle = Vehicle.model_construct(**(vars(tested.vehicle) | {"structure": entry}))
    with pytest.raises(InputError, match=r"expected a body that is held .* `strainfmu equations` needs no model"):
        refuse_untestable(vehicle)


def test_an_influence_matrix_is_tested_as_its_mesh(tested: Case, tmp_path: Path) -> None:
    vehicle = tested.vehicle
    layout = vehicle.gauges.layout
    written_influence(structure_case(vehicle, [layout]), layout, tmp_path / "z.h5")
    entry = vehicle.structure.model_copy(update={"influence": str(tmp_path / "z.h5")})
    matrix = vehicle.model_copy(update={"structure": entry})
    mapped = mapped_structure(external_structure(matrix, tested.snapshots), tested.snapshots)
    structure, built = displaced_structure(matrix, mapped), tested.structure.exactly_built()
    built = built.changed(orientation=np.full(built.n_gauges, 0.02), axial_shift=np.full(built.n_gauges, 1e-3))
    for load in LOADS:
        expected = tested.structure.load_strain(built, [load])
        found = structure.load_strain(built, [load])
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())


def test_the_calibrated_map_beats_the_drawing(tested: Case) -> None:
    """A vehicle of the tolerances, with zeros of 150 um/m: nothing is blamed, and every load is nearer."""
    vehicle, structure, random = tested.vehicle, tested.structure, np.random.default_rng(4)
    noise, prior = np.full(structure.n_gauges, 0.3e-6), structure.prior(vehicle.calibration)
    built = draw_as_built(prior.changed(zero=np.full(structure.n_gauges, 150e-6)), random)
    limits = LoadLimits(force=800.0, half_length=0.08, half_angle=0.8, stations=(0.3, 0.45, 0.6))
    offered = candidate_cases(vehicle, limits, structure.outer_span)
    cases = [PlannedCase(name="no load", loads=()), *offered[::2]]
    errors = LoadErrors(pad_position=0.0, pad_roll=0.0, pad_shape=0.0)
    test = simulate_ground_test(structure, built, cases, errors, noise, random=random)
    std = noise / np.sqrt(test.strain.shape[1])
    read = [
        LoadCase(name=one.name, loads=known_loads(one, errors), reading=strain.mean(axis=0), reading_std=std)
        for one, strain in zip(cases, test.strain, strict=True)
    ]
    loads = LoadTest(gauge_names=structure.gauges.names, cases=tuple(read), errors=errors)
    estimate, faults = calibrate_with_faults(ReadingsModel(structure, loads, prior))
    assert faults == ()
    assert estimate.agrees
    calibrated = calibrated_map(vehicle, tested.snapshots, structure, remaining_after(estimate))
    exactly = Remaining(parameters=built, covariance=np.zeros((len(built.vector),) * 2))
    exact = calibrated_map(vehicle, tested.snapshots, structure, exactly)
    drawing = build_inverse_map(vehicle, tested.snapshots, structure.mapped)

    flown = on_structure(tested.snapshots, structure.mapped)
    strain = (flown.pressure - flown.internal_pressure[:, None]) @ structure.strain_operator(built).T
    strain = strain + built.zero - remaining_after(estimate).parameters.zero
    dynamic = np.array([one.dynamic_pressure for one in flown.conditions()])
    known, before, after = (
        np.asarray(Estimator(one).estimate(strain, dynamic).coefficients) for one in (exact, drawing, calibrated)
    )
    rms_before, rms_after = (np.sqrt(np.mean((one - known) ** 2, axis=0)) for one in (before, after))
    assert (rms_after[1:] < 0.3 * rms_before[1:]).all()
    assert rms_after[0] < 1e-4  # axial force: as exact before the test as after it
