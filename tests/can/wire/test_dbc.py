"""The generated DBC file, users' DBC files, and nodes that know nothing but them."""

from __future__ import annotations

import importlib.util
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import cantools
import numpy as np
import pytest
from can_case import CYCLE, Projection, Truth, gauge_names, layout_of

from strainfmu.can.bridge.result_frames import BridgeStatus, ResultFrames
from strainfmu.can.bridge.result_layouts import result_layouts
from strainfmu.can.cycle.core import BridgeCore, bridge_core
from strainfmu.can.cycle.frame_account import FrameClass
from strainfmu.can.cycle.quality import Cause, Quality
from strainfmu.can.cycle.result import CycleResult
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.tools.dbc_export import all_layouts
from strainfmu.can.wire.dbc_files import database_of, load_mapping
from strainfmu.can.wire.dbc_mapping import mapped_layout
from strainfmu.can.wire.dbc_writer import dbc_text
from strainfmu.can.wire.frame import Frame, from_message
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.can.wire.profiles import PROFILES, Identifiers, configuration_of
from strainfmu.can.wire.strain_encoder import StrainEncoder
from strainfmu.errors import InputError

EXAMPLE = Path(__file__).parents[3] / "docs" / "howto" / "can_cantools_example.py"


def text_of(profile: str, n_gauges: int = 54, extended: bool = False) -> str:
    layouts = all_layouts(
        profile, gauge_names(n_gauges), cycle_time=CYCLE, identifiers=Identifiers(is_extended=extended)
    )
    return dbc_text(layouts, "test")


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("profile", PROFILES)
def test_a_generated_dbc_file_survives_loading_and_dumping(profile: str, extended: bool) -> None:
    text = text_of(profile, extended=extended)
    database = cantools.database.load_string(text, "dbc")
    assert database.as_dbc_string() == text
    ours = all_layouts(profile, gauge_names(54), cycle_time=CYCLE, identifiers=Identifiers(is_extended=extended))
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
    from strainfmu.can.wire.dbc_files import database_of
    from strainfmu.can.wire.dbc_mapping import mapped_layout

    text = text_of("fd64-sec", 2)
    strain = dict(zip(gauge_names(2), ("Strain1.gauge_0", "Strain1.gauge_1"), strict=True))
    with pytest.raises(InputError, match=r"frame 'Strain1' is authenticated \(SecOCDataID\).*--profile fd64-sec"):
        mapped_layout(database_of(text, "x.dbc"), {"strain": strain}, gauge_names=gauge_names(2), name="m.toml")
    assert "SecOCDataID" not in text_of("fd64", 2)


def run_core(
    layout: InputLayout, frames: list[Frame], n: int, **options: float
) -> tuple[list[CycleResult], BridgeCore]:
    core = bridge_core(layout, Projection(n), BridgeSettings(), start=0.0, **options)
    results = [result for frame in frames for result in core.receive(frame)]
    results += core.advance(frames[-1].time + 0.5 * CYCLE)
    core.finish(frames[-1].time + CYCLE)
    assert core.account.unaccounted == 0
    return results, core


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

    from strainfmu.can.tools.faults import Fault, FaultKind

    kinds = (FaultKind.CORRUPTION, FaultKind.CONFIGURATION, FaultKind.DELAY, FaultKind.RESTART)
    run = run_campaign(
        layout, [Fault(kind=kind, start=40 + 60 * i, cycles=10, seed=i) for i, kind in enumerate(kinds)], 300
    )
    assert run.false_valid == []
    assert run.late_recovery == []
    assert run.results[-1].quality is Quality.VALID


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
    with pytest.raises(InputError, match=r"map\.toml: cannot be read"):
        load_mapping(path)


# --- nodes that know the DBC file alone --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def example() -> ModuleType:
    """Return the documented script as a module."""
    spec = importlib.util.spec_from_file_location("can_cantools_example", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_script_in_the_docs_writes_frames_that_the_bridge_accepts(example: ModuleType) -> None:
    database = cantools.database.load_string(text_of("fd64", 30), "dbc")
    layout, truth = layout_of("fd64", 30), Truth(30, 1)
    frames = []
    for k in range(30):
        strain, pressure = truth.cycle(k)
        by_name = {f"gauge_{i}": 1e6 * value for i, value in enumerate(strain)}
        messages = example.strain_frames(database, k, k * CYCLE, by_name.__getitem__, pressure)
        frames += [from_message(message, k * CYCLE + 1e-4 * i) for i, message in enumerate(messages)]
    results, core = run_core(layout, frames, 30)
    assert [result.quality for result in results[3:]] == [Quality.VALID] * 27
    np.testing.assert_allclose(results[-1].strain, truth.cycle(29)[0], atol=0.126e-6)
    assert core.account.rejected == 9, "except in the three cycles until they are trusted"


RESULT = CycleResult(
    time=2.0,
    quality=Quality.DEGRADED,
    causes=Cause.GAUGE_INVALID | Cause.HEALTH,
    valid=np.arange(54) > 2,
    strain=np.zeros(54),
    dynamic_pressure=95.8e3,
    age=0.0123,
    sample_time=123_456_789,
    counter=77,
    coefficients=np.array([0.02, 0.61, -0.02, -0.18, 0.0123]),
    coefficients_std=np.array([0.001, 0.002, 0.003, 0.004, 0.005]),
    chi_square=48.5,
    health=4,
    arrival=1.99,
)


@pytest.mark.parametrize("form", ["fd", "classic-le", "classic-be"])
def test_results_are_read_by_cantools(form: str, example: ModuleType) -> None:
    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    composer = ResultFrames(layouts, configuration_of("fd64", gauge_names(54)))
    values: dict = {}
    for count in range(20):
        for frame in composer.of_result(RESULT):
            decoded = database.decode_message(frame.identifier, frame.data, decode_choices=False)
            assert decoded["E2E_Counter"] == count % (256 if form == "fd" else 15)
            values |= decoded
            if form == "fd":
                assert example.is_intact(frame.data, example.data_id_of(database.messages[0]))
    # float32, or the documented steps of 16 bits.
    close = 1e-7 if form == "fd" else 2.51e-4
    names = ("C_A", "C_N", "C_Y", "M_P", "M_Y")
    np.testing.assert_allclose([values[n] for n in names], RESULT.coefficients, rtol=1e-6, atol=close)
    sigmas = [values[f"sigma_{n}"] for n in names]
    np.testing.assert_allclose(sigmas, RESULT.coefficients_std, rtol=1e-6, atol=min(close, 5.1e-5))
    assert values["ChiSquare"] == pytest.approx(48.5)
    assert values["Age"] == pytest.approx(12.3)
    assert (values["Quality"], values["Health"], values["GaugesUsed"]) == (3, 4, 51)
    assert (values["AnsweredCounter"], values["Causes"]) == (77, int(RESULT.causes))
    if form == "fd":
        assert values["SampleTime"] == 123_456_789
        assert values["UsedPressure"] == pytest.approx(95.8e3)


@pytest.mark.parametrize("form", ["fd", "classic-le", "classic-be"])
def test_a_result_outside_the_map_says_so(form: str) -> None:
    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    outside = replace(RESULT, quality=Quality.SUSPECT, health=7)
    for score, shown in ((0.0, 0.0), (4.26, 4.3), (25.4, 25.4), (1e6, 25.4), (np.nan, "NotAvailable")):
        values: dict = {}
        for frame in ResultFrames(layouts, 1).of_result(replace(outside, envelope_score=score)):
            values |= database.decode_message(frame.identifier, frame.data)
        assert (str(values["Quality"]), str(values["Health"])) == ("Suspect", "Outside")
        if form != "fd":
            found = values["EnvelopeScore8"]
            assert str(found) == shown if isinstance(shown, str) else found == pytest.approx(shown)


@pytest.mark.parametrize("form", ["fd", "classic-le", "classic-be"])
def test_causes_above_bit_15_and_the_uncertainty_of_the_age_are_in_a_frame_of_their_own(form: str) -> None:
    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    assert layouts[-1].name == "EstimateDetail"
    composer = ResultFrames(layouts, 1)
    assert layouts[-1].key not in [frame.key for frame in composer.of_result(RESULT)], "no further cause"
    causes = Cause.OLD | Cause.SECOND_BRIDGE
    for uncertainty, shown in ((12.34e-3, 12.3), (9.0, 6553.4), (np.nan, 6553.5)):
        result = replace(RESULT, quality=Quality.UNCONFIRMED, causes=causes, age_uncertainty=uncertainty)
        values: dict = {}
        for frame in composer.of_result(result):
            values |= database.decode_message(frame.identifier, frame.data, decode_choices=False)
        assert values["Causes"] == 1 << 15 | int(Cause.OLD)
        assert values["AllCauses"] == int(causes)
        assert values["AgeUncertainty"] == pytest.approx(shown)
        assert (values["Quality"], values["AnsweredCounter"]) == (7, 77)


@pytest.mark.parametrize("profile", PROFILES)
def test_navigation_is_that_of_the_dbc_file(profile: str) -> None:
    database = cantools.database.load_string(text_of(profile, 6), "dbc")
    layout = layout_of(profile, 6)
    encoder = StrainEncoder(layout)
    message = database.get_message_by_name("Navigation")
    assert message.frame_id == max(frame.layout.identifier for frame in layout.frames)
    assert message.get_signal_by_name("Altitude").raw_initial == 65535
    for cycle, (mach, altitude) in enumerate([(6.02, 20e3), (np.nan, -150.0), (70.0, 2e5)]):
        frames = encoder.encode(
            np.zeros(6), 9e4, cycle=cycle, sample_time=0.0, mach_number=mach, altitude=altitude
        )
        data = next(frame.data for frame in frames if frame.identifier == message.frame_id)
        values = message.decode(data)
        if cycle == 2:
            assert str(values["MachNumber"]) == str(values["Altitude"]) == "NotAvailable"
            continue
        assert values["Altitude"] == altitude
        if cycle == 0:
            assert values["MachNumber"] == pytest.approx(6.02)
        else:
            assert str(values["MachNumber"]) == "NotAvailable"


@pytest.mark.parametrize("form", ["fd", "classic-le", "classic-be"])
@pytest.mark.parametrize("quality", [q for q in Quality if not q.has_coefficients])
def test_no_coefficients_go_out_without_quality(form: str, quality: Quality) -> None:
    """Even if a result held some by mistake: NaN, or the raw value for "not available"."""
    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    for frame in ResultFrames(layouts, 1).of_result(replace(RESULT, quality=quality)):
        decoded = database.decode_message(frame.identifier, frame.data)
        for name in ("C_A", "C_N", "C_Y", "M_P", "M_Y"):
            if name in decoded:
                assert str(decoded[name]) in ("nan", "NotAvailable")


@pytest.mark.parametrize("form", ["fd", "classic-le", "classic-be"])
def test_the_status_holds_the_last_valid_coefficients_and_their_age(form: str) -> None:
    from strainfmu.can.cycle.bus_state import BusState
    from strainfmu.can.cycle.frame_account import FrameAccount

    layouts = result_layouts(form, Identifiers(), CYCLE)
    database = cantools.database.load_string(dbc_text(layouts, "test"), "dbc")
    account = FrameAccount(received=70_000)
    account.settle(FrameClass.CORRUPT, 1.0, 70_000)
    status = BridgeStatus(
        time=3.0,
        quality=Quality.STALE,
        bus_state=BusState.ERROR_PASSIVE,
        last_valid=RESULT,
        account=account,
        cycles=5,
        send_failures=6,
        reconnects=7,
        drift_ppm=12.3,
        envelope_score=5.5,
    )
    values: dict = {}
    for frame in ResultFrames(layouts, 1).of_status(status):
        values |= database.decode_message(frame.identifier, frame.data, decode_choices=False)
    # 1 s since then, and 12.3 ms that it was old by then; 10 ms steps in the classic form.
    age = values["LastAge" if form == "fd" else "LastAge16"]
    assert age == pytest.approx(1012.3, abs=0.5 if form == "fd" else 5.0)
    assert values["last_C_N"] == pytest.approx(0.61, abs=2.6e-4)
    assert (values["Quality"], values["BusState"], values["Reconnects"]) == (5, 2, 7)
    if form == "fd":
        assert values["EnvelopeScore"] == 5.5
    assert values["Rejected" if form == "fd" else "Rejected16"] == (70_000 if form == "fd" else 70_000 % 65536)
