"""Users' DBC files: value names, ends of converters, ambiguities, entries of a mapping that would go unheard."""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import pytest
from can_case import CYCLE, Projection

from strainfmu.can.bridge.setup import BridgeOptions, make_core
from strainfmu.can.cycle.core import bridge_core
from strainfmu.can.cycle.quality import Cause, Quality
from strainfmu.can.cycle.result import CycleResult
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.dbc_files import database_of, load_database
from strainfmu.can.wire.dbc_mapping import mapped_layout
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.frame_layout import InputLayout
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: A B\n'
RACK = """BO_ 256 R: 8 A
 SG_ S1 : 0|16@1- (0.25,0) [0|0] "um/m" B
 SG_ S2 : 16|16@1- (0.25,0) [0|0] "um/m" B
 SG_ St : 32|16@1+ (1,0) [0|0] "" B
"""
FORMAT = 'BA_DEF_ BO_ "VFrameFormat" INT 0 15;\nBA_DEF_DEF_ "VFrameFormat" 0;\n'
AIR = """BO_ 257 Air: 8 A
 SG_ q : 0|16@1+ (10,0) [0|0] "Pa" B
"""
MULTIPLEXED = """BO_ 256 R: 8 A
 SG_ page M : 0|8@1+ (1,0) [0|0] "" B
 SG_ S1 m0 : 8|16@1- (0.25,0) [0|0] "um/m" B
 SG_ S2 m0 : 24|16@1- (0.25,0) [0|0] "um/m" B
 SG_ St m1 : 8|16@1+ (1,0) [0|0] "" B
 SG_ T m1 : 24|32@1+ (1,0) [0|0] "us" B
"""
# A multiplexer that is itself multiplexed: cantools reads it; our one level could not decide.
NESTED = """BO_ 256 R: 8 A
 SG_ outer M : 0|8@1+ (1,0) [0|0] "" B
 SG_ page m3M : 8|8@1+ (1,0) [0|0] "" B
 SG_ S1 m0 : 16|16@1- (0.25,0) [0|0] "um/m" B
 SG_ S2 m0 : 32|16@1- (0.25,0) [0|0] "um/m" B
SG_MUL_VAL_ 256 page outer 3-3;
SG_MUL_VAL_ 256 S1 page 0-0;
SG_MUL_VAL_ 256 S2 page 0-0;
"""


def mapping(**tables: Any) -> dict[str, Any]:
    """Return the mapping of both gauges, and ``tables``."""
    return {"cycle_time_ms": 10, "strain": {"g1": "R.S1", "g2": "R.S2"}, **tables}


def layout_from(text: str, **tables: Any) -> InputLayout:
    return mapped_layout(
        database_of(HEAD + text, "rack.dbc"), mapping(**tables), gauge_names=("g1", "g2"), name="map.toml"
    )


def results_of(layout: InputLayout, frames: list[Frame], pressure: float | None = 9e4) -> list[CycleResult]:
    core = bridge_core(layout, Projection(2), BridgeSettings(), start=0.0, dynamic_pressure=pressure)
    results = [result for frame in frames for result in core.receive(frame)]
    return results + core.advance(frames[-1].time + 0.6 * CYCLE)


def rack(number: int, codes: str = "<hhH2x", last: tuple[int, ...] = ()) -> Frame:
    """Return a cycle of both gauges, that move a little, with ``last`` behind or in place of them."""
    usual = (400 + 3 * number, 800 - 3 * number, 0)
    return Frame(identifier=256, data=struct.pack(codes, *(last or usual)), time=number * CYCLE)


def after_good_cycles(text: str, *last: int, **tables: Any) -> CycleResult:
    """Return the result of a cycle with the raw numbers ``last`` behind 20 good ones."""
    frames = [rack(number) for number in range(20)] + [rack(20, last=last)]
    return results_of(layout_from(text, **tables), frames)[-1]


# --- values that are none ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "refused"),
    [
        ('460 "SNA" 461 "Invalid"', True),
        ('461 "Signal invalid"', True),
        ('461 "sensor_failure"', True),
        ('461 "ADC error"', True),
        ('461 "No data"', True),
        ('461 "SignalNotAvailable"', True),
        ('461 "No error"', False),
        ('461 "Ausnahme"', False),
        ('460 "SNA"', False),
    ],
)
def test_every_value_name_that_says_no_value_counts(names: str, refused: bool) -> None:
    result = after_good_cycles(RACK + f"VAL_ 256 S1 {names} ;\n", 461, 740, 0)
    assert result.quality is (Quality.DEGRADED if refused else Quality.UNPROTECTED)
    assert result.valid.tolist() == [not refused, True]


def test_a_value_name_of_a_float_is_that_of_its_number() -> None:
    text = RACK.replace("0|16@1- (0.25,0)", "32|32@1- (1,0)").replace(' SG_ St : 32|16@1+ (1,0) [0|0] "" B\n', "")
    text += 'SIG_VALTYPE_ 256 S1 : 1;\nVAL_ 256 S1 101 "SNA" ;\n'
    frames = [
        Frame(identifier=256, data=struct.pack("<2xhf", 800 + k, 100.0 + 0.1 * k), time=k * CYCLE)
        for k in range(12)
    ]
    results = results_of(layout_from(text), frames)
    # The sum of float32 0.1 is not 101 before its tenth step.
    assert [bool(result.valid[0]) for result in results[3:]] == [True] * 7 + [False] * 2


@pytest.mark.parametrize(
    ("code", "expected"), [(9000, 9e4), (65534, None), (65533, None), (65535, None), (0, None), (65532, 655320.0)]
)
def test_value_names_and_converter_ends_hold_for_the_dynamic_pressure(code: int, expected: float | None) -> None:
    text = RACK + AIR + 'VAL_ 257 q 65534 "Error" 65533 "Fehler (invalid)" ;\n'
    layout = layout_from(text, dynamic_pressure={"signal": "Air.q"})
    frames = []
    for number in range(20):
        air = struct.pack("<H6x", 8000 + number if number < 19 else code)
        frames += [Frame(identifier=257, data=air, time=number * CYCLE), rack(number)]
    result = results_of(layout, frames, None)[-1]
    assert result.quality is (Quality.INVALID if expected is None else Quality.UNPROTECTED)
    assert bool(result.causes & Cause.DYNAMIC_PRESSURE) is (expected is None)
    if expected is not None:
        assert result.dynamic_pressure == expected


NAVIGATION = """BO_ 257 Air: 8 A
 SG_ q : 0|16@1+ (10,0) [0|0] "Pa" B
 SG_ M : 16|16@1+ (0.001,0) [0|0] "" B
 SG_ h : 32|16@1+ (10,-10000) [0|0] "ft" B
BO_ 258 Nav: 8 A
 SG_ h : 0|32@1- (1,0) [0|0] "km" B
 SG_ M : 32|32@1- (1,0) [0|0] "Mach" B
SIG_VALTYPE_ 258 h : 1;
SIG_VALTYPE_ 258 M : 1;
VAL_ 257 M 65000 "SNA" ;
"""


def navigated(frame: Callable[[int], Frame], **tables: Any) -> list[CycleResult]:
    """Return the results of 20 cycles with a further frame ahead of each; q_inf is fixed unless it is mapped."""
    layout = layout_from(RACK + NAVIGATION, **tables)
    frames = [one for k in range(20) for one in (frame(k), rack(k))]
    return results_of(layout, frames, None if "dynamic_pressure" in tables else 9e4)


AIR_TABLES = {
    "dynamic_pressure": {"signal": "Air.q"},
    "mach_number": {"signal": "Air.M"},
    "altitude": {"signal": "Air.h"},
}


@pytest.mark.parametrize(
    ("codes", "expected"),
    [
        ((9000, 5250, 7562), (9e4, 5.25, 0.3048 * 65620.0)),
        ((9000, 65000, 7562), (9e4, None, 0.3048 * 65620.0)),
        ((9000, 0, 65535), (9e4, None, None)),
        ((65535, 5250, 0), (None, 5.25, None)),
    ],
)
def test_dynamic_pressure_and_navigation_of_one_frame_are_judged_one_by_one(
    codes: tuple[int, int, int], expected: tuple[float | None, ...]
) -> None:
    def air(number: int) -> Frame:
        last = (9000, 5250, 7562) if number < 19 else codes
        return Frame(identifier=257, data=struct.pack("<3H2x", *last), time=number * CYCLE)

    result = navigated(air, **AIR_TABLES)[-1]
    for value, known in zip((result.dynamic_pressure, result.mach_number, result.altitude), expected, strict=True):
        assert value == (pytest.approx(known, rel=1e-12) if known is not None else pytest.approx(nan, nan_ok=True))
    assert bool(result.causes & Cause.NAVIGATION) is (None in expected[1:])
    assert result.quality is (Quality.INVALID if expected[0] is None else Quality.UNPROTECTED)


@pytest.mark.parametrize(
    ("altitude", "mach", "expected"),
    [
        (20.0, 6.0, (20e3, 6.0)),
        (1e9, 6.0, (nan, 6.0)),
        (-9.0, 1e30, (nan, nan)),
        (float("inf"), nan, (nan, nan)),
        (20.0, -0.5, (20e3, nan)),
    ],
)
def test_absurd_navigation_of_a_frame_of_its_own_is_not_known(
    altitude: float, mach: float, expected: tuple[float, float]
) -> None:
    def nav(number: int) -> Frame:
        values = (20.0, 6.0) if number < 19 else (altitude, mach)
        return Frame(identifier=258, data=struct.pack("<2f", *values), time=number * CYCLE)

    result = navigated(nav, mach_number={"signal": "Nav.M"}, altitude={"signal": "Nav.h"})[-1]
    assert (result.altitude, result.mach_number) == pytest.approx(expected, nan_ok=True)
    assert result.quality is Quality.UNPROTECTED


def test_navigation_alone_need_not_come() -> None:
    layout = layout_from(RACK + NAVIGATION, altitude={"signal": "Nav.h"})
    results = results_of(layout, [rack(k) for k in range(20)])
    assert results[-1].quality is Quality.UNPROTECTED
    assert not results[-1].causes


@pytest.mark.parametrize("status", [0, 1, 2, (1 << 62), (1 << 63), (1 << 64) - 1])
def test_a_status_of_64_bits_counts_with_its_top_bit(status: int) -> None:
    text = HEAD + RACK.replace("BO_ 256 R: 8", "BO_ 256 R: 12").replace("32|16@1+", "32|64@1+")
    text += FORMAT + 'BA_ "VFrameFormat" BO_ 256 14;\n'
    layout = mapped_layout(
        database_of(text, "x"), mapping(status={"R": "R.St"}), gauge_names=("g1", "g2"), name="map.toml"
    )
    frames = []
    for k in range(20):
        data = struct.pack("<hhQ", 400 + 3 * k, 800 - 3 * k, status if k == 19 else 0)
        frames.append(Frame(identifier=256, data=data, time=k * CYCLE, is_fd=True))
    result = results_of(layout, frames)[-1]
    assert result.quality is {0: Quality.UNPROTECTED, 1: Quality.DEGRADED}.get(status, Quality.INVALID)


def test_a_pressures_status_of_64_bits_counts_with_its_top_bit() -> None:
    text = RACK + 'BO_ 258 Q: 12 A\n SG_ q : 0|32@1+ (1,0) [0|0] "Pa" B\n SG_ St : 32|64@1+ (1,0) [0|0] "" B\n'
    text += FORMAT + 'BA_ "VFrameFormat" BO_ 258 14;\n'
    layout = layout_from(text, dynamic_pressure={"signal": "Q.q"}, status={"Q": "Q.St"})
    for status in (0, 1 << 63):
        data = struct.pack("<IQ", 90_000, status)
        frames = [
            f for k in range(20) for f in (Frame(identifier=258, data=data, time=k * CYCLE, is_fd=True), rack(k))
        ]
        result = results_of(layout, frames, None)[-1]
        assert bool(result.causes & Cause.DYNAMIC_PRESSURE) is bool(status)


@pytest.mark.parametrize(
    ("scaling", "codes", "zero"),
    [
        ("16@1+ (0.07,-700)", "<Hh4x", 10000),  # offset binary; 0.07 * 10000 - 700 is 1e-13 by round-off
        ("16@1- (0.25,-50)", "<hh4x", 200),
        ("16@1- (0.25,0)", "<hh4x", 0),
    ],
)
def test_a_gauge_that_falls_to_exactly_zero_is_left_out_whatever_its_offset(
    scaling: str, codes: str, zero: int
) -> None:
    layout = layout_from(RACK.replace("16@1- (0.25,0)", scaling, 1))
    frames = [rack(k, codes, (zero + 400 + 3 * k, 800 - 3 * k)) for k in range(20)]
    frames.append(rack(20, codes, (zero, 740)))
    results = results_of(layout, frames)
    assert results[-2].valid.tolist() == [True, True]
    assert results[-1].valid.tolist() == [False, True]


def test_minus_zero_of_a_float_is_zero() -> None:
    text = RACK.replace("0|16@1- (0.25,0)", "32|32@1- (1,0)").replace(' SG_ St : 32|16@1+ (1,0) [0|0] "" B\n', "")
    layout = layout_from(text + "SIG_VALTYPE_ 256 S1 : 1;\n")
    frames = [
        Frame(identifier=256, data=struct.pack("<2xhf", 800 + k, 100.0 + k), time=k * CYCLE) for k in range(20)
    ]
    frames.append(Frame(identifier=256, data=struct.pack("<2xhf", 820, -0.0), time=20 * CYCLE))
    assert results_of(layout, frames)[-1].valid.tolist() == [False, True]


# --- what cannot be meant ----------------------------------------------------------------------------------------

START = 'BA_DEF_ SG_ "GenSigStartValue" INT 0 100000;\n'


def refused(text: str, **tables: Any) -> Callable[[], InputLayout]:
    return lambda: layout_from(text, **tables)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (refused(NESTED), "multiplexers outer, page found, one allowed"),
        (
            refused(MULTIPLEXED, status={"R": "R.St"}),
            r"status\.R: expected .*, got 'R\.St', which comes with multiplexer",
        ),
        (
            refused(MULTIPLEXED, sample_time={"R": "R.T"}),
            r"expected a signal of multiplexer value 0, got .* value 1$",
        ),
        (refused(RACK, status={"Rr": "R.St"}), r"status: expected a frame in use \(R\), got 'Rr'$"),
        (
            refused(RACK + AIR, sample_time={"Air": "Air.q"}),
            r"sample_time: expected a frame in use \(R\), got 'Air'",
        ),
        (refused(RACK, configuration={"Rr": "R.St"}), r"configuration: expected a frame in use \(R\), got 'Rr'"),
        (
            refused(RACK, end_to_end={"Rr": {"profile": 5, "data_id": 1}}),
            r"end_to_end: expected a frame in use \(R\), got 'Rr'",
        ),
        (
            refused(RACK, units={"R.S3": "um/m"}),
            r"units: expected a signal in use \(.*R\.S1, R\.S2\), got 'R\.S3'$",
        ),
        (refused(RACK, units={"R.St": "us"}), r"units: expected a signal in use .*, got 'R\.St'"),
        (
            refused(RACK + NAVIGATION, altitude={"signal": "R.St"}),
            r"'R\.St': unit: expected a unit of length \(m, km, ft\), got ''",
        ),
        (
            refused(RACK + NAVIGATION, mach_number={"signal": "Air.q"}),
            r"'Air\.q': unit: expected a number \(.*\), got 'Pa'",
        ),
        (
            refused(RACK + NAVIGATION, mach_number={"signal": "R.St"}),
            "mach_number: expected a frame without strains, got 'R', which holds some",
        ),
        (
            refused(
                RACK + NAVIGATION,
                mach_number={"signal": "Air.M"},
                altitude={"signal": "Air.M"},
                units={"Air.M": "1"},
            ),
            r"'Air\.M': unit: expected a unit of length",
        ),
        (refused(RACK + NAVIGATION, altitude="Nav.h"), r"expected a table \[altitude\]"),
        (refused(RACK + NAVIGATION, altitude={"sig": "Nav.h"}), "altitude: expected 'signal', got sig"),
        (
            refused(RACK, configuration={"R": "R.St"}),
            r"\(GenSigStartValue\) of 'St': expected .* 0 to 65535, got none",
        ),
        (
            refused(RACK + START + 'BA_ "GenSigStartValue" SG_ 256 St 70000;\n', configuration={"R": "R.St"}),
            "'St': expected .*, got 70000",
        ),
        (refused(RACK + RACK.replace("256", "258")), "expected one frame 'R' in the DBC file, got 2"),
        (refused(RACK + AIR.replace("257", "256")), "identifier 0x100 is that of both 'R' and 'Air'"),
        (refused(RACK, cycle_time_ms=1e-300), "cycle_time_ms: 1e-300 ms found, 0.1 to 10,000 ms allowed"),
        (refused(RACK, cycle_time_ms=10_000.5), "0.1 to 10,000 ms allowed"),
        (refused(RACK, cycle_time_ms=float("nan")), "expected a number of ms, got nan"),
        (refused(RACK, cycle_time_ms=10**400), "expected a number of ms, got"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_one_line(make: Callable[[], InputLayout], text: str) -> None:
    with pytest.raises(InputError, match=text) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_frames_that_share_a_name_are_one_line_of_standard_error(tmp_path: Path) -> None:
    """cantools warns of them through logging, which without a handler writes a line of its own."""
    path = tmp_path / "rack.dbc"
    path.write_text(HEAD + RACK + RACK.replace("256", "258"))
    code = "from pathlib import Path; from strainfmu.can.wire.dbc_files import load_database; "
    code += f"load_database(Path({str(path)!r}))"
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert finished.stderr == ""


@pytest.mark.parametrize("cycle_time", [1e-15, 0.99e-4, 10.001, float("nan"), -0.01])
def test_a_cycle_time_that_no_bus_has_is_refused(cycle_time: float) -> None:
    """Of 1e-15 s the loop over silent cycles would never end."""
    options = BridgeOptions(interface="virtual", channel="x", cycle_time=cycle_time)
    with pytest.raises(InputError, match="ms found, 0"):
        make_core(Projection(2), options, gauge_names=("g1", "g2"), start=0.0)
    make_core(Projection(2), replace(options, cycle_time=1e-3 * 0.1), gauge_names=("g1", "g2"), start=0.0)


def test_a_status_of_the_same_multiplexer_value_is_read() -> None:
    text = MULTIPLEXED.replace("St m1 : 8|16", "St m0 : 40|16")
    layout = layout_from(text, status={"R": "R.St"})
    frames = [
        Frame(
            identifier=256, data=struct.pack("<BhhHx", 0, 400 + 3 * k, 800 - 3 * k, 2 * (k == 19)), time=k * CYCLE
        )
        for k in range(20)
    ]
    results = results_of(layout, frames)
    assert [results[-2].quality, results[-1].quality] == [Quality.UNPROTECTED, Quality.INVALID]


@pytest.mark.parametrize(
    ("attributes", "number"),
    [
        (START + 'BA_DEF_DEF_ "GenSigStartValue" 0;\nBA_ "GenSigStartValue" SG_ 256 St 7;\n', 7),
        (START + 'BA_DEF_DEF_ "GenSigStartValue" 5;\n', 5),
    ],
)
def test_the_start_value_of_a_configuration_may_be_the_files_default(attributes: str, number: int) -> None:
    layout = layout_from(RACK + attributes, configuration={"R": "R.St"})
    frames = [rack(k, last=(400 + 3 * k, 800 - 3 * k, number)) for k in range(12)]
    assert results_of(layout, frames)[-1].quality is Quality.UNPROTECTED
    frames = [rack(k, last=(400 + 3 * k, 800 - 3 * k, number + 1)) for k in range(12)]
    assert not any(result.quality.has_coefficients for result in results_of(layout, frames))


@pytest.mark.parametrize(
    ("unit", "encoding"),
    [("µm/m", "cp1252"), ("µm/m", "utf-8"), ("μm/m", "utf-8"), ("με", "utf-8"), ("um/m", "utf-8-sig")],
)
def test_units_are_read_in_either_encoding(tmp_path: Path, unit: str, encoding: str) -> None:
    """Micro sign and Greek mu; Windows-1252 has the sign alone."""
    path = tmp_path / "rack.dbc"
    path.write_bytes((HEAD + RACK.replace('"um/m"', f'"{unit}"')).encode(encoding))
    layout = mapped_layout(load_database(path), mapping(), gauge_names=("g1", "g2"), name="map.toml")
    assert layout.strain_frames[0].to_strain == (1e-6, 1e-6)


def test_why_a_suppressed_refusal_was_one_is_not_said_of_the_next_result() -> None:
    """Cycles that repeat themselves, too many to be answered one by one, then good ones."""
    core = bridge_core(
        layout_from(RACK), Projection(2), BridgeSettings(stuck_cycles=1000), start=0.0, dynamic_pressure=9e4
    )
    frames = [rack(k) for k in range(20)]
    frames += [Frame(identifier=256, data=frames[-1].data, time=(19.0 + 0.05 * k) * CYCLE) for k in range(1, 61)]
    results = [result for frame in frames for result in core.receive(frame)]
    refusals = [result for result in results if result.causes & Cause.FROZEN]
    assert 20 <= len(refusals) < 50, "the last ones were suppressed"
    good = core.receive(Frame(identifier=256, data=rack(20).data, time=frames[-1].time + CYCLE))
    assert [(result.quality, result.causes) for result in good] == [(Quality.UNPROTECTED, Cause.NONE)]
