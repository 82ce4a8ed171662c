"""Texts as recorders and their owners write them: names and units of time, headings, ends of files, cells."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from strainfmu.can.log_frames import is_bus_log
from strainfmu.errors import InputError
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import Samples, open_recording

pytestmark = pytest.mark.fast

N = 30
TIME = 0.01 * np.arange(N)
STRAIN = np.column_stack([10.0 * (i + 1) + np.round(np.sin(40.0 * TIME * (i + 1)), 4) for i in range(3)])
NAMES = ("time", "G0", "G1", "G2", "dynamic_pressure")
UNITS = ("s", "um/m", "um/m", "um/m", "Pa")
HEADINGS = ["time", *(f"{name} [{unit}]" for name, unit in zip(NAMES[1:], UNITS[1:], strict=True))]
ROWS = [[f"{t:.4f}", *(f"{e:.6f}" for e in strain), "90000.0"] for t, strain in zip(TIME, STRAIN, strict=True)]


def text(*head: str, between: str = ",", rows: list[list[str]] = ROWS, end: str = "\n") -> str:
    """Return the lines of a recording below the lines ``head``."""
    return "\n".join([*head, *(between.join(row) for row in rows)]) + end


def heads(time: str, between: str = ",") -> str:
    return between.join([time, *HEADINGS[1:]])


def read(path: Path, content: str, channels: str = "") -> tuple[Samples, list[str]]:
    """Return the samples, and the lines for the user behind the path."""
    path.write_text(content, encoding="utf-8")
    toml = path.parent / "channels.toml"
    toml.write_text(channels)
    wanted = Wanted(gauge_names=NAMES[1:4])
    with open_recording(path, wanted, toml if channels else None) as opened:
        (block,) = opened.blocks
        return block, [line.removeprefix(f"{path}: ") for line in opened.notes]


def check(block: Samples, n: int = N) -> None:
    np.testing.assert_allclose(block.time - block.time[0], TIME[:n], atol=2e-7)
    np.testing.assert_allclose(block.strain, 1e-6 * STRAIN[:n], atol=1e-15)
    np.testing.assert_allclose(block.dynamic_pressure, 9e4, rtol=1e-12)


def column_toml(time: str = "") -> str:
    return time + "".join(
        f"[[{'flow' if i == 5 else 'channel'}]]\nname = 'column[{i}]'\nunit = '{UNITS[i - 1]}'\n"
        f"{'quantity' if i == 5 else 'gauge'} = '{NAMES[i - 1]}'\n"
        for i in range(2, 6)
    )


@pytest.mark.parametrize(
    "name",
    [
        *(
            "timestamp",
            "Timestamp",
            "TIME STAMP",
            "Zeit [s]",
            "t",
            "Elapsed Time",
            "elapsed_s",
            "Time, s",
            "Seconds",
        ),
        *(
            "GPS time [s]",
            "MET",
            "Date/Time",
            "IRIG time",
            "T / s",
            "Time (sec.)",
            "X_Value",
            "UTC",
            "Mission time",
        ),
    ],
)
def test_names_of_time(name: str, tmp_path: Path) -> None:
    check(read(tmp_path / "d.csv", text(heads(f'"{name}"')))[0])


@pytest.mark.parametrize("form", ["Time [{}]", "timestamp ({})", "time_{}", "Time / {}", "elapsed {}"])
@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        *(
            ("ns", 1e-9),
            ("µs", 1e-6),
            ("usec", 1e-6),
            ("ms", 1e-3),
            ("Msec", 1e-3),
            ("Seconds", 1.0),
            ("min", 60.0),
        ),
        *(("MIN", 60.0), ("Minutes", 60.0), ("h", 3600.0), ("hrs", 3600.0), ("days", 86400.0)),
    ],
)
def test_units_of_time(unit: str, factor: float, form: str, tmp_path: Path) -> None:
    rows = [[f"{t / factor:.12g}", *row[1:]] for t, row in zip(TIME, ROWS, strict=True)]
    check(read(tmp_path / "d.csv", text(heads(form.format(unit)), rows=rows))[0])


@pytest.mark.parametrize("name", ["Time [fortnight]", "timestamp (fortnight)"])
def test_an_unknown_unit_of_time_is_named(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"column '.*': unit: expected one of ns, .*, got 'fortnight'"):
        read(tmp_path / "d.csv", text(heads(name)))


@pytest.mark.parametrize(
    "form",
    [
        *("%j:%H:%M:%S.%f", "%Y:%j:%H:%M:%S.%f", "%j %H:%M:%S.%f", "%Y-%jT%H:%M:%S.%f", "%j/%H:%M:%S:%f"),
        *("%Y-%m-%dT%H:%M:%S.%fZ", "%Y/%m/%d %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f", "%d-%b-%Y %H:%M:%S.%f"),
        *("%Y%m%dT%H%M%S.%f", "%Y-%m-%d %H:%M:%S.%f UTC", "%b %d %Y %H:%M:%S.%f", "%d-%b-%y %H:%M:%S.%f +0100"),
        *("%H:%M:%S.%f", "%H:%M:%S:%f", "%M:%S.%f", "%I:%M:%S.%f %p"),
    ],
)
def test_forms_of_times(form: str, tmp_path: Path) -> None:
    """Across midnight and, where a date is stated, across New Year; minutes and seconds across a minute."""
    start = datetime(2024, 12, 31, 23, 59 if "%H" in form or "%I" in form else 58, 59, 850_000)
    times = [start + timedelta(seconds=float(t)) for t in TIME]
    rows = [[moment.strftime(form), *row[1:]] for moment, row in zip(times, ROWS, strict=True)]
    check(read(tmp_path / "d.csv", text(heads("IRIG time"), rows=rows))[0])


TWO_LINES = ",".join(f'"{name}\n[{unit}]"' for name, unit in zip(NAMES, UNITS, strict=True))
PLAIN = ",".join(HEADINGS)
HEADED = {
    **{f"behind {mark}": text(mark + PLAIN) for mark in ("# ", "#", "% ", "//", ";")},
    "comments": text("# rack 4", "# 100 Hz", "# " + PLAIN),
    "a mark of its own": text("#," + PLAIN),
    "break in quotes": text(TWO_LINES),
    "break in one heading": text(PLAIN.replace("G1 [um/m]", '"G1\n[um/m]"')),
    "break by Windows": text(TWO_LINES).replace("\n", "\r\n"),
    "blanks": text("time[s] G0[um/m] G1[um/m]  G2[um/m] dynamic_pressure[Pa]", between="   "),
    "blanks in headings": text("   ".join(HEADINGS), between="   "),
    "a fixed width": text(*("".join(f"{cell:>20}" for cell in row) for row in (NAMES, UNITS, *ROWS)), rows=[]),
    "bars": text(PLAIN.replace(",", "|"), between="|"),
    "byte-order mark": text("\ufeff" + PLAIN),
    "sep": text("sep=;", PLAIN.replace(",", ";"), between=";"),
}


@pytest.mark.parametrize("kind", HEADED)
def test_headings(kind: str, tmp_path: Path) -> None:
    check(read(tmp_path / "d.txt", HEADED[kind])[0])


@pytest.mark.parametrize("between", [",", ";", "\t", "  "])
def test_columns_without_headings_are_numbered(between: str, tmp_path: Path) -> None:
    content = text(between=between, rows=ROWS)
    check(read(tmp_path / "d.csv", content, column_toml("time.channel = 'column[1]'\n"))[0])
    check(read(tmp_path / "d.csv", content, column_toml("time.rate_hz = 100\n"))[0])
    with pytest.raises(InputError, match=r"column 'column\[1\]': unknown name.*no column is a gauge"):
        read(tmp_path / "d.csv", content)


ENDS = [
    "# end of data",
    "\n\nTotal samples: 30",
    '"End of recording","2024"',
    "Max,1,2,3,4",
    "Mean,,,,",
    "*** END ***",
]
ENDS += ["Statistics\nMin,1,2,3,4\nMax,5,6,7,8", "\x1a", ",,,,\n,,,,", "samples,30,rate,100,Hz", "---"]


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("newline", ["", "\n"])
def test_what_stands_behind_the_samples_is_left_out_and_said(end: str, newline: str, tmp_path: Path) -> None:
    block, lines = read(tmp_path / "d.csv", text(PLAIN) + end + newline)
    check(block)
    assert len([line for line in lines if "at the end of the file, no sample: left out ('" in line]) == 1


def test_room_that_a_recorder_took_ahead_is_no_sample(tmp_path: Path) -> None:
    check(read(tmp_path / "d.csv", text(PLAIN) + 5000 * "\x00")[0])


@pytest.mark.parametrize("cut", [12, 20, 30, 40])
def test_an_incomplete_last_line_is_left_out_and_said(cut: int, tmp_path: Path) -> None:
    block, lines = read(tmp_path / "d.csv", text(PLAIN, end="")[:-cut])
    check(block, N - 1)
    assert lines == [line for line in lines if line.startswith(f"line {N + 1}: at the end of the file, no sample")]


def test_a_line_in_the_midst_that_is_no_sample_is_refused(tmp_path: Path) -> None:
    rows = [*ROWS[:9], ["0.0900", "10.0"], *ROWS[9:]]
    with pytest.raises(InputError, match=r"d\.csv: line 11: expected 5 cells, got 2"):
        read(tmp_path / "d.csv", text(PLAIN, rows=rows))


@pytest.mark.parametrize("name", ["d.asc", "d.log", "d.dat", "d.prn", "recording"])
def test_a_text_is_a_text_whatever_its_suffix(name: str, tmp_path: Path) -> None:
    content = text("Messung 1", "\t".join(NAMES), "\t".join(UNITS), between="\t")
    check(read(tmp_path / name, content.replace(".", ","))[0])
    assert not is_bus_log(tmp_path / name)


CELLS = {
    **dict.fromkeys(("+ 0.081", "+  0.081", "+0.081", ".081", "8.1E-02", ' " + 0.081"'), 0.081),
    **dict.fromkeys(("- 0.081", "-.081"), -0.081),
    **dict.fromkeys(("++++++", "------", "********", "#####", "?", "-", "", "NaN", "#N/A", "n/a", "null"), np.nan),
    **dict.fromkeys(("BURNOUT", "Burn-out", "OVER", "-OL", "O.L", "O/L", "+Over Range", "OVERFLOW"), np.nan),
    **dict.fromkeys((">9999", "<-9999", "9.9E+37", "-9.90000000E+37", "+1.#INF00", "Bad", "inf", "HHHH"), np.nan),
}


@pytest.mark.parametrize("cell", CELLS)
def test_cells_of_recorders(cell: str, tmp_path: Path) -> None:
    rows = [list(row) for row in ROWS]
    rows[7][2] = cell.strip()
    block, _ = read(tmp_path / "d.csv", text(PLAIN, rows=rows))
    np.testing.assert_allclose(block.strain[7, 1], 1e-6 * CELLS[cell], rtol=1e-12)
    rest = np.arange(N) != 7
    np.testing.assert_allclose(block.strain[rest], 1e-6 * STRAIN[rest], atol=1e-15)


@pytest.mark.parametrize("cell", ["1D-1", "0.081um/m", "x1", "1.2.3", "0x10"])
def test_other_cells_are_refused_with_line_and_column(cell: str, tmp_path: Path) -> None:
    rows = [list(row) for row in ROWS]
    rows[7][2] = cell
    with pytest.raises(InputError, match=r"d\.csv: line 9, column 'G1': expected a number, got"):
        read(tmp_path / "d.csv", text(PLAIN, rows=rows))
