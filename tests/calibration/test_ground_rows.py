"""Ground tests as a trial: what is said of them, errors over the exactly known vehicle, some from end to end."""

from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest
from coarse_vehicle import COARSE
from drawn_tests import blank_test

from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.score.ground_rows import (
    CALIBRATION,
    ground_rows,
    refuse_unknown_tests,
    row_of,
    spoil_of,
    with_errors,
)
from builder.calibration.score.ground_world import GroundWorld, flights_of, ground_world, on_cells
from builder.calibration.score.simulated_test import standard_load_cases
from builder.campaign.snapshots import Snapshots, save_snapshots
from builder.structure.as_built.as_built_vehicle import Counts, exactly_built
from builder.trial.cases import Built, Case, GroundTest, GroundTests, Plan
from builder.trial.conditions import quantities
from builder.trial.readings import Readings
from builder.trial.score import MISSED, Row, judged, rms_ratios
from builder.truth.flow_table import FlowTable, save_flow_table
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolutions
from builder.vehicle.shape.geometry import surface_grid
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES


def case_of(built: Built | None = None, **entries: object) -> Case:
    return Case(error="a", group="alone", as_built=built or Built(), ground=GroundTest.model_validate(entries))


@pytest.mark.fast
def test_errors_of_a_case_are_what_the_file_says() -> None:
    """Errors that a test cannot have are refused."""
    built, random = exactly_built(Counts(gauge=3, region=4, joint=2)), np.random.default_rng(0)
    assert with_errors(case_of(), built, random).vector.tobytes() == built.vector.tobytes()
    errors = Built(set={"mass": -3.0, "joint_softness": 20.0, "region_modulus": 3.0}, signs=True)
    changed = with_errors(case_of(errors, taper_percent=2.0), built, random)
    assert np.abs(changed.mass) == pytest.approx([0.03])
    assert np.abs(changed.joint_softness) == pytest.approx([0.02, 0.02])
    assert set(np.abs(changed.region_modulus)) == {0.03}
    assert set(changed.wall_taper) == {0.02}
    zero = with_errors(case_of(zero_um_per_m=150.0), exactly_built(Counts(gauge=4000)), random).zero
    assert np.median(zero) == pytest.approx(75e-6, abs=15e-6)
    assert np.abs(zero).max() > 1000e-6  # heavy-tailed
    pads = blank_test(("a", "b", "c"), LoadErrors(), 1.0, 6)
    pads = replace(pads, cases=pads.cases[:6])
    with pytest.raises(InputError, match=r"ground.wrong: expected kgf, .* in this test, got 'attitude'"):
        spoil_of(GroundTest(wrong="attitude"), pads)
    with pytest.raises(InputError, match=r"ground.wrong: expected kgf, .*, wrong load; got 'kgs'"):
        refuse_unknown_tests((), [case_of(wrong="kgs")])


@pytest.mark.fast
def test_loads_stand_on_the_load_cells_in_turn() -> None:
    in_turn, errors = cycle(range(2)), LoadErrors(load=0.001)
    loads = [known for case in standard_load_cases(3, 2.0) for known in on_cells(case, errors, in_turn)]
    assert [known.load_cell for known in loads if known.on_load_cell] == ["1", "2", "1"]
    assert {known.std for known in loads if known.on_load_cell} == {0.001}


@pytest.mark.fast
def test_what_the_calibration_says_is_counted_by_test() -> None:
    names = ("refused", "named", "silent", "gauges_blamed", "cases_blamed", "per_reading")
    sound, blaming, refused = (
        dict(zip(names, values, strict=True))
        for values in ((0, 0, 0, 0.0, 0.0, 1.0), (0, 1, 0, 0.5, 0.0, 3.0), (1, 1, 0, 0.0, 0.0, np.nan))
    )
    row = row_of([sound, sound, blaming, refused])
    assert [row[f"{name}_percent"] for name in ("refused", "named", "refused_or_named")] == [25.0, 50.0, 50.0]
    assert [row[f"{name}_percent"] for name in ("blamed", "gauges_blamed", "silent")] == [25.0, 12.5, 0.0]
    assert row["chi_square_per_reading"] == pytest.approx(5.0 / 3.0)
    assert row["silent_percent_upper"] == 75.0  # three in four


@pytest.mark.fast
def test_errors_stand_over_those_of_the_exactly_known_vehicle() -> None:
    """With a standard error of pairs: the same errors twice as large are twice as large for certain."""
    error, other = np.random.default_rng(0).standard_normal((2, 400, 5))
    number = np.arange(400)
    read = Readings(
        strain=np.empty((400, 0)), known={}, truth=np.zeros((400, 5)), vehicle=number // 20, flight=number % 20
    )
    twice = np.array(rms_ratios(2.0 * error, error, read))
    np.testing.assert_allclose(twice, np.tile([2.0, 0.0], (5, 1)), atol=1e-9)
    case = Case(error="a", group="unobservable", at_most={"over_exact": 1.25})
    rows: list[Row] = [
        {"load": name, "over_exact": ratio, "over_exact_error": error}
        for name, (ratio, error) in zip(COEFFICIENT_NAMES, twice.tolist(), strict=True)
    ]
    verdict, why = judged(case, rows)
    assert (verdict, "over exact of C_A 2 +- " in why) == (MISSED, True)
    for ratio, of_ratio in rms_ratios(other, error, read):
        assert abs(ratio - 1.0) < 3.0 * of_ratio < 0.3


@pytest.mark.fast
@pytest.mark.parametrize("ratio", [1.0, 1.5])
def test_flights_are_of_the_pressure_above_that_of_the_air(vehicle: Vehicle, ratio: float) -> None:
    """The same pressure all over the surface acts on its base alone: C_A q S = (p - p_inf) A."""
    body, knots = vehicle.body(), np.radians([2.0, 5.0, 8.0, 11.0])
    grid = surface_grid(body, 40, 24)
    harmonic = np.zeros((4, 4, 40, 3))
    harmonic[..., 0] = ratio
    mach = np.linspace(4.0, 8.0, 4)
    table = FlowTable(vehicle="even", mach_knots=mach, incidence_knots=knots, harmonic=harmonic, provenance={})
    pressure, found = flights_of(vehicle, table, grid, 5)
    ambient, dynamic = (quantities(found.conditions, name) for name in ("ambient_pressure", "dynamic_pressure"))
    np.testing.assert_allclose(pressure, np.tile((ratio - 1.0) * ambient[:, None], 40 * 24), atol=1e-9)
    base = np.pi * body.radius(np.array([body.length]))[0] ** 2
    expected = (ratio - 1.0) * ambient * base / (dynamic * vehicle.reference_quantities().area)
    np.testing.assert_allclose(found.truth[:, 0], expected, rtol=1e-3, atol=1e-12)
    np.testing.assert_allclose(found.truth[:, 1:], 0.0, atol=1e-9)


KNOWN = ("linear Case 2, known exactly", "linear Case 2, before the test", "linear Case 2", "load equations")


@pytest.fixture(scope="module")
def world(
    vehicle: Vehicle, snapshots: Snapshots, table: FlowTable, tmp_path_factory: pytest.TempPathFactory
) -> GroundWorld:
    folder = tmp_path_factory.mktemp("ground")
    save_snapshots(snapshots, folder / "snapshots.h5")
    save_flow_table(table, folder / "flows.h5")
    finer = COARSE.model_copy(update={"element_length_mm": 30.0})
    vehicle = vehicle.model_copy(update={"resolution": Resolutions(map=COARSE, truth=finer)})
    options = GroundTests(walls="stated", proposed=False, draws=2)
    return ground_world(vehicle, folder / "snapshots.h5", folder / "flows.h5", 20, options)


@pytest.mark.slow
def test_a_tested_vehicle_flies_as_one_that_is_known(world: GroundWorld) -> None:
    rows = ground_rows(world, case_of(), Plan(vehicles=2, seed=0, estimators=list(KNOWN)))
    exact, before, tested, equations = (rows[name] for name in KNOWN)
    assert max(row["over_exact"] for row in tested[1:]) < 1.15
    assert max(row["over_exact"] for row in before[1:]) > 1.5
    assert max(row["rms"] / own["rms"] for row, own in zip(equations[1:], exact[1:], strict=True)) > 3.0
    assert min(row["covered_percent"] for row in tested[1:]) >= 97.5
    (said,) = rows[CALIBRATION]
    assert (said["load"], said["refused_percent"], said["blamed_percent"]) == ("test", 0.0, 0.0)
    assert 0.9 < said["chi_square_per_reading"] < 1.15  # the other mesh leaves 0.1
