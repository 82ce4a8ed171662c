"""The journal: what was appended whole comes back, whatever happened to the end of the file."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from builder.aero.engine import Flow
from builder.campaign.journal import HEADER, Journal, encode_record, journal_path, read_records
from strainfmu.errors import StrainfmuError

pytestmark = pytest.mark.fast

PRINT = "0123456789abcdef"


def flow(number: int) -> Flow:
    arrays = {"roll_angle": np.arange(3.0), "ratio_0": np.full((2, 3), 1.0 / (number + 1))}
    return Flow(key=(5.0, 0.1 * number), arrays=arrays, momentum_error=1e-3 * number, repairs=number)


RECORDS = [encode_record(PRINT, flow(number)) for number in range(4)]
CONTENT = b"".join(RECORDS)
ENDS = np.cumsum([0, *map(len, RECORDS)]).tolist()


def assert_same(found: Flow, expected: Flow) -> None:
    assert (found.key, found.momentum_error, found.repairs) == (
        expected.key,
        expected.momentum_error,
        expected.repairs,
    )
    assert found.arrays.keys() == expected.arrays.keys()
    for name, values in expected.arrays.items():
        np.testing.assert_array_equal(found.arrays[name], values)


def test_flows_come_back(tmp_path: Path) -> None:
    with Journal(tmp_path / "snapshots.h5") as journal:
        for number in range(4):
            journal.append(PRINT, flow(number))
    with Journal(tmp_path / "snapshots.h5") as journal:
        found = journal.flows(PRINT)
        assert journal.flows("f" * 16) == {}
    for number in range(4):
        assert_same(found[5.0, 0.1 * number], flow(number))


@given(cut=st.integers(0, len(CONTENT)) | st.sampled_from(ENDS).map(lambda end: max(end - 1, 0)))
def test_a_cut_loses_the_torn_record_alone(cut: int) -> None:
    flows, whole = read_records(CONTENT[:cut])
    assert whole == max(end for end in ENDS if end <= cut)
    assert len(flows) == ENDS.index(whole)


@given(at=st.integers(0, len(CONTENT) - 1), flip=st.integers(1, 255))
def test_a_changed_byte_ends_reading_at_its_record(at: int, flip: int) -> None:
    """SHA-256 over fingerprint and payload, checks of mark and length: no changed byte is read as a flow."""
    content = bytearray(CONTENT)
    content[at] ^= flip
    flows, whole = read_records(bytes(content))
    assert whole == max(end for end in ENDS if end <= at)
    assert len(flows) == ENDS.index(whole)


@settings(max_examples=40)
@given(cut=st.integers(0, len(CONTENT) - 1))
def test_appending_goes_on_behind_the_last_whole_record(
    cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    result = tmp_path_factory.mktemp("cut") / "snapshots.h5"
    journal_path(result).write_bytes(CONTENT[:cut])
    with Journal(result) as journal:
        before = set(journal.flows(PRINT))
        journal.append(PRINT, flow(7))
    with Journal(result) as journal:
        assert set(journal.flows(PRINT)) == before | {flow(7).key}


def test_no_name_is_executed(tmp_path: Path) -> None:
    """A journal holds numbers: an array of Python objects, which only pickle could hold, is refused."""
    with pytest.raises(ValueError, match="Object arrays cannot be"):
        encode_record(PRINT, Flow(key=(5.0, 0.0), arrays={"ratio": np.array([print], dtype=object)}))


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    result = tmp_path / "snapshots.h5"
    with Journal(result), pytest.raises(StrainfmuError, match=r"snapshots\.h5: another campaign is writing it"):
        Journal(result)
    with Journal(result):
        pass


def test_an_empty_journal_leaves_nothing(tmp_path: Path) -> None:
    with Journal(tmp_path / "snapshots.h5"):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="file size limits are a POSIX means to fill a disk")
def test_a_full_disk_is_said_and_loses_nothing_kept(tmp_path: Path) -> None:
    import resource
    import signal

    result = tmp_path / "snapshots.h5"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        with Journal(result) as journal:
            journal.append(PRINT, flow(0))
            resource.setrlimit(resource.RLIMIT_FSIZE, (len(RECORDS[0]) + HEADER.size + 9, before[1]))
            with pytest.raises(
                StrainfmuError, match=r"snapshots\.h5\.journal: could not be written: File too large"
            ):
                journal.append(PRINT, flow(1))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    with Journal(result) as journal:
        assert set(journal.flows(PRINT)) == {flow(0).key}
