"""Connections to the page that are slow or aborted: the first are ended, neither leaves a word or a thread."""

import http.client
import socket
import struct
import threading
import time
from contextlib import suppress

import pytest

import strainfmu.monitor.server as server
from strainfmu.monitor.server import Monitor

pytestmark = pytest.mark.fast

PATIENCE = 60.0
"""How long a busy machine may take for what is waited for [s]."""
REQUEST = b"GET /events HTTP/1.1\r\nHost: localhost\r\n"


def connected(monitor: Monitor) -> socket.socket:
    """Return a connection to the page."""
    host, port = monitor.url.removeprefix("http://").rstrip("/").rsplit(":", 1)
    return socket.create_connection((host, int(port)), timeout=PATIENCE)


def is_ended(connection: socket.socket) -> bool:
    """Wait for the next byte of the other end; return whether it is the end."""
    try:
        return connection.recv(1) == b""
    except ConnectionError:
        return True


def handlers(before: set[threading.Thread]) -> list[threading.Thread]:
    """Return the threads that answer connections."""
    return [one for one in threading.enumerate() if one not in before]


def wait_until_none_is_left(before: set[threading.Thread]) -> None:
    end = time.monotonic() + PATIENCE
    while handlers(before):
        assert time.monotonic() < end, "a connection is still served"
        time.sleep(0.01)


@pytest.mark.parametrize("begin", [b"", b"G", REQUEST], ids=["nothing", "one byte", "header without end"])
def test_a_request_that_does_not_come_is_ended(
    begin: bytes, monitor: Monitor, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(server, "REQUEST_TIME", 0.3)
    before = set(threading.enumerate())
    with connected(monitor) as connection:
        connection.sendall(begin)
        assert is_ended(connection)
    wait_until_none_is_left(before)
    assert capfd.readouterr() == ("", "")


def test_a_request_that_comes_byte_by_byte_is_ended(
    monitor: Monitor, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Each byte comes in time, the whole never does; others are answered meanwhile."""
    before, stopped = set(threading.enumerate()), threading.Event()
    with connected(monitor) as slow:
        slow.sendall(REQUEST)

        def drip() -> None:
            with suppress(OSError):
                while not stopped.wait(0.02):
                    slow.sendall(b"X: y\r\n")

        dripping = threading.Thread(target=drip)
        dripping.start()
        page = http.client.HTTPConnection(monitor.url.removeprefix("http://").rstrip("/"), timeout=PATIENCE)
        page.request("GET", "/")
        assert page.getresponse().status == 200
        page.close()
        monkeypatch.setattr(server, "REQUEST_TIME", 0.3)
        assert is_ended(slow)
        stopped.set()
        dripping.join()
    wait_until_none_is_left(before)
    assert capfd.readouterr() == ("", "")


def test_a_stream_outlives_the_time_of_a_request(monitor: Monitor, monkeypatch: pytest.MonkeyPatch) -> None:
    page = http.client.HTTPConnection(monitor.url.removeprefix("http://").rstrip("/"), timeout=PATIENCE)
    page.request("GET", "/events")
    stream, begin = page.getresponse(), time.monotonic()
    monkeypatch.setattr(server, "REQUEST_TIME", 0.1)
    while time.monotonic() < begin + 0.5:
        assert stream.readline().startswith(b"data: ")
        assert stream.readline() == b"\n"
    page.close()


@pytest.mark.parametrize("begin", [b"GET", REQUEST + b"\r\n", b"GET /state HTTP/1.1\r\nHost: localhost\r\n\r\n"])
def test_an_aborted_connection_leaves_no_traceback(
    begin: bytes, monitor: Monitor, capfd: pytest.CaptureFixture[str]
) -> None:
    """Ended by a reset, as by a browser that is killed."""
    before = set(threading.enumerate())
    for _ in range(5):
        connection = connected(monitor)
        connection.sendall(begin)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        connection.close()
    wait_until_none_is_left(before)
    assert capfd.readouterr() == ("", "")
