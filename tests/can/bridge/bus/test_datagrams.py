"""Datagrams that wait in a socket: both ways of reading give the same."""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Callable, Iterator
from errno import EBADF

import pytest

from strainfmu.can.bridge.bus.datagrams import AT_ONCE, LARGEST_DATAGRAM, AllAtOnce, Datagrams, OneByOne

pytestmark = pytest.mark.fast

_SO_TIMESTAMPNS = 35
Maker = Callable[[socket.socket], Datagrams]
_AT_ONCE = pytest.param(
    AllAtOnce, marks=pytest.mark.skipif(sys.platform != "linux", reason="recvmmsg is a call of Linux")
)
both = pytest.mark.parametrize("maker", [OneByOne, _AT_ONCE])


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Return a receiving socket with time stamps of the kernel, and one connected to it."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiving,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending,
    ):
        receiving.bind(("127.0.0.1", 0))
        receiving.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        sending.connect(receiving.getsockname())
        yield receiving, sending


@both
def test_what_waits_is_read_in_order_with_the_time_of_its_reception(
    ends: tuple[socket.socket, socket.socket], maker: Maker
) -> None:
    receiving, sending = ends
    reader = maker(receiving)
    assert reader.read(AT_ONCE) == ([], True)
    for turn in range(3):
        sent = [bytes([turn, number]) * (number + 1) for number in range(5)]
        for data in sent:
            sending.send(data)
        time.sleep(0.02)
        begin = time.time()
        found, is_drained = reader.read(AT_ONCE)
        spent = time.time() - begin
        assert [data for data, _ in found] == sent
        waited = [seconds for _, seconds in found]
        # To a step of a coarse clock of the kernel.
        assert 0.01 <= waited[-1] <= waited[0] < 60.0 + spent
        assert waited == sorted(waited, reverse=True)
        assert is_drained
        assert reader.is_stamped


@both
def test_a_step_of_the_clock_makes_no_datagram_younger_than_now(
    ends: tuple[socket.socket, socket.socket], maker: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    receiving, sending = ends
    reader = maker(receiving)
    sending.send(b"1")
    now = time.time()
    monkeypatch.setattr("strainfmu.can.bridge.bus.datagrams.time.time", lambda: now - 3600.0)
    assert reader.read(AT_ONCE) == ([(b"1", 0.0)], True)


@both
def test_no_more_is_read_than_asked_for(ends: tuple[socket.socket, socket.socket], maker: Maker) -> None:
    receiving, sending = ends
    reader = maker(receiving)
    for number in range(7):
        sending.send(bytes([number]))
    first, was_drained = reader.read(4)
    rest, is_drained = reader.read(4)
    assert ([data[0] for data, _ in first], was_drained) == ([0, 1, 2, 3], False)
    assert ([data[0] for data, _ in rest], is_drained) == ([4, 5, 6], True)


@both
def test_empty_and_too_long_datagrams_are_read_too(
    ends: tuple[socket.socket, socket.socket], maker: Maker
) -> None:
    receiving, sending = ends
    reader = maker(receiving)
    for data in (b"", bytes(LARGEST_DATAGRAM + 1), b"next"):
        sending.send(data)
    assert [data for data, _ in reader.read(AT_ONCE)[0]] == [b"", bytes(LARGEST_DATAGRAM), b"next"]


@both
def test_stamps_may_be_missing_for_a_while(ends: tuple[socket.socket, socket.socket], maker: Maker) -> None:
    receiving, sending = ends
    reader = maker(receiving)
    for is_stamped in (1, 0, 1):
        receiving.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, is_stamped)
        sending.send(b"1")
        sending.send(b"2")
        found, _ = reader.read(AT_ONCE)
        assert [data for data, _ in found] == [b"1", b"2"]
        assert reader.is_stamped is bool(is_stamped)
        assert is_stamped or [waited for _, waited in found] == [0.0, 0.0]


@both
def test_a_socket_that_was_closed_is_an_error(maker: Maker) -> None:
    """Its number may be that of another socket by then: nothing of that one is taken."""
    receiving = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    reader = maker(receiving)
    reader.close()
    receiving.close()
    with pytest.raises(OSError, match="Bad file descriptor") as raised:
        reader.read(AT_ONCE)
    assert raised.value.errno == EBADF


@both
def test_an_error_of_the_socket_is_raised(ends: tuple[socket.socket, socket.socket], maker: Maker) -> None:
    _, sending = ends
    reader = maker(sending)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind(("127.0.0.1", 0))
        nobody = gone.getsockname()
    sending.connect(nobody)
    sending.send(b"to nobody")
    with pytest.raises(ConnectionRefusedError):
        reader.read(AT_ONCE)
