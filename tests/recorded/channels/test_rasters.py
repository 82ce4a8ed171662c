"""Channels of several rasters, also in MF4 files that asammdf wrote."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mf4_files import write_channels
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.errors import InputError
from strainfmu.recorded.channels.rasters import Channel, on_one_raster
from strainfmu.recorded.columns.column_names import Wanted
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.strains.strain_files import open_strains

pytestmark = pytest.mark.fast

FILE = Path("f.mf4")
FAST, SLOW = np.arange(0.0, 1.0, 0.01), np.arange(0.0, 1.0, 0.05)


def ramp(time: np.ndarray) -> np.ndarray:
    return 3.0 + 2.0 * time


def test_a_straight_line_is_exact_on_any_raster() -> None:
    found = on_one_raster(
        FILE, {"a": Channel(FAST, ramp(FAST)), "q": Channel(SLOW + 0.003, ramp(SLOW + 0.003))}, ["a"]
    )
    inside = (FAST >= 0.003) & (SLOW[-1] + 0.003 >= FAST)
    np.testing.assert_allclose(found.values["q"][inside], ramp(FAST)[inside], rtol=1e-12)
    assert np.isnan(found.values["q"][~inside]).all()
    assert found.notes == ("f.mf4: 1 channels of 50 ms ('q') interpolated at the samples of 'a', every 10 ms",)


def test_the_raster_is_that_of_most_gauges_then_the_slower_one() -> None:
    channels = {"a": Channel(FAST, ramp(FAST)), "b": Channel(SLOW, ramp(SLOW)), "c": Channel(SLOW, ramp(SLOW))}
    assert len(on_one_raster(FILE, channels, ["a", "b", "c"]).time) == len(SLOW)
    assert len(on_one_raster(FILE, channels, ["a", "b"]).time) == len(SLOW)
    assert len(on_one_raster(FILE, channels, ["a"]).time) == len(FAST)
    assert on_one_raster(FILE, {"a": channels["a"], "d": channels["a"]}, ["a"]).notes == ()


def test_samples_that_fall_together_are_taken_and_gaps_are_not_bridged() -> None:
    values = ramp(SLOW)
    values[4] = np.nan
    kept = np.delete(np.arange(len(SLOW)), [10, 11])
    found = on_one_raster(
        FILE, {"a": Channel(FAST, ramp(FAST)), "b": Channel(SLOW[kept] + 1e-7, values[kept])}, ["a"]
    ).values["b"]
    np.testing.assert_allclose(found[[0, 15, 25, 60]], ramp(FAST)[[0, 15, 25, 60]], rtol=1e-6)
    assert np.isnan(found[16:25]).all()  # beside the missing value
    assert np.isnan(found[46:60]).all()  # in the gap of three periods


def test_rounding_makes_no_other_raster() -> None:
    other = FAST + 1e-6 * (np.arange(len(FAST)) % 2)
    found = on_one_raster(FILE, {"a": Channel(FAST, FAST), "b": Channel(other, FAST)}, ["a"])
    assert found.notes == ()
    np.testing.assert_array_equal(found.values["b"], FAST)


@pytest.mark.parametrize("time", [[0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [0.0, np.nan, 1.0]])
def test_times_that_do_not_increase_are_refused(time: list[float]) -> None:
    with pytest.raises(InputError, match=r"f\.mf4: channel 'b', sample [23]: expected finite times that increase"):
        on_one_raster(FILE, {"a": Channel(FAST, FAST), "b": Channel(np.array(time), np.ones(3))}, ["a"])


def test_a_single_value_is_no_raster() -> None:
    one = Channel(np.array([0.5]), np.array([9e4]))
    with pytest.raises(InputError, match=r"f\.mf4: channel 'q': expected two samples or more, got 1"):
        on_one_raster(FILE, {"a": Channel(FAST, FAST), "q": one}, ["a"])


def test_an_mf4_file_of_three_rasters(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """Straight lines in time: interpolation is exact, so the estimates are those of one raster."""
    pytest.importorskip("asammdf")
    names = [f"G{i}" for i in range(N_GAUGES)]
    units = dict.fromkeys(names, "um/m") | {"dynamic_pressure": "Pa"}

    def strains(time: np.ndarray) -> dict[str, np.ndarray]:
        return {name: 100.0 + 10.0 * i + 20.0 * time for i, name in enumerate(names)}

    half, quick = np.arange(0.0, 1.0001, 0.02), np.arange(0.0, 1.0001, 0.001)
    pressure = {"dynamic_pressure": 9e4 + 100.0 * SLOW}
    most, rest = names[: N_GAUGES - 2], names[N_GAUGES - 2 :]
    path = write_channels(
        tmp_path / "three.mf4",
        [
            (half, {name: strains(half)[name] for name in most}),
            (quick, {name: strains(quick)[name] for name in rest}),
            (SLOW, pressure),
        ],
        units,
    )
    with open_strains(path, Wanted(gauge_names=tuple(names))) as opened:
        (block, _), *_ = opened.blocks
        assert len(opened.notes) == 2
    np.testing.assert_allclose(block.time, half)
    np.testing.assert_allclose(block.strain[:, 0], 1e-6 * strains(half)["G0"], rtol=1e-12)
    np.testing.assert_allclose(block.strain[:, -1], 1e-6 * strains(half)[names[-1]], rtol=1e-9)
    covered = half <= SLOW[-1] + 1e-9
    np.testing.assert_allclose(block.dynamic_pressure[covered], 9e4 + 100.0 * half[covered], rtol=1e-9)
    assert np.isnan(block.dynamic_pressure[~covered]).all()
    summary = estimate_file(synthetic.map_1, path, tmp_path / "o.csv", check_level=False)
    assert summary.samples == len(half)
    assert summary.missing_pressure == int((~covered).sum())
    assert [note for note in summary.notes if "interpolated at the samples of 'G0', every 20 ms" in note]


def test_a_damaged_file_is_one_line_and_no_more(tmp_path: Path) -> None:
    """asammdf's destructor of a half-made object fails too, when Python cleans up."""
    pytest.importorskip("asammdf")
    path = tmp_path / "d.mf4"
    path.write_bytes(b"MDF     4.10    " + bytes(100))
    command = [sys.executable, "-c", "from strainfmu.cli.main import main; main()", "estimate", "x.fmu", str(path)]
    ended = subprocess.run([*command, "-o", str(tmp_path / "o.csv")], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (2, f"strainfmu: {path}: damaged, or not an MF4 file\n")
