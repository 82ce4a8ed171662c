"""Users' DBC files: value names, ends of converters, states, start values, units."""

import struct
from collections.abc import Callable
from math import nan
from pathlib import Path
from typing import Any

import pytest
from can_case import CYCLE, Projection
from dbc_case import (
    AIR,
    FORMAT,
    HEAD,
    MULTIPLEXED,
    NAVIGATION,
    RACK,
    START,
    after_good_cycles,
    layout_from,
    mapping,
    rack,
    results_of,
)

from strainfmu.can.dbc_files import database_of, load_database
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.frame import Frame
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause, Quality

pytestmark = pytest.mark.fast


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


def navigated(frame: Callable[[int], Frame], **tables: Any) -> list[Result]:
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
    core = Machine(
        layout_from(RACK),
        Projection(2),
        BridgeSettings(stuck_cycles=1000, period_tolerance=100.0),  # of frames that come twenty times too often
        start=0.0,
        dynamic_pressure=9e4,
    )
    frames = [rack(k) for k in range(20)]
    frames += [Frame(identifier=256, data=frames[-1].data, time=(19.0 + 0.05 * k) * CYCLE) for k in range(1, 61)]
    results = [result for frame in frames for result in core.receive(frame)]
    refusals = [result for result in results if result.causes & Cause.FROZEN]
    assert 20 <= len(refusals) < 50, "the last ones were suppressed"
    good = []
    for k in range(20, 23):
        good += core.receive(Frame(identifier=256, data=rack(k).data, time=frames[-1].time + (k - 19) * CYCLE))
    assert not any(result.causes & Cause.FROZEN for result in good)
    assert (good[-1].quality, good[-1].causes) == (Quality.UNPROTECTED, Cause.NONE), "healed"
