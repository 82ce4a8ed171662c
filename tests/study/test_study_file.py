"""The file of a trade study: combinations, entries that are set, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from builder.study.run import flows_key
from builder.study.study_file import designs_of, load_study, vehicle_of
from builder.vehicle.file import IC3X, Vehicle
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

SWEEP = '"structure.wall_thickness_mm" = [3.0, 4.0, 5.0]\n"map.estimator" = ["linear", "nonlinear"]\n'


def write(folder: Path, sweep: str = SWEEP, more: str = "", vehicle: str = "ic3x.toml") -> Path:
    for name in ("ic3x.toml", "ic3x_manoeuvre.csv"):
        (folder / name).write_bytes((IC3X.parent / name).read_bytes())
    path = folder / "study.toml"
    path.write_text(f'vehicle = "{vehicle}"\n[sweep]\n{sweep}{more}')
    return path


def test_all_combinations_are_designs(tmp_path: Path) -> None:
    designs = designs_of(load_study(write(tmp_path)))
    assert [tuple(one.values.values()) for one in designs] == [
        (thickness, estimator) for thickness in (3.0, 4.0, 5.0) for estimator in ("linear", "nonlinear")
    ]
    assert [one.name for one in designs][-1] == "design_0006"


def test_values_are_those_of_the_vehicle(tmp_path: Path) -> None:
    more = '[set]\n"profile.2.end_x_m" = 3.5\n"mass.lateral_g" = 4.0\n'
    path = write(tmp_path, more=more)
    study = load_study(path)
    vehicle = vehicle_of(path, study, designs_of(study)[2])
    assert (vehicle.structure.wall_thickness_mm, vehicle.map.estimator) == (4.0, "linear")
    assert vehicle.body().length == 3.5
    assert vehicle.mass is not None
    assert vehicle.mass.lateral_g == 4.0
    assert vehicle.manoeuvre() == tmp_path / "ic3x_manoeuvre.csv"


@pytest.mark.parametrize(
    ("sweep", "shares"),
    [
        ('"structure.wall_thickness_mm" = [3.0, 4.0]', True),
        ('"gauges.layout" = ["configuration_1", "configuration_2"]', True),
        ('"noise.gauge_gain_percent" = [1.0, 2.0]', True),
        ('"structure.internal_pressure_Pa" = ["ambient", 0.0]', False),
        ('"profile.1.half_angle_deg" = [5.0, 6.0]', False),
        ('"resolution.map.radial_cells" = [12, 24]', False),
    ],
)
def test_designs_share_flows_that_no_entry_changes(tmp_path: Path, sweep: str, shares: bool) -> None:
    path = write(tmp_path, sweep + "\n")
    study = load_study(path)
    one, other = (flows_key(vehicle_of(path, study, design)) for design in designs_of(study))
    assert (one == other) == shares


@pytest.mark.parametrize(
    ("sweep", "more", "text"),
    [
        ('"map.mods" = [3]\n', "", "design 1 (map.mods = 3): "),
        ('"map.mods" = [3]\n', "", "map.mods: unknown entry, did you mean modes?"),
        ('"structure.wall_thickness_mm" = [4.0, -1.0]\n', "", "design 2 (structure.wall_thickness_mm = -1.0): "),
        ('"profile.3.end_x_m" = [3.0]\n', "", "profile.3.end_x_m: expected a number from 1 to 2 for '3'"),
        (
            '"gauges.layouts.configuration_2.rows.1.first_x_m" = [0.35, 0.05]\n',
            "",
            "first_x_m = 0.05): gauges.layouts.configuration_2.rows.1: station 0.05 m found",
        ),
        ('"name.x" = [3.0]\n', "", "name.x: expected an entry of a section, got a part of another entry"),
        ('"map.modes" = []\n', "", "sweep.map.modes: "),
        ('"map.modes" = [3, 3]\n', "", "sweep.map.modes: expected each value once, got [3, 3]"),
        ('"map.modes" = [3]\n', '[set]\n"map.modes" = 4\n', "expected in one of [set] and [sweep], got both"),
        ('"map.modes" = [3]\n', "[trial]\ndraws = 0\n", "trial.draws: expected 1 .. 10000, got 0"),
    ],
)
def test_a_wrong_study_is_one_line(tmp_path: Path, sweep: str, more: str, text: str) -> None:
    path = write(tmp_path, sweep, more)
    with pytest.raises(InputError) as refused:
        vehicles(path)
    assert len(refused.value.lines) == 1
    assert text in str(refused.value)
    assert str(refused.value).startswith(str(path))


def vehicles(path: Path) -> list[Vehicle]:
    study = load_study(path)
    return [vehicle_of(path, study, design) for design in designs_of(study)]


def test_a_missing_vehicle_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"vehicle: expected a vehicle file next to it, got 'other\.toml'"):
        load_study(write(tmp_path, vehicle="other.toml"))
