"""A proposed channels.toml: gauges by name, number or order, units of the recording, read back by ``estimate``."""

from collections.abc import Callable
from pathlib import Path

import pytest
from recorded_case import NAMES
from synthetic_vehicle import SyntheticFiles

from strainfmu.errors import InputError
from strainfmu.recorded.channel_draft import channel_draft, channels, likely_pairs, similarity
from strainfmu.recorded.channel_map import load_channels

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]


def recording(path: Path, headings: list[str], units: list[str] | None = None, encoding: str = "utf-8") -> Path:
    rows = [";".join(headings), *([] if units is None else [";".join(units)])]
    rows += [";".join([f"{0.1 * i:g}".replace(".", ","), *["9e4"] * (len(headings) - 1)]) for i in range(3)]
    path.write_text("\n".join(rows), encoding=encoding)
    return path


def test_numbers_of_names_count_as_numbers() -> None:
    gauges = [f"axial_180deg_{i}" for i in range(1, 13)] + [f"hoop_180deg_{i}" for i in range(1, 13)]
    channels = [f"AX-180-{i:02d}" for i in range(12, 0, -1)] + [f"HOOP-180-{i:02d}" for i in range(1, 13)]
    found = likely_pairs(gauges, channels)
    assert found == {
        one: f"{'AX' if one.startswith('axial') else 'HOOP'}-180-{int(one.rpartition('_')[2]):02d}"
        for one in gauges
    }
    assert similarity("axial_1", "axial_11") < similarity("axial_1", "ax 1")
    assert likely_pairs(["axial_1"], ["axial-1", "axial 1", "other"]) == {}, "two that fit equally well"
    assert likely_pairs(["axial_0deg_1"], ["AI0/ch1", "1.0.1"]) == {}, "numbers alone"


def test_a_recording_of_other_names_is_read_by_its_draft(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    """Time by its unit, gauges by name, the unit of the row of units, Mach number by its usual short name."""
    names = [name.upper().replace("_", "-") for name in NAMES]
    data = recording(tmp_path / "r.csv", ["Uhr", *names, "Ma"], ["s", *["um/m"] * len(NAMES), "-"], "latin-1")
    output = tmp_path / "channels.toml"
    code, out, errors = run("channels", synthetic.map_1, data, "-o", output)
    assert (code, errors) == (0, "")
    assert (
        f"{len(NAMES)} of {len(NAMES)} gauges have a channel: {len(NAMES)} by name, 0 by roll angle and "
        "station number, 0 by order, a guess" in out
    )
    assert f"strainfmu estimate {synthetic.map_1} {data} -o loads.csv --channels {output}" in out
    found = load_channels(output)
    assert {entry.quantity: (entry.name, entry.unit) for entry in found.strain} == {
        gauge: (name, "um/m") for gauge, name in zip(NAMES, names, strict=True)
    }
    assert (found.time, found.flow[0].name, found.flow[0].quantity) == ("Uhr", "Ma", "mach_number")
    code, out, _ = run(
        *("estimate", synthetic.map_1, data, "-o", tmp_path / "loads.csv", "--channels", output),
        *("--dynamic-pressure", "9e4", "--accept-held", "--accept-strain-level"),
    )
    assert "written, 3 samples" in out, "a recording at rest, but all of its channels are read"


def test_a_recorded_simulation_is_read_by_its_draft_as_without(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    """The flow is the plant's, behind the name of its instance, not what the estimator made of it."""
    strains = [f"plant.strain[{i}]" for i in range(1, len(NAMES) + 1)]
    flow = {"plant.dynamic_pressure": 9e4, "plant.altitude": 2e4, "estimator.air_data.dynamic_pressure": 1e4}
    rows = [",".join(["time", *strains, *flow])]
    for sample in range(40):
        values = [(1.0 + 0.01 * sample) * 1e-6 * (gauge % 7 + 1) for gauge in range(len(NAMES))]
        rows.append(",".join(map(repr, [0.01 * sample, *values, *flow.values()])))
    data = tmp_path / "flight.csv"
    data.write_text("\n".join(rows) + "\n")
    channels, loads = tmp_path / "channels.toml", [tmp_path / "without.csv", tmp_path / "by_draft.csv"]
    assert run("channels", synthetic.map_1, data, "-o", channels)[0] == 0
    for output, options in zip(loads, ([], ["--channels", channels]), strict=True):
        code, _, errors = run("estimate", synthetic.map_1, data, "-o", output, *options)
        assert (code, errors) == (0, "")
    assert loads[0].read_bytes() == loads[1].read_bytes()


def test_ports_are_taken_in_their_order_and_said_to_be(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    ports = [f"AI{i // 4}/ch{i % 4}" for i in range(len(NAMES))]
    data = recording(tmp_path / "r.csv", ["t", *ports], ["s", *["mV/V"] * len(NAMES)])
    draft = channel_draft(synthetic.map_1, data)
    assert draft.channel == dict(zip(NAMES, ports, strict=True))
    assert draft.text().count("# by order, a guess") == len(NAMES)
    assert "# gauge_factor = 2.0" in draft.text()
    back = recording(tmp_path / "b.csv", ["t", *reversed(ports)], ["s", *["mV/V"] * len(NAMES)])
    assert channel_draft(synthetic.map_1, back).channel == draft.channel
    words = [f"port {'abc'[i % 3]}{i}" for i in reversed(range(len(NAMES)))]
    of_words = channel_draft(synthetic.map_1, recording(tmp_path / "w.csv", ["t", *words]))
    assert of_words.channel == dict(zip(NAMES, words, strict=True))
    fewer = channel_draft(synthetic.map_1, recording(tmp_path / "s.csv", ["t", *ports[:-1]]))
    assert (fewer.channel, fewer.free) == ({}, tuple(ports[:-1]))


def test_a_draft_that_may_have_been_corrected_is_kept(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    data = recording(tmp_path / "r.csv", ["time", *(f"plant.strain[{i}]" for i in range(1, 7))])
    output = tmp_path / "channels.toml"
    channels(synthetic.map_1, data, output)
    assert {entry.unit for entry in load_channels(output).strain} == {"m/m"}, "as strain[i] without a unit is"
    output.write_text("corrected", encoding="utf-8")
    with pytest.raises(InputError, match=r"channels\.toml: expected a new file"):
        channels(synthetic.map_1, data, output)
    assert output.read_text(encoding="utf-8") == "corrected"


def test_hostile_names_stay_a_file_of_toml(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    headings = ["time", *(f'"G""\\{i} # é"' for i in range(6)), "x\x7f"]
    data = tmp_path / "r.csv"
    data.write_text(",".join(headings) + "\n" + ",".join("0" * 8) + "\n", encoding="utf-8")
    channels(synthetic.map_1, data, tmp_path / "c.toml")
    assert len(load_channels(tmp_path / "c.toml").strain) == 6
