"""The file of a trade study: combinations, entries that are set, and what is refused."""

import csv
import pickle
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from coarse_vehicle import COARSE
from undrawn_figures import draw_nothing

from builder import study as study_module
from builder.study import SCORES, TABLE, designs_of, flows_key, load_study, run_study, vehicle_of
from builder.trial.run import Task, run_tasks
from builder.vehicle.file import IC3X
from strainfmu.errors import InputError

SWEEP = '"structure.wall_thickness_mm" = [3.0, 4.0, 5.0]\n"map.estimator" = ["linear", "nonlinear"]\n'


def write(folder: Path, sweep: str = SWEEP, more: str = "", vehicle: str = "ic3x.toml") -> Path:
    for name in ("ic3x.toml", "ic3x_manoeuvre.csv"):
        (folder / name).write_bytes((IC3X.parent / name).read_bytes())
    path = folder / "study.toml"
    path.write_text(f'vehicle = "{vehicle}"\n[sweep]\n{sweep}{more}')
    return path


@pytest.mark.fast
def test_all_combinations_are_designs_with_their_values(tmp_path: Path) -> None:
    path = write(tmp_path, more='[set]\n"profile.2.end_x_m" = 3.5\n"mass.lateral_g" = 4.0\n')
    study = load_study(path)
    designs = designs_of(study)
    assert [tuple(one.values.values()) for one in designs] == [
        (thickness, estimator) for thickness in (3.0, 4.0, 5.0) for estimator in ("linear", "nonlinear")
    ]
    assert designs[-1].name == "design_0006"
    vehicle = vehicle_of(path, study, designs[2])
    assert (vehicle.structure.wall_thickness_mm, vehicle.map.estimator) == (4.0, "linear")
    assert vehicle.body().length == 3.5
    assert vehicle.mass is not None
    assert vehicle.mass.lateral_g == 4.0
    assert vehicle.manoeuvre() == tmp_path / "ic3x_manoeuvre.csv"
    with pytest.raises(InputError, match=r"vehicle: expected a vehicle file next to it, got 'other\.toml'"):
        load_study(write(tmp_path, vehicle="other.toml"))


@pytest.mark.fast
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


@pytest.mark.fast
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
        [vehicle_of(path, study, design) for study in [load_study(path)] for design in designs_of(study)]
    assert len(refused.value.lines) == 1
    assert text in str(refused.value)
    assert str(refused.value).startswith(str(path))


ENTRIES = COARSE.model_dump().items()
COARSE_LINES = [f'"resolution.{way}.{name}" = {value}' for way in ("map", "truth") for name, value in ENTRIES]
FAST = """
[set]
"aerodynamics.engine" = "newtonian"
"truth.engine" = "newtonian"
"map.estimator" = "linear"
"map.alarm_levels" = "nominal"
{}
[trial]
conditions = 20
draws = 2
""".format("\n".join(COARSE_LINES))


def pickled(tasks: Sequence[Task], *arguments: Any, **options: Any) -> Any:
    """Run tasks as other processes get them: that these give the same is tested of trials, which run alike."""
    return run_tasks(pickle.loads(pickle.dumps(tasks)), *arguments, **options)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A study of noise, at Mach numbers of the vehicle and at some where it has no flows of the truth."""
    folder = tmp_path_factory.mktemp("study")
    sweep = '"conditions.mach_number" = [[5.0, 6.0, 7.0], [8.0, 9.0, 10.0]]\n'
    path = write(folder, sweep + '"noise.percent_of_median_strain" = [1.0, 4.0]\n', FAST)
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch.setattr)
        patch.setattr(study_module, "run_tasks", pickled)
        run_study(path, folder / "out", workers=1)
    return path, folder / "out"


def test_more_noise_errs_more_and_flows_are_solved_once(done: tuple[Path, Path]) -> None:
    with (done[1] / TABLE).open(newline="") as file:
        rows = list(csv.DictReader(file))
    for name in ("C_N", "C_Y", "M_P", "M_Y"):
        quiet, noisy = (row for row in rows if row["load"] == name)
        assert [row["noise.percent_of_median_strain"] for row in (quiet, noisy)] == ["1", "4"]
        assert float(noisy["sigma"]) > float(quiet["sigma"]) > 0.0
        assert min(float(row["covered_percent"]) for row in (quiet, noisy)) > 95.0
    assert (quiet["samples"], quiet["vehicles"], quiet["flights"]) == ("40", "40", "20")
    folders = sorted(one.name for one in done[1].iterdir() if one.is_dir())
    assert folders == [*(f"design_000{k}" for k in range(1, 5)), "flows_0001", "flows_0002", SCORES]
    assert not list(done[1].glob("design_*/snapshots.h5"))


def test_a_second_run_reuses_what_is_there_and_a_design_that_fails_leaves_the_others(
    done: tuple[Path, Path], run: Callable[..., tuple[int, str, str]]
) -> None:
    path, out = done
    before = {one: one.stat().st_mtime_ns for one in (out / SCORES).iterdir()}
    assert len(before) == 2
    code, _, errors = run("study", path, "-o", out, "--workers", 1)
    assert {one: one.stat().st_mtime_ns for one in before} == before
    first, second = errors.splitlines()
    assert code == 1
    assert first.startswith("strainfmu: design_0003 (conditions.mach_number = [8.0, 9.0, 10.0], noise")
    assert second.startswith("strainfmu: design_0004 (conditions")
