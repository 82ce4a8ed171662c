"""Mapped frames of different periods: what is held and for how long; what makes no sense is refused at start."""

import struct
from typing import Any

import numpy as np
import pytest
from can_case import CYCLE, Projection

from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause, Quality
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

RACKS = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 256 Fast: 8 A
 SG_ S1 : 0|16@1- (0.25,0) [0|0] "um/m" B
 SG_ S2 : 16|16@1- (0.25,0) [0|0] "um/m" B
BO_ 257 Slow: 8 A
 SG_ S3 : 0|16@1- (0.25,0) [0|0] "um/m" B
 SG_ T : 16|16@1+ (1,0) [0|0] "ms" B
BO_ 258 Air: 8 A
 SG_ q : 0|16@1+ (10,0) [0|0] "Pa" B
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 256 10;
BA_ "GenMsgCycleTime" BO_ 257 50;
BA_ "GenMsgCycleTime" BO_ 258 50;
"""
GAUGES = {"g1": "Fast.S1", "g2": "Fast.S2", "g3": "Slow.S3"}
PRESSURE = {"dynamic_pressure": {"signal": "Air.q"}}
TRUSTED = 20
"""Cycles after which frames that come in every fifth one are trusted: four have come."""

HELD = PRESSURE

ALWAYS_AND_MULTIPLEXED = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 256 R: 8 A
 SG_ page M : 0|8@1+ (1,0) [0|0] "" B
 SG_ S1 : 8|16@1- (0.25,0) [0|0] "um/m" B
 SG_ S2 m1 : 24|16@1- (0.25,0) [0|0] "um/m" B
 SG_ S3 m2 : 24|16@1- (0.25,0) [0|0] "um/m" B
"""


def layout_from(text: str = RACKS, gauges: dict[str, str] | None = None, **entries: Any) -> InputLayout:
    strain = gauges or GAUGES
    return mapped_layout(
        database_of(text, "rack.dbc"), {"strain": strain, **entries}, gauge_names=tuple(strain), name="map.toml"
    )


def frames_of(number: int, slow: bool, air: bool) -> list[Frame]:
    """Return the frames of cycle ``number``: strains that move a little."""
    time, step = number * CYCLE, 3 * number
    sent = [Frame(identifier=256, data=struct.pack("<hh4x", 400 + step, 800 - step), time=time)]
    if slow:
        sent.insert(0, Frame(identifier=257, data=struct.pack("<h6x", 200 + step), time=time - 1e-4))
    if air:
        sent.insert(0, Frame(identifier=258, data=struct.pack("<H6x", 9000), time=time - 2e-4))
    return sent


def run(layout: InputLayout, n_cycles: int, last_slow: int, last_air: int) -> list[Result]:
    """Return the results of cycles whose slow frames come in every fifth one, up to the last ones."""
    core = Machine(layout, Projection(3), BridgeSettings(), start=-1e-3)
    results = []
    for k in range(n_cycles):
        due = k % 5 == 0
        for frame in frames_of(k, slow=due and k <= last_slow, air=due and k <= last_air):
            results += core.receive(frame)
        results += core.advance(k * CYCLE + 0.6 * CYCLE)
    assert core.account.unaccounted == 0
    return results


def test_a_slow_frame_is_held_and_the_age_is_that_of_the_oldest_strains() -> None:
    results = run(layout_from(**HELD), 60, last_slow=60, last_air=60)[TRUSTED:]
    assert {result.quality for result in results} == {Quality.UNPROTECTED}
    for k, result in enumerate(results, start=TRUSTED):
        sampled = k - k % 5
        assert result.strain[2] == pytest.approx((200 + 3 * sampled) * 0.25e-6, rel=1e-12)
        assert result.age == pytest.approx((k - sampled) * CYCLE, abs=2e-4)


def test_strains_are_held_for_two_of_their_own_periods_unless_told_otherwise() -> None:
    for entries, held in (({}, 10), ({"timeout_ms": {"Slow": 70}}, 7)):
        results = run(layout_from(**HELD, **entries), 70, last_slow=40, last_air=70)
        lost = [k for k, result in enumerate(results) if k > TRUSTED and not result.valid[2]]
        assert lost == list(range(40 + held, 70))
        assert all(results[k].causes & Cause.PARTIAL_CYCLE for k in lost)
        assert all(results[k].quality is Quality.DEGRADED for k in lost)


def test_a_slow_dynamic_pressure_is_used_for_two_of_its_own_periods_unless_told_otherwise() -> None:
    """20 Hz among 100 Hz: it was used for 0.5 s."""
    for entries, held in (({}, 9), ({"timeout_ms": {"Air": 200}}, 19)):
        results = run(layout_from(**HELD, **entries), 90, last_slow=90, last_air=40)
        without = [k for k, result in enumerate(results) if k > TRUSTED and np.isnan(result.dynamic_pressure)]
        assert without == list(range(41 + held, 90))
        assert all(results[k].causes & Cause.DYNAMIC_PRESSURE for k in without)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (
            {"cycle_time_ms": 50, **PRESSURE},
            r"frame 'Fast': a period of 10 ms found, it would come more than once in a cycle of 50 ms",
        ),
        (
            {"cycle_time_ms": 2, **HELD},
            r"cycle_time_ms: expected the period of a frame of strains, got 2; the fastest has 10 ms",
        ),
        (
            {**HELD, "slow_strains": "hold"},
            r"slow_strains: expected no such entry: slower frames of strains are held",
        ),
        ({**HELD, "timeout_ms": {"Slow": 40}}, r"timeout_ms\.Slow: expected at least its period of 50, got 40"),
        ({**HELD, "timeout_ms": {"Fast": 40}}, r"timeout_ms: expected a frame of q_inf, .*, got 'Fast'"),
        ({**HELD, "timeout_ms": {"Air": "x"}}, r"timeout_ms\.Air: expected a number of ms, got x"),
        ({**HELD, "period_ms": {"Rack": 10}}, r"period_ms: expected a frame in use \(.*\), got 'Rack'"),
        ({**HELD, "period_ms": {"Slow": -1}}, r"period_ms\.Slow: -1 ms found, 0.1 to 10,000 ms allowed"),
        ({**HELD, "period_ms": 10}, r"expected a table \[period_ms\]"),
    ],
)
def test_what_makes_no_sense_is_said_when_the_mapping_is_loaded(entries: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        layout_from(**entries)
    assert "\n" not in str(caught.value)


def test_the_mapping_corrects_the_periods_of_the_dbc_file() -> None:
    layout = layout_from(period_ms={"Slow": 10, "Air": 10}, **PRESSURE)
    assert layout.cycle_time == 0.01
    assert [frame.hold for frame in layout.strain_frames] == [None] * len(layout.strain_frames)
    assert layout.flow_frames[0].timeout is None


def test_sample_times_of_held_frames_are_comparable() -> None:
    fast = RACKS.replace(
        'S2 : 16|16@1- (0.25,0) [0|0] "um/m"',
        'S2 : 16|16@1- (0.25,0) [0|0] "um/m" B\n SG_ U : 32|32@1+ (1,0) [0|0] "us"',
    )
    with pytest.raises(InputError, match=r"sample_time\.Slow: expected unit and length of 'Fast', 1e-06 s and 32"):
        layout_from(fast, sample_time={"Fast": "Fast.U", "Slow": "Slow.T"}, **HELD)


def test_a_frame_with_strains_that_always_come_and_multiplexed_ones_works() -> None:
    gauges = {"g1": "R.S1", "g2": "R.S2", "g3": "R.S3"}
    layout = layout_from(ALWAYS_AND_MULTIPLEXED, gauges, cycle_time_ms=10)
    assert [frame.layout.name for frame in layout.strain_frames] == ["R[1]", "R[2]"]
    core, results = Machine(layout, Projection(3), BridgeSettings(), start=0.0, dynamic_pressure=9e4), []
    for k in range(40):
        for page in (1, 2):
            data = struct.pack("<Bhh3x", page, 100 + 3 * k, 300 * page - 3 * k)
            results += core.receive(Frame(identifier=256, data=data, time=k * CYCLE + 1e-3 * page))
    assert {result.quality for result in results[3:]} == {Quality.UNPROTECTED}
    np.testing.assert_allclose(results[-1].strain, 0.25e-6 * np.array([217, 183, 483]), rtol=1e-12)
    assert core.account.unaccounted == 0


def multiplexed_rack(n_pages: int = 5) -> str:
    """A rack of one fast frame and a multiplexed one, which sends a page in each cycle: 10 ms in the DBC file."""
    pages = "".join(f' SG_ P{p} m{p} : 8|16@1- (0.25,0) [0|0] "um/m" B\n' for p in range(n_pages))
    return (
        'VERSION ""\nNS_ :\nBS_:\nBU_: A B\n'
        'BO_ 256 Fast: 8 A\n SG_ S : 0|16@1- (0.25,0) [0|0] "um/m" B\n'
        f'BO_ 257 Page: 8 A\n SG_ page M : 0|8@1+ (1,0) [0|0] "" B\n{pages}'
        'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;\nBA_DEF_DEF_ "GenMsgCycleTime" 10;\n'
    )


def test_a_multiplexed_rack_needs_no_setting() -> None:
    """The period of a page is the message's times its number of values: it was DEGRADED for good."""
    gauges = {"f": "Fast.S", **{f"p{p}": f"Page.P{p}" for p in range(5)}}
    layout = layout_from(multiplexed_rack(), gauges)
    assert layout.cycle_time == 0.01
    assert {frame.layout.cycle_time for frame in layout.strain_frames} == {0.01, 0.05}
    core, results = Machine(layout, Projection(6), BridgeSettings(), start=0.0, dynamic_pressure=9e4), []
    for k in range(200):
        fast, page = struct.pack("<h6x", 100 + 3 * k % 50), struct.pack("<Bh5x", k % 5, 100 * (k % 5) + 7 * k % 40)
        results += core.receive(Frame(identifier=257, data=page, time=k * CYCLE))
        results += core.receive(Frame(identifier=256, data=fast, time=k * CYCLE + 1e-3))
    assert {result.quality for result in results[TRUSTED:]} == {Quality.UNPROTECTED}
    assert max(result.age for result in results[TRUSTED:]) < 5.2 * CYCLE
    assert core.account.unaccounted == 0
