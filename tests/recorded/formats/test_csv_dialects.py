"""CSV files as recorders and spreadsheets write them, and the dynamic pressure that they do not hold."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_case import NAMES, read_csv, samples, write_flight
from synthetic_vehicle import SyntheticFiles

from strainfmu.atmosphere import dynamic_pressure
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import STATIC_PRESSURE
from strainfmu.recorded.formats import open_table
from strainfmu.recorded.names import FLOW_NAMES, Wanted
from strainfmu.recorded.samples import Samples, open_recording
from strainfmu.recorded.table import Reading

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]
TWO = Wanted(gauge_names=("G0", "G1"), flow=(*FLOW_NAMES, STATIC_PRESSURE), computes_pressure=True)
PLAIN = "time,G0,G1,dynamic_pressure\n0,1e-6,2e-6,9e4\n0.5,1.5e-6,-2e-6,9.1e4\n"


def read(path: Path, content: str | bytes, encoding: str = "utf-8") -> tuple[Samples, tuple[str, ...]]:
    """Return the samples of a file with this content, and the notes."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
    with open_recording(path, TWO) as opened:
        (block,) = opened.blocks
    return block, opened.notes


COMMA = "time;G0;G1;dynamic_pressure\n0;1,0E-06;2e-6;90000\n0,5;1,5E-06;-2e-6;91000\n"
HEADER = "Recorder;QX\nTime;2026-03-01 12:00\nRate;2;Hz\n\n"
UNITS = "Time;G0;G1;dynamic_pressure\ns;µm/m;[um/m];kPa\n0;1,0;2;90\n0,5;1,5;-2;91\n"
ISO = PLAIN.replace("\n0,", "\n2026-03-01T12:00:00Z,").replace("\n0.5,", "\n2026-03-01T12:00:00.5+00:00,")
DIALECTS = {
    "decimal comma": (COMMA, "utf-8"),
    "header block": (HEADER + COMMA, "utf-8-sig"),
    "row of units": (HEADER + UNITS, "utf-8"),
    "Latin-1": (HEADER + UNITS, "latin-1"),
    "UTF-16": (HEADER + UNITS, "utf-16"),
    "UTF-16 without a mark": (COMMA, "utf-16-be"),
    "blank line ahead of the units": (UNITS.replace("\ns;", "\n\ns;"), "utf-8"),
    "tab": (PLAIN.replace(",", "\t"), "utf-16-le"),
    "old Mac": (PLAIN.replace("\n", "\r"), "utf-8"),
    "ISO 8601": (ISO, "utf-8"),
    "time of day": (COMMA.replace("\n0;", "\n23:59:58,25;").replace("\n0,5;", "\n23:59:58,75;"), "utf-8"),
    "milliseconds and ISO": (ISO.replace("time,", "time [ms],"), "utf-8"),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_a_dialect_gives_the_numbers_of_the_plain_file(name: str, tmp_path: Path) -> None:
    expected, _ = read(tmp_path / "plain.csv", PLAIN)
    content, encoding = DIALECTS[name]
    block, notes = read(tmp_path / "d.csv", content, encoding)
    np.testing.assert_allclose(block.time, expected.time, atol=1e-12)
    np.testing.assert_allclose(block.strain, expected.strain, rtol=1e-12)
    np.testing.assert_allclose(block.dynamic_pressure, expected.dynamic_pressure, rtol=1e-12)
    is_iso = "ISO" in name or "day" in name
    assert [note for note in notes if "times of ISO 8601, read as seconds since" in note] == list(notes)
    assert len(notes) == is_iso


REFUSED = {
    COMMA.replace(
        "0,5;", "0.5;"
    ): "line 3, column 'time': expected a number with a decimal ',', as before, got '0.5'",
    COMMA.replace("1,5E-06", "1.23,5"): "line 3, column 'G0': expected a number, got '1.23,5'",
    PLAIN.replace(
        "1.5e-6", '"1,5e-6"'
    ): "line 3, column 'G0': expected a number with a decimal point, got '1,5e-6'",
    ISO.replace(".5+00:00", ".5"): "line 3, column 'time': expected a time zone everywhere or nowhere, got both",
    ISO.replace("2026-03-01T12:00:00.5+00:00", "0.5"): "expected a time of ISO 8601, as at the start, got '0.5'",
    ISO.replace("2026-03-01T12:00:00.5+00:00", "noon"): "expected a time of ISO 8601, as at the start, got 'noon'",
    ISO.replace("-01T12:00:00.5", "-01T11:00:00"): "column 'time', line 3: expected increasing times, got -3600 s",
    UNITS.replace("µm/m", "furlong"): "column 'G0': unit: expected one of um/m, ",
    UNITS.replace("G0", "G0 [mm/m]"): "unit: expected one, got 'mm/m' in the heading and 'µm/m' below",
    PLAIN.replace("0.5,", "0.5,\x00"): "damaged, or not a CSV file: expected text, got bytes of 0",
}


@pytest.mark.parametrize("content", REFUSED, ids=range(len(REFUSED)))
def test_what_is_ambiguous_is_refused_in_one_line(content: str, tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    with pytest.raises(InputError) as error:
        read(path, content)
    assert REFUSED[content] in str(error.value)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_dynamic_pressure_from_altitude_is_computed_and_said(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    mach = np.linspace(5.0, 6.0, 20)
    time, strain, _ = samples(20)
    path = tmp_path / "d.csv"
    headings = ["time", *NAMES, "mach_number", "altitude [ft]"]
    table = np.column_stack([time, strain, mach, np.full(20, 20e3 / 0.3048)])
    np.savetxt(path, table, delimiter=",", header=",".join(headings), comments="", fmt="%.17g")
    code, out, _ = run("estimate", synthetic.map_1, path, "-o", tmp_path / "o.csv", "--columns", "all")
    assert code == 0
    assert "d.csv: no dynamic_pressure found: computed from mach_number and altitude" in out
    expected = [dynamic_pressure(one, 20e3) for one in mach]
    np.testing.assert_allclose(read_csv(tmp_path / "o.csv")["dynamic_pressure [Pa]"], expected, rtol=1e-12)


def test_a_measured_static_pressure_comes_before_the_atmosphere(tmp_path: Path) -> None:
    text = "time,G0,G1,mach_number,altitude,static_pressure [psf]\n0,0,0,6,20000,100\n1,0,0,6,20000,\n"
    block, notes = read(tmp_path / "d.csv", text)
    # 100 lbf/ft2 = 100 x 4.4482216152605 N / 0.3048^2 m2
    np.testing.assert_allclose(
        block.dynamic_pressure, [0.7 * 36.0 * 444.82216152605 / 0.3048**2, np.nan], rtol=1e-14
    )
    assert "mach_number and static_pressure" in notes[0]
    assert set(block.flow) == {"dynamic_pressure", "mach_number", "altitude"}


def test_a_recorded_dynamic_pressure_is_taken_as_it_is(tmp_path: Path) -> None:
    path = write_flight(tmp_path / "d.csv", mach_number=6.0, static_pressure=1.0, altitude=2e4)
    wanted = Wanted(gauge_names=tuple(NAMES), flow=TWO.flow, computes_pressure=True)
    with open_recording(path, wanted) as opened:
        (block,) = opened.blocks
    np.testing.assert_allclose(block.dynamic_pressure, samples(20)[2], rtol=1e-12)
    assert opened.notes == []
    assert opened.selection.unused == ("static_pressure",)
    path = write_flight(tmp_path / "n.csv", **{"static_pressure [hPa]": 55.0})
    path.write_text(path.read_text().replace("dynamic_pressure", "dynamic_pressure [kPa]"))
    with open_recording(path, replace(wanted, navigates=True)) as opened:
        assert opened.selection.pressure_name == ("dynamic_pressure", 1e3), "its own unit"


def test_above_the_atmosphere_there_is_no_dynamic_pressure(tmp_path: Path) -> None:
    text = "time,G0,G1,mach_number,altitude [km]\n0,0,0,6,20\n1,0,0,6,72\n2,0,0,6,\n"
    block, _ = read(tmp_path / "d.csv", text)
    assert np.isfinite(block.dynamic_pressure).tolist() == [True, False, False]


def test_a_static_pressure_by_another_name_is_suggested(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="column 'Ps': unknown name; did you mean 'static_pressure'"):
        read(tmp_path / "d.csv", "time,G0,G1,mach_number,Ps\n0,0,0,6,100\n")


@pytest.mark.parametrize("unknown", [0, 8])
def test_numbers_of_samples_are_not_searched_for_headings(tmp_path: Path, unknown: int) -> None:
    known = [f"G{i}" for i in range(20)]
    headings, rows = [*known, *(f"x{i}" for i in range(unknown))], 150
    lines = [headings, *([str(0.5 * row + i) for i in range(len(headings))] for row in range(rows))]
    (tmp_path / "d.csv").write_text("".join(",".join(line) + "\n" for line in lines))
    asked = Counter[bool]()

    def is_known(name: str) -> bool:
        asked[name in headings] += 1
        return name in known

    with open_table(tmp_path / "d.csv", Reading(is_known=is_known)) as table:
        assert [column.heading for column in table.columns] == headings
    assert asked[False] == 0


def test_a_table_of_factors_ahead_of_the_headings_is_not_taken_for_them(tmp_path: Path) -> None:
    """All of its names are known and numbers follow; the headings have more names."""
    factors = "G0,G1\n2.08,2.09\n\n"
    block, _ = read(tmp_path / "d.csv", factors + PLAIN)
    assert block.time.tolist() == [0.0, 0.5]
