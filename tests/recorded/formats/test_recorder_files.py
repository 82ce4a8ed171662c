"""Binary files of recorders, written from the description of their formats: several rates, wrong and cut files."""

import re
from pathlib import Path

import numpy as np
import pytest
from recorder_files import Mdf3Channel, lvm, mdf3

from strainfmu.errors import InputError
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import Samples, open_recording

pytestmark = pytest.mark.fast

FAST, SLOW = 0.01 * np.arange(50), 0.05 * np.arange(11)
STRAIN = np.column_stack([100.0 + FAST, -5.0 - FAST])
INTERPOLATED = (
    r"1 columns of 50 ms \('(air/)?dynamic_pressure'\) interpolated at the samples of '(strain/)?G0', every 10 ms"
)


def read(path: Path, *ignored: str) -> tuple[Samples, tuple[str, ...]]:
    with open_recording(path, Wanted(gauge_names=("G0", "G1"), ignored=ignored)) as opened:
        (block,) = opened.blocks
    return block, opened.notes


def check(path: Path, resolution: float = 1e-12) -> None:
    """Compare with the two rasters above: strains in um/m, and q_inf of 90 kPa + 1 kPa/s."""
    block, notes = read(path)
    np.testing.assert_allclose(block.time, FAST, atol=1e-12)
    np.testing.assert_allclose(block.strain, 1e-6 * STRAIN, atol=1e-6 * resolution)
    np.testing.assert_allclose(block.dynamic_pressure, 9e4 + 1e3 * FAST, atol=1e3 * resolution)
    assert len(notes) == 1
    assert re.fullmatch(f"{path}: {INTERPOLATED}", notes[0])


@pytest.fixture(scope="module")
def mdf3_bytes() -> bytes:
    gauges = [
        Mdf3Channel("G0", "um/m", STRAIN[:, 0], 0.005),
        Mdf3Channel("G1", "µm/m", STRAIN[:, 1], 0.005, -3.0),
    ]
    return mdf3([(FAST, gauges), (SLOW, [Mdf3Channel("dynamic_pressure", "kPa", 90.0 + SLOW, 0.005)])])


@pytest.mark.parametrize("suffix", [".mdf", ".dat"])
def test_mdf_3_with_two_rasters(suffix: str, mdf3_bytes: bytes, tmp_path: Path) -> None:
    pytest.importorskip("asammdf")
    path = tmp_path / f"run{suffix}"
    path.write_bytes(mdf3_bytes)
    check(path, 0.0026)


def test_a_cut_mdf_3_file_gets_one_line(mdf3_bytes: bytes, tmp_path: Path) -> None:
    pytest.importorskip("asammdf")
    path = tmp_path / "run.mdf"
    for n in range(0, len(mdf3_bytes), 331):
        path.write_bytes(mdf3_bytes[:n])
        with pytest.raises(InputError) as error:
            read(path)
        assert str(error.value) == f"{path}: damaged, or not an MDF file"


def test_a_text_named_dat_is_read_as_text(tmp_path: Path) -> None:
    path = tmp_path / "run.dat"
    path.write_text("time\tG0 (um/m)\tG1 (um/m)\tdynamic_pressure\n0\t1\t2\t90000\n")
    np.testing.assert_allclose(read(path)[0].strain, [[1e-6, 2e-6]])


def test_tdms_channels_of_two_rates_need_no_channels_toml(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "run.tdms"
    objects = [
        nptdms.ChannelObject(group, name, values, {"wf_increment": step, "unit_string": unit})
        for group, name, values, step, unit in (
            ("strain", "G0", STRAIN[:, 0], 0.01, "um/m"),
            ("strain", "G1", STRAIN[:, 1], 0.01, "um/m"),
            ("air", "dynamic_pressure", 90.0 + SLOW, 0.05, "kPa"),
        )
    ]
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(objects)
    check(path)


def lvm_text(x_columns: str, **more: str) -> str:
    """Return the two rasters; the strains in two segments, the second a quarter of a second later."""
    slow = ("dynamic_pressure", "kPa", SLOW, 90.0 + SLOW)
    first = [(f"G{i}", "um/m", FAST[:25], STRAIN[:25, i]) for i in range(2)]
    second = [(f"G{i}", "um/m", FAST[:25], STRAIN[25:, i]) for i in range(2)]
    return lvm([("11:59:59.9", [*first, slow]), ("12:00:00.15", second)], x_columns, **more)


@pytest.mark.parametrize("x_columns", ["No", "One", "Multi"])
@pytest.mark.parametrize("more", [{}, {"decimal": ","}, {"between": ","}], ids=["tab", "decimal comma", "comma"])
def test_lvm_with_segments_and_two_rasters(x_columns: str, more: dict[str, str], tmp_path: Path) -> None:
    path = tmp_path / "run.lvm"
    path.write_text(lvm_text(x_columns, **more), encoding="latin-1")
    check(path)


def test_lvm_with_one_column_of_times_and_one_heading(tmp_path: Path) -> None:
    path = tmp_path / "run.lvm"
    pressure = ("dynamic_pressure", "kPa", FAST, 90.0 + FAST)
    both = [*((f"G{i}", "µm/m", FAST, STRAIN[:, i]) for i in range(2)), pressure]
    both.insert(0, ("short", "V", FAST[:7], FAST[:7]))
    cut = [[(name, unit, x[rows], y[rows]) for name, unit, x, y in both] for rows in (slice(20), slice(20, 50))]
    text = lvm([("12:00:00", cut[0]), ("12:00:00", cut[1])], "One", headings="No")
    special = "***Start_Special***\r\nG0\t7\r\n***End_Special***\r\n"
    path.write_text(text.replace("Channels", f"{special}Channels", 1), encoding="latin-1")
    block, notes = read(path, "short")
    np.testing.assert_allclose(block.time, FAST, atol=1e-12)
    np.testing.assert_allclose(block.strain, 1e-6 * STRAIN, atol=1e-15)
    np.testing.assert_allclose(block.dynamic_pressure, 9e4 + 1e3 * FAST, rtol=1e-9)
    assert notes == []


LVM = lvm_text("Multi")
BLOCK = [
    *((f"G{i}", "um/m", FAST[:25], STRAIN[:25, i]) for i in range(2)),
    ("dynamic_pressure", "kPa", SLOW[:5], SLOW[:5]),
]
BLOCKS = lvm([("12:00:00", BLOCK), ("12:00:00.25", BLOCK)], "One", headings="No")
WRONG_LVM = {
    "no such file": (LVM.replace("LabVIEW Measurement", "LabVIEW"), "does not begin with that name"),
    "no names": (LVM.replace("X_Value", "Y"), "line 23: expected the names of channels behind X_Value, got 'Y"),
    "no segment": (LVM.partition("Channels")[0], "without segment headers: no names of channels behind X_Value"),
    "text": (LVM.replace("100.010000000", "high"), "line 25, column 'G0': expected a number, got 'high'"),
    "two units": ("mm/m".join(LVM.rsplit("um/m", 1)), "column 'G1': unit: expected one, got 'um/m' and 'mm/m'"),
    "no time": (LVM.replace("Dimension\tTime", "Dimension\tFrequency"), "column of times: expected one, got none"),
    "no time of a value": (
        LVM.replace("\r\n0.010000000\t", "\r\n\t", 1),
        "column 'time', row 2: no number found",
    ),
    "times": (
        LVM.replace("12:00:00.15", "12:00:00.13"),
        "column 'time', row 26: expected increasing times, got 0.23 s after 0.24 s",
    ),
    "blocks of two rasters": (
        BLOCKS,
        "column 'dynamic_pressure': expected its 5 samples in one block of 25 rows, got 50 rows",
    ),
}


@pytest.mark.parametrize("name", WRONG_LVM)
def test_a_wrong_lvm_file_gets_one_line(name: str, tmp_path: Path) -> None:
    text, line = WRONG_LVM[name]
    path = tmp_path / "run.lvm"
    path.write_bytes(text.encode())
    with pytest.raises(InputError) as error:
        read(path)
    assert line in str(error.value)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
