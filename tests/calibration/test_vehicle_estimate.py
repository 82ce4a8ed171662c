"""A vehicle drawn at random and tested on the same mesh: what the estimate finds, and which faults it names."""

from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_tests import blank_test
from sweeps import sweep

from builder.calibration.after_test.calibrated_map import remaining_after
from builder.calibration.estimate.estimated_vehicle import Estimate, estimate, usable
from builder.calibration.estimate.ground_test_faults import calibrate_with_faults, load_shifts
from builder.calibration.estimate.outside_terms import outside_model
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.remarks import remarks, unexplained
from builder.calibration.ground_test.load_changes import moved
from builder.calibration.ground_test.load_test import KnownLoad, LoadCase, LoadErrors, LoadTest
from builder.calibration.ground_test.load_test_file import read_test_file
from builder.pipeline.load_test_proposal import write_template
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import GAUGE_KINDS, AsBuilt, as_built_std, draw_as_built, slices
from builder.structure.loads.applied import PadForce
from builder.vehicle.file import IC3X, Vehicle
from strainfmu.errors import InputError

NOISE = 0.05e-6
ERRORS = LoadErrors(common=0.002)


@pytest.fixture(scope="module")
def prior(vehicle: Vehicle, as_built: AsBuiltStructure) -> AsBuilt:
    return as_built_std(vehicle.calibration, as_built.counts)


@pytest.fixture(scope="module")
def model(as_built: AsBuiltStructure, prior: AsBuilt) -> tuple[ReadingsModel, np.ndarray]:
    """A test of ten pads and four attitudes, and the vector that its readings were drawn with."""
    random, blank = np.random.default_rng(11), blank_test(as_built.gauges.names, ERRORS, NOISE)
    empty = ReadingsModel(as_built, blank, prior)
    vector = np.zeros(len(empty.std))
    own = slice(empty.entries["direction"][0])  # what all cases have in common is zero
    vector[own] = empty.std[own] * random.standard_normal(own.stop)
    vector[: empty.n_built] = draw_as_built(prior, random).vector
    reading = empty.readings(vector) + NOISE * random.standard_normal(blank.readings.shape)
    return empty.with_readings(reading), vector


@pytest.fixture(scope="module")
def found(model: tuple[ReadingsModel, np.ndarray]) -> Estimate:
    return estimate(model[0], usable(model[0]))


def test_derivatives_are_those_of_the_readings(model: tuple[ReadingsModel, np.ndarray]) -> None:
    built, vector = model
    readings, jacobian = built.jacobian(vector)
    np.testing.assert_allclose(readings, built.readings(vector), rtol=1e-12, atol=1e-15)
    random = np.random.default_rng(2)
    direction = built.std * random.standard_normal(len(vector))
    step = 1e-3
    change = (built.readings(vector + step * direction) - built.readings(vector - step * direction)) / (2.0 * step)
    # The change by pads is that of the drawing: to first order in the load's own error.
    np.testing.assert_allclose(jacobian @ direction, change.ravel(), atol=1e-2 * np.abs(change).max())


def test_a_pad_elsewhere_changes_what_the_wall_and_the_gauges_as_built_read(
    model: tuple[ReadingsModel, np.ndarray],
) -> None:
    drawn, vector = model
    case, known = next(pair for pair in drawn.loads if pair[1].on_load_cell)
    elsewhere = np.where(np.arange(len(vector)) < drawn.n_built, vector, 0.0)
    place = next(k for k, name in enumerate(drawn.names) if name.startswith("pad place ") and drawn.std[k] > 0.0)
    elsewhere[place] = drawn.std[place]
    acting = [one.load for one in drawn.test.cases[case].loads]
    acting[acting.index(known.load)] = moved(known.load, along=drawn.std[place])
    expected = drawn.structure.reading(drawn.built(elsewhere), acting)
    by_drawing, by_vehicle = (
        np.abs(one.readings(elsewhere)[case] - expected).max() for one in (drawn, drawn.with_pads_of(elsewhere))
    )
    assert by_vehicle < 0.5 * by_drawing


def test_the_estimate_is_as_good_as_it_says(
    model: tuple[ReadingsModel, np.ndarray], found: Estimate, as_built: AsBuiltStructure
) -> None:
    built, vector = model
    known = found.std > 0.0
    pull = (found.vector - vector)[known] / found.std[known]
    assert np.sqrt(np.mean(pull**2)) == pytest.approx(1.0, abs=0.15)
    assert 0.9 <= found.per_reading <= 1.1
    truth = as_built.strain_operator(built.built(vector))
    before, after = (
        np.abs(as_built.strain_operator(one) - truth).max() for one in (as_built.exactly_built(), found.parameters)
    )
    assert after < 0.35 * before
    assert np.all(found.std <= built.std * (1.0 + 1e-9))


def test_sound_readings_raise_no_alarm(found: Estimate) -> None:
    shift, _ = load_shifts(found)
    assert np.abs(shift).max() < 4.0


@pytest.mark.parametrize(
    ("mass", "named"), sweep([(0.0, False), (0.03, True), (-0.05, True)], [(0.0, False), (-0.05, True)])
)
def test_a_mass_that_differs_is_found_and_named(
    model: tuple[ReadingsModel, np.ndarray], mass: float, named: bool
) -> None:
    built, vector = model
    at = built.names.index("mass")
    other = np.where(np.arange(len(vector)) == at, mass, vector)
    noise = built.test.readings - built.readings(vector)
    found = estimate(built.with_readings(built.readings(other) + noise), usable(built))
    assert found.std[at] < 0.25 * built.std[at]
    assert abs(found.vector[at] - mass) < 3.0 * found.std[at]
    said = [line for line in remarks(found) if line.startswith("mass: ")]
    assert len(said) == named
    if named:
        assert f"% {'more' if mass > 0.0 else 'less'} than the vehicle file states" in said[0]


def test_a_test_states_its_mass_or_has_no_part_in_it(
    model: tuple[ReadingsModel, np.ndarray], as_built: AsBuiltStructure, prior: AsBuilt
) -> None:
    test = model[0].test
    weighed = ReadingsModel(as_built, replace(test, errors=replace(ERRORS, mass=0.001)), prior)
    assert weighed.std[weighed.names.index("mass")] == 0.001
    pads = tuple(
        replace(case, loads=tuple(one for one in case.loads if isinstance(one.load, PadForce)))
        for case in test.cases[:2]
    )
    light = ReadingsModel(as_built, replace(test, cases=pads), prior)
    assert light.std[light.names.index("mass")] == 0.0


def test_two_load_cells_have_gains_and_offsets_of_their_own(
    model: tuple[ReadingsModel, np.ndarray], as_built: AsBuiltStructure, prior: AsBuilt
) -> None:
    """Cell B reads 2 % too little, cell A 15 N: both are found, and a cell that is far off is named."""
    built, vector = model
    cells = tuple(
        replace(case, loads=tuple(replace(one, load_cell="AB"[k % 2]) for one in case.loads))
        for k, case in enumerate(built.test.cases)
    )
    errors = LoadErrors(common=0.02, cell_offset=10.0)
    two = ReadingsModel(as_built, replace(built.test, cases=cells, errors=errors), prior)
    truth = np.zeros(len(two.std))
    truth[: two.n_built] = vector[: built.n_built]
    at = slice(two.entries["cell"][0, 0], two.entries["cell"][1, -1] + 1)
    assert two.names[at] == ("load cell A", "load cell B", "load cell offset A", "load cell offset B")
    truth[at] = 0.0, 0.02, 15.0, 0.0
    noise = built.test.readings - built.readings(vector)
    found = estimate(two.with_readings(two.readings(truth) + noise), usable(two))
    assert np.all(np.abs(found.vector[at] - truth[at]) < 3.0 * found.std[at])
    assert np.all(found.std[at] < 0.9 * two.std[at])
    off = found.vector + 0.1 * (np.arange(len(truth)) == at.start + 1)
    assert any(line.startswith("load cell B: loads are") for line in remarks(replace(found, vector=off)))


@pytest.mark.parametrize(("factor", "said"), [(0.2, "too low"), (5.0, "too high")])
def test_a_chi_square_counts_on_both_sides(
    model: tuple[ReadingsModel, np.ndarray], found: Estimate, factor: float, said: str
) -> None:
    assert found.disagreement == ""
    other = replace(found, chi_square=factor * found.chi_square)
    assert not other.agrees
    assert said in other.disagreement
    assert other.disagreement in remarks(other)


@pytest.mark.parametrize("rms", sweep([150e-6, 1000e-6, 20e-3], [20e-3]))
def test_zeros_of_the_recorder_are_no_evidence(
    model: tuple[ReadingsModel, np.ndarray], found: Estimate, rms: float
) -> None:
    """Whatever they are, within a recorder's range: no gauge is blamed, and chi-square stays."""
    built, vector = model
    change = rms * np.random.default_rng(4).standard_normal(built.structure.n_gauges) - built.built(vector).zero
    again, faults = calibrate_with_faults(built.with_readings(built.test.readings + change))
    assert faults == ()
    assert again.per_reading == pytest.approx(found.per_reading, rel=0.02)
    assert again.from_priors == pytest.approx(found.from_priors, rel=0.02)
    assert not unexplained(again, outside_model(again), faults)
    assert not again.farthest[0].startswith("zero ")


def test_readings_and_priors_are_two_numbers(model: tuple[ReadingsModel, np.ndarray], found: Estimate) -> None:
    """Readings three times as exact as stated show in the first, twice the tolerances in the second."""
    built, vector = model
    assert found.from_priors == pytest.approx(1.0, abs=0.25)
    assert found.tolerances_hold
    noise = built.test.readings - built.readings(vector)
    exact = built.with_readings(built.readings(vector) + noise / 3.0)
    of_exact = estimate(exact, usable(exact))
    assert of_exact.per_reading < 0.2
    assert "too low" in of_exact.disagreement
    twice = built.with_readings(built.readings(2.0 * vector) + noise)
    of_twice = estimate(twice, usable(twice))
    assert of_twice.from_priors == pytest.approx(4.0, rel=0.25)
    assert any(line.startswith("tolerances: vehicle and loads differ") for line in remarks(of_twice))
    assert of_twice.per_reading == pytest.approx(1.0, abs=0.15)


def test_a_gauge_that_changed_after_the_test_is_as_before_it(found: Estimate) -> None:
    """One is replaced, one balanced again: their entries have the tolerances, and no part in the others'."""
    model, names = copy(found.model), found.model.structure.gauges.names
    model.test = replace(model.test, changed={names[3]: "replaced", names[5]: "balanced again"})
    after, before = remaining_after(replace(found, model=model)), remaining_after(found)
    where = slices(model.structure.counts)
    again = np.array([where[kind].start + 3 for kind in GAUGE_KINDS] + [where["zero"].start + 5])
    as_it_was = np.setdiff1d(np.arange(model.n_built), again)
    assert not after.parameters.vector[again].any()
    np.testing.assert_array_equal(after.covariance[np.ix_(again, again)], np.diag(model.std[again] ** 2))
    assert not after.covariance[np.ix_(again, as_it_was)].any()
    np.testing.assert_array_equal(after.parameters.vector[as_it_was], before.parameters.vector[as_it_was])
    kept = np.ix_(as_it_was, as_it_was)
    np.testing.assert_array_equal(after.covariance[kept], before.covariance[kept])


def test_steps_that_do_not_settle_are_named(
    model: tuple[ReadingsModel, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    built = model[0]
    monkeypatch.setattr("builder.calibration.estimate.estimated_vehicle.STEPS", 1)
    found = estimate(built, usable(built))
    assert not found.settled
    name, length = found.last_step
    line = f"the steps of the estimate did not settle: the last of 1 changes {name} by {length:.2g} standard"
    assert length > 1.0
    assert name in built.names
    assert found.unsettled.startswith(line)
    assert found.unsettled in remarks(found)
    assert found.unsettled in found.far_off
    assert "too few cases are left" in replace(found, used=np.zeros_like(found.used)).far_off
    monkeypatch.undo()
    assert estimate(built, usable(built)).unsettled == ""


@pytest.mark.parametrize("factor", [-1.0, pytest.param(1e3, marks=pytest.mark.slow)])
def test_readings_that_no_vehicle_has_are_refused(model: tuple[ReadingsModel, np.ndarray], factor: float) -> None:
    """All of the wrong sign or unit: gauges cannot be named, and the steps diverge."""
    built = model[0]
    with pytest.raises(InputError, match="no vehicle near the drawing") as refused:
        calibrate_with_faults(built.with_readings(factor * built.test.readings))
    said = float(str(refused.value).split("case to case are ")[1].split()[0])
    assert said == pytest.approx(factor, rel=0.2)


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        pytest.param(1.05, "", marks=pytest.mark.slow),  # the modulus and the load cell are known no better
        (1.5, "youngs modulus would be 9"),
        pytest.param(0.5, "common gain would be 1", marks=pytest.mark.slow),  # chi-square per reading is 1.0
        pytest.param(0.1, "common gain would be 4", marks=pytest.mark.slow),
    ],
)
def test_a_factor_on_all_readings_has_no_name(
    model: tuple[ReadingsModel, np.ndarray], factor: float, said: str
) -> None:
    built = model[0]
    found, _ = calibrate_with_faults(built.with_readings(factor * built.test.readings))
    against = unexplained(found, outside_model(found), ())
    assert (said in against) if said else not against
    if said:
        near = float(against.split("case to case are ")[1].split()[0])
        assert near == pytest.approx(factor, rel=0.1)


@pytest.mark.parametrize("factor", [pytest.param(1.5, marks=pytest.mark.slow), 0.5])
def test_a_factor_and_a_gauge_of_the_wrong_sign(model: tuple[ReadingsModel, np.ndarray], factor: float) -> None:
    """No gauge is named then, and no vehicle fits: the steps end at a minimum, whose misfit is named."""
    built = model[0]
    reading = factor * built.test.readings
    reading[:, 7] *= -1.0
    found = estimate(built.with_readings(reading), usable(built))
    assert not found.has_diverged
    near = float(unexplained(found, outside_model(found), ()).split("case to case are ")[1].split()[0])
    assert near == pytest.approx(factor, rel=0.1)


@pytest.mark.parametrize(("station", "said"), [(15.48, "15.48"), (-1.0, "-1")])
def test_a_load_off_the_body_is_named_by_its_case(
    as_built: AsBuiltStructure, prior: AsBuilt, station: float, said: str
) -> None:
    pad = PadForce(station=station, roll_angle=0.0, half_length=0.05, half_angle=0.5, force=(0.0, 0.0, -1e3))
    n_d = as_built.n_gauges
    case = LoadCase(
        name="aft", loads=(KnownLoad(load=pad),), reading=np.zeros(n_d), reading_std=np.full(n_d, NOISE)
    )
    test = LoadTest(gauge_names=as_built.gauges.names, cases=(case,), errors=ERRORS)
    with pytest.raises(InputError, match=rf"load case 'aft': load: station {said} m is beyond the surface"):
        ReadingsModel(as_built, test, prior)


def test_the_section_load_of_the_template_strains_the_gauges(as_built: AsBuiltStructure, tmp_path: Path) -> None:
    """It acts ahead of them; on the clamp it strained none. Axial gauges at 90 deg are in the neutral plane."""
    write_template(IC3X, tmp_path / "loadtest.toml", LoadErrors())
    (case,) = (one for one in read_test_file(tmp_path / "loadtest.toml").case if "ring" in one.name)
    (load,) = (one.load() for one in case.load if one.kind == "section")
    strain = as_built.nominal_strain(as_built.exactly_built(), (load,))[0]
    bent = np.array([name.startswith(("axial_0deg", "axial_180deg")) for name in as_built.gauges.names])
    assert bent.sum() == 18
    assert np.abs(strain[bent]).min() > 5e-6


@pytest.mark.parametrize("from_aft", [False, True])
def test_a_pad_at_an_end_of_the_body(as_built: AsBuiltStructure, prior: AsBuilt, from_aft: bool) -> None:
    """Its place is varied by 1 mm, on the body; the derivative is that of 1 mm inboard."""
    n_d, end = as_built.n_gauges, as_built.outer_span[from_aft]
    inboard = 1e-3 if not from_aft else -1e-3

    def columns(station: float) -> np.ndarray:
        pad = PadForce(station=station, roll_angle=0.3, half_length=0.2, half_angle=1.5, force=(0.0, 0.0, -1e3))
        case = LoadCase(
            name="end", loads=(KnownLoad(load=pad),), reading=np.zeros(n_d), reading_std=np.full(n_d, NOISE)
        )
        test = LoadTest(gauge_names=as_built.gauges.names, cases=(case,), errors=ERRORS)
        model = ReadingsModel(as_built, test, prior)
        return model.at_drawing()[1][:, [model.names.index("pad place pad force 1 of end")]].toarray()

    inside = columns(end + 2.0 * inboard)
    assert np.abs(inside).max() > 0.0
    for station in (end, end + 0.3 * inboard):
        np.testing.assert_allclose(columns(station), inside, atol=0.1 * np.abs(inside).max())


@pytest.mark.slow
def test_faults_are_named_and_left_out(model: tuple[ReadingsModel, np.ndarray], found: Estimate) -> None:
    built, vector = model
    names = built.structure.gauges.names
    reading = built.test.readings.copy()
    strain = built.readings(np.where(np.arange(len(vector)) < built.n_built, vector, 0.0))
    reading[:, 3] *= -1.0
    reading[:, 20] *= 1e3
    reading[:, 30] = 1e-5 + NOISE * np.random.default_rng(1).standard_normal(len(reading))
    reading[:, [5, 40]] = reading[:, [40, 5]]
    case = [one.name for one in built.test.cases].index("pad 4")
    zero = built.built(vector).zero
    reading[case] += (
        0.1 * (strain[case] - zero) * (reading[case] != 0.0) * ~np.isin(np.arange(len(names)), [3, 20, 30, 5, 40])
    )
    repaired, faults = calibrate_with_faults(built.with_readings(reading))
    kinds = {fault.where: fault.kind for fault in faults}
    assert kinds == {
        names[3]: "sign",
        names[20]: "unit",
        names[30]: "dead",
        names[5]: "swapped",
        names[40]: "swapped",
        "pad 4": "load",
    }
    assert not repaired.used[:, [3, 20, 30, 5, 40]].any()
    assert not repaired.used[case].any()
    assert 0.9 <= repaired.per_reading <= 1.1
