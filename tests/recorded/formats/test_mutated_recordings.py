"""Files of every format with bytes changed, cut or doubled: read, or refused in one line, and never a hang."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mutations import TooLongError, limited
from recorded_formats import WRITERS, Group

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import open_recording

MUTATIONS = 500

GAUGES = ("a", "b", "c")
TIME = 0.01 * np.arange(60)


def mutated(content: bytes, random: np.random.Generator) -> bytes:
    """Return ``content`` with one to three changes, each anywhere; a cut is its last change."""
    changed = bytearray(content)
    for _ in range(random.integers(1, 4)):
        at, size = int(random.integers(len(changed))), int(random.integers(1, 40))
        match int(random.integers(6)):
            case 0:
                changed[at] ^= 1 << int(random.integers(8))
            case 1:
                changed[at : at + size] = random.bytes(size)
            case 2:
                del changed[at : at + size]
            case 3:
                changed[at:at] = changed[at : at + size]
            case 4:
                changed[at : at + 8] = int(random.choice([0, 1, -1, 2**31 - 1, 2**62])).to_bytes(
                    8, "little", signed=True
                )
            case _:
                return bytes(changed[: max(at, 1)])
    return bytes(changed)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_a_mutated_file_is_read_or_refused_in_one_line(name: str, tmp_path: Path) -> None:
    columns = {gauge: (1e-4 * np.sin(TIME + k), "m/m") for k, gauge in enumerate(GAUGES)}
    source = WRITERS[name](tmp_path, [Group("log", TIME, {**columns, "dynamic_pressure": (1e4 + TIME, "Pa")})])
    content, random = source.read_bytes(), np.random.default_rng(59)
    path, outcomes = source.with_stem("mutated"), Counter[str]()
    wanted = Wanted(gauge_names=GAUGES, ignored=("*",))
    for number in range(MUTATIONS):
        path.write_bytes(mutated(content, random))
        try:
            with limited(), open_recording(path, wanted) as recording:
                rows = sum(len(block.time) for block in recording.blocks)
            outcomes["read whole" if rows == len(TIME) else "read in part"] += 1
        except StrainfmuError as error:
            outcomes["refused" if "\n" not in str(error) else f"several lines: {error}"] += 1
        except (Exception, TooLongError) as error:
            pytest.fail(f"mutation {number} of {name}: {type(error).__name__}: {error}")
    print(f"{name}: {dict(outcomes)}")
    assert {"read whole", "refused"} <= outcomes.keys() <= {"read whole", "read in part", "refused"}
    assert outcomes.total() == MUTATIONS


def test_a_channel_beyond_the_records_of_an_mdf_file_is_refused(tmp_path: Path) -> None:
    """asammdf's compiled reader would read and write beyond its memory."""
    asammdf = pytest.importorskip("asammdf")
    columns = {gauge: (1e-4 * np.sin(TIME + k), "m/m") for k, gauge in enumerate(GAUGES)}
    path = WRITERS["mf4"](tmp_path, [Group("log", TIME, {**columns, "dynamic_pressure": (1e4 + TIME, "Pa")})])
    with asammdf.MDF(path) as file:
        channel = next(one for one in file.groups[0].channels if one.name == "c")
        # Block of a channel: header and links of 24 + 8 n bytes, four types of a byte each, then the offset.
        at, offset = channel.address + 24 + 8 * channel.links_nr + 4, channel.byte_offset
    content = bytearray(path.read_bytes())
    assert int.from_bytes(content[at : at + 4], "little") == offset
    content[at : at + 4] = (offset + 2048).to_bytes(4, "little")
    path.write_bytes(content)
    with (
        pytest.raises(InputError, match="damaged: channel 'c' reaches beyond its records"),
        open_recording(path, Wanted(gauge_names=GAUGES, ignored=("*",))) as recording,
    ):
        sum(len(block.time) for block in recording.blocks)
