"""Text files as exporters of recorders write them, made line by line from what their documentation says."""

from pathlib import Path

import numpy as np
import pytest

import strainfmu
from strainfmu.errors import InputError
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import Samples, open_recording
from strainfmu.text_cells import NO_READING, OVERLOAD, DateOrder

pytestmark = pytest.mark.fast

PLAIN = "time,G0,G1\n{},1e-6,2e-6\n{},3e-6,4e-6\n"


def read(
    path: Path, content: str, encoding: str = "utf-8", channels: str = "", order: DateOrder | None = None
) -> tuple[Samples, list[str]]:
    """Return the samples of a file, and all lines for the user."""
    path.write_bytes(content.encode(encoding))
    toml = None
    if channels:
        toml = path.with_name("channels.toml")
        toml.write_text(channels, encoding="utf-8")
    with open_recording(
        path, Wanted(gauge_names=("G0", "G1"), fixed_pressure=9e4, date_order=order), toml
    ) as opened:
        (block,) = opened.blocks
    return block, opened.notes


CATMAN = "\r\n".join(
    [
        "HBM catmanEasy-AP V5.1.2\tExport: ASCII + Kanalinfo",
        "Messung:\tFlügelbiegung links",
        "Kanalanzahl:\t3",
        "",
        "Zeit  1 - Standardmessrate [s]\tDMS 1 [µm/m]\tDMS 2 [µm/m]",
        "Abtastrate\t100 Hz\t100 Hz",
        "T0\t17.05.2026 14:39:16\t17.05.2026 14:39:16",
        "Messbereich\t4000\t4000",
        "Sensor\tViertelbrücke 120 Ohm\tViertelbrücke 120 Ohm",
        "0,00\t1.234,5\t-2,0",
        "0,01\t1.235\tOverflow",
        "0,02\t1.236,5\t-2,5",
    ]
)
"""Header lines, then rows for the channels; decimal commas, points between thousands, tabs, Latin-1."""

PORTS = (
    "[time]\nchannel = 'Zeit  1 - Standardmessrate'\n"
    "[[channel]]\nname = 'DMS 1'\ngauge = 'G0'\n[[channel]]\nname = 'DMS 2'\ngauge = 'G1'\n"
)


def test_catman_with_rows_of_channel_information(tmp_path: Path) -> None:
    block, lines = read(tmp_path / "run.txt", CATMAN, "cp1252", PORTS)
    np.testing.assert_allclose(block.time, [0.0, 0.01, 0.02])
    np.testing.assert_allclose(block.strain, 1e-6 * np.array([[1234.5, -2], [1235, np.nan], [1236.5, -2.5]]))
    assert any(
        "not read: line 6 ('Abtastrate'), 7 ('T0'), 8 ('Messbereich'), 9 ('Sensor')" in one for one in lines
    )
    assert any(
        "line 10, column 'DMS 1': '1.234,5' read as 1234.5: numbers with separators of thousands" in one
        for one in lines
    )


def test_two_rates_of_catman_are_refused(tmp_path: Path) -> None:
    """Columns behind the second time are at its times, which a table of one time cannot state."""
    head, *rows = "Zeit  1 - schnell;DMS 1;DMS 2;Zeit  2 - langsam;q", "0,00;1;2;0,00;5", "0,01;1;2;0,04;6"
    ports = PORTS.replace("Standardmessrate", "schnell") + "[defaults]\nunit = 'um/m'\n"
    with pytest.raises(InputError, match="'Zeit 1 - schnell' and 'Zeit 2 - langsam': expected one time"):
        read(tmp_path / "two.txt", "\r\n".join([head, *rows]), channels=ports)


UNITS = {
    "square brackets": "time [ms],G0 [um/m],G1 [um/m]\n",
    "round brackets": "Time (ms),G0 (µm/m),G1(um/m)\n",
    "row behind other rows": "time,G0,G1\nRate,100,100\n(ms),(µm/m),um/m\nZero,0,0\n",
    "row with a label in a column of its own": "Channel,time,G0,G1\nUnit:,ms,um/m,um/m\n",
}


@pytest.mark.parametrize("name", UNITS)
def test_units_in_brackets_or_a_row(name: str, tmp_path: Path) -> None:
    lead = "1," if "own" in name else ""
    wanted = Wanted(gauge_names=("G0", "G1"), fixed_pressure=9e4, ignored=("Channel",) if lead else ())
    (tmp_path / "d.csv").write_text(f"{UNITS[name]}{lead}0,1,2\n{lead}10,3,4\n", encoding="utf-8")
    with open_recording(tmp_path / "d.csv", wanted) as opened:
        (block,) = opened.blocks
    np.testing.assert_allclose(block.time, [0.0, 0.01])
    np.testing.assert_allclose(block.strain, 1e-6 * np.array([[1, 2], [3, 4]]))


def test_round_brackets_without_a_unit_are_part_of_the_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"column 'G1 \(top\)': unknown name"):
        read(tmp_path / "d.csv", "time,G0,G1 (top)\n0,1e-6,2e-6\n")


TIMES: dict[str, tuple[str, str, DateOrder | None, float]] = {
    "ISO": ("2026-03-04T12:00:00", "2026-03-04T12:00:01.5", None, 1.5),
    "day first, stated": ("03/04/2026 23:59:59", "04/04/2026 00:00:00", "day", 1.0),
    "month first, stated": ("03/31/2026 23:59:59", "04/01/2026 00:00:00", "month", 1.0),
    "month first, seen": ("03/31/2026 11:59:59 PM", "04/01/2026 12:00:00 AM", None, 1.0),
    "points": ("31.03.26 23:59:59", "01.04.26 0:00:00.250", None, 1.25),
    "stated, points": ("02.03.2026 00:00:00", "02.04.2026 00:00:00", "month", 86400.0),
    "year first": ("2026/03/31 23:59:59", "2026/04/01 00:00:00", None, 1.0),
    "named month": ("31-Mar-2026 23:59:59", "01-Apr-2026 00:00:00", None, 1.0),
    "German month": ("31. März 2026 23:59:59", "1. Mai 2026 00:00:00", None, 1.0 + 30 * 86400.0),
    "noon": ("1/31/2026 11:59:59.5 a.m.", "1/31/2026 12:00:00 p.m.", None, 0.5),
    "time of day, 12 h": ("9:59:59 PM", "10:00:01 PM", None, 2.0),
    "past midnight": ("23:59:59.75", "00:00:00.25", None, 0.5),
    "past midnight, 12 h": ("11:59:59 PM", "12:00:01 AM", None, 2.0),
    "relative": ("0", "0.5", None, 0.5),
}


@pytest.mark.parametrize("name", TIMES)
def test_dates_and_times(name: str, tmp_path: Path) -> None:
    first, second, order, expected = TIMES[name]
    block, lines = read(tmp_path / "d.csv", PLAIN.format(first, second), order=order)
    np.testing.assert_allclose(block.time, [0.0, expected], atol=1e-9)
    assert [line for line in lines if f"read as seconds since {first}" in line] == (lines if ":" in first else [])


WRONG_TIMES: dict[str, tuple[tuple[str, str], DateOrder | None, str]] = {
    "ambiguous": (
        ("03/04/2026 12:00:00", "03/04/2026 12:00:01"),
        None,
        "line 2, column 'time': expected a date whose order of day and month is known, got '03/04/2026 12:00:00'; "
        "state --date-order day or month, or [time] date_order in channels.toml",
    ),
    "against the statement": (
        ("03/04/2026 12:00:00", "03/14/2026 12:00:00"),
        "day",
        "line 3, column 'time': expected a time with the day first, as at the start, got '03/14/2026 12:00:00'",
    ),
    "no such day": (
        ("31/01/2026 12:00:00", "31/02/2026 12:00:00"),
        None,
        "line 3, column 'time': expected a time with the day first, as at the start, got '31/02/2026 12:00:00'",
    ),
    "13 o'clock": (
        ("1/31/2026 1:00 PM", "1/31/2026 13:00 PM"),
        None,
        "line 3, column 'time': expected a time with the month first, as at the start, got '1/31/2026 13:00 PM'",
    ),
    "number": (
        ("1:00:00 PM", "3601"),
        None,
        "line 3, column 'time': expected a time of day, as at the start, got '3601'",
    ),
    "overload": (("0", "OVL"), None, "column 'time', line 3: no number found"),
    "repeated": (("0.5", "0.5"), None, "column 'time', line 3: expected increasing times, got 0.5 s after 0.5 s"),
}


@pytest.mark.parametrize("name", WRONG_TIMES)
def test_wrong_times_are_refused_with_their_line(name: str, tmp_path: Path) -> None:
    times, order, line = WRONG_TIMES[name]
    with pytest.raises(InputError) as error:
        read(tmp_path / "d.csv", PLAIN.format(*times), order=order)
    assert str(error.value) == f"{tmp_path / 'd.csv'}: {line}"


def test_the_order_of_dates_in_channels_toml(tmp_path: Path) -> None:
    toml = "time.date_order = 'day'\ndefaults.unit = 'm/m'\n" + "".join(
        f"[[channel]]\nname = 'G{i}'\ngauge = 'G{i}'\n" for i in range(2)
    )
    text = PLAIN.format("01/03/2026 12:00:00", "02/03/2026 12:00:00")
    block, _ = read(tmp_path / "d.csv", text, channels=toml)
    np.testing.assert_allclose(block.time, [0.0, 86400.0])
    with pytest.raises(InputError, match=r"state --date-order day or month, or \[time\] date_order"):
        read(tmp_path / "d.csv", text, channels=toml.partition("\n")[2])
    with pytest.raises(
        InputError, match=r"--date-order month: expected as in .*channels.toml, \[time\] date_order = 'day'"
    ):
        read(tmp_path / "d.csv", text, channels=toml, order="month")


NUMERALS = {
    "points between thousands": (";", "1.234,5;-1.234.567,25e-2", (1234.5, -12345.6725)),
    "points without decimals": (";", "0,5;1.234", (0.5, 1234.0)),
    "commas between thousands": (";", "1,234.5;1,234,567E-2", (1234.5, 12345.67)),
    "commas in quotes": (",", '"1,234.5","12,345"', (1234.5, 12345.0)),
    "blanks and apostrophes": (";", "1 234,5;1'234,5", (1234.5, 1234.5)),
    "no-break spaces": ("\t", "1\u202f234,5\t1\u00a0234", (1234.5, 1234.0)),
    "a point that may be either": (";", "1.234;5.678", (1.234, 5.678)),
}


@pytest.mark.parametrize("name", NUMERALS)
def test_separators_of_thousands(name: str, tmp_path: Path) -> None:
    between, cells, expected = NUMERALS[name]
    text = between.join(["time", "G0 [um/m]", "G1 [um/m]"]) + f"\n0{between}{cells}\n"
    block, lines = read(tmp_path / "d.csv", text)
    np.testing.assert_allclose(block.strain[0], 1e-6 * np.array(expected), rtol=1e-14)
    assert bool(lines) == ("either" not in name)


@pytest.mark.parametrize("cells", ["1.234;5,678", "0,5;1.234.5", "0,5;1.2345", "0.5;1.234,5", "1.23,4;0"])
def test_marks_that_are_against_each_other_are_refused(cells: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"d\.csv: line 2, column 'G[01]': expected a number"):
        read(tmp_path / "d.csv", f"time;G0 [um/m];G1 [um/m]\n0;{cells}\n")


def test_overloads_and_missing_readings_have_no_value(tmp_path: Path) -> None:
    texts = [*OVERLOAD, *NO_READING, "-OVL", "+Inf", "overload", "---", "****", ""]
    rows = "".join(f"{k},{text},1e-6\n" for k, text in enumerate(texts, start=1))
    block, _ = read(tmp_path / "d.csv", f"time,G0,G1\n0,2e-6,1e-6\n{rows}")
    assert np.isnan(block.strain[:, 0]).tolist() == [False, *[True] * len(texts)]
    assert np.isfinite(block.strain[:, 1]).all()


def test_gaps_are_said_with_their_line(tmp_path: Path) -> None:
    time = np.delete(np.arange(30) * 0.01, [7, 8, 20, 21, 22])
    text = "time,G0,G1\n\n" + "".join(f"{t:.2f},1e-6,2e-6\n" for t in time)
    _, lines = read(tmp_path / "d.csv", text)
    line = "d.csv: column 'time': 2 gaps, the longest of 0.04 s behind line 20; samples are 0.01 s apart"
    assert [one.partition(str(tmp_path) + "/")[2] for one in lines] == [line]


def test_the_documentation_lists_the_texts_without_a_value() -> None:
    page = Path(strainfmu.__file__).parents[1] / "docs" / "howto" / "estimate_recorded.md"
    if not page.is_file():
        pytest.skip("installed without its documentation")
    text = page.read_text(encoding="utf-8")
    assert [one for one in (*OVERLOAD, *NO_READING) if f"`{one}`" not in text] == []
