"""Steps of the loads show the curve of the load cell that reads them."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_tests import blank_test
from sweeps import sweep

from builder.calibration.estimate.ground_test_faults import calibrate_with_faults
from builder.calibration.estimate.load_steps import step_parts
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.remarks import remarks
from builder.calibration.ground_test.load_test import LoadErrors, LoadStep
from builder.calibration.ground_test.structure_of_test import prior_of_test
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray

NOISE = 0.05e-6
STEPS = ((0.0, False), (0.5, False), (0.5, True), (0.0, True))


@pytest.fixture(scope="module")
def blank(vehicle: Vehicle, tested: AsBuiltStructure) -> ReadingsModel:
    test = blank_test(tested.gauges.names, LoadErrors(common=0.001), NOISE)
    return ReadingsModel(tested, test, prior_of_test(vehicle, tested))


def read(blank: ReadingsModel, seed: int, full_scale: float, bow: float) -> tuple[ReadingsModel, FloatArray]:
    """Return the model of a test with steps whose cell deviates by ``bow`` of full scale at half of it.

    The deviation is a sine, which the quadratic and cubic curves of the model only approach.
    """
    random = np.random.default_rng(seed)
    vector = blank.std * random.standard_normal(len(blank.std))
    vector[blank.entries["cell"][:2]] = 0.0
    strain, n_d = blank.load_strains(blank.built(vector)), blank.structure.n_gauges
    zero = blank.errors(vector).zero[0]
    cases = []
    for number, case in enumerate(blank.test.cases):
        at = np.flatnonzero(blank.case_of_load == number)

        def reading(part: float, at: np.ndarray = at) -> FloatArray:
            total = zero + NOISE * random.standard_normal(n_d)
            for k in at:
                known = blank.loads[k][1]
                force = part * float(np.linalg.norm(getattr(known.load, "force", 0.0)))
                more = full_scale * bow * np.sin(np.pi * force / full_scale) / max(force, 1e-9)
                total = total + (part * (1.0 + more) if known.on_load_cell else 1.0) * strain[k]
            return total

        std = np.full(n_d, NOISE)
        steps = tuple(
            LoadStep(part=part, unloading=back, reading=reading(part), reading_std=std) for part, back in STEPS
        )
        loaded = any(blank.loads[k][1].on_load_cell for k in at)
        cases.append(replace(case, reading=reading(1.0), steps=steps if loaded else ()))
    made = ReadingsModel(blank.structure, replace(blank.test, cases=tuple(cases)), blank.prior)
    return made, vector


def test_a_step_says_what_part_of_the_load_acted(blank: ReadingsModel) -> None:
    bow, full_scale = 0.01, 3000.0
    model, _ = read(blank, 1, full_scale, bow)
    steps = step_parts(model.test, np.ones(len(model.test.cases), dtype=bool))
    assert len(steps.value) == 2 * 10
    half, whole = (
        1.0 + full_scale * bow * np.sin(np.pi * force / full_scale) / force
        for force in (0.5 * steps.force, steps.force)
    )
    assert np.all(np.abs(steps.value - (half / whole - 1.0)) < 5.0 * steps.std)
    assert np.median(steps.std) < 1e-3


def test_a_straight_cell_has_no_cause(blank: ReadingsModel) -> None:
    found, faults = calibrate_with_faults(read(blank, 2, 3000.0, 0.0)[0])
    assert faults == ()
    assert found.model.causes == ()


@pytest.mark.parametrize("bow", sweep([0.01, -0.01], [0.01]))
def test_a_cell_that_is_not_straight_is_named_and_its_gain_not_believed(blank: ReadingsModel, bow: float) -> None:
    """1 % of full scale: nothing else is blamed, and gauges are as exact as the estimate says."""
    model, vector = read(blank, 3, 3000.0, bow)
    found, faults = calibrate_with_faults(model)
    assert faults == ()
    assert [one.kind for one in found.model.causes] == ["load cell"]
    assert any(line.startswith("load cell: it is not straight, by ") for line in remarks(found))
    known = found.std[: model.n_built] > 0.0
    pull = (found.vector - vector)[: model.n_built][known] / found.std[: model.n_built][known]
    assert np.sqrt(np.mean(pull**2)) < 1.25
    assert np.abs(pull).max() < 4.5
