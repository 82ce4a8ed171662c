"""Channels of several rasters, also in MF4 files that asammdf wrote."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from strainfmu.errors import InputError
from strainfmu.recorded import table
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import Samples, open_recording

pytestmark = pytest.mark.fast

FAST, SLOW = np.arange(0.0, 1.0, 0.01), np.arange(0.0, 1.0, 0.05)
TENTHS, SPARSE = np.arange(0.0, 1.0, 0.1), np.array([0.0, 0.3, 0.6])

Channel = tuple[np.ndarray, np.ndarray]
"""Times [s] and values."""


def ramp(time: np.ndarray) -> np.ndarray:
    return 3.0 + 2.0 * time


def joined(
    folder: Path, channels: dict[str, Channel], join: str = "", gauges: tuple[str, ...] = ("a",)
) -> tuple[Samples, dict[str, np.ndarray], tuple[str, ...]]:
    """Return samples, values by channel, and notes, of groups with times of their own.

    ``gauges`` are channels of strain, others of the Mach number.
    """
    path, toml = folder / "d.h5", folder / "channels.toml"
    with h5py.File(path, "w") as file:
        for name, (time, values) in channels.items():
            file[f"g{name}/time"], file[f"g{name}/{name}"] = time, values
    entries = [f"[[channel]]\nname = '{name}'\ngauge = '{name}'\nunit = 'm/m'\n" for name in gauges]
    entries += [
        f"[[flow]]\nname = '{name}'\nquantity = 'mach_number'\n" for name in channels if name not in gauges
    ]
    toml.write_text(join + "\n" + "".join(entries))
    wanted = Wanted(gauge_names=gauges, fixed_pressure=9e4)
    with open_recording(path, wanted, toml) as opened:
        (block,) = opened.blocks
    values = dict(zip(gauges, block.strain.T, strict=True))
    values |= {name: block.flow["mach_number"] for name in channels if name not in gauges}
    return block, values, opened.notes


SMALL = 1e-3
"""Of values, as strains are."""


def test_a_straight_line_is_exact_on_any_raster(tmp_path: Path) -> None:
    late = SLOW + 0.003
    _, values, notes = joined(tmp_path, {"a": (FAST, SMALL * ramp(FAST)), "q": (late, ramp(late))})
    inside = (FAST >= 0.003) & (late[-1] >= FAST)
    np.testing.assert_allclose(values["q"][inside], ramp(FAST)[inside], rtol=1e-12)
    assert np.isnan(values["q"][~inside]).all()
    assert notes == [
        f"{tmp_path / 'd.h5'}: 1 columns of 50 ms ('gq/q') interpolated at the samples of 'ga/a', every 10 ms"
    ]


def test_the_raster_is_that_of_most_gauges_then_the_slower_one(tmp_path: Path) -> None:
    fast, slow = (FAST, SMALL * ramp(FAST)), (SLOW, SMALL * ramp(SLOW))
    channels = {"a": fast, "b": slow, "c": slow}
    assert len(joined(tmp_path, channels, gauges=("a", "b", "c"))[0].time) == len(SLOW)
    assert len(joined(tmp_path, {"a": fast, "b": slow}, gauges=("a", "b"))[0].time) == len(SLOW)
    assert len(joined(tmp_path, {"a": fast, "c": slow})[0].time) == len(FAST)
    assert joined(tmp_path, {"a": fast, "d": fast}, gauges=("a", "d"))[2] == []


def test_samples_that_fall_together_are_taken_and_gaps_are_not_bridged(tmp_path: Path) -> None:
    values = ramp(SLOW)
    values[4] = np.nan
    kept = np.delete(np.arange(len(SLOW)), [10, 11])
    channels = {"a": (FAST, SMALL * ramp(FAST)), "b": (SLOW[kept] + 1e-7, values[kept])}
    found = joined(tmp_path, channels)[1]["b"]
    np.testing.assert_allclose(found[[0, 15, 25, 60]], ramp(FAST)[[0, 15, 25, 60]], rtol=1e-6)
    assert np.isnan(found[16:25]).all()  # beside the missing value
    assert np.isnan(found[46:60]).all()  # in the gap of three periods


def test_rounding_makes_no_other_raster(tmp_path: Path) -> None:
    other = FAST + 1e-6 * (np.arange(len(FAST)) % 2)
    _, values, notes = joined(tmp_path, {"a": (FAST, SMALL * FAST), "b": (other, FAST)})
    assert notes == []
    np.testing.assert_array_equal(values["b"], FAST)


@pytest.mark.parametrize("time", [[0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [0.0, np.nan, 1.0]])
def test_times_that_do_not_increase_are_refused(time: list[float], tmp_path: Path) -> None:
    channels = {"a": (FAST, SMALL * FAST), "b": (np.array(time), np.ones(3))}
    with pytest.raises(InputError, match=r"column 'time', row [23]: (expected increasing times|no number found)"):
        joined(tmp_path, channels)


def test_a_single_value_is_no_raster(tmp_path: Path) -> None:
    channels = {"a": (FAST, SMALL * FAST), "q": (np.array([0.5]), np.array([6.0]))}
    with pytest.raises(InputError, match="column 'gq/q': expected two samples or more, got 1"):
        joined(tmp_path, channels)


@pytest.mark.parametrize(
    ("join", "expected"),
    [
        ("rule = 'linear'", [0, 1, 2, 3, 4, 5, 6, None, None, None]),
        ("rule = 'linear'\nlimit_s = 0.2", [0, None, None, 3, None, None, 6, None, None, None]),
        ("rule = 'hold'", [0, 0, 0, 3, 3, 3, 6, 6, 6, 6]),
        ("rule = 'hold'\nlimit_s = 0.1", [0, 0, None, 3, 3, None, 6, 6, None, None]),
        ("rule = 'nearest'", [0, 0, 3, 3, 3, 6, 6, 6, None, None]),
        ("rule = 'nearest'\nlimit_s = 0.0", [0, None, None, 3, None, None, 6, None, None, None]),
    ],
)
def test_rules_that_join_rates(join: str, expected: list[int | None], tmp_path: Path) -> None:
    channels = {"a": (TENTHS, SMALL * TENTHS), "q": (SPARSE, 10.0 * SPARSE)}
    found = joined(tmp_path, channels, f"[join]\n{join}")[1]["q"]
    np.testing.assert_allclose(found, [np.nan if one is None else one for one in expected], atol=1e-12)


def test_nothing_is_held_ahead_of_the_first_sample_or_out_of_a_gap(tmp_path: Path) -> None:
    late = (np.array([0.25, 0.35, 0.8]), np.array([1.0, np.nan, 2.0]))
    for rule in ("linear", "hold", "nearest"):
        channels = {"a": (TENTHS, SMALL * TENTHS), "b": late}
        found = joined(tmp_path, channels, f"[join]\nrule = '{rule}'\nlimit_s = 0.1")[1]["b"]
        has_value = np.isfinite(found)
        assert not has_value[[0, 1, 4, 5, 6]].any()
        assert has_value[8]


@pytest.mark.parametrize("rule", ["linear", "hold", "nearest"])
def test_long_recordings_are_joined_as_short_ones(
    rule: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same rows in pieces of some: another frame that ends early, gaps, a late begin."""
    slow = np.delete(SLOW + 0.013, [3, 4, 5, 11])[:-2]
    channels = {"a": (FAST, SMALL * ramp(FAST)), "q": (slow, ramp(slow))}
    whole = joined(tmp_path, channels, f"[join]\nrule = '{rule}'")
    monkeypatch.setattr(table, "PIECE_ROWS", 7)
    pieces = joined(tmp_path, channels, f"[join]\nrule = '{rule}'")
    np.testing.assert_array_equal(pieces[1]["q"], whole[1]["q"])
    np.testing.assert_array_equal(pieces[0].strain, whole[0].strain)
    assert pieces[2] == whole[2]


def test_a_damaged_file_is_one_line_and_no_more(tmp_path: Path) -> None:
    """asammdf's destructor of a half-made object fails too, when Python cleans up."""
    pytest.importorskip("asammdf")
    path = tmp_path / "d.mf4"
    path.write_bytes(b"MDF     4.10    " + bytes(100))
    command = [sys.executable, "-c", "from strainfmu.cli.main import main; main()", "estimate", "x.fmu", str(path)]
    ended = subprocess.run([*command, "-o", str(tmp_path / "o.csv")], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (2, f"strainfmu: {path}: damaged, or not an MF4 file\n")
