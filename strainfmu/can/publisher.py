"""Results as UDP datagrams of JSON, for displays; those that cannot be sent at once are dropped and counted.

A thread of its own makes and sends them, so that the bridge's cycle only hands over a reference.
"""

import json
import socket
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from strainfmu.can.machine import Result
from strainfmu.can.page_message import (
    FIELD_PERIOD,
    EstimatorFacts,
    FieldMessages,
    GaugePosition,
    layout_message,
    result_message,
)
from strainfmu.can.quality import BusState, Cause, FrameAccount, Quality
from strainfmu.errors import InputError, StrainfmuError

LAYOUT_PERIOD = 1.0
"""Period of the datagrams with the positions of the gauges [s]: the longest wait of a new display."""

TOKEN = "token"
"""Key of the token in a datagram."""

WAITING = 64
"""Maximum number of results that wait for the thread; further ones are dropped and counted."""

CHANGES, CHANGES_AT_ONCE = 20.0, 5
"""Changes of quality that are sent per second for long, or the rate if that is larger; and in a row at once.

A quality that flaps at the rate of the cycles must not cost more than they do.
"""

_ATTEMPTS, _FRAME_TIME = 5, 1e-4
_PATIENCE = 2.0
_ENCODED = json.JSONEncoder(separators=(",", ":")).encode


def parsed_address(text: str, option: str) -> tuple[str, int]:
    """Return host and port of "host:port".

    Raises
    ------
    InputError
        The text has another form.
    """
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or not 0 <= int(port) < 65536:
        raise InputError(f"{option}: expected HOST:PORT such as 127.0.0.1:9870, got '{text}'")
    return host.strip("[]"), int(port)


IN_ORDER: dict[str, Any] = {
    "bus_state": BusState.ERROR_ACTIVE.name,
    "bus": {},
    "recording": None,
    "period_text": "",
}
"""Report of a bridge in order: state of the controller; name, last fault and number of reopenings of the bus;
file, frames, lost frames and failure of the recording; the sender's period in words."""


class Publisher:
    """Sends every result, or at most ``rate`` per second; a change of quality is sent at once.

    Of many changes in a row some are sent late or, if the quality was back by then, not by themselves: every
    message holds the causes since the message before and the counts of all results.

    Parameters
    ----------
    address : host and port.
    gauges : n_d positions, order of the strains.
    account, report : return the frames so far, and entries of IN_ORDER; the publisher's thread calls them.
    facts : of the estimator.
    field : messages with the pressure on the surface; None for none.
    token : stated in every datagram, for a page that requires it; None for none.

    Raises
    ------
    StrainfmuError
        The host is not known.
    """

    def __init__(
        self,
        address: tuple[str, int],
        gauges: Sequence[GaugePosition],
        *,
        rate: float,
        account: Callable[[], FrameAccount],
        report: Callable[[], Mapping[str, Any]] = dict,
        facts: EstimatorFacts | None = None,
        field: FieldMessages | None = None,
        token: str | None = None,
    ) -> None:
        try:
            family, kind, protocol, _, target = socket.getaddrinfo(*address, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
        except OSError as error:
            raise StrainfmuError(f"page.publish {address[0]}:{address[1]}: {error.strerror or error}") from error
        self._socket.setblocking(False)
        self._target = target
        self._gauges, self._period, self._change_period = tuple(gauges), 1.0 / rate, 1.0 / max(rate, CHANGES)
        self._account, self._report, self._facts = account, report, facts or EstimatorFacts()
        self._field = field
        self._token = {} if token is None else {TOKEN: token}
        self._start = time.monotonic()
        self._next = self._next_change = self._next_layout = self._next_field = float("-inf")
        self._quality: Quality | None = None
        self._since = Cause.NONE
        self._counts: Counter[Quality] = Counter()
        self.sent = self.dropped = self._sequence = 0
        self._waiting: deque[tuple[Result, Cause, float]] = deque()
        self._wake, self._stop = threading.Event(), False
        self._thread = threading.Thread(target=self._run, name="publisher", daemon=True)
        self._thread.start()

    def result(self, result: Result) -> None:
        """Hand over a result to be sent, unless one was just before; never waits."""
        now = time.monotonic()
        quality = result.quality
        if result.causes:  # the sum of two flags takes longer than all the rest
            self._since |= result.causes
        self._counts[quality] += 1
        ahead = 0.0 if quality is self._quality else CHANGES_AT_ONCE * self._change_period
        if now < self._next_change - ahead or (now < self._next and not ahead):
            return
        self._quality, self._next = quality, now + self._period
        self._next_change = max(self._next_change, now) + self._change_period
        if len(self._waiting) >= WAITING or self._stop:
            self.dropped += 1
            return
        self._waiting.append((result, self._since, time.time()))
        self._since = Cause.NONE
        self._wake.set()

    def close(self) -> None:
        """Send what waits, end the thread and close the socket."""
        self._stop = True
        self._wake.set()
        self._thread.join(_PATIENCE)
        self._socket.close()

    def _run(self) -> None:
        while not self._stop or self._waiting:
            self._wake.wait()
            self._wake.clear()
            while self._waiting:
                result, since, timestamp = self._waiting.popleft()
                now = time.monotonic()
                if now >= self._next_layout:
                    self._next_layout = now + LAYOUT_PERIOD
                    self._send(layout_message(self._gauges, self._facts))
                self._send(self._message(result, since, timestamp))
                if self._field is not None and now >= self._next_field and not self._waiting:
                    self._next_field = now + FIELD_PERIOD
                    self._send(self._field.message(result, timestamp))

    def _message(self, result: Result, since: Cause, timestamp: float) -> dict[str, Any]:
        """Return the message of one result with the state of the bridge."""
        account = _settled(self._account)
        self._sequence += 1
        return {
            "timestamp": timestamp,
            "sequence": self._sequence,
            "uptime_s": round(time.monotonic() - self._start, 3),
            **result_message(result, self._gauges, self._facts.score_limit, since, self._facts.sensors),
            **IN_ORDER,
            **self._report(),
            "account": {**dict(account.rows()), "not accounted for": account.unaccounted},
            "results": {quality.name: count for quality, count in sorted(self._counts.copy().items())},
            "datagrams": {"sent": self.sent, "dropped": self.dropped},
        }

    def _send(self, content: dict[str, Any]) -> None:
        try:
            self._socket.sendto(_ENCODED({**content, **self._token}).encode(), self._target)
        except OSError:  # the system's buffer is full, the datagram is too long, or no one listens
            self.dropped += 1
            return
        self.sent += 1


def _settled(take: Callable[[], FrameAccount]) -> FrameAccount:
    """Return the account, read again if the bridge's threads were in the middle of a frame."""
    for _ in range(_ATTEMPTS):
        try:
            account = take()
        except RuntimeError:  # a table of it grew meanwhile
            continue
        if account.unaccounted == 0:
            return account
        time.sleep(_FRAME_TIME)
    return take()
