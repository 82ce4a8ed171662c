"""Messages that are no frames, and frames that no log can hold: counted and passed over."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest
from can_case import CYCLE, layout_of

from strainfmu.can.bridge.reception.receiver import ERRORS_PER_SECOND, BusFault, FrameQueue, Receiver
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.tools.log_frames import LogState, log_frames
from strainfmu.can.tools.recording import LOG_SUFFIXES, MicrosecondClock, Recorder
from strainfmu.can.wire.frame import Frame, MalformedFrame, from_message

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
    """A bus that hands over ``messages``, then is silent."""

    def __init__(self, messages: list[can.Message]) -> None:
        super().__init__("scripted")
        self.left = messages

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self.left:
            time.sleep(0.001)
            return None, False
        return self.left.pop(0), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("cannot send")


def received(
    messages: list[can.Message],
    on_received: Callable[[Frame], None] | None = None,
    kind: type[Scripted] = Scripted,
) -> tuple[Receiver, list[Frame | BusFault]]:
    """Return a receiver that has taken ``messages``, and what it has queued."""
    layout = layout_of("fd64")
    queue = FrameQueue(1000, 3)
    bus = kind(list(messages))
    acceptance = Acceptance(layout, [], BridgeSettings())
    receiver = Receiver(bus, queue, acceptance=acceptance, clock=time.monotonic, on_received=on_received)
    receiver.start()
    items: list[Frame | BusFault] = []
    end = time.monotonic() + 60.0
    while bus.left and time.monotonic() < end and not any(isinstance(item, BusFault) for item in items):
        items += queue.take(0.01, time.monotonic)[0]
    receiver.stop()
    while found := queue.take(0.0, time.monotonic)[0]:
        items += found
    bus.shutdown()
    return receiver, items


def test_a_receiver_counts_malformed_messages_and_goes_on() -> None:
    good = can.Message(**GOOD)
    bad = [can.Message(**(GOOD | {"arbitration_id": number})) for number in (5.5, float("nan"), 768.0)]
    receiver, items = received([good, bad[0], good, bad[1], bad[2], good])
    assert [item.identifier for item in items if isinstance(item, Frame)] == [0x301] * 3
    assert (receiver.malformed, receiver.failures) == (3, 0)
    assert "identifier 768.0 found" in receiver.last_malformed
    assert not any(isinstance(item, BusFault) for item in items)


class Garbled(Scripted):
    """A bus whose interface cannot unpack what it receives, and says so as python-can's udp_multicast does."""

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        message, is_filtered = super()._recv_internal(timeout)
        if message is None:
            return message, is_filtered
        raise can.CanOperationError("could not unpack received message") from ValueError("extra data")


def test_what_an_interface_cannot_unpack_never_ends_a_bus() -> None:
    receiver, items = received([can.Message(**GOOD)] * (3 * ERRORS_PER_SECOND), kind=Garbled)
    assert items == []
    assert (receiver.malformed, receiver.failures) == (3 * ERRORS_PER_SECOND, 0)


def test_whatever_else_goes_wrong_in_the_receiver_is_said_to_the_bridge() -> None:
    def fail(frame: Frame) -> None:
        raise ZeroDivisionError("a tap that fails")

    _, items = received([can.Message(**GOOD)], fail)
    assert [item.reason for item in items if isinstance(item, BusFault)] == ["a tap that fails"]


@pytest.mark.parametrize("suffix", LOG_SUFFIXES)
def test_a_frame_that_a_log_cannot_hold_is_lost_and_the_recording_goes_on(tmp_path: Path, suffix: str) -> None:
    path, clock = tmp_path / f"run{suffix}", MicrosecondClock()
    recorder = Recorder(path, clock)
    for number in range(9):
        identifier: Any = 768.0 if number == 4 else 0x300 + number
        recorder.received(Frame(identifier=identifier, data=bytes(8), time=clock() + CYCLE * number))
    recorder.close()
    assert (recorder.recorded, recorder.lost, recorder.failure) == (8, 1, "")
    found = [frame.identifier for frame, _ in log_frames(path, clock.start, LogState())]
    assert found == [0x300 + number for number in range(9) if number != 4]
