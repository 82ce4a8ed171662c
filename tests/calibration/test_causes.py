"""What gauges have in common when they do not fit: it is named and estimated, and nothing sound is blamed."""

from dataclasses import replace

import numpy as np
import pytest
from as_built_case import TITANIUM
from drawn_tests import blank_test, drawn_readings
from scipy.stats import chi2
from sweeps import sweep

from builder.calibration.estimate.causes import Evidence, causes_of
from builder.calibration.estimate.estimated_vehicle import usable
from builder.calibration.estimate.ground_test_faults import calibrate_with_faults
from builder.calibration.estimate.outside_terms import outside_model
from builder.calibration.estimate.readings_model import Cause, ReadingsModel
from builder.calibration.estimate.remarks import remarks, unexplained
from builder.calibration.ground_test.candidate_cases import harmonics_of_test
from builder.calibration.ground_test.load_changes import common_turns, tilted
from builder.calibration.ground_test.load_test import KnownLoad, LoadErrors
from builder.calibration.ground_test.structure_of_test import joint_candidates, prior_of_test
from builder.calibration.score.simulated_test import pads
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import slices
from builder.structure.loads.applied import Load, PadForce, PointForce, Weight
from builder.structure.loads.fourier import MAX_HARMONIC, harmonics_of
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray

NOISE = 0.05e-6

EACH_DRAW = pytest.mark.parametrize("draw", [0, pytest.param(1, marks=pytest.mark.slow)])


@pytest.fixture(scope="module")
def model(vehicle: Vehicle, tested: AsBuiltStructure) -> ReadingsModel:
    """A test of ten pads and four attitudes; the vehicle file names no joint and one modulus."""
    return model_of(vehicle, tested, LoadErrors())


def model_of(vehicle: Vehicle, tested: AsBuiltStructure, errors: LoadErrors) -> ReadingsModel:
    test = blank_test(tested.gauges.names, errors, NOISE)
    return ReadingsModel(tested, test, prior_of_test(vehicle, tested))


def change_of(model: ReadingsModel, kind: str) -> FloatArray:
    """Return (n,) what a kind of cause changes of the vector, far beyond what the files state."""
    (cause, *_) = [one for one in causes_of(model) if one.kind == kind and one.number in (0, 1)][::-1]
    random = np.random.default_rng(5)
    size = {
        "support": np.array([0.03, 0.03]),
        "joint": np.array([0.03]),
        "modulus": np.array([0.03, -0.03, 0.03, -0.03]),
        "taper": np.array([0.02, -0.02, 0.02, 0.02]),
        "direction": np.deg2rad([5.0, 0.0]),
        "rig": np.array([10.0]),
        "pad size": np.array([0.5]),
        "drift": 1e-6 * random.standard_normal(len(cause.entries)),
        "hysteresis": np.append(np.zeros(len(cause.entries) - 1), 0.01),
    }[kind]
    found = np.zeros(len(model.std))
    found[cause.entries] = size
    return found


def test_a_vehicle_file_without_joints_has_candidates_that_are_taken_for_zero(
    vehicle: Vehicle, tested: AsBuiltStructure
) -> None:
    assert joint_candidates(vehicle) == tested.joint_stations == pytest.approx((0.975, 1.75, 2.725))
    prior = prior_of_test(vehicle, tested)
    assert not prior.joint_softness.any()
    assert not prior.region_modulus.any()
    assert tested.has_moduli


def test_a_test_needs_the_harmonics_of_its_loads(model: ReadingsModel) -> None:
    """Pads of 30 deg need 12, narrower pads and points more. A test without load needs what a plan's pads need."""

    def needed(*loads: Load) -> int:
        case = replace(model.test.cases[0], loads=tuple(KnownLoad(load=load) for load in loads))
        return harmonics_of_test(replace(model.test, cases=(case,)))

    (pad,) = [one.load for one in model.test.cases[0].loads if isinstance(one.load, PadForce)]
    assert needed() == needed(Weight()) == harmonics_of_test(model.test) == 12
    assert needed(Weight(), replace(pad, half_angle=float(np.deg2rad(20.0)))) == 18
    point = PointForce(station=1.0, roll_angle=0.0, force=(0.0, 0.0, 1.0))
    assert needed(point) == needed(replace(pad, half_angle=0.1)) == MAX_HARMONIC


def test_harmonics_beyond_what_a_pad_needs_leave_its_strain(vehicle: Vehicle) -> None:
    few, many = (
        fourier_structure_of(vehicle, vehicle.gauges.layout, properties=TITANIUM, max_harmonic=count)
        for count in (harmonics_of(pads(1, 3.6)[0]), MAX_HARMONIC)
    )
    for pad in pads(10, 3.6):
        strain, exact = (gauge_strain(one, [pad]) for one in (few, many))
        assert np.abs(strain - exact).max() < 2e-4 * np.abs(exact).max()


def test_common_turns_are_those_of_a_tilted_force() -> None:
    pad = PadForce(station=1.0, roll_angle=0.5, half_length=0.05, half_angle=0.5, force=(0.0, -300.0, -400.0))
    for way, towards in enumerate(np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6]])):
        first, second = 1e-4 * common_turns(pad)[:, way]
        turned = tilted(pad, first, second)
        assert isinstance(turned, PadForce)
        np.testing.assert_allclose((np.array(turned.force) - pad.force) / 500.0, 1e-4 * towards, atol=1e-8)


def test_derivatives_by_what_all_cases_have_in_common(model: ReadingsModel) -> None:
    random = np.random.default_rng(2)
    vector = np.zeros(len(model.std))
    vector[: model.n_built] = (model.std * random.standard_normal(len(model.std)))[: model.n_built]
    jacobian = model.jacobian(vector)[1].toarray()
    of = model.entries
    for entry in (
        *of["direction"],
        *of["size"],
        of["drift"][3],
        of["hysteresis"][3],
        *of["hysteresis of all"],
    ):
        step = 1e-4 * np.eye(len(vector))[entry]
        change = (model.readings(vector + step) - model.readings(vector - step)) / 2e-4
        np.testing.assert_allclose(jacobian[:, entry], change.ravel(), atol=1e-6 * np.abs(change).max())


def test_derivatives_are_kept_for_the_last_vector_and_what_is_not_known(model: ReadingsModel) -> None:
    vector = 0.1 * model.std
    readings, jacobian = model.jacobian(vector)
    wide = model.with_std(np.maximum(model.std, 1e-3))
    more = wide.jacobian(vector)[1]
    modulus = slices(model.structure.counts)["region_modulus"]
    assert more[:, modulus].count_nonzero()
    again = model.jacobian(vector)
    np.testing.assert_array_equal(again[0], readings)
    np.testing.assert_array_equal(again[1].toarray(), jacobian.toarray())
    assert not again[1][:, modulus].count_nonzero()


@EACH_DRAW
def test_sound_tests_have_no_cause(model: ReadingsModel, draw: int) -> None:
    reading, _ = drawn_readings(model, np.random.default_rng([draw, 8]))
    found, faults = calibrate_with_faults(model.with_readings(reading))
    assert found.model.causes == ()
    assert faults == ()


@EACH_DRAW
@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("support", "clamp: it yields as "),
        ("joint", "joint at or near 1.75 m"),
        ("modulus", "modulus: Young's modulus of the regions"),
        pytest.param("taper", "wall: taper of ", marks=pytest.mark.slow),
        ("direction", "direction of all forces: turned by "),
        pytest.param("rig", "rig: ", marks=pytest.mark.slow),  # test_case_faults.py hangs its mass on the pads
        pytest.param("pad size", "size of all pads: it differs by ", marks=pytest.mark.slow),
        ("drift", "drift: zeros moved by "),
        ("hysteresis", "hysteresis: a case reads "),
    ],
)
def test_what_gauges_have_in_common_is_named_and_estimated(
    model: ReadingsModel, kind: str, said: str, draw: int
) -> None:
    change = change_of(model, kind)
    # Strain is not linear in the size of a pad, which is 50 % larger here: slopes are taken there.
    reading, vector = drawn_readings(model.with_pads_of(change), np.random.default_rng([draw, 9]), change)
    found, faults = calibrate_with_faults(model.with_readings(reading))
    assert faults == ()
    assert [one.kind for one in found.model.causes] == [kind]
    assert any(line.startswith(said) for line in remarks(found))
    assert 0.85 < found.per_reading < 1.15
    known = found.std[: model.n_built] > 0.0
    pull = (found.vector - vector)[: model.n_built][known] / found.std[: model.n_built][known]
    assert np.sqrt(np.mean(pull**2)) < 1.25
    at = change != 0.0
    error = (found.vector - vector)[at] / found.std[at]
    assert np.sum(error**2) < chi2.ppf(0.99, len(error))


def test_a_load_is_called_wrong_from_one_percent(vehicle: Vehicle, tested: AsBuiltStructure) -> None:
    exact = model_of(vehicle, tested, LoadErrors(load=0.001))
    change = np.zeros(len(exact.std))
    at = exact.entries["load"][0]
    (number,) = [k for k, (case, one) in enumerate(exact.loads) if case == 3 and one.on_load_cell]
    for size, expected in ((0.007, []), (0.05, ["pad 4"])):
        change[at + number] = size
        reading, _ = drawn_readings(exact, np.random.default_rng(12), change)
        _, faults = calibrate_with_faults(exact.with_readings(reading))
        assert [one.where for one in faults] == expected


@pytest.mark.slow
@pytest.mark.parametrize("case", [1, 4, 6])
def test_a_load_far_beyond_its_statement_blames_no_gauge(
    vehicle: Vehicle, tested: AsBuiltStructure, case: int
) -> None:
    """3 % off where 0.05 % is stated: without this case the gauges fit."""
    exact = model_of(vehicle, tested, LoadErrors(load=0.0005))
    at, change = exact.entries["load"][0], np.zeros(len(exact.std))
    (number,) = [k for k, (one, known) in enumerate(exact.loads) if one == case and known.on_load_cell]
    change[at + number] = 0.03
    reading, _ = drawn_readings(exact, np.random.default_rng(case), change)
    _, faults = calibrate_with_faults(exact.with_readings(reading))
    assert [(one.where, one.kind) for one in faults] == [(exact.test.cases[case].name, "load")]


def test_a_tilted_force_keeps_its_size(model: ReadingsModel) -> None:
    number = next(k for k, (_, one) in enumerate(model.loads) if isinstance(one.load, PadForce))
    case, known = model.loads[number]
    vector, angle = np.zeros(len(model.std)), float(np.tan(np.deg2rad(5.0)))
    vector[model.entries["pad"][number, -2]] = angle
    structure = model.structure
    drawing = structure.exactly_built()
    change = structure.load_strain(drawing, [tilted(known.load, angle)]) - structure.load_strain(
        drawing, [known.load]
    )
    found = (model.readings(vector) - model.at_drawing()[0])[case]
    np.testing.assert_allclose(found, change, atol=2e-3 * np.abs(change).max())


@EACH_DRAW
def test_noise_larger_than_stated_blames_nobody(model: ReadingsModel, draw: int) -> None:
    random = np.random.default_rng([draw, 10])
    reading, _ = drawn_readings(model, random)
    reading += np.sqrt(8.0) * NOISE * random.standard_normal(reading.shape)
    found, faults = calibrate_with_faults(model.with_readings(reading))
    assert faults == ()
    assert {one.kind for one in found.model.causes} == {"noise"}
    assert found.model.noise_factor == pytest.approx(3.0, rel=0.3)
    assert not unexplained(found, outside_model(found), ())
    assert any("scatter about 3 times as much as stated" in line for line in remarks(found))
    assert 0.85 < found.per_reading < 1.15


@pytest.mark.parametrize("swapped", sweep([True, False], [True]))
def test_a_gauge_or_a_case_at_fault_is_named_on_a_soft_support(model: ReadingsModel, swapped: bool) -> None:
    names = model.structure.gauges.names
    reading, _ = drawn_readings(model, np.random.default_rng(11), change_of(model, "support"))
    if swapped:
        reading[:, [3, 30]] = reading[:, [30, 3]]
        expected = {names[3]: "swapped", names[30]: "swapped"}
    else:
        reading[2] = reading[5]
        expected = {model.test.cases[2].name: "duplicate"}
    found, faults = calibrate_with_faults(model.with_readings(reading))
    assert {one.where: one.kind for one in faults} == expected
    assert [one.kind for one in found.model.causes] == ["support"]


def test_one_gauge_that_differs_is_no_common_cause(model: ReadingsModel) -> None:
    """A gauge whose gain is 20 % off, which is said, and one whose readings are of nothing that is known."""
    reading, vector = drawn_readings(model, np.random.default_rng(12))
    off = reading.copy()
    off[:, 7] += 0.2 * (reading[:, 7] - vector[slices(model.structure.counts)["zero"]][7])
    off[:, 20] += 3e-6 * np.random.default_rng(13).standard_normal(len(off))
    spoiled = model.with_readings(off)
    found, faults = calibrate_with_faults(spoiled)
    named = {one.where: one for one in faults}
    gain, _ = (named.pop(model.structure.gauges.names[k]) for k in (7, 20))
    assert named == {}
    assert gain.kind == "gain"
    assert "its gain differs by about +" in gain.line
    assert found.model.causes == ()


def test_evidence_of_a_term_is_the_ratio_of_both_densities(model: ReadingsModel) -> None:
    reading, _ = drawn_readings(model, np.random.default_rng(14))
    of_readings = model.with_readings(reading)
    used = usable(of_readings)
    used[3:] = False
    evidence = Evidence(of_readings, used, np.zeros(len(model.std)))
    support: Cause = next(one for one in evidence.causes if one.kind == "support")
    std = model.std.copy()
    std[support.entries] = support.wide
    density = []
    for one in (of_readings, of_readings.with_std(std)):
        predicted, jacobian = one.at_drawing()
        rows = (jacobian.toarray() * one.std)[used.ravel()]
        covariance = rows @ rows.T + np.diag(one.test.reading_stds[used] ** 2)
        left = (reading - predicted)[used]
        density.append(-0.5 * (left @ np.linalg.solve(covariance, left) + np.linalg.slogdet(covariance)[1]))
    assert next(evidence._of_terms([support])) == pytest.approx(density[1] - density[0], rel=1e-6)
