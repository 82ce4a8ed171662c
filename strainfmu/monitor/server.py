"""The server of the live view: datagrams to all open pages by Server-Sent Events, on loopback by default."""

from __future__ import annotations

import ipaddress
import re
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any

from strainfmu.can.bus_file import read_bus
from strainfmu.can.publisher import parsed_address
from strainfmu.errors import StrainfmuError
from strainfmu.monitor.message import LARGEST_DATAGRAM
from strainfmu.monitor.state import MonitorState, Seen

PUSH_PERIOD = 0.1
"""Time between two events to a page [s]; an eye sees no faster changes."""

REQUEST_TIME = 5.0
"""Time [s] in which a connection has to send its whole request, and in which it has to take an answer or event."""

_HEARTBEAT = 1.0
_HOST = re.compile(r"(\[[^\[\]]*\]|[^:\[\]]*)(?::\d*)?")


def serve_monitor(
    listen: str | None = None, http: str | None = None, bus: str | PathLike[str] | None = None
) -> Monitor:
    """Show live strains, coefficients, health and the frame account in a browser.

    A process of its own: it may start before or after the bridge, and goes on when that restarts.

    On the command line::

        strainfmu monitor
        strainfmu bridge estimator.fmu --bus bus.toml --set page.publish=127.0.0.1:9870

    Parameters
    ----------
    listen : address to which the bridge publishes. Default: 127.0.0.1:9870.
    http : address of the page. Beyond loopback, everyone can read it. Default: 127.0.0.1:8780.
    bus : bus file; addresses and token are entries of its table page.

    Raises
    ------
    StrainfmuError
        As :class:`Monitor`, whose ``close()`` ends it.
    """
    described = read_bus(None if bus is None else Path(bus))
    listen_at = parsed_address(listen or described.publish or "127.0.0.1:9870", "--listen")
    page_at = parsed_address(http or described.http or "127.0.0.1:8780", "--http")
    return Monitor(listen_at, page_at, token=described.publish_token)


class Monitor:
    """Receives datagrams and serves the page until it is closed.

    Parameters
    ----------
    listen : host and port of the datagrams; port 0 for any.
    http : host and port of the page; port 0 for any.
    token : what datagrams must state to be shown; None: anybody on this host may publish.

    Raises
    ------
    StrainfmuError
        An address is in use, or is not one of this host.
    """

    def __init__(self, listen: tuple[str, int], http: tuple[str, int], token: str | None = None) -> None:
        self.state = MonitorState(token)
        self._stop = threading.Event()
        self._socket = _bound(listen)
        try:
            self._server = _Server(http, _Handler)
        except OSError as error:
            self._socket.close()
            raise StrainfmuError(f"page at {shown_address(http)}: {error.strerror or error}") from error
        self._server.state, self._server.stopped = self.state, self._stop.is_set
        self._threads = [
            threading.Thread(target=self._receive, name="monitor datagrams", daemon=True),
            threading.Thread(target=self._server.serve_forever, args=(0.1,), name="monitor page", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def listens_at(self) -> tuple[str, int]:
        """Host and port of the datagrams."""
        host, port = self._socket.getsockname()[:2]
        return str(host), int(port)

    @property
    def url(self) -> str:
        """Address of the page."""
        host, port = self._server.server_address[:2]
        return f"http://{shown_address((str(host), int(port)))}/"

    def close(self) -> None:
        """End all threads and free both addresses."""
        self._stop.set()
        self._server.shutdown()
        for thread in self._threads:
            thread.join(2.0)
        self._server.server_close()
        self._socket.close()

    def _receive(self) -> None:
        while not self._stop.is_set():
            try:
                datagram, sender = self._socket.recvfrom(LARGEST_DATAGRAM)
            except TimeoutError:
                continue
            except OSError:
                return
            self.state.take(datagram, time.monotonic(), shown_address(sender[:2]))


def shown_address(address: tuple[str, int]) -> str:
    """Return "host:port", an IPv6 host in brackets."""
    host, port = address
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def is_loopback(host: str) -> bool:
    """Return whether ``host``, a name or an address, is a loopback: 127.0.0.0/8, ::1 or localhost."""
    if host.lower() == "localhost":
        return True
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return False
    mapped = getattr(address, "ipv4_mapped", None)
    return (mapped or address).is_loopback


def _bound(address: tuple[str, int]) -> socket.socket:
    """Return a socket that receives datagrams at ``address``."""
    try:
        family, kind, protocol, _, target = socket.getaddrinfo(*address, type=socket.SOCK_DGRAM)[0]
        opened = socket.socket(family, kind, protocol)
        opened.bind(target)
    except OSError as error:
        raise StrainfmuError(f"datagrams at {shown_address(address)}: {error.strerror or error}") from error
    opened.settimeout(0.1)
    return opened


PAGE_FILES = {
    "/": ("monitor.html", "text/html; charset=utf-8"),
    "/page/monitor.css": ("monitor.css", "text/css; charset=utf-8"),
    **{
        f"/page/{name}.js": (f"{name}.js", "text/javascript; charset=utf-8")
        for name in ("monitor", "figures", "gauges", "histories", "pressure", "other_loads", "texts")
    },
}
"""File and type of every address of the page; they need no others."""


@cache
def page_file(address: str) -> bytes:
    """Return the file of one of :data:`PAGE_FILES`."""
    return (files("strainfmu.monitor") / "page" / PAGE_FILES[address][0]).read_bytes()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    state: MonitorState
    stopped: Callable[[], bool]

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        family, _, _, _, target = socket.getaddrinfo(*address, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        self.address_family = family
        self._unheard: dict[Any, float] = {}
        super().__init__((str(target[0]), int(target[1])), handler)
        self.is_local = is_loopback(str(self.server_address[0]))

    def process_request(self, request: Any, client_address: Any) -> None:
        """Begin a connection, whose request is to come in time."""
        self._unheard[request] = time.monotonic()
        super().process_request(request, client_address)

    def heard(self, request: Any) -> None:
        """Note that the request of a connection is complete."""
        self._unheard.pop(request, None)

    def service_actions(self) -> None:
        """End connections whose request takes too long, byte by byte or not; called several times a second."""
        super().service_actions()
        now = time.monotonic()
        for request, since in list(self._unheard.items()):
            if now - since > REQUEST_TIME:
                self.heard(request)
                with suppress(OSError):  # ended by itself
                    request.shutdown(socket.SHUT_RDWR)

    def shutdown_request(self, request: Any) -> None:
        """End a connection."""
        self.heard(request)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a connection that its other end has aborted or left."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers / and /page with the page, /events with the stream, /state with one snapshot."""

    server: _Server
    timeout = REQUEST_TIME

    def do_GET(self) -> None:
        self.server.heard(self.connection)
        # A foreign page whose host name points to this host must not read its measurements.
        host = _HOST.fullmatch(self.headers.get("Host", ""))
        if self.server.is_local and (host is None or not is_loopback(host[1].strip("[]"))):
            self.send_error(403)
            return
        if self.path in PAGE_FILES:
            self._answer(PAGE_FILES[self.path][1], page_file(self.path))
        elif self.path == "/state":
            self._answer("application/json", self.server.state.snapshot(time.monotonic()).encode())
        elif self.path == "/events":
            self._stream()
        else:
            self.send_error(404)

    def _answer(self, kind: str, content: bytes) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", "default-src 'self'; img-src 'self' data:")
        self.end_headers()
        self.wfile.write(content)

    def _stream(self) -> None:
        """Send the latest state, until the page is closed."""
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        version = -1
        sent: Seen | None = None
        try:
            while not self.server.stopped():
                # The heartbeat reports a bridge that has gone silent.
                version = self.server.state.wait(version, _HEARTBEAT)
                content, sent = self.server.state.news(time.monotonic(), sent)
                self.wfile.write(f"data: {content}\n\n".encode())
                self.wfile.flush()
                time.sleep(PUSH_PERIOD)
        except OSError:
            return

    def log_message(self, format: str, *args: Any) -> None:
        """Keep the console for what matters."""
