"""One recording as recorders write it, by a channel file: three gauges and the air data, or the right line.

Layouts follow public reports of faults of readers, and files of recorders; the values are the same in all.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from strainfmu.errors import InputError
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import open_recording

pytestmark = pytest.mark.fast

N = 60
TIME = np.round(0.01 * np.arange(N), 4)
STRAIN = np.round(np.column_stack([(i + 1.0) * np.cos(9.0 * TIME + i) - 0.5 for i in range(3)]), 3)
PRESSURE = np.round(160.0 + 0.1 * np.floor(10.0 * TIME + 1e-9), 3)
CHANNELS, UNITS = ("SG01", "SG02", "SG03", "Pdyn", "Mach", "Alt"), ("um/m", "um/m", "um/m", "kPa", "", "m")
VALUES = np.column_stack([STRAIN, PRESSURE, np.full(N, 6.5), np.full(N, 20000.0)])
HEADINGS = [f"{name} [{unit}]" if unit else name for name, unit in zip(CHANNELS, UNITS, strict=True)]
ENTRIES = "".join(f"[[channel]]\nname = 'SG0{i}'\ngauge = 'G{i}'\n" for i in (1, 2, 3)) + "".join(
    f"[[flow]]\nname = '{name}'\nquantity = '{quantity}'\nunit = '{unit}'\n"
    for name, quantity, unit in (
        ("Pdyn", "dynamic_pressure", "kPa"),
        ("Mach", "mach_number", "1"),
        ("Alt", "altitude", "m"),
    )
)
MICRO = "[defaults]\nunit = 'um/m'\n"
Case = tuple[str, str | bytes, str]
"""Suffix, content and channel file."""


def table(*head: str, times: list[str] | None = None, form: str = "{:.4f}", between: str = ",") -> str:
    """Return the lines of the samples below the lines ``head``."""
    stamps = [f"{t:.4f}" for t in TIME] if times is None else times
    rows = [between.join([stamp, *map(form.format, row)]) for stamp, row in zip(stamps, VALUES, strict=True)]
    return "\n".join([*head, *rows]) + "\n"


def headed(time: str) -> str:
    return ",".join([time, *HEADINGS])


def slow_lvm() -> str:
    """Return a LabVIEW file with one column of times; air data have every tenth sample, and steps of their own."""
    slow = [i > 2 for i in range(6)]
    tags = {
        "Channels": ["6"],
        "Samples": ["6" if is_slow else "60" for is_slow in slow],
        "Date": 6 * ["2021/05/04"],
        "Time": 6 * ["09:00:00.0"],
        "Y_Unit_Label": [*UNITS],
        "X_Dimension": 6 * ["Time"],
        "X0": 6 * ["0.0000"],
        "Delta_X": ["0.1000" if is_slow else "0.0100" for is_slow in slow],
    }
    rows = [
        [f"{TIME[k]:.4f}"]
        + [
            "" if is_slow and k > 5 else f"{VALUES[10 * k if is_slow else k, i]:.4f}"
            for i, is_slow in enumerate(slow)
        ]
        for k in range(N)
    ]
    head = {
        "LabVIEW Measurement": "",
        "Writer_Version": "2",
        "Reader_Version": "2",
        "Separator": "Tab",
        "Decimal_Separator": ".",
        "Multi_Headings": "No",
        "X_Columns": "One",
        "Time_Pref": "Relative",
        "Date": "2021/05/04",
        "Time": "09:00:00.0",
    }
    lines = ["\t".join(item) for item in head.items()] + ["***End_of_Header***\t", "\t"]
    lines += ["\t".join([name, *cells]) for name, cells in tags.items()] + ["***End_of_Header***"]
    return "\n".join(
        [*lines, "\t".join(["X_Value", *CHANNELS, "Comment"]), *("\t".join([*row, ""]) for row in rows)]
    )


def mf4(groups: list[tuple[str, ...]]) -> bytes:
    """Return an MF4 file with the named channels in each group."""
    asammdf = pytest.importorskip("asammdf")
    of = dict(zip(CHANNELS, zip(VALUES.T, UNITS, strict=True), strict=True))
    with asammdf.MDF() as file:
        for names in groups:
            stated = [(name, *of.get(name, (np.zeros(N), ""))) for name in names]
            file.append([asammdf.Signal(values, TIME, name=name, unit=unit) for name, values, unit in stated])
        file.save("r.mf4", overwrite=True)
    return Path("r.mf4").read_bytes()


IRIG = [f"124:09:00:{t:09.6f}" for t in TIME]
LOGGER = [f"{k + 1},2021/05/04,09:00:00,{10000 * k}" for k in range(N)]
FIXED = [
    "".join(f"{cell:>14}" for cell in line.split(",")) for line in table(",".join(["time", *CHANNELS])).split("\n")
]

CASES: dict[str, Callable[[], Case]] = {
    "slow channels of one LVM file": lambda: (".lvm", slow_lvm(), ""),
    "a text with the suffix of a log": lambda: (
        ".asc",
        table("Messung 1", "", "\t".join(["Zeit", *CHANNELS]), "\t".join(["s", *UNITS]), between="\t").replace(
            ".", ","
        ),
        "time.channel = 'Zeit'\n",
    ),
    "signs apart": lambda: (
        ".csv",
        table(
            ",".join(["NO.,Date,Time,us", *CHANNELS]),
            ",".join(["NO.,Date,Time,us", *UNITS]),
            times=LOGGER,
            form="{:+.3f}",
        )
        .replace(",+", ",+ ")
        .replace(",-", ",- "),
        "time.rate_hz = 100.0\n",
    ),
    "day of the year": lambda: (".csv", table(headed("IRIG time"), times=IRIG), "time.channel = 'IRIG time'\n"),
    "blanks": lambda: (".txt", "\n".join(FIXED), MICRO),
    "a channel in two groups that no entry names": lambda: (
        ".mf4",
        mf4([(*CHANNELS[:3], "Spare"), (*CHANNELS[3:], "Spare")]),
        "",
    ),
}


def read(case: Case, folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Return times, strains and q_inf from the first sample on, and the lines for the user."""
    suffix, content, toml = case
    path, channels = folder / f"r{suffix}", folder / "channels.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    channels.write_text(toml if "[[channel]]" in toml else toml + ENTRIES)
    wanted = Wanted(gauge_names=("G1", "G2", "G3"))
    with open_recording(path, wanted, channels) as opened:
        (block,) = opened.blocks
    return block.time - block.time[0], block.strain, block.dynamic_pressure, opened.notes


@pytest.mark.parametrize("name", CASES)
def test_the_values_are_those_of_the_recording(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Channels that are slower have no value behind their last sample, and q is a straight line between two."""
    monkeypatch.chdir(tmp_path)
    time, strain, pressure, _ = read(CASES[name](), tmp_path)
    np.testing.assert_allclose(time, TIME, atol=1e-7)
    np.testing.assert_allclose(strain, 1e-6 * STRAIN, atol=1e-15)
    expected = np.interp(TIME, TIME[::10], PRESSURE[::10]) if name.startswith("slow") else PRESSURE
    known = TIME[50] >= TIME if name.startswith("slow") else np.ones(N, dtype=bool)
    np.testing.assert_allclose(pressure[known], 1e3 * expected[known], rtol=1e-9)
    assert np.isnan(pressure[~known]).all()


def test_a_name_in_two_groups_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    case = ".mf4", mf4([CHANNELS[:3], CHANNELS[3:], CHANNELS[:1]]), ""
    line = (
        r"channel 'SG01': expected one of that name, got 2: 'group\[1\]/SG01' and 'group\[3\]/SG01'; a name with"
    )
    with pytest.raises(InputError, match=line):
        read(case, tmp_path)
