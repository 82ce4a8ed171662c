"""The generated DBC file, and users' DBC files."""

import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cantools
import numpy as np
import pytest
from can_case import CYCLE, Truth, dbc_text_of, frames_of, gauge_names, layout_of, run_core

from strainfmu.can.dbc_files import database_of, load_mapping
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.dbc_writer import dbc_text
from strainfmu.can.frame import Frame
from strainfmu.can.profiles import PROFILES
from strainfmu.can.quality import FrameClass, Quality
from strainfmu.errors import InputError


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("profile", PROFILES)
def test_a_generated_dbc_file_survives_loading_and_dumping(profile: str, extended: bool) -> None:
    text = dbc_text_of(profile, extended=extended)
    database = cantools.database.load_string(text, "dbc")
    assert database.as_dbc_string() == text
    ours = frames_of(profile, 54, extended)
    for layout in ours:
        message = database.get_message_by_name(layout.name)
        assert (message.frame_id, message.length) == (layout.identifier, layout.length)
        assert (message.is_fd, message.is_extended_frame) == (layout.is_fd, extended)
        assert message.cycle_time == (None if layout.cycle_time is None else 10)
        if layout.protection is not None:
            assert message.dbc.attributes["E2EDataID"].value == layout.protection.data_id
            assert message.dbc.attributes["E2EProfile"].value == layout.protection.profile
        if layout.secured is not None:
            assert message.dbc.attributes["SecOCDataID"].value == layout.secured.data_id
    assert {m.is_fd for m in database.messages} == {profile.startswith("fd64")}


def test_a_mapping_of_authenticated_frames_is_refused() -> None:
    from strainfmu.can.dbc_files import database_of
    from strainfmu.can.dbc_mapping import mapped_layout

    text = dbc_text_of("fd64-sec", 2)
    strain = dict(zip(gauge_names(2), ("Strain1.gauge_0", "Strain1.gauge_1"), strict=True))
    with pytest.raises(InputError, match=r"frame 'Strain1' is authenticated \(SecOCDataID\).*--profile fd64-sec"):
        mapped_layout(database_of(text, "x.dbc"), {"strain": strain}, gauge_names=gauge_names(2), name="m.toml")
    assert "SecOCDataID" not in dbc_text_of("fd64", 2)


# GSV-4 style: four strains of 16 bits, high byte first, offset binary; nothing else in the frame.
BIG_ENDIAN = """VERSION ""
NS_ :
BS_:
BU_: Amp Bridge
BO_ 256 Amp1: 8 Amp
 SG_ ch1 : 7|16@0+ (0.05,-1638.4) [0|0] "um/m" Bridge
 SG_ ch2 : 23|16@0+ (0.05,-1638.4) [0|0] "um/m" Bridge
 SG_ ch3 : 39|16@0+ (0.05,-1638.4) [0|0] "um/m" Bridge
 SG_ ch4 : 55|16@0+ (0.05,-1638.4) [0|0] "um/m" Bridge
BO_ 257 Amp2: 8 Amp
 SG_ ch1 : 7|16@0+ (0.05,-1638.4) [0|0] "um/m" Bridge
 SG_ ch2 : 23|16@0+ (0.05,-1638.4) [0|0] "um/m" Bridge
BA_DEF_ BO_  "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_  "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 256 10;
BA_ "GenMsgCycleTime" BO_ 257 10;
"""
BIG_ENDIAN_MAPPING = {
    "strain": {
        "gauge 0": "Amp1.ch1",
        "gauge 1": "Amp1.ch2",
        "gauge 2": "Amp2.ch2",
        "gauge 3": "Amp1.ch4",
        "gauge 4": "Amp2.ch1",
        "strain[6]": "Amp1.ch3",
    }
}

# Two float32 per frame, 29 bit identifiers, strain in percent of nothing but its own unit; q_inf in kPa.
FLOATS = (
    """VERSION ""
NS_ :
BS_:
BU_: Mim Bridge
"""
    + "".join(
        f"""BO_ {0x80000000 | 0x18FF3100 + i} Mim{i}: 8 Mim
 SG_ a : 0|32@1- (1,0) [-20000|20000] "ustrain" Bridge
 SG_ b : 32|32@1- (1,0) [-20000|20000] "" Bridge
"""
        for i in range(3)
    )
    + f"""BO_ {0x80000000 | 0x18FF3110} Air: 8 Mim
 SG_ q : 0|32@1- (1,0) [0|1000] "kPa" Bridge
 SG_ t : 32|32@1+ (1,0) [0|0] "us" Bridge
"""
    + "".join(f"SIG_VALTYPE_ {0x80000000 | 0x18FF3100 + i} {s} : 1;\n" for i in range(3) for s in "ab")
    + f"SIG_VALTYPE_ {0x80000000 | 0x18FF3110} q : 1;\n"
)
FLOATS_MAPPING = {
    "cycle_time_ms": 10,
    "strain": {f"gauge {2 * i + j}": f"Mim{i}.{'ab'[j]}" for i in range(3) for j in range(2)},
    "units": {f"Mim{i}.b": "um/m" for i in range(3)},
    "dynamic_pressure": {"signal": "Air.q"},
    "sample_time": {"Air": "Air.t"},
}


def test_big_endian_frames_of_an_amplifier() -> None:
    """Bytes composed by struct, not by us: order, offset and scale as the amplifier's manual has them."""
    layout = mapped_layout(
        database_of(BIG_ENDIAN, "amp"), BIG_ENDIAN_MAPPING, gauge_names=gauge_names(6), name="map"
    )
    truth, frames = Truth(6, 1), []
    for k in range(40):
        raw = np.rint((1e6 * truth.cycle(k)[0] + 1638.4) / 0.05).astype(int)
        frames.append(
            Frame(identifier=256, data=struct.pack(">4H", raw[0], raw[1], raw[5], raw[3]), time=k * CYCLE)
        )
        frames.append(Frame(identifier=257, data=struct.pack(">2H4x", raw[4], raw[2]), time=k * CYCLE + 1e-3))
    results, core = run_core(layout, frames, 6, dynamic_pressure=9e4)
    good = [result for result in results if result.quality is Quality.UNPROTECTED]
    assert len(good) == 37, "never VALID: no CRC; three cycles until it is trusted"
    # 0.025 um/m, half a quantum.
    np.testing.assert_allclose(good[-1].strain, truth.cycle(39)[0], atol=0.0251e-6)
    assert core.account.classes[FrameClass.USED] == 74


def test_float_frames_with_29_bit_identifiers() -> None:
    layout = mapped_layout(database_of(FLOATS, "mim"), FLOATS_MAPPING, gauge_names=gauge_names(6), name="map")
    truth, frames = Truth(6, 1), []
    for k in range(40):
        strain, pressure = truth.cycle(k)
        air = struct.pack("<fI", 1e-3 * pressure, round(1e6 * k * CYCLE))
        frames.append(Frame(identifier=0x18FF3110, data=air, time=k * CYCLE, is_extended=True))
        for i in range(3):
            data = struct.pack("<2f", *(1e6 * strain[2 * i : 2 * i + 2]))
            frames.append(
                Frame(identifier=0x18FF3100 + i, data=data, time=k * CYCLE + 1e-3 * (i + 1), is_extended=True)
            )
    results, _ = run_core(layout, frames, 6)
    assert results[-1].quality is Quality.UNPROTECTED
    np.testing.assert_allclose(results[-1].strain, truth.cycle(39)[0], rtol=1e-7)
    # float32 of kPa.
    assert results[-1].dynamic_pressure == pytest.approx(truth.cycle(39)[1], rel=1e-7)
    # HBK's answer to a sensor error is 2.0E15; of integers it is 0.
    broken = [replace(f, data=struct.pack("<2f", 2e15, 1.0)) if f.identifier == 0x18FF3101 else f for f in frames]
    results, _ = run_core(layout, broken, 6)
    assert results[-1].quality is Quality.DEGRADED
    assert np.flatnonzero(~results[-1].valid).tolist() == [2, 3], "out of range, and stuck"


def test_multiplexed_frames() -> None:
    text = (
        BIG_ENDIAN.split("BO_ 257")[0].split("BO_ 256")[0]
        + """BO_ 256 Amp1: 8 Amp
 SG_ page M : 0|8@1+ (1,0) [0|0] "" Bridge
 SG_ a m0 : 8|16@1- (0.25,0) [0|0] "um/m" Bridge
 SG_ b m0 : 24|16@1- (0.25,0) [0|0] "um/m" Bridge
 SG_ c m1 : 8|16@1- (0.25,0) [0|0] "um/m" Bridge
"""
    )
    mapping = {
        "cycle_time_ms": 10,
        "strain": {"gauge 0": "Amp1.a", "gauge 1": "Amp1.c", "gauge 2": "Amp1.b"},
    }
    layout = mapped_layout(database_of(text, "mux"), mapping, gauge_names=gauge_names(3), name="map")
    frames = []
    for k in range(20):
        frames.append(Frame(identifier=256, data=struct.pack("<Bhh3x", 0, 400 + k, 800 + k), time=k * CYCLE))
        frames.append(Frame(identifier=256, data=struct.pack("<Bh5x", 1, 1200 + k), time=k * CYCLE + 1e-3))
        frames.append(Frame(identifier=256, data=struct.pack("<Bh5x", 2, 1), time=k * CYCLE + 2e-3))
    results, core = run_core(layout, frames, 3, dynamic_pressure=9e4)
    assert results[-1].quality is Quality.UNPROTECTED
    np.testing.assert_allclose(1e6 * results[-1].strain, np.array([419, 1219, 819]) / 4.0)
    assert core.account.classes[FrameClass.NOT_USABLE] == 20, "a page that nothing is mapped to"


def test_a_users_dbc_file_may_state_end_to_end_protection() -> None:
    """Our own DBC file as if it were a user's: protection and configuration come from its attributes."""
    names = gauge_names(30)
    profile = layout_of("fd64", 30)
    text = dbc_text([frame.layout for frame in profile.frames], "x")
    mapping = {
        "strain": {name: f"Strain{1 + i // 27}.gauge_{i}" for i, name in enumerate(names)},
        "dynamic_pressure": {"signal": "DynamicPressure.DynamicPressure"},
        **{
            role: {f: f"{f}.{signal}" for f in ("Strain1", "Strain2", "DynamicPressure")}
            for role, signal in (
                ("sample_time", "SampleTime"),
                ("status", "Status"),
                ("configuration", "Configuration"),
            )
        },
    }
    layout = mapped_layout(database_of(text, "own"), mapping, gauge_names=names, name="map")
    assert layout.is_protected
    assert layout.is_timed
    from can_case import run_campaign
    from can_faults import Fault, FaultKind

    kinds = (FaultKind.CORRUPTION, FaultKind.CONFIGURATION, FaultKind.DELAY, FaultKind.RESTART)
    run = run_campaign(
        layout, [Fault(kind=kind, start=40 + 60 * i, cycles=10, seed=i) for i, kind in enumerate(kinds)], 300
    )
    assert run.false_valid == []
    assert run.late_recovery == []
    assert run.results[-1].quality is Quality.VALID


def test_all_other_gauges_are_the_signals_of_their_names() -> None:
    names = gauge_names(30)
    text = dbc_text([frame.layout for frame in layout_of("fd64", 30).frames], "x")
    paths = {name: f"Strain{1 + i // 27}.gauge_{i}" for i, name in enumerate(names)}
    mapping = {
        "strain": {names[2]: paths.pop(names[2]), **paths},
        "dynamic_pressure": {"signal": "DynamicPressure.DynamicPressure"},
    }
    short = {**mapping, "strain": {names[2]: "Strain1.gauge_2", "*": "Strain*.*"}}
    one, other = (mapped_layout(database_of(text, "own"), m, names, name="map") for m in (mapping, short))
    assert one == other
    for pattern, found in (("Rack*.*", "none"), ("*.*", "Strain1.gauge_0, Copy.gauge_0")):
        twice = text + 'BO_ 999 Copy: 8 x\n SG_ gauge_0 : 0|16@1- (1,0) [0|0] "um/m" x\n'
        with pytest.raises(InputError, match=rf"for gauge 'gauge 0', got {found}$"):
            mapped_layout(
                database_of(twice, "own"), {**mapping, "strain": {"*": pattern}}, gauge_names=names, name="map"
            )


def change(path: str, value: object) -> Callable[[], dict]:
    """Return a maker of the big-endian mapping with one entry changed; None takes it away."""

    def make() -> dict:
        mapping: dict = {"strain": dict(BIG_ENDIAN_MAPPING["strain"]), "cycle_time_ms": 10}
        *tables, key = path.split("/")
        table = mapping
        for name in tables:
            table = table.setdefault(name, {})
        if value is None:
            del table[key]
        else:
            table[key] = value
        return mapping

    return make


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (change("strain/gauge 1", None), r"expected one signal for gauge 'gauge 1', got none"),
        (change("strain/gauge 5", "Amp1.ch3"), "expected one signal for gauge 'gauge 5', got 2"),
        (change("strain/gauge 9", "Amp1.ch3"), "expected a gauge of the FMU .*, got 'gauge 9'"),
        (change("strain/gauge 1", "Amp1.ch1"), "'Amp1.ch1' found for two gauges"),
        (change("strain/gauge 1", "Amp3.ch1"), "no frame 'Amp3'"),
        (change("strain/gauge 1", "Amp1.ch9"), "no signal 'ch9' in frame 'Amp1'"),
        (change("strain/gauge 1", "Amp1"), "expected 'Message.Signal', got"),
        (change("strain/gauge 1", 7), "expected 'Message.Signal', got"),
        (change("strian/x", "y"), "expected one of .*, got entry 'strian'"),
        (change("strain", {}), r"expected a table \[strain\]"),
        (change("units/Amp1.ch1", "furlong"), "unit: expected a unit of strain .*, got 'furlong'"),
        (change("cycle_time_ms", -1), "cycle_time_ms: -1 ms found"),
        (change("end_to_end/Amp1", {"profile": 4, "data_id": 1}), "profile 4 found, 1 or 5 allowed"),
        (change("end_to_end/Amp1", {"profile": 5, "data_id": 70000}), "data_id 70000 found"),
        (
            change("sample_time/Amp1", "Amp1.ch3"),
            r"got none for 'Amp2'|unit: expected a unit of time .*, got 'um/m'",
        ),
        (change("dynamic_pressure/signal", "Amp1.ch3"), "a unit of pressure"),
    ],
)
def test_a_wrong_mapping_is_one_line(make: Callable[[], dict], text: str) -> None:
    with pytest.raises(InputError, match=text) as caught:
        mapped_layout(database_of(BIG_ENDIAN, "amp"), make(), gauge_names=gauge_names(6), name="map.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", ["strain = [", "\x00", "a = 1\na = 2"])
def test_a_mapping_file_that_is_no_toml_is_one_line(tmp_path: Path, content: str) -> None:
    path = tmp_path / "map.toml"
    path.write_text(content)
    with pytest.raises(InputError, match=r"map\.toml: not a TOML file"):
        load_mapping(path)
