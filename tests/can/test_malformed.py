"""Messages that are no frames, and frames that no log can hold: counted and passed over."""

import threading
import time
from pathlib import Path
from typing import Any

import can
import pytest
from can_case import CYCLE, Projection, layout_of

from strainfmu.can.bridge import ERRORS_PER_SECOND, BackOff, Bridge
from strainfmu.can.frame import Frame, MalformedFrame, from_message
from strainfmu.can.frame_queue import FrameQueue
from strainfmu.can.listener import BusListener, Taps
from strainfmu.can.log_frames import LogState, log_frames
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import Identifiers
from strainfmu.can.recording import LOG_SUFFIXES, MicrosecondClock, Recorder
from strainfmu.can.result_frames import result_layouts

pytestmark = pytest.mark.fast

GOOD = {"arbitration_id": 0x301, "is_extended_id": False, "is_fd": True, "data": bytes(64), "dlc": 64}


@pytest.mark.parametrize(
    "wrong",
    [
        {"arbitration_id": 5.5},
        {"arbitration_id": 768.0},
        {"arbitration_id": float("nan")},
        {"is_fd": 0.5},
        {"is_extended_id": "x"},
        {"bitrate_switch": [1]},
    ],
)
def test_what_python_can_lets_through_is_refused(wrong: dict[str, Any]) -> None:
    """All of these pass python-can's own check, which assumes that the types are right."""
    with pytest.raises(MalformedFrame, match=r"found, .* allowed$|expected .*, got "):
        from_message(can.Message(**(GOOD | wrong), check=True), 0.0)


@pytest.mark.parametrize("wrong", [{"arbitration_id": -1}, {"arbitration_id": 1 << 29}, {"data": bytes(65)}])
def test_what_no_frame_can_hold_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(MalformedFrame):
        from_message(can.Message(**(GOOD | wrong)), 0.0)


class Scripted(can.BusABC):
    """A bus that hands over ``messages``, raises those that are errors, then is silent."""

    def __init__(self, messages: list[can.Message | Exception]) -> None:
        super().__init__("scripted")
        self.left = messages

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self.left:
            time.sleep(0.001)
            return None, False
        message = self.left.pop(0)
        if isinstance(message, Exception):
            raise message from ValueError("extra data")
        return message, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        pass


def bridged(messages: list[can.Message | Exception], **taps: Any) -> Bridge:
    """Return a bridge that has taken ``messages`` and what follows for 0.1 s."""
    layout, results = layout_of("fd64"), result_layouts("fd", Identifiers(), CYCLE)
    own = [one.key for one in results]
    machine = Machine(layout, Projection(30), BridgeSettings(), start=time.monotonic(), own=own)
    bus = Scripted(list(messages))
    back_off = BackOff(first=0.01, attempts=1)
    bridge = Bridge(
        BusListener(machine, results, 0, Taps(**taps)), lambda: bus, back_off=back_off, queued_cycles=1000
    )
    thread = threading.Thread(target=bridge.run, args=(60.0,))
    thread.start()
    n = len(messages)
    while thread.is_alive() and bridge.summary().malformed + bridge.account().received < n:
        time.sleep(0.01)
    bridge.stop()
    thread.join()
    return bridge


def test_malformed_messages_are_counted_and_passed_over() -> None:
    good, queue = can.Message(**GOOD), FrameQueue(900)
    bad = [can.Message(**(GOOD | {"arbitration_id": number})) for number in (5.5, float("nan"), 768.0)]
    bridge = bridged([good, bad[0], good, bad[1], bad[2], good], queue=queue)
    summary = bridge.summary()
    taken = queue.take()
    assert taken["key"][taken["is_received"] == 1].tolist() == [0x301] * 3
    assert (summary.malformed, summary.failures, summary.account.received) == (3, 0, 3)
    assert "identifier 768.0 found" in summary.last_malformed


def test_what_an_interface_cannot_unpack_never_ends_a_bus() -> None:
    """As python-can's udp_multicast reports it."""
    garbled = can.CanOperationError("could not unpack received message")
    summary = bridged([garbled] * (3 * ERRORS_PER_SECOND)).summary()
    assert (summary.malformed, summary.failures, summary.reconnects) == (3 * ERRORS_PER_SECOND, 0, 0)


@pytest.mark.parametrize("suffix", LOG_SUFFIXES)
def test_a_frame_that_a_log_cannot_hold_is_lost_and_the_recording_goes_on(tmp_path: Path, suffix: str) -> None:
    path, clock = tmp_path / f"run{suffix}", MicrosecondClock()
    recorder = Recorder(path, clock)
    for number in range(9):
        identifier: Any = 768.0 if number == 4 else 0x300 + number
        recorder.queue.put(Frame(identifier=identifier, data=bytes(8), time=clock() + CYCLE * number), True)
    recorder.close()
    assert (recorder.recorded, recorder.lost, recorder.failure) == (8, 1, "")
    found = [frame.identifier for frame, _ in log_frames(path, clock.start, LogState())]
    assert found == [0x300 + number for number in range(9) if number != 4]
