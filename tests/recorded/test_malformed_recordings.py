"""Recordings and channels.toml that are wrong: one line with file, channel, what was found and what is allowed."""

from collections.abc import Callable
from pathlib import Path

import pytest
from recorded_case import NAMES
from synthetic_vehicle import SyntheticFiles

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]

CHANNELS = "".join(f"[[channel]]\nname = 'ch{i}'\ngauge = '{gauge}'\n" for i, gauge in enumerate(NAMES))
FLOW = "[[flow]]\nname = 'q'\nquantity = 'dynamic_pressure'\nunit = 'Pa'\n"
TOML = f"defaults.unit = 'um/m'\n{CHANNELS}{FLOW}"
HEADINGS = "time,ch0,ch1,ch2,ch3,ch4,ch5,q\n"
CSV = HEADINGS + "".join(f"{k},{k},2,3,4,5,6,90000\n" for k in range(4))
FIRST = "name = 'ch0'\n"


def changed(old: str, new: str) -> tuple[str, str]:
    """Return the files with a change in channels.toml."""
    assert old in TOML
    return CSV, TOML.replace(old, new, 1)


def bridged(entries: str) -> tuple[str, str]:
    """Return the files with entries added to the first channel."""
    return changed(FIRST, f"{FIRST}{entries}\n")


TEXTS: dict[str, tuple[tuple[str, str], str]] = {
    "no TOML": ((CSV, "[[channel"), "{toml}: not a TOML file: "),
    "no channel": ((CSV, "[join]\nrule = 'linear'\n"), "{toml}: channel: expected at least one [[channel]]"),
    "unknown entry": (bridged("guage_factor = 2.0"), "{toml}: channel.1.guage_factor: unknown entry"),
    "unknown section": ((CSV, TOML + "[tare]\nx = 1\n"), "{toml}: tare: unknown entry"),
    "unknown bridge": (
        bridged("bridge = 'third'"),
        "{toml}: channel.1.bridge: expected one of quarter, ",
    ),
    "unknown unit": (bridged("unit = 'inch'"), "{toml}: channel.1.unit: expected one of um/m, "),
    "no unit": (
        changed("defaults.unit = 'um/m'\n", ""),
        "{toml}: channel.1.unit: entry is missing for channel 'ch0', the recording states none; expected one of",
    ),
    "no factor": (
        bridged("unit = 'mV/V'"),
        "{toml}: channel.1.gauge_factor: entry is missing, unit mV/V needs it, channel 'ch0'",
    ),
    "no excitation": (
        bridged("unit = 'V'\ngauge_factor = 2.0"),
        "{toml}: channel.1.excitation_V: entry is missing, unit V needs it or scale_um_per_m_per_V, channel 'ch0'",
    ),
    "sign": (bridged("sign = 2"), "{toml}: channel.1.sign: expected a number from -1 to 1, got 2"),
    "sign of 0": (bridged("sign = 0"), "{toml}: channel.1.sign: expected 1 or -1, got 0"),
    "wires": (bridged("wires = 4"), "{toml}: channel.1.wires: expected 2 or 3 with bridge 'quarter', got 4"),
    "bending pair": (
        bridged("bridge = 'half-bending'"),
        "{toml}: channel.1.bridge: 'half-bending' gives half the difference of the strains at two positions, and "
        "gauge 'G0' of the map is at one: expected a channel for each",
    ),
    "Poisson bridge": (
        bridged("bridge = 'half-poisson'\npoisson_ratio = 0.3"),
        "{toml}: channel.1.bridge: 'half-poisson' adds the strain across: expected uniaxial_stress = true",
    ),
    "compensation": (
        bridged("temperature_compensation = 'bridge'"),
        "{toml}: channel.1.temperature_compensation: 'bridge': expected a half or full bridge, got 'quarter'",
    ),
    "unknown gauge": (
        changed("'G0'", "'H0'"),
        "{toml}: channel.1.gauge: no gauge 'H0' in the map, there are G0, G1",
    ),
    "gauge twice": (
        changed("'G1'", "' g0'"),
        "{toml}: channel.2.gauge: expected one channel for gauge ' g0', got another in channel.1.gauge",
    ),
    "channel twice": (
        changed("'ch1'", "'CH 0'"),
        "{toml}: channel.2.name: channel 'ch0' belongs to channel.1 already",
    ),
    "two that fit": (
        (CSV.replace("ch1", "CH 0"), TOML.replace("'ch0'", "'Ch0'")),
        "{data}: channel 'Ch0': expected one of that name, got 2: 'ch0' and 'CH 0'",
    ),
    "none found": (
        (CSV, TOML.replace("'ch", "'port")),
        "{data}: none of the channels of {toml} found, the recording holds time, ch0, ch1, ch2, ch3, ch4 ..",
    ),
    "no flow": (changed("'q'", "'qbar'"), "{data}: no channel 'qbar' of {toml}: flow.1 found, "),
    "unit of the flow": (changed("'Pa'", "'atm'"), "{data}: column 'q': unit: expected one of Pa, "),
    "no dynamic pressure": (
        (CSV, TOML.replace(FLOW, "")),
        "{data}: no column of dynamic_pressure found, nor of mach_number with static_pressure or altitude; ",
    ),
    "no time": (
        (CSV.replace("time", "Uhr"), TOML),
        "{data}: column of times: expected one, got none, it holds Uhr, ch0, ch1, ch2, ch3, ch4 ..; state [time] "
        "channel or rate_hz in {toml}",
    ),
    "misspelt time": (
        (CSV, "time.channel = 'tme'\n" + TOML),
        "{data}: no channel 'tme' of {toml}: time.channel, did you mean 'time'",
    ),
    "time twice over": (
        (CSV, "time.channel = 'time'\ntime.rate_hz = 9\n" + TOML),
        "{toml}: time.rate_hz: expected ",
    ),
    "backward": (
        (CSV.replace("\n2,2", "\n0.5,2"), TOML),
        "{data}: column 'time', line 4: expected increasing times, got 0.5 s after 1 s",
    ),
    "no time at a sample": (
        (CSV.replace("\n2,2", "\n,2"), TOML),
        "{data}: column 'time', line 4: no number found",
    ),
    "text": (
        (CSV.replace("\n2,2", "\n2,OVK"), TOML),
        "{data}: line 4, column 'ch0': expected a number, got 'OVK'",
    ),
    "infinite": (
        (CSV.replace("\n2,2", "\n2,1e999"), TOML),
        "{data}: column 'ch0', line 4: expected a finite number",
    ),
    "short line": ((CSV.replace("\n1,1,2,", "\n1,1\n"), TOML), "{data}: line 3: expected 8 cells, got 2"),
    "headings alone": ((HEADINGS, TOML), "{data}: no samples found"),
    "empty": (("", TOML), "{data}: no headings found in the first line"),
    "rule": (
        (CSV, "join.rule = 'spline'\n" + TOML),
        "{toml}: join.rule: expected one of linear, hold, nearest, got 'spl",
    ),
    "raster": (
        (CSV, "join.raster = 'ch9'\n" + TOML),
        "{toml}: join.raster: no channel 'ch9' in use, did you mean 'ch",
    ),
    "two legs": (
        (CSV, TOML + "[[rosette]]\nlegs = ['a', 'b']\nangles_deg = [0, 45, 90]\n"),
        "{toml}: rosette.1.legs: expected three names of legs, got ['a', 'b']",
    ),
    "equal angles": (
        (CSV, TOML + "[[rosette]]\nlegs = ['a', 'b', 'c']\nangles_deg = [0, 45, 180]\n"),
        "{toml}: rosette.1.angles_deg: expected three angles that differ modulo 180, got [0, 45, 180]",
    ),
}


def refused(run: Run, source: Path, data: Path, toml: Path, line: str) -> None:
    """Check that the estimation ends with one line, exit code 2 and nothing written."""
    before = sorted(data.parent.iterdir())
    code, out, errors = run("estimate", source, data, "-o", data.with_name("o.csv"), "--channels", toml)
    assert (code, out.strip()) == (2, ""), errors
    assert errors.startswith(f"strainfmu: {line.format(data=data, toml=toml)}"), errors
    assert errors.count("\n") == 1
    assert sorted(data.parent.iterdir()) == before


@pytest.mark.parametrize("name", TEXTS)
def test_malformed_text_gets_one_line(name: str, synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    (csv, toml), line = TEXTS[name]
    data, channels = tmp_path / "d.csv", tmp_path / "channels.toml"
    data.write_text(csv, encoding="utf-8")
    channels.write_text(toml, encoding="utf-8")
    refused(run, synthetic.map_1, data, toml=channels, line=line)


BROKEN = {
    ".csv": ("", "damaged, or not a CSV file"),
    ".h5": ("h5py", "damaged, or not an HDF5 file"),
    ".mat": ("scipy", "damaged, or not a MAT file"),
    ".lvm": ("", "damaged, or not a LabVIEW measurement file: it does not begin with that name"),
    ".mdf": ("asammdf", "damaged, or not an MDF file"),
    ".mf4": ("asammdf", "damaged, or not an MF4 file"),
    ".parquet": ("pyarrow", "damaged, or not a Parquet file"),
    ".tdms": ("nptdms", "damaged, or not a TDMS file"),
    ".uff": ("pyuff", "damaged, or not a universal file"),
    ".xls": ("", "expected one of .mf4, .mdf, .csv, .txt, "),
}


@pytest.mark.parametrize("suffix", BROKEN)
def test_a_broken_file_gets_one_line(suffix: str, synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    library, line = BROKEN[suffix]
    if library:
        pytest.importorskip(library)
    data, channels = tmp_path / f"d{suffix}", tmp_path / "channels.toml"
    data.write_bytes(b"nothing of the kind\x00\x01\x02" * 20)
    channels.write_text(TOML, encoding="utf-8")
    refused(run, synthetic.map_1, data, toml=channels, line="{data}: " + line)


def test_options_that_do_not_go_with_channels(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    data, channels = tmp_path / "d.csv", tmp_path / "channels.toml"
    data.write_text(CSV)
    channels.write_text(TOML)
    for more, source, line in (
        (("--ignore-columns", "x"), data, "--ignore-columns: expected none with --channels"),
        ((), tmp_path / "run.blf", "--channels: expected none with a CAN log"),
    ):
        code, _, errors = run(
            "estimate", synthetic.map_1, source, "-o", tmp_path / "o.csv", "--channels", channels, *more
        )
        assert code == 2
        assert line in errors
    assert not (tmp_path / "o.csv").exists()


def test_a_pressure_that_is_not_known_needs_the_nonlinear_estimator(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    (tmp_path / "d.csv").write_text(CSV)
    for name, line in (
        ("d.csv", "--dynamic-pressure: expected a pressure for a linear estimator, got nan"),
        ("run.blf", "--dynamic-pressure: expected a pressure with a CAN log, got nan"),
    ):
        code, _, errors = run(
            "estimate", synthetic.map_1, tmp_path / name, "-o", tmp_path / "o.csv", "--dynamic-pressure", "nan"
        )
        assert code == 2
        assert line in errors
    assert not (tmp_path / "o.csv").exists()
