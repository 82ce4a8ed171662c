"""Limits of the vehicle file: every number has a range, derived sizes have one, all faults are listed."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from annotated_types import Ge, Gt, Le, Lt
from changed_vehicle import TEXT, write_changed
from pydantic import BaseModel

from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.toml.entry_faults import _constraints, _models_in
from strainfmu.errors import FaultsError, InputError

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]

BY_CHECK = {"gamma", "internal_pressure_Pa", "depth_mm"}
"""A number or a word: a check of their own holds their range."""


def lines_of(path: Path) -> list[str]:
    """Return the lines of the refusal of a file, without its name."""
    with pytest.raises(InputError) as caught:
        load_vehicle(path)
    for line in caught.value.lines:
        assert line.startswith(f"{path}: ")
    return [line.removeprefix(f"{path}: ") for line in caught.value.lines]


def numbers(model: type[BaseModel], where: str = "") -> Iterator[tuple[str, set[str]]]:
    """Yield every entry that holds numbers, with the sides on which it is limited."""
    for name, field in model.model_fields.items():
        for section in _models_in(field.annotation):
            yield from numbers(section, f"{where}{name}.")
        if holds_number(field.annotation) and name not in BY_CHECK:
            found = list(_constraints(field))
            low, high = (
                any(isinstance(one, Ge | Gt) for one in found),
                any(isinstance(one, Le | Lt) for one in found),
            )
            yield f"{where}{name}", {side for side, held in (("low", low), ("high", high)) if held}


def holds_number(annotation: Any) -> bool:
    return annotation in (int, float) or any(holds_number(one) for one in get_args(annotation))


def test_every_number_has_a_range() -> None:
    found = dict(numbers(Vehicle))
    assert len(found) > 40
    assert [name for name, sides in found.items() if sides != {"low", "high"}] == []


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (
            "count = 9",
            "count = 1000000000",
            "gauges.layouts.configuration_1.rows.1.count: expected 2 .. 1000, got 1000000000",
        ),
        (
            "count = 9",
            "count = 1e9",
            "gauges.layouts.configuration_1.rows.1.count: expected a whole number, 2 .. 1000, got 1000000000.0",
        ),
        (
            "mach_number = [5.0, 5.5",
            "mach_number = [5.0, 1e300",
            "conditions.mach_number.2: expected 1.01 .. 30, got 1e+300",
        ),
        (
            "mach_number = [5.0, 5.25,",
            "mach_number = [1e300, 5.25,",
            "truth.mach_number.1: expected 1.01 .. 30, got 1e+300",
        ),
        (
            "youngs_modulus_GPa = 110.0",
            "youngs_modulus_GPa = 0.001",
            "material.youngs_modulus_GPa: expected 0.1 .. 2000, got 0.001",
        ),
        ("modes = 5", "gamma = 1e300", "map.gamma: expected 1e-12 .. 1e+12 or one of morozov, "),
        ("modes = 5", "gamma = true", "map.gamma: expected 1e-12 .. 1e+12 or one of morozov, "),
        (
            '= "ambient" # "ambient"',
            "= 1e300 #",
            "structure.internal_pressure_Pa: expected 'ambient' or 0 .. 1e+08, got 1e+300",
        ),
        (
            "mach_number = [5.0, 5.5, 6.0",
            "mach_number = [5.0, 5.5, 5.5",
            "conditions.mach_number: expected each value once, got 5.5 more than once",
        ),
        (
            "sideslip_angle_deg = [0.0",
            "sideslip_angle_deg = [0, -0.0",
            "conditions.sideslip_angle_deg: expected each value once, got 0 more than once",
        ),
        (
            "element_length_mm = 10.0",
            "element_length_mm = 5000.0",
            "resolution.map.element_length_mm: expected at most 360, 1/10 of the body's length, got 5000",
        ),
        ("moment_station_m = 2.0", "moment_station_m = 1e9", "expected -1000 .. 1000, got 1000000000.0"),
        (
            'layout = "configuration_2"',
            'layout = "configuration_2"\nrange_um_per_m = 1e6',
            "gauges.range_um_per_m: expected 1 .. 50000, got 1000000.0",
        ),
        ("roll_angle_deg = 180.0", "roll_angle_deg = 1e9", "expected -360 .. 360, got 1000000000.0"),
        (
            "mach_number = [5.0,",
            "mach_number = [5.5000000001,",
            "values at least 1e-06 apart, got 5.5 and ",
        ),
        ('name = "IC3X surrogate"', 'name = " "', "name: expected text, got ' '"),
        ('name = "IC3X surrogate"', f"name = '{'x' * 201}'", "name: expected at most 200 "),
        (
            "manoeuvre = ",
            'manoeuvre = "a\\u0000" #',
            "manoeuvre: expected printable text on one line, got ",
        ),
        ("manoeuvre = ", 'manoeuvre = "" #', "truth.manoeuvre: expected at least 1 "),
        ("modes = 5", "case = true", "map.case: expected 1 or 2, got True"),
        (
            'engine = "euler"',
            'leeward = "dry"',
            "leeward: expected 'ambient', 'prandtl_meyer' or 'matched'",
        ),
        (
            'engine = "euler"',
            'surface_length_unit = "yd"',
            "surface_length_unit: expected 'm', 'mm', ",
        ),
        (
            "first_x_m = 0.35, last_x_m = 3.30,",
            "first_x_m = 0.35, last_x_m = 0.35,",
            "rows.1: first_x_m, last_x_m: expected two stations, got 0.35 twice",
        ),
        (
            "first_x_m = 0.35, last_x_m = 3.30, count = 9",
            "x_m = [1.0, 1.5, 1.0]",
            "rows.1.x_m: expected each value once, got 1 more than once",
        ),
        (
            "roll_angle_deg = 90.0",
            "roll_angle_deg = -180.0",
            "configuration_1: rows.2: expected each gauge once, got the axial one at 0.35 m of rows.1 again",
        ),
        ("modes = 5", f"modes = {'9' * 400}", "map.modes: expected 1 .. 1000, got 999"),
        ("modes = 5", f"modes = {'9' * 5000}", "not a TOML file: "),
        ("[map]", f"x = {'[' * 5000}", "not a TOML file: "),
    ],
)
def test_value_beyond_its_limits(tmp_path: Path, old: str, new: str, line: str) -> None:
    found = lines_of(write_changed(tmp_path, (old, new)))
    assert len(found) == 1
    assert line in found[0]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            [
                ("[5.0, 5.5, 6.0, 6.5, 7.0]", str([2.0 + 0.01 * i for i in range(100)])),
                ("[0.0, 2.0, 4.0, 6.0, 8.0, 10.0]", str([0.01 * i for i in range(100)])),
            ],
            "conditions: expected at most 20000 conditions, got 100 x 100 x 3 x 1 = 30000",
        ),
        (
            [
                ("[5.0, 5.5, 6.0, 6.5, 7.0]", str([2.0 + 0.01 * i for i in range(100)])),
                ("surface_stations = 120", "surface_stations = 2000"),
            ],
            "conditions: expected at most 250000000 values of pressure, got 1800 conditions x 2000 x 72 nodes of "
            "resolution.map = 259200000",
        ),
        (
            [("first_x_m = 0.35, last_x_m = 3.30, count = 9", "first_x_m = 0.35, last_x_m = 3.30, count = 1000")]
            * 6,
            "gauges.layouts.configuration_2: expected at most 4096 gauges, got 6000",
        ),
        (
            [
                ("first_x_m = 0.35, last_x_m = 3.30, count = 9", "first_x_m = 0.35, last_x_m = 3.30, count = 900"),
                ("surface_stations = 240", "surface_stations = 2000"),
            ],
            "gauges.layouts.configuration_1: expected at most 250000000 strains per pressure, got 1809 gauges x "
            "2000 x 144 nodes of resolution.truth = 520992000",
        ),
        (
            [("element_length_mm = 6.0", "element_length_mm = 0.1"), ("wall_layers = 3", "wall_layers = 8")],
            "resolution.truth: expected at most 200000 elements, got 3.6 m / 0.1 mm x 8 wall_layers = 288000",
        ),
    ],
)
def test_derived_size_beyond_its_limit(tmp_path: Path, changes: list[tuple[str, str]], line: str) -> None:
    """Refused as the file is read, not after hours or by the lack of memory."""
    assert lines_of(write_changed(tmp_path, *changes)) == [line]


def test_all_faults_of_a_file_are_listed(tmp_path: Path, run: Run) -> None:
    path = write_changed(
        tmp_path,
        ("wall_thickness_mm = 4.0", "wall_thickness_mm = -4.0"),
        ("poisson_ratio = 0.31", "poisson_ratio = 0.7"),
        ("modes = 5", "modes = 0\nmodus = 3"),
        ("radial_cells = 24", 'radial_cells = "24"'),
    )
    expected = [
        "map.modus: unknown entry, did you mean modes?",
        "structure.wall_thickness_mm: expected 0.01 .. 1000, got -4.0",
        "material.poisson_ratio: expected 0 .. 0.499, got 0.7",
        "map.modes: expected 1 .. 1000, got 0",
        "resolution.map.radial_cells: expected a whole number, 8 .. 400, got '24'",
    ]
    assert lines_of(path) == expected
    code, _, message = run("check", path)
    assert code == 2
    assert message.splitlines() == [f"strainfmu: {path}: {line}" for line in expected]


def test_faults_between_sections_are_listed(tmp_path: Path) -> None:
    path = write_changed(
        tmp_path,
        ('support = "clamped_aft"', 'support = "free_flight"'),
        ("density_kg_per_m3 = 4430.0", ""),
        ('of_layout = "configuration_2"', 'of_layout = "other"'),
    )
    found = lines_of(path)
    assert len(found) == 2
    assert "needs material.density_kg_per_m3" in found[0]
    assert "'other' is not among the layouts" in found[1]
    path = write_changed(tmp_path, ("end_x_m = 3.6", "end_x_m = 1.6"), *[("count = 9", "count = 1000")] * 6)
    assert [line.partition(":")[0] for line in lines_of(path)] == [
        "profile segment 2",
        "gauges.layouts.configuration_2",
    ]


def test_many_faults_are_cut_off(tmp_path: Path) -> None:
    path = write_changed(tmp_path, ("[5.0, 5.5, 6.0, 6.5, 7.0]", str([0.1] * 100)))
    found = lines_of(path)
    assert len(found) == 41
    assert found[-1] == "60 more entries are wrong"


def test_file_with_a_byte_order_mark(tmp_path: Path) -> None:
    """As editors of Windows write it."""
    path = tmp_path / "vehicle.toml"
    path.write_text(TEXT, encoding="utf-8-sig")
    assert load_vehicle(path).name == "IC3X surrogate"
    path.write_text(TEXT, encoding="utf-16")
    with pytest.raises(InputError, match="not a TOML file") as caught:
        load_vehicle(path)
    assert "\n" not in str(caught.value)


def test_path_as_text_and_as_path() -> None:
    assert load_vehicle(str(IC3X)) == load_vehicle(Path(IC3X))


def test_faults_are_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(FaultsError) as caught:
        load_vehicle(write_changed(tmp_path, ("modes = 5", "modes = 0")))
    assert isinstance(caught.value, InputError)
    assert caught.value.exit_code == 2
