"""Cases of a trial: files that are shipped, rows for a vehicle, and classes by what its file states."""

from pathlib import Path

import pytest
from trial_cases import with_entries

from builder.structure.as_built_kinds import ALWAYS_DRAWN, IN_NOISE
from builder.trial.cases import FILES, Case, cases_for, load_trial
from builder.vehicle.file import IC3X, VEHICLES, Vehicle, load_vehicle
from builder.vehicle.map_options import HARDWARE_ERRORS, Noise
from builder.vehicle.structure_section import Mass
from strainfmu.errors import FaultsError, InputError

pytestmark = pytest.mark.fast

STRESS, SHIPPED = load_trial("stress"), load_vehicle(IC3X)


def of(vehicle: Vehicle, error: str) -> list[Case]:
    return [case for case in cases_for(vehicle, STRESS) if case.error == error]


@pytest.mark.parametrize("name", sorted(path.stem for path in FILES.glob("*.toml")))
def test_shipped_files_have_rows_of_distinct_names(name: str) -> None:
    trial = load_trial(name)
    cases = cases_for(SHIPPED, trial)
    assert cases or trial.closed_loop
    assert len({case.name for case in cases}) == len(cases)
    assert {case.group for case in cases} <= {"drawn", "alone", "beyond", "unobservable"}


@pytest.mark.parametrize("name", ["ic3x", "finned_body", "elliptic_cone", "launcher", "blunt_cone"])
def test_every_shipped_vehicle_has_its_own_rows(name: str) -> None:
    vehicle = load_vehicle(VEHICLES / f"{name}.toml")
    errors = {case.error for case in cases_for(vehicle, STRESS)}
    shape, revolved = {"angle near its largest"}, {"incidence near its largest", "angles mirrored"}
    assert (revolved if vehicle.is_axisymmetric else shape) <= errors
    assert not (shape if vehicle.is_axisymmetric else revolved) & errors
    sizes = [case.size for case in of(vehicle, "another engine")]
    assert sizes[0].startswith("newtonian")
    assert len(sizes) == 1 + vehicle.is_axisymmetric


def test_every_stated_error_is_tried_alone_and_no_other() -> None:
    assert {kind.entry for kind in IN_NOISE} == set(HARDWARE_ERRORS)

    def rows(noise: Noise) -> list[Case]:
        vehicle = SHIPPED.model_copy(update={"noise": noise})
        return [case for case in cases_for(vehicle, STRESS) if case.as_built.signs]

    assert len(rows(Noise(std_um_per_m=1.0, wall_thickness_percent=0.0))) == len(ALWAYS_DRAWN) - 1
    turned = rows(Noise(std_um_per_m=1.0, row_orientation_deg=1.5))[-1]
    assert (turned.error, turned.size) == ("orientation of each row of gauges", "+-3 deg")
    assert [case.size for case in rows(Noise(std_um_per_m=1.0, clamp_compliance_mm=2.0))][-2:] == ["+-4 mm"] * 2
    assert rows(Noise(std_um_per_m=1.0, model="paper")) == []


def test_classes_and_sizes_follow_from_the_file() -> None:
    for stated, group in ((1.0, "alone"), (0.9, "beyond"), (0.0, "beyond")):
        (case,) = of(with_entries(SHIPPED, "noise", wall_thickness_percent=stated), "wall thickness")[-1:]
        assert (case.size, case.group) == ("+2 %", group)
    for stated, group in ((1.0, "beyond"), (5.0, "alone")):
        case = of(with_entries(SHIPPED, "noise", dynamic_pressure_percent=stated), "dynamic pressure")[-1]
        assert (case.size, case.group) == ("+10 %", group)
    listed = with_entries(SHIPPED, "map", estimator="linear", symmetry="listed")
    absolute = with_entries(SHIPPED, "map", estimator="linear", form="absolute")
    assert of(SHIPPED, "angles mirrored")[0].group == "alone"
    assert of(listed, "angles mirrored")[0].group == "beyond"
    assert {case.group for case in of(SHIPPED, "altitude")} == {"alone"}
    assert {case.group for case in of(absolute, "altitude")} == {"beyond"}
    assert of(absolute, "dynamic pressure computed") == []


def test_the_class_of_inertia_follows_from_the_file() -> None:
    def groups(vehicle: Vehicle) -> list[str]:
        return [case.group for case in cases_for(vehicle, STRESS) if case.inertia is not None]

    assert groups(with_entries(SHIPPED, "map", estimator="linear")) == 3 * ["unobservable"]
    assert groups(SHIPPED) == 3 * ["unobservable"]
    weak = SHIPPED.model_copy(update={"mass": Mass(lateral_g=1.0, vibration_um_per_m=1.0)})
    assert groups(weak) == ["drawn", "beyond", "alone", *(3 * ["beyond"]), "alone"]
    strong = SHIPPED.model_copy(update={"mass": Mass(unlisted_kg=1.0)})
    assert groups(strong) == ["drawn", *(6 * ["alone"])]


@pytest.mark.parametrize(
    ("vehicle", "inertia", "flow"),
    [
        (SHIPPED, None, None),
        (with_entries(SHIPPED, "map", estimator="linear"), None, 0.1),
        (with_entries(SHIPPED, "map", estimator="linear", model_form_percent=0.0), None, None),
        (SHIPPED.model_copy(update={"mass": Mass(lateral_g=3.0, vibration_um_per_m=1.0)}), 3.0, None),
    ],
)
def test_all_stated_errors_are_drawn_together_first(
    vehicle: Vehicle, inertia: float | None, flow: float | None
) -> None:
    """The sizes are the ones that sigma is made of; the tables of a nonlinear map hold errors of the pressure."""
    case = cases_for(vehicle, STRESS)[0]
    assert (case.error, case.name, case.group) == ("all_stated", "all_stated ", "drawn")
    assert case.as_built.stated == 1.0
    assert case.air.drawn
    assert (None if case.inertia is None else case.inertia.load_factor) == inertia
    assert (None if case.flow is None else case.flow.drawn) == flow
    assert case.inertia is None or case.inertia.drawn
    assert case.map_errors == (vehicle.map.estimator == "nonlinear")
    assert case.as_built.set == ({"internal_pressure": 0.0} if case.map_errors else {})


FAULTS = """
[[group]]
class = "beyond"
cases = [{ error = "a", fault = { of = 0 } }, { error = "b", faults = {} }, { error = "c", class = "none" }]
"""


def test_wrong_entries_are_named_a_line_each(tmp_path: Path) -> None:
    path = tmp_path / "trial.toml"
    path.write_text(FAULTS)
    with pytest.raises(FaultsError) as error:
        load_trial(path)
    lines = sorted(error.value.lines)
    assert [line.removeprefix(f"{path}: group.1.cases.").partition(",")[0] for line in lines] == [
        "1.fault.of: expected at least 1",
        "2.faults: unknown entry",
        "3.class: expected 'drawn'",
    ]
    for entries, message in (
        ('{ error = "a", when = ["not round"] }', r"'a ': expected properties of the vehicle, .*, got 'round'"),
        ('{ error = "a", built = { set = { colour = 1.0 } } }', "'a ': expected kinds of error, .*, got 'colour'"),
        (
            '{ error = "a" }, { error = "a" }',
            r"^.*trial\.toml: cases: expected each error and size once, got 'a '",
        ),
        ('{ error = "a", built = { set = { wall_taper = -150.0 } } }', "wall_taper: expected more than -100 %"),
        (
            '{ error = "a", where = { incidence = [0.8, 0.2] } }',
            "where.incidence: expected the smaller number first",
        ),
        (
            '{ error = "a", where = { altitudes_km = [-5.0, 10.0] } }',
            r"altitudes_km.1: expected 0 \.\. 71, got -5.0",
        ),
        ('{ error = "a", where = { edge = [1.0] } }', "where.edge: expected at least 2 values"),
        ('{ error = "a", where = { altitude_km = 9.0, altitudes_km = [5.0, 9.0] } }', "altitudes_km, got both"),
        ('{ error = "a", tenths_by = ["mach"] }', "tenths_by.1: expected 'mach_number', .*, got 'mach'"),
        (
            '{ error = "a", at_most = { flaged_percent = 5.0 } }',
            "expected aims of columns, .*, got 'flaged_percent'",
        ),
        ('{ error = "a", draws = 0.0 }', "draws: expected above 0, got 0.0"),
    ):
        path.write_text(f'[[group]]\nclass = "alone"\ncases = [{entries}]')
        with pytest.raises(InputError, match=message):
            cases_for(SHIPPED, load_trial(path))
    with pytest.raises(InputError, match=r"^nothing: expected the path of a file, .* stress, uncertainty"):
        load_trial("nothing")
    with pytest.raises(InputError, match=r"^--only: expected errors of all_stated, .*, got 'colour'$"):
        cases_for(SHIPPED, STRESS, ["colour"])
