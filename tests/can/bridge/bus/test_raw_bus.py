"""The socket under python-can's interfaces: the same frames as python-can's own way, in both directions."""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame
from can.interfaces.udp_multicast.utils import pack_message

from strainfmu.can.bridge.bus.opening import BusSettings, open_bus
from strainfmu.can.bridge.bus.raw_bus import RawMulticast, RawSocketCan, can_frame, raw_bus
from strainfmu.can.bridge.reception.inline_receiver import InlineReceiver
from strainfmu.can.bridge.reception.receiver import BusFault, FrameQueue
from strainfmu.can.cycle.frames.acceptance import Acceptance
from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.own_frames import OwnFrames
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame import Frame, MalformedFrame, from_message, to_message

pytestmark = pytest.mark.fast

GROUP = "239.74.163.11"
FRAMES = [
    Frame(identifier=0x301, data=bytes(range(64)), is_fd=True, bitrate_switch=True),
    Frame(identifier=0x301, data=bytes(12), is_fd=True),
    Frame(identifier=0x7FF, data=b"12345678"),
    Frame(identifier=0x1FFFFFFF, data=b"", is_extended=True),
    Frame(identifier=0x123, data=b"", is_remote=True),
]
ERROR = Frame(identifier=0x40, data=bytes(8), is_error=True)


@pytest.fixture
def buses() -> Iterator[list[can.BusABC]]:
    """Return two buses on a port that nobody else has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    settings = BusSettings(interface="udp_multicast", channel=GROUP, options={"port": port})
    with open_bus(settings) as first, open_bus(settings) as second:
        yield [first, second]


def raw_multicast(bus: can.BusABC) -> RawMulticast:
    found = raw_bus(bus)
    assert isinstance(found, RawMulticast)
    return found


def waiting(raw: Any, n: int) -> list[tuple[bytes, float]]:
    """Return the next ``n`` datagrams."""
    found: list[tuple[bytes, float]] = []
    end = time.monotonic() + 60.0
    while len(found) < n and time.monotonic() < end:
        raw.wait(0.1)
        found += raw.read(n - len(found))[0]
    return found


def wait_for_times(raw: RawMulticast, sender: can.BusABC) -> None:
    """Send until frames have times: the kernel takes them from a moment after a socket has asked for them."""
    for _ in range(100):
        sender.send(to_message(FRAMES[1]))
        time.sleep(0.02)
        ((_, waited),) = waiting(raw, 1)
        if waited >= 0.015:
            return
    pytest.fail("no frame of 100 had a time")


def test_multicast_is_what_python_can_sends_and_receives(buses: list[can.BusABC]) -> None:
    raw = raw_multicast(buses[0])
    for frame in [*FRAMES, ERROR]:
        buses[1].send(to_message(frame))
    assert [raw.frame(data, 0.0) for data, _ in waiting(raw, 6)] == [*FRAMES, ERROR]
    for frame in FRAMES:
        raw.send(frame)
    heard = [buses[1].recv(60.0) for _ in range(6 + len(FRAMES))][6:]
    assert [from_message(message, 0.0) for message in heard] == FRAMES
    raw.close()


def test_a_frame_has_the_time_at_which_the_kernel_received_it(buses: list[can.BusABC]) -> None:
    raw = raw_multicast(buses[0])
    wait_for_times(raw, buses[1])
    buses[1].send(to_message(FRAMES[0]))
    time.sleep(0.05)
    ((_, waited),) = waiting(raw, 1)
    assert 0.05 <= waited < 60.0
    assert raw.read(1) == ([], True)
    raw.close()


@pytest.mark.parametrize(
    "wrong",
    [{"dlc": 63}, {"arbitration_id": 0x800}, {"is_remote_frame": True}, {"arbitration_id": 5.5}, {"is_fd": False}],
)
def test_what_python_can_refuses_is_no_frame(buses: list[can.BusABC], wrong: dict[str, Any]) -> None:
    raw = raw_multicast(buses[0])
    message = to_message(FRAMES[0])
    for name, value in wrong.items():
        setattr(message, name, value)
    with pytest.raises(MalformedFrame):
        raw.frame(bytes(pack_message(message)), 0.0)
    raw.close()


def test_frames_are_never_older_than_a_time_already_known(buses: list[can.BusABC]) -> None:
    raw, queue = raw_multicast(buses[0]), FrameQueue(100, 3)
    wait_for_times(raw, buses[1])
    clock = time.monotonic
    acceptance = Acceptance(layout(), [], BridgeSettings())
    receiver = InlineReceiver(raw, queue, acceptance=acceptance, clock=clock, cycle=1)
    known = receiver.collect(0.0)
    for _ in range(3):
        buses[1].send(to_message(FRAMES[0]))
        time.sleep(0.02)
        later = receiver.collect(1.0)
        ((item,), _) = queue.take(0.0, clock)
        assert isinstance(item, Frame)
        assert known <= item.time <= later <= clock()
        assert later - item.time >= 0.015, "it has waited"
        known = later
    receiver.stop()


def test_own_frames_that_have_come_back_do_not_end_the_wait(buses: list[can.BusABC]) -> None:
    raw, queue = raw_multicast(buses[0]), FrameQueue(100, 3)
    own = Frame(identifier=0x390, data=bytes(8))
    sent = OwnFrames([own.key])
    sent.sending(own)
    acceptance = Acceptance(layout(), sent, BridgeSettings())
    receiver = InlineReceiver(raw, queue, acceptance=acceptance, clock=time.monotonic, cycle=1)
    buses[1].send(to_message(own))
    time.sleep(0.05)
    later = threading.Timer(0.05, buses[1].send, [to_message(FRAMES[0])])
    later.start()
    receiver.collect(60.0)
    later.join()
    assert [item.key for item in queue.take(0.0, time.monotonic)[0] if isinstance(item, Frame)] == [FRAMES[0].key]
    assert receiver.account.received == 1
    receiver.stop()


def test_own_frames_that_come_back_are_neither_read_nor_recorded_and_each_is_own_once(
    buses: list[can.BusABC], monkeypatch: pytest.MonkeyPatch
) -> None:
    raw, queue = raw_multicast(buses[0]), FrameQueue(100, 3)
    own = [Frame(identifier=0x390, data=bytes([number, 7])) for number in range(3)]
    sent, recorded, read = OwnFrames([0x390]), list[Frame](), list[bytes]()
    receiver = InlineReceiver(
        raw, queue, Acceptance(layout(), sent, BridgeSettings()), clock=time.monotonic, on_received=recorded.append
    )
    frame_of = raw.frame

    def reading(datagram: bytes, received: float) -> Frame:
        read.append(datagram)
        return frame_of(datagram, received)

    monkeypatch.setattr(raw, "frame", reading)
    for frame in own:
        sent.sending(frame)
        raw.send(frame)
    time.sleep(0.05)
    receiver.collect(0.0)
    assert (receiver.account.received, receiver.account.classes[FrameClass.OWN]) == (3, 3)
    assert (read, recorded) == ([], [])
    # The same content once more is another bridge's, and so is an identifier that is not ours what it is.
    buses[1].send(to_message(own[1]))
    raw.send(FRAMES[2])
    time.sleep(0.05)
    receiver.collect(0.0)
    assert [frame.data for frame in recorded] == [own[1].data, FRAMES[2].data]
    items = [item for item in queue.take(0.0, time.monotonic)[0] if isinstance(item, Frame)]
    core_side = Acceptance(layout(), sent, BridgeSettings())
    assert [core_side.refused(item) for item in items] == [FrameClass.SECOND_BRIDGE]
    classes = receiver.account.classes
    assert (classes[FrameClass.OWN], classes[FrameClass.UNKNOWN_IDENTIFIER]) == (3, 1)
    receiver.stop()


def test_datagrams_that_never_come_back_do_not_fill_the_memory(buses: list[can.BusABC]) -> None:
    raw = raw_multicast(buses[0])
    first = Frame(identifier=0x390, data=bytes(8))
    raw.send(first)
    (datagram, _), *_ = waiting(raw, 1)
    for number in range(1000):
        raw.send(Frame(identifier=0x390, data=number.to_bytes(2, "big")))
    assert len(raw._returning) == 1000
    assert raw.returned(datagram) is None, "the oldest is forgotten, and would be read as any other"
    raw.close()


def test_formats_and_rates_of_few_frames_are_for_the_core_and_of_a_flood_for_the_receiver(
    buses: list[can.BusABC],
) -> None:
    raw, queue = raw_multicast(buses[0]), FrameQueue(100, 2)
    acceptance = Acceptance(layout(), (), BridgeSettings())
    receiver = InlineReceiver(raw, queue, acceptance=acceptance, clock=time.monotonic, cycle=2)
    known = next(iter(acceptance.buckets))
    wrong = Frame(identifier=known, data=b"1")
    for n_frames, n_refused in ((4, 0), (5, 5)):
        for _ in range(n_frames):
            buses[1].send(to_message(wrong))
        time.sleep(0.05)
        receiver.collect(0.0)
        assert receiver.account.classes[FrameClass.WRONG_FORMAT] == n_refused
    assert len(queue) == 4
    assert Acceptance(layout(), (), BridgeSettings()).refused(wrong) is FrameClass.WRONG_FORMAT
    receiver.stop()


def test_a_cycle_is_taken_whole_by_one_wake_up_at_its_expected_end(
    buses: list[can.BusABC], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("strainfmu.can.bridge.reception.inline_receiver.LONGEST_EXPECTED", 10.0)
    raw, queue = raw_multicast(buses[0]), FrameQueue(100, 2)
    acceptance, clock = Acceptance(layout(), [], BridgeSettings()), time.monotonic
    receiver = InlineReceiver(
        raw, queue, acceptance=acceptance, clock=clock, collect_time=0.004, cycle=2, cycle_time=1.0
    )
    wakes: list[str] = []
    pauses: list[float] = []
    sleep, wait = time.sleep, raw.wait

    def send_cycle() -> None:
        for _ in range(2):
            buses[1].send(to_message(FRAMES[0]))
        sleep(0.001)

    def slept(seconds: float) -> None:
        wakes.append("sleep")
        pauses.append(seconds)
        send_cycle()

    def waited(timeout: float) -> None:
        wakes.append("wait")
        wait(min(timeout, 0.01))

    send_cycle()
    receiver.collect(60.0)
    monkeypatch.setattr("strainfmu.can.bridge.reception.inline_receiver.time.sleep", slept)
    monkeypatch.setattr(raw, "wait", waited)
    for _ in range(3):
        first, last = queue.take(0.0, clock)[0]
        begin = clock()
        receiver.collect(60.0)
        assert first.time <= last.time <= begin
        # Its end and half of the time for which frames are collected.
        assert 0.0 < pauses[-1] <= last.time + 1.002 - begin
    assert wakes == 3 * ["sleep"]
    receiver.stop()


def test_without_stamps_of_the_kernel_no_cycle_is_expected(
    buses: list[can.BusABC], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A frame would seem to come when it is looked for, and be looked for ever later."""
    monkeypatch.setattr("strainfmu.can.bridge.reception.inline_receiver.LONGEST_EXPECTED", 10.0)
    raw, queue = raw_multicast(buses[0]), FrameQueue(100, 1)
    acceptance, clock = Acceptance(layout(), [], BridgeSettings()), time.monotonic
    receiver = InlineReceiver(
        raw, queue, acceptance=acceptance, clock=clock, collect_time=0.004, cycle=1, cycle_time=5.0
    )
    with socket.socket(fileno=os.dup(buses[0].fileno())) as same:
        same.setsockopt(socket.SOL_SOCKET, 35, 0)  # SO_TIMESTAMPNS
    buses[1].send(to_message(FRAMES[0]))
    time.sleep(0.01)
    receiver.collect(60.0)
    assert len(queue.take(0.0, clock)[0]) == 1
    buses[1].send(to_message(FRAMES[0]))
    time.sleep(0.002)
    begin = clock()
    receiver.collect(60.0)
    assert clock() - begin < 2.5, "it is taken at once"
    receiver.stop()


def test_of_a_bus_that_was_shut_down_no_frame_is_answered(buses: list[can.BusABC]) -> None:
    raw, queue = raw_multicast(buses[0]), FrameQueue(100, 3)
    acceptance = Acceptance(layout(), [], BridgeSettings())
    receiver = InlineReceiver(raw, queue, acceptance=acceptance, clock=time.monotonic, cycle=1)
    buses[1].send(to_message(FRAMES[0]))
    time.sleep(0.05)
    buses[0].shutdown()
    receiver.collect(1.0)
    items, _ = queue.take(0.0, time.monotonic)
    assert [type(item) for item in items] == [BusFault]
    raw.close()


def test_only_known_sockets_are_read_directly(buses: list[can.BusABC]) -> None:
    with can.Bus(interface="virtual", channel="raw") as virtual:
        assert raw_bus(virtual) is None
    buses[0].set_filters([{"can_id": 1, "can_mask": 0x7FF}])
    assert raw_bus(buses[0]) is None, "python-can filters this one in software"


class _AnySocket:
    """A pair of sockets in place of SocketCAN's, which needs a kernel with CAN."""

    def __init__(self) -> None:
        self.socket, self.other = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.fileno = self.socket.fileno


@pytest.mark.parametrize("frame", FRAMES, ids=lambda frame: f"{frame.identifier:X}")
def test_socketcan_frames_are_those_of_python_can(frame: Frame) -> None:
    theirs = bytes(build_can_frame(to_message(frame)))
    ours = can_frame(frame)
    # CAN FD has further flags in byte 5; byte 7 is read by the kernel of 9 to 15 alone.
    assert (len(ours), ours[:5], ours[8:].rstrip(b"\0")) == (len(theirs), theirs[:5], theirs[8:].rstrip(b"\0"))
    bus = _AnySocket()
    raw = RawSocketCan(bus)
    bus.other.send(theirs)
    ((data, _),) = waiting(raw, 1)
    assert raw.frame(data, 0.0) == frame
    raw.send(frame)
    assert raw.frame(bus.other.recv(100), 0.0) == frame
    with pytest.raises(MalformedFrame):
        raw.frame(data[:-1], 0.0)
    raw.close()
    bus.socket.close()
    bus.other.close()


def layout() -> Any:
    from can_case import layout_of

    return layout_of("fd64")
