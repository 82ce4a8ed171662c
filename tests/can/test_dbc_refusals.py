"""Users' DBC files and mappings that cannot be meant: refused in one line."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from can_case import Projection
from dbc_case import AIR, HEAD, MULTIPLEXED, NAVIGATION, NESTED, RACK, START, layout_from

from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.options import BridgeOptions
from strainfmu.can.setup import make_machine
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


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
        (refused(RACK + AIR.replace("257", "256")), "identifier 0x100 belongs to both 'R' and 'Air'"),
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
    code = "from pathlib import Path; from strainfmu.can.dbc_files import load_database; "
    code += f"load_database(Path({str(path)!r}))"
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert finished.stderr == ""


@pytest.mark.parametrize("cycle_time", [1e-15, 0.99e-4, 10.001, float("nan"), -0.01])
def test_a_cycle_time_that_no_bus_has_is_refused(cycle_time: float) -> None:
    """Of 1e-15 s the loop over silent cycles would never end."""
    options = BridgeOptions(interface="virtual", channel="x", cycle_time=cycle_time)
    with pytest.raises(InputError, match="ms found, 0"):
        make_machine(Projection(2), options, gauge_names=("g1", "g2"), start=0.0)
    make_machine(Projection(2), replace(options, cycle_time=1e-3 * 0.1), gauge_names=("g1", "g2"), start=0.0)


OTHER = """BO_ 300 Other: 2 A
 SG_ a : 0|12@1+ (1,0) [0|0] "" B
 SG_ b : {} (1,0) [0|0] "" B
"""


@pytest.mark.parametrize("other", [OTHER.format("8|8@1+"), OTHER.format("12|8@1+")], ids=["overlap", "too long"])
def test_a_fault_in_a_message_counts_where_the_mapping_names_it(other: str) -> None:
    text = RACK + AIR + other
    assert layout_from(text).frames == layout_from(RACK + AIR).frames
    pattern = r"map.toml: mach_number: in the DBC file: .*signals? b .* message Other\.$"
    with pytest.raises(InputError, match=pattern):
        layout_from(text, mach_number={"signal": "Other.b"}, units={"Other.b": "1"})


def test_values_and_types_of_signals_that_are_missing_are_left_out() -> None:
    """Each kind is listed by cantools in a failure of its own; values of other signals stay."""
    values = 'VAL_ 256 S1 32767 "SNA" ;\nVAL_ 301 Gone 0 "a; b" 1 "on" ;\nVAL_ 256 Gone 1 "SNA" ;\n'
    layout = layout_from(RACK + values + "SIG_VALTYPE_ 301 Gone : 1;\n")
    assert layout.frames == layout_from(RACK + values.splitlines()[0] + "\n").frames
    assert layout.frames != layout_from(RACK).frames
