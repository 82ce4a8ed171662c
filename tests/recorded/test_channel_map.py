"""What channels.toml makes of a recorder's channels: bridges, leads, rosettes, names, missing channels, rates."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from strainfmu.errors import InputError
from strainfmu.recorded.channel_map import bridge_strain, lead_factor
from strainfmu.recorded.names import Wanted, matched, suggestion
from strainfmu.recorded.samples import Samples, open_recording

pytestmark = pytest.mark.fast

K, NU, STRAIN = 2.1, 0.3, 3e-3
FILE = Path("f")


def divider(one: float, two: float) -> float:
    """Return the voltage at the middle of two arms over that of the excitation."""
    return one / (one + two)


ARMS = {
    # Strains in the arms 1, 2, 3, 4; the output is that of the divider 1-2 less that of 4-3.
    "quarter": (1.0, 0.0, 0.0, 0.0),
    "half-poisson": (1.0, -NU, 0.0, 0.0),
    "full-poisson": (1.0, -NU, 1.0, -NU),
}


@pytest.mark.parametrize("bridge", ARMS)
def test_each_bridge_gives_the_strain_of_its_arms_back(bridge: str) -> None:
    """Against Kirchhoff's rules for four resistors; a strain of 3000 um/m, where the non-linearity is 0.3 %."""
    r1, r2, r3, r4 = (1.0 + K * STRAIN * part for part in ARMS[bridge])
    output = np.array([divider(r1, r2) - divider(r4, r3)])
    np.testing.assert_allclose(bridge_strain(output, bridge, K, NU), STRAIN, rtol=1e-12)


@pytest.mark.parametrize(("wires", "leads"), [(2, 2), (3, 1)])
def test_leads_in_the_arm_of_a_gauge(wires: int, leads: int) -> None:
    """Leads stand in series with the gauge; those of three wires also with the resistor beside it."""
    lead, gauge = 4.0, 350.0
    arm = gauge * (1.0 + K * STRAIN) + leads * lead
    output = np.array([divider(arm, gauge + leads * lead) - 0.5])
    found = bridge_strain(output, "quarter", K, NU) * lead_factor(wires, lead, gauge)
    np.testing.assert_allclose(found, STRAIN, rtol=1e-12)


def test_leads_of_a_full_bridge_lower_its_excitation() -> None:
    assert lead_factor(4, 3.5, 350.0) == pytest.approx(357.0 / 350.0)
    assert lead_factor(6, 3.5, 350.0) == 1.0


def read(folder: Path, csv: str, toml: str, *gauges: str) -> tuple[Samples, list[str]]:
    """Return the samples and the notes of a recording."""
    data, channels = folder / "d.csv", folder / "channels.toml"
    data.write_text(csv, encoding="utf-8")
    channels.write_text(toml, encoding="utf-8")
    wanted = Wanted(gauge_names=gauges, fixed_pressure=9e4)
    with open_recording(data, wanted, channels) as opened:
        (block,) = opened.blocks
    return block, opened.notes


def entry(name: str, gauge: str, more: str = "unit = 'um/m'") -> str:
    return f"[[channel]]\nname = '{name}'\ngauge = '{gauge}'\n{more}\n"


def test_a_missing_channel_leaves_its_gauge_out_and_is_said_once(tmp_path: Path) -> None:
    csv = "time,AI 1,AI 2\n0,1,2\n1,3,4\n"
    toml = entry("ai1", "A") + entry("AI 11", "B")
    block, notes = read(tmp_path, csv, toml, "A", "B", "C")
    np.testing.assert_allclose(block.strain, 1e-6 * np.array([[1, np.nan, np.nan], [3, np.nan, np.nan]]))
    assert len([note for note in notes if "AI 11" in note]) == 1
    assert f"{tmp_path / 'd.csv'}: no channel 'AI 11' found, did you mean 'AI 1'; gauge 'B' is left out" in notes
    assert f"{tmp_path / 'channels.toml'}: no channel for 1 gauges of the map, left out: C" in notes


def test_names_are_compared_without_case_and_blanks() -> None:
    names = ("AI0/Ch 3", "AI1/ch3", "AI1/ch4", "x.Y")
    assert matched(FILE, "channel", "ai0 / CH3", names) == "AI0/Ch 3"
    assert matched(FILE, "channel", "CH4", names) == "AI1/ch4"
    assert matched(FILE, "channel", "y", names) == "x.Y"
    assert matched(FILE, "channel", "ch5", names) is None
    assert matched(FILE, "channel", "x.y", ("x.Y", "x.y")) == "x.y"
    with pytest.raises(
        InputError, match="channel 'ch3': expected one of that name, got 2: 'AI0/Ch 3' and 'AI1/ch3'"
    ):
        matched(FILE, "channel", "ch3", names)
    assert suggestion("AI1/ch5", names) == "did you mean 'AI1/ch4'"
    assert suggestion("pressure", ("a", "b")) == "there are a, b"


def test_the_unit_that_is_used_against_the_recordings_is_said(tmp_path: Path) -> None:
    block, notes = read(
        tmp_path,
        "time,a [um/m],b [um/m]\n0,1,1\n",
        entry("a", "A", "unit = 'mm/m'") + entry("b", "B", ""),
        "A",
        "B",
    )
    np.testing.assert_allclose(block.strain, [[1e-3, 1e-6]])
    assert len(notes) == 1
    assert "units other than the recording's are used in 1 channels: 'a' mm/m, not um/m" in notes[0]


def test_temperature_compensation_is_said(tmp_path: Path) -> None:
    toml = entry("a", "A", "unit = 'um/m'\ntemperature_compensation = 'none'") + entry("b", "B")
    _, notes = read(tmp_path, "time,a,b\n0,1,1\n", toml, "A", "B")
    assert notes == [
        f"{tmp_path / 'channels.toml'}: temperature compensation of the channels: none 1, not stated 1; "
        "nothing else is taken off",
    ]


def test_a_rosette_gives_the_strain_at_the_angle_of_a_gauge(tmp_path: Path) -> None:
    """Legs at 10, 70 and 130 deg; gauges at 0 and 90, and one at a leg, which needs no other."""
    e_x, e_y, shear = 400.0, -120.0, 300.0

    def at(angle: float) -> float:
        turn = np.radians(angle)
        return float(e_x * np.cos(turn) ** 2 + e_y * np.sin(turn) ** 2 + shear * np.sin(turn) * np.cos(turn))

    csv = f"time,a,b,c\n0,{at(10.0)!r},{at(70.0)!r},{at(130.0)!r}\n1,{at(10.0)!r},1,\n"
    toml = "".join(entry(name, f"leg {name}") for name in "abc")
    toml += "[[rosette]]\nlegs = ['Leg A', 'leg b', 'leg c']\nangles_deg = [10, 70, 130]\n"
    toml += "gauges_deg = { axial = 0, hoop = 90.0, leg = 190 }\n"
    block, _ = read(tmp_path, csv, toml, "axial", "hoop", "leg")
    np.testing.assert_allclose(block.strain[0], 1e-6 * np.array([e_x, e_y, at(10.0)]), rtol=1e-9)
    np.testing.assert_allclose(block.strain[1], [np.nan, np.nan, 1e-6 * at(10.0)], rtol=1e-9)


def test_a_poisson_bridge_under_uniaxial_stress(tmp_path: Path) -> None:
    more = (
        "unit = 'mV/V'\nbridge = 'full-poisson'\ngauge_factor = 2.0\npoisson_ratio = 0.25\nuniaxial_stress = true"
    )
    block, _ = read(tmp_path, "time,a\n0,1\n", entry("a", "A", more), "A")
    np.testing.assert_allclose(block.strain, [[2e-3 / (1.25 - 0.75e-3) / 2.0]], rtol=1e-12)


def test_the_raster_can_be_stated_and_mostly_empty_columns_are_slower(tmp_path: Path) -> None:
    rows = [f"{k},{k},{k},{10 * k if k % 3 == 0 else ''}" for k in range(10)]
    toml = entry("a", "A") + entry("b", "B") + entry("c", "C")
    block, notes = read(tmp_path, "\n".join(["time,a,c,b", *rows]), toml, "A", "B", "C")
    np.testing.assert_allclose(block.strain[:, 1], 1e-5 * np.arange(10.0), rtol=1e-12)
    assert "1 columns of 3000 ms ('b') interpolated at the samples of 'a', every 1000 ms" in notes[0]
    block, _ = read(tmp_path, "\n".join(["time,a,c,b", *rows]), f"join.raster = 'b'\n{toml}", "A", "B", "C")
    np.testing.assert_allclose(block.time, [0.0, 3.0, 6.0, 9.0])


def test_groups_of_a_tdms_file_have_times_of_their_own(tmp_path: Path) -> None:
    """Two groups with a channel of time each, in the unit stated; two waveforms that start at different times."""
    nptdms = pytest.importorskip("nptdms")
    data, channels = tmp_path / "d.tdms", tmp_path / "channels.toml"
    ramp = np.arange(5.0)
    start = np.datetime64("2026-03-01T12:00:00")
    waves = [{"wf_increment": 1.0, "wf_start_time": start + np.timedelta64(s, "s")} for s in (0, 2)]
    grouped = [("g", "Time", ramp, {}), ("g", "a", ramp, {}), ("h", "Time", 0.5 * np.arange(10.0), {})]
    grouped += [("h", "b", np.arange(10.0), {})]
    started = [("g", "a", ramp, waves[0]), ("h", "b", ramp, waves[1])]
    for objects, unit, time, expected in (
        (grouped, "time.unit = 'ms'\n", 1e-3 * ramp, 2.0 * ramp),
        (started, "", ramp, np.array([np.nan, np.nan, 0.0, 1.0, 2.0])),
    ):
        with nptdms.TdmsWriter(data) as writer:
            writer.write_segment([nptdms.ChannelObject(*one) for one in objects])
        channels.write_text(unit + entry("a", "A") + entry("b", "B"), encoding="utf-8")
        with open_recording(data, Wanted(gauge_names=("A", "B"), fixed_pressure=9e4), channels) as opened:
            (block,) = opened.blocks
        np.testing.assert_allclose(block.time, time, rtol=1e-12)
        np.testing.assert_allclose(block.strain[:, 1], 1e-6 * expected, rtol=1e-12)


def test_a_channel_that_is_there_without_numbers_is_refused_not_left_out(tmp_path: Path) -> None:
    data, channels = tmp_path / "d.h5", tmp_path / "channels.toml"
    channels.write_text(entry("a", "A") + entry("b", "B"), encoding="utf-8")
    for value, line in (
        (np.array([b"x"] * 4), "column 'b': values that are no numbers"),
        (np.ones(4) * 1j, "column 'b': values that are no numbers"),
        (np.empty(0), "column 'b': expected 4 values, as many as times in 'time', got 0"),
    ):
        with h5py.File(data, "w") as file:
            file["time"], file["a"], file["b"] = np.arange(4.0), np.arange(4.0), value
        wanted = Wanted(gauge_names=("A", "B"), fixed_pressure=9e4)
        with pytest.raises(InputError, match=line), open_recording(data, wanted, channels):
            pass
