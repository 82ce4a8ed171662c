"""Check loads are predicted and not fitted; the worth of a test in flight; what its report says."""

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from drawn_tests import blank_test
from page_checks import read_page
from sweeps import sweep

from builder.calibration.after_test.calibrated_map import calibrated_structure
from builder.calibration.estimate.check_loads import check_loads, cross_validation
from builder.calibration.estimate.estimated_vehicle import Estimate, estimate, usable
from builder.calibration.estimate.ground_test_faults import calibrate_with_faults
from builder.calibration.estimate.load_steps import stepped_cases
from builder.calibration.estimate.outside_terms import outside_model
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.regression import load_equations
from builder.calibration.ground_test.load_test import LoadErrors, LoadStep, LoadTest
from builder.calibration.plan.load_plan import PlanParts
from builder.calibration.plan.worth_of_test import WorthOfTest, worth_of_test
from builder.figures.calibration import influence_coefficients
from builder.pipeline.calibration_report import write_report
from builder.pipeline.stages import take_snapshots
from builder.reports.calibration_page import ground_test_page
from builder.reports.calibration_page.ground_test_page import calibration_page
from builder.reports.calibration_page.ground_test_tables import equations_table
from builder.reports.calibration_page.verdict import CalibrationFindings, UsedCell, verdict
from builder.reports.page.html import page_html
from builder.reports.page.origin import Origin
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import as_built_std, draw_as_built
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray

NOISE = 0.05e-6
ERRORS = LoadErrors(common=0.002)
CHECKS = ("pad 8", "pad 10")


@pytest.fixture(scope="module")
def readings(vehicle: Vehicle, as_built: AsBuiltStructure) -> tuple[ReadingsModel, Callable[[float], FloatArray]]:
    """A test of ten pads, two of them check loads, and its readings where the first of these is so much larger."""
    n_d, random = as_built.n_gauges, np.random.default_rng(11)
    cases = tuple(
        replace(case, check=case.name in CHECKS) for case in blank_test(as_built.gauges.names, ERRORS, NOISE).cases
    )
    prior = as_built_std(vehicle.calibration, as_built.counts)
    model = ReadingsModel(as_built, LoadTest(gauge_names=as_built.gauges.names, cases=cases, errors=ERRORS), prior)
    vector = model.std * random.standard_normal(len(model.std))
    vector[: model.n_built] = draw_as_built(prior, random).vector
    noise = NOISE * random.standard_normal((len(cases), n_d))
    first = next(n for n, (k, one) in enumerate(model.loads) if cases[k].name == CHECKS[0] and one.on_load_cell)
    at = model.names.index(f"load pad force {first + 1} of {CHECKS[0]}")

    def read(larger: float) -> FloatArray:
        moved = vector.copy()
        moved[at] += larger
        return np.asarray(model.readings(moved) + noise)

    return model, read


@pytest.fixture(scope="module")
def found(readings: tuple[ReadingsModel, Callable[[float], FloatArray]]) -> Estimate:
    model, read = readings
    one = model.with_readings(read(0.0))
    return estimate(one, usable(one))


@pytest.fixture(scope="module")
def worth(vehicle: Vehicle, as_built: AsBuiltStructure, found: Estimate) -> WorthOfTest:
    aerodynamics = vehicle.aerodynamics.model_copy(update={"engine": "newtonian"})
    flying = vehicle.model_copy(update={"aerodynamics": aerodynamics})
    mapped = calibrated_structure(as_built, as_built.exactly_built(), vehicle.gauges.layout, {})
    parts = PlanParts(vehicle=flying, snapshots=take_snapshots(flying), structure=mapped, as_built=as_built)
    return worth_of_test(parts, found)


def findings(found: Estimate, worth: WorthOfTest) -> CalibrationFindings:
    equations = load_equations(found, 2.0)
    return CalibrationFindings(
        title="a vehicle: calibration by a test",
        estimate=found,
        faults=(),
        outside=outside_model(found),
        left_out=tuple(cross_validation(found)),
        equations=tuple(equations),
        checks=tuple(check_loads(found, equations, 2.0)),
        steps=tuple(stepped_cases(found.model.test)),
        worth=worth,
        origin=Origin(version="1", date="2026-03-03 10:00 UTC", files=()),
        tested_on="2026-03-03",
        cells=(UsedCell(name="A", serial_number="17", calibrated_on="2026-01-12", loads=10),),
    )


def test_check_loads_are_not_fitted(
    readings: tuple[ReadingsModel, Callable[[float], FloatArray]], found: Estimate
) -> None:
    model, read = readings
    wrong = model.with_readings(read(0.3))
    again, faults = calibrate_with_faults(wrong)
    sound, none = calibrate_with_faults(found.model)
    assert faults == none == ()
    np.testing.assert_allclose(again.vector, sound.vector, atol=1e-12)
    assert found.n_readings == 12 * model.structure.n_gauges
    assert [one.case for one in cross_validation(found)] == [
        case.name for case in model.test.cases if not case.check
    ]


def test_check_loads_are_predicted_within_their_sigma(found: Estimate) -> None:
    for one in check_loads(found):
        assert abs(one.difference) < 3.0 * one.std < 0.03
        assert one.chance > 1e-3
        assert one.chi_square == pytest.approx(1.0, abs=0.6)
        assert one.predicted == pytest.approx(one.applied * (1.0 + one.difference))


@pytest.mark.parametrize("larger", [0.05, -0.1])
def test_a_check_load_that_was_another_one_shows_its_size(
    readings: tuple[ReadingsModel, Callable[[float], FloatArray]], found: Estimate, larger: float
) -> None:
    model, read = readings
    sound = check_loads(found)
    off = check_loads(replace(found, model=model.with_readings(read(larger))))
    assert off[0].difference - sound[0].difference == pytest.approx(larger, rel=0.05)
    assert off[1].difference == pytest.approx(sound[1].difference)
    assert abs(off[0].difference) > 3.0 * off[0].std


def test_influence_coefficients_are_of_cases_with_one_force(found: Estimate) -> None:
    rows = influence_coefficients(found)
    assert [row[0] for row in rows] == [f"pad {k}" for k in range(1, 11)]
    _, measured, by_drawing, calibrated = (np.array([row[k] for row in rows]) for k in (0, 1, 2, 3))
    after, before = (np.sqrt(np.mean((measured - one) ** 2)) for one in (calibrated, by_drawing))
    assert after < 0.1 * before


def test_the_worth_of_a_test_in_flight(worth: WorthOfTest, found: Estimate) -> None:
    """Sigmas fall from before over after to exact, a further case lowers them, and its name is not in the test."""
    assert np.all(worth.before > worth.after)
    assert np.all(worth.after > worth.exact)
    assert np.all(worth.with_further <= worth.after * (1.0 + 1e-9))
    assert worth.further not in [case.name for case in found.model.test.cases]
    assert 0.5 < worth.spanned <= 1.0
    assert worth.ground_loads.shape == (12, 5)


@pytest.mark.usefixtures("undrawn")
def test_a_sound_test_is_accepted_and_the_page_says_so(found: Estimate, worth: WorthOfTest) -> None:
    one = findings(found, worth)
    screen = verdict(one)
    not_held = [criterion.name for criterion in screen.criteria if not criterion.holds]
    assert not_held == [], screen.reasons
    assert screen.title == "Accept the test"
    assert any("no steps of unloading" in line for line in screen.open)
    assert not any("no check loads" in line for line in screen.open)
    page = read_page(page_html(calibration_page(one)))
    assert page.wrong == []
    for words in (
        "Accept the test",
        "Tested on 2026-03-03",
        "no steps of loading and unloading",
        "What would help",
        f"chi-square per reading {found.per_reading:.3g}, 1 is expected",
        f"squared distance from the files {found.from_priors:.3g}, 1 is expected",
    ):
        assert words in page.text
    assert [row[0] for row in page.tables["table-check_loads"][1:]] == list(CHECKS)
    assert page.tables["table-load_cells"][1] == ["A", "17", "2026-01-12", "10"]
    assert sum(tag == "img" for tag in page.tags) == 5


def test_an_estimate_that_did_not_settle_is_not_accepted(
    found: Estimate, worth: WorthOfTest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ground_test_page, "find_spec", lambda package: None)  # without figures
    one = findings(replace(found, settled=False), worth)
    screen = verdict(one)
    assert not screen.accepted
    assert "steps did not settle" in screen.reasons[0]
    assert f"{found.steps} steps, which did not settle" in read_page(page_html(calibration_page(one))).text


@pytest.mark.parametrize("larger", [0.1])
def test_what_does_not_hold_is_named_with_what_to_do(
    readings: tuple[ReadingsModel, Callable[[float], FloatArray]],
    found: Estimate,
    worth: WorthOfTest,
    larger: float,
) -> None:
    model, read = readings
    bad = replace(found, model=model.with_readings(read(larger)), chi_square=3.0 * found.chi_square)
    screen = verdict(findings(bad, replace(worth, after=2.0 * worth.exact)))
    assert screen.title == "Repeat parts of the test"
    names = [one.name.split(":")[0] for one in screen.criteria if not one.holds]
    assert names == [
        "Readings fit the model",
        "Sigma in flight, in units of a vehicle known exactly",
        "Check loads that were not fitted are predicted",
    ]
    assert any(f"apply further cases, first '{worth.further}'" in line for line in screen.reasons)
    assert any("1 of 2, off by" in line for line in screen.reasons)


def test_load_equations_are_written_with_coefficients_and_errors(found: Estimate) -> None:
    """A row for each gauge of each equation; applied to readings they give the applied loads."""
    equations = load_equations(found, 2.0)
    table = equations_table(found, equations)
    rows = [row for row in table.rows if row[0] == "normal force"]
    names = list(found.model.structure.gauges.names)
    assert len(rows) == len(equations[1].gauges) > 0
    assert all(abs(float(row[5] or 0.0)) >= 4.0 for row in rows)
    errors = found.model.errors(found.vector)
    strain = 1e6 * (found.model.test.readings - errors.zero[0])
    load = sum(float(row[3] or 0.0) * strain[:, names.index(str(row[2]))] for row in rows)
    np.testing.assert_allclose(load, equations[1].value(1e-6 * strain), rtol=1e-9)


@pytest.mark.usefixtures("undrawn")
def test_steps_show_hysteresis_and_return_to_zero(found: Estimate, worth: WorthOfTest) -> None:
    """One per cent of hysteresis at half of the load, and a zero that drifted by 2 um/m."""
    test, random = found.model.test, np.random.default_rng(8)
    case = test.cases[0]
    zero = found.model.errors(found.vector).zero[0]
    strain = case.reading - zero

    def step(part: float, unloading: bool, more: float = 0.0, drift: float = 0.0) -> LoadStep:
        reading = zero + part * strain + more * strain + drift + NOISE * random.standard_normal(len(zero))
        return LoadStep(part=part, unloading=unloading, reading=reading, reading_std=case.reading_std)

    steps = (step(0.0, False), step(0.5, False), step(0.5, True, more=0.01), step(0.0, True, drift=2e-6))
    stepped = replace(test, cases=(replace(case, steps=steps), *test.cases[1:]))
    (one,) = stepped_cases(stepped)
    np.testing.assert_allclose(one.change(one.same_load)[0][0], 0.01 * strain, atol=6.0 * NOISE)
    (zero,) = one.change(one.without_load)[0]
    np.testing.assert_allclose(zero, 2e-6, atol=6.0 * NOISE)
    model = found.model.with_readings(test.readings)
    model.test = stepped
    page = read_page(page_html(calibration_page(findings(replace(found, model=model), worth))))
    assert "readings do not return to zero: 2 um/m rms" in page.text
    assert page.tables["table-steps"][1][0] == case.name
    assert sum(tag == "img" for tag in page.tags) == 6


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("missing", "said"),
    sweep([("", ""), ("reportlab", "without PDF, "), ("matplotlib", "without figures and PDF, ")], [("", "")]),
)
def test_files_of_a_report_are_those_that_the_installed_packages_can_write(
    found: Estimate,
    worth: WorthOfTest,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    missing: str,
    said: str,
) -> None:
    for module in ("builder.reports.page.html", "builder.reports.calibration_page.ground_test_page"):
        monkeypatch.setattr(f"{module}.find_spec", lambda name: None if name == missing else find_spec(name))
    files, lines = write_report(findings(found, worth), tmp_path / "calibrated.h5")
    assert sorted(one.suffix for one in files) == [".csv", ".html", *([] if missing else [".pdf"])]
    assert all(one.stat().st_size > 1000 for one in files)
    assert not list(tmp_path.glob("*.pdf")) if missing else not lines
    assert said in " ".join(lines)
    assert missing in " ".join(lines)
