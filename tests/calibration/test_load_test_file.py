"""The file of a ground test: what it holds, and one line for each fault."""

from pathlib import Path

import numpy as np
import pytest

from builder.calibration.ground_test.ground_test_readings import read_load_test
from builder.calibration.ground_test.load_test_file import WrittenCase, read_test_file, write_load_test
from builder.structure.loads.applied import (
    Load,
    PadForce,
    PadPressure,
    PointForce,
    SectionLoad,
    SurfaceForce,
    SurfacePressure,
    Weight,
)
from builder.structure.loads.temperature import TemperatureField
from strainfmu.errors import FaultsError, InputError

pytestmark = pytest.mark.fast

GAUGES = ("a", "b", "c")

FILE = """
name = "static test"
[readings]
recording = "test.csv"
[errors]
load_percent = 0.4
pad_position_mm = 3.0
[[case]]
name = "level"
window_s = [0.0, 0.95]
[[case.load]]
kind = "weight"
[[case]]
name = "pad"
window_s = [1.0, 1.95]
temperature_K = 4.0
zeros = "second day"
[[case.load]]
kind = "weight"
[[case.load]]
kind = "pad"
x_m = 1.0
roll_angle_deg = 90.0
half_length_mm = 50.0
half_angle_deg = 30.0
force_N = [0.0, -1500.0, 0.0]
std_percent = 0.2
"""


def write_recording(folder: Path, strain: np.ndarray, heading: str = "a,b,c") -> None:
    """Write samples (n, 3) [m/m] at 20 Hz."""
    rows = [f"{0.05 * k:.9g},{','.join(repr(float(v)) for v in row)}" for k, row in enumerate(strain)]
    (folder / "test.csv").write_text("\n".join([f"time,{heading}", *rows]))


def two_steps(folder: Path, noise: float = 1e-7) -> np.ndarray:
    """Write 20 samples at one strain and 20 at another; return them."""
    random = np.random.default_rng(3)
    level = np.repeat(np.array([[1e-5, 2e-5, -1e-5], [3e-5, -2e-5, 0.0]]), 20, axis=0)
    strain = level + noise * random.standard_normal(level.shape)
    write_recording(folder, strain)
    return strain


def written(folder: Path, text: str = FILE) -> Path:
    path = folder / "loadtest.toml"
    path.write_text(text)
    return path


def test_file_gives_loads_and_how_exactly_they_are_known(tmp_path: Path) -> None:
    strain = two_steps(tmp_path)
    test, notes = read_load_test(read_test_file(written(tmp_path)), GAUGES)
    assert notes == ()
    level, pad = test.cases
    assert [type(known.load) for known in pad.loads] == [Weight, PadForce, TemperatureField]
    assert [known.std for known in pad.loads] == pytest.approx([0.0, 0.002, 0.0])
    assert [known.on_load_cell for known in pad.loads] == [False, True, False]
    assert (pad.group, level.group) == ("second day", "1")
    assert (test.errors.pad_position, test.errors.common) == pytest.approx((0.003, 0.005))
    load = pad.loads[1].load
    assert isinstance(load, PadForce)
    assert (load.roll_angle, load.half_length, load.half_angle) == pytest.approx((np.pi / 2, 0.05, np.pi / 6))
    np.testing.assert_allclose(test.readings, [strain[:20].mean(axis=0), strain[20:].mean(axis=0)], rtol=1e-12)


def test_standard_deviation_is_that_of_a_mean(tmp_path: Path) -> None:
    """Windows that are alike: their pooled scatter over the root of the number of samples, and the stated one."""
    strain = two_steps(tmp_path)
    found, _ = read_load_test(read_test_file(written(tmp_path)), GAUGES)
    pooled = np.sqrt(0.5 * (strain[:20].var(axis=0, ddof=1) + strain[20:].var(axis=0, ddof=1)))
    np.testing.assert_allclose(found.reading_stds, np.tile(pooled / np.sqrt(20), (2, 1)), rtol=1e-9)
    drifting = FILE.replace("[errors]", "reading_std_um_per_m = 0.3\n[errors]")
    found, _ = read_load_test(read_test_file(written(tmp_path, drifting)), GAUGES)
    np.testing.assert_allclose(
        found.reading_stds, np.tile(np.hypot(pooled / np.sqrt(20), 3e-7), (2, 1)), rtol=1e-9
    )


def test_single_rows_need_a_stated_deviation(tmp_path: Path) -> None:
    two_steps(tmp_path)
    rows = FILE.replace("window_s = [0.0, 0.95]", "row = 1").replace("window_s = [1.0, 1.95]", "row = 40")
    with pytest.raises(InputError, match=r"reading_std_um_per_m: expected more than 0"):
        read_load_test(read_test_file(written(tmp_path, rows)), GAUGES)
    stated = rows.replace("[errors]", "reading_std_um_per_m = 0.5\n[errors]")
    np.testing.assert_allclose(
        read_load_test(read_test_file(written(tmp_path, stated)), GAUGES)[0].reading_stds, 5e-7
    )


def test_lost_and_dead_channels_and_moving_loads_are_said(tmp_path: Path) -> None:
    strain = two_steps(tmp_path)
    strain[:20, 0] = np.nan
    strain[:, 1] = 3e-6
    strain[20:30, 2] += 5e-6
    write_recording(tmp_path, strain)
    found, said = read_load_test(read_test_file(written(tmp_path)), GAUGES)
    assert np.isnan(found.readings[0, 0])
    assert np.isfinite(found.readings[1, 0])
    assert np.isnan(found.readings[:, 1]).all()
    lines = "\n".join(said)
    (line,) = found.left_out
    assert line.endswith(
        "gauge 'b': railed or frozen, 100 % of its samples in test.csv stand at 3 um/m; left out of all cases"
    )
    assert line in lines
    assert "case 'level': 1 gauges without a reading" in lines
    assert "case 'pad': strain moves by 4.99 um/m" in lines


def test_channels_file_of_the_recorder_is_used(tmp_path: Path) -> None:
    strain = two_steps(tmp_path)
    write_recording(tmp_path, 1e6 * strain, "ch0,ch1,load cell")
    channels = "[defaults]\nunit = 'um/m'\n[[channel]]\nname = 'ch1'\ngauge = 'a'\n"
    (tmp_path / "channels.toml").write_text(channels + "[[channel]]\nname = 'ch0'\ngauge = 'b'\nsign = -1\n")
    text = FILE.replace("[errors]", "channels = 'channels.toml'\n[errors]")
    found, said = read_load_test(read_test_file(written(tmp_path, text)), GAUGES)
    np.testing.assert_allclose(found.readings[1, :2], [strain[20:, 1].mean(), -strain[20:, 0].mean()], rtol=1e-9)
    assert np.isnan(found.readings[:, 2]).all()
    assert any("gauge 'c' has no reading in any case" in line for line in said)


def test_baselines_alone_are_no_test(tmp_path: Path) -> None:
    two_steps(tmp_path)
    text = FILE[: FILE.index("[[case.load]]")]
    with pytest.raises(InputError, match=r"loadtest\.toml: case: expected a load in one case or more"):
        read_load_test(read_test_file(written(tmp_path, text)), GAUGES)


def test_steps_and_check_loads_are_read_and_not_fitted(tmp_path: Path) -> None:
    """Steps in the order of time, those after the whole load are unloading; a check load has readings as well."""
    random = np.random.default_rng(4)
    level = np.repeat(1e-6 * np.array([[0.0], [5.0], [10.0], [6.0], [1.0]]), 10, axis=0)
    write_recording(tmp_path, level * np.array([1.0, 2.0, -1.0]) + 1e-8 * random.standard_normal((50, 3)))
    steps = "".join(
        f"[[case.step]]\nload_percent = {part}\nwindow_s = [{0.5 * k}, {0.5 * k + 0.45}]\n"
        for k, part in ((4, 0), (3, 50), (1, 50))
    )
    text = FILE.replace("[0.0, 0.95]", "[0.0, 0.45]").replace("[1.0, 1.95]", "[1.0, 1.45]\ncheck = true") + steps
    text = text.replace('name = "static test"', 'name = "static test"\ntested_on = 2026-03-03')
    file = read_test_file(written(tmp_path, text + "[[load_cell]]\nname = '1'\nserial_number = 'A 17'\n"))
    assert (str(file.tested_on), file.load_cell[0].serial_number) == ("2026-03-03", "A 17")
    test, _ = read_load_test(file, GAUGES)
    assert test.fitted.tolist() == [True, False]
    found = test.cases[1].steps
    assert [(one.part, one.unloading) for one in found] == [(0.5, False), (0.5, True), (0.0, True)]
    np.testing.assert_allclose([1e6 * one.reading[1] for one in found], [10.0, 12.0, 2.0], atol=0.02)
    checks = text.replace("[errors]", "[errors]").replace('name = "level"', 'name = "level"\ncheck = true')
    with pytest.raises(InputError, match=r"case: expected one without check or more, got check loads alone"):
        read_load_test(read_test_file(written(tmp_path, checks)), GAUGES)


LOADS: tuple[Load, ...] = (
    PadForce(station=1.0, roll_angle=0.3, half_length=0.05, half_angle=0.5, force=(0.0, 10.0, -1e3)),
    PadPressure(station=1.0, roll_angle=-0.3, half_length=0.05, half_angle=0.5, push=800.0),
    PointForce(station=0.5, roll_angle=1.0, force=(1.0, 2.0, 3.0)),
    SectionLoad(station=0.2, force=(-5e3, 0.0, 0.0), moment=(10.0, 20.0, 30.0)),
    SectionLoad(station=0.2, moment=(10.0, 20.0, 30.0)),
    SurfaceForce(surface="outer", force=(0.0, 0.0, 5.0)),
    SurfacePressure(surface="inner", pressure=1e5),
    Weight(up_roll_angle=np.pi / 2, nose_elevation=0.1),
)


def test_written_file_reads_back(tmp_path: Path) -> None:
    path = tmp_path / "loadtest.toml"
    cases = [WrittenCase(name=f"case {k}", loads=(load,), window=(k, k + 0.5)) for k, load in enumerate(LOADS)]
    write_load_test(path, 'a "test"', cases, {"recording": None}, {"load_percent": 0.3}, head=["as proposed"])
    file = read_test_file(path)
    assert file.name == 'a "test"'
    assert (file.errors.load_percent, file.readings.recording) == (0.3, None)
    for case, load in zip(file.case, LOADS, strict=True):
        found = case.load[0].load()
        assert type(found) is type(load)
        for name, value in vars(load).items():
            held = getattr(found, name)
            assert held == value if isinstance(value, str) else held == pytest.approx(value, rel=1e-11, abs=1e-11)


def test_temperature_is_a_mode_round_the_body(tmp_path: Path) -> None:
    entry = "kind = 'temperature'\nx_m = [0.0, 2.0]\ntemperature_K = [10.0, 0.0]\nharmonic = 1\n"
    file = read_test_file(written(tmp_path, f"name = 't'\n[[case]]\nname = 'hot'\n[[case.load]]\n{entry}"))
    load = file.case[0].load[0].load()
    assert isinstance(load, TemperatureField)
    where = np.array([0.0, 1.0]), np.array([0.0, np.pi]), np.zeros(2)
    np.testing.assert_allclose(load.at(*where), [10.0, -5.0], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (FILE.replace("force_N", "force_kN"), r"case\.2\.load\.2\.force_kN: unknown entry.*force_N"),
        (FILE.replace('"pad"\nx', '"pod"\nx'), r"case\.2\.load\.2\.kind: expected 'pad', 'push', .*, got 'pod'"),
        (FILE.replace('kind = "pad"\n', ""), r"case\.2\.load\.2\.kind: entry is missing, expected 'pad'"),
        (FILE.replace("x_m = 1.0\n", ""), r"case\.2\.load\.2\.x_m: entry is missing"),
        (FILE.replace("[0.0, -1500.0, 0.0]", "[0.0, 1.0]"), r"load\.2\.force_N: expected at least 3 values"),
        (FILE.replace('"pad"\nw', '"level"\nw'), r"case\.2\.name: expected each name once, got 'level' again"),
        (FILE.replace("[1.0, 1.95]", "[1.95, 1.0]"), r"case\.2\.window_s: expected two rising times"),
        (FILE.replace("load_percent = 0.4", "load_percent = -1"), r"errors\.load_percent: expected .*0 .. 100"),
        (FILE.replace("temperature_K = 4.0", "row = 3"), r"case\.2: expected window_s or row, got both"),
        ("name = 'x'", r"case: entry is missing"),
        (
            FILE + "[[load_cell]]\nname = 'A'\n",
            r"case\.2\.load\.2\.load_cell: expected one of A, got '1'",
        ),
        (
            FILE + "[[case.step]]\nload_percent = 50\nrow = 2\nwindow_s = [1, 2]\n",
            r"case\.2\.step\.1: expected window_s or row, got both",
        ),
    ],
)
def test_faults_name_the_entry(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(FaultsError, match=line):
        read_test_file(written(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            FILE.replace("[1.0, 1.95]", "[9.0, 9.5]"),
            r"case\.2\.window_s: 'pad': expected times of .*, 0 to 1.95 s, got \[9\.0, 9\.5\]",
        ),
        (FILE.replace("window_s = [1.0, 1.95]", "row = 41"), r"case\.2\.row: 'pad': expected at most 40"),
        (
            FILE.replace("window_s = [1.0, 1.95]\n", ""),
            r"case\.2\.window_s: 'pad': entry is missing, expected it or row",
        ),
        (
            FILE.replace("window_s = [0.0, 0.95]\n", "").replace("window_s = [1.0, 1.95]\n", ""),
            r"case\.1\.window_s: 'level': entry is missing.*\n.*case\.2\.window_s: 'pad': entry is missing",
        ),
        (FILE.replace('recording = "test.csv"\n', ""), r"case\.1\.recording: entry is missing"),
        (FILE.replace("test.csv", "other.csv"), r"other\.csv: no such file"),
        (
            FILE.replace("[1.0, 1.95]", "[1.0, 2.5]"),
            r"case\.2\.window_s: 'pad': expected times of the recording, 0 to 1.95 s, got \[1\.0, 2\.5\]",
        ),
        (
            FILE.replace("[1.0, 1.95]", "[0.9, 1.9]"),
            r"case\.2\.window_s: 'pad': expected .* case\.1 'level', \[0\.0, 0\.95\] s, got \[0\.9, 1\.9\]",
        ),
        (
            FILE.replace("window_s = [0.0, 0.95]", "row = 7").replace("window_s = [1.0, 1.95]", "row = 7"),
            r"case\.2\.row: 'pad': expected another row than case\.1 'level', got 7 as well",
        ),
        (
            FILE + "[[case.step]]\nload_percent = 50\nwindow_s = [0.9, 0.99]\n",
            r"case\.2\.step\.1\.window_s: 'pad', 50 %: expected .* apart from case\.1 'level'",
        ),
    ],
)
def test_readings_that_are_not_there_are_refused(tmp_path: Path, text: str, line: str) -> None:
    two_steps(tmp_path)
    with pytest.raises(InputError, match=line):
        read_load_test(read_test_file(written(tmp_path, text)), GAUGES)
