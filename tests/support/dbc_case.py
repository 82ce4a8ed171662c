"""Small DBC files of two gauges, their mapping, and what a bridge makes of their frames."""

import struct
from typing import Any

from can_case import CYCLE, Projection

from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings

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
START = 'BA_DEF_ SG_ "GenSigStartValue" INT 0 100000;\n'
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


def results_of(layout: InputLayout, frames: list[Frame], pressure: float | None = 9e4) -> list[Result]:
    core = Machine(layout, Projection(2), BridgeSettings(), start=0.0, dynamic_pressure=pressure)
    results = [result for frame in frames for result in core.receive(frame)]
    return results + core.advance(frames[-1].time + 0.6 * CYCLE)


def rack(number: int, codes: str = "<hhH2x", last: tuple[int, ...] = ()) -> Frame:
    """Return a cycle of both gauges, that move a little, with ``last`` behind or in place of them."""
    usual = (400 + 3 * number, 800 - 3 * number, 0)
    return Frame(identifier=256, data=struct.pack(codes, *(last or usual)), time=number * CYCLE)


def after_good_cycles(text: str, *last: int, **tables: Any) -> Result:
    """Return the result of a cycle with the raw numbers ``last`` behind 20 good ones."""
    frames = [rack(number) for number in range(20)] + [rack(20, last=last)]
    return results_of(layout_from(text, **tables), frames)[-1]
