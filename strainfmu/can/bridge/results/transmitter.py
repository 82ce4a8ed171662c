"""The transmitter: the only place from which the bridge sends."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from strainfmu.can.bridge.bus.raw_bus import RawBus
from strainfmu.can.wire.frame import Frame, to_message
from strainfmu.can.wire.libraries import error_line, import_can

FAILURES_IN_A_ROW = 20
"""Failed transmissions in a row after which the bus counts as broken."""

SEND_TIMEOUT = 0.0
"""Time to wait for a bus [s]: none, as a result that cannot be sent now would be old later."""


class Transmitter:
    """Sends frames on one bus after another; counts failures.

    Parameters
    ----------
    on_sent : called with every frame that was sent.
    on_sending : called with every frame before it is sent, as it may come back before the call returns.
    """

    def __init__(
        self,
        on_sent: Callable[[Frame], None] | None = None,
        on_sending: Callable[[Frame], None] | None = None,
    ) -> None:
        self._on_sent, self._on_sending = on_sent, on_sending
        self._bus: Any = None
        self._raw: RawBus | None = None
        self._errors: tuple[type[Exception], ...] = ()
        self._in_a_row = 0
        self.sent = 0
        self.failures = 0
        self.last_failure = ""

    def use(self, bus: Any, raw: RawBus | None = None) -> None:
        """Send on ``bus`` from now on, through its socket ``raw`` if that is known; on none if None."""
        self._bus, self._raw = bus, raw
        self._errors = (import_can().CanError, OSError, ValueError)
        self._in_a_row = 0

    def send(self, frames: Iterable[Frame]) -> bool:
        """Send ``frames``, each at most once; return False when the bus counts as broken."""
        if self._bus is None:
            return True
        raw = self._raw
        for frame in frames:
            if self._on_sending is not None:
                self._on_sending(frame)
            try:
                if raw is None:
                    self._bus.send(to_message(frame), timeout=SEND_TIMEOUT)
                else:
                    raw.send(frame)
            except self._errors as error:
                self.failures += 1
                self._in_a_row += 1
                self.last_failure = error_line(error)
                continue
            self._in_a_row = 0
            self.sent += 1
            if self._on_sent is not None:
                self._on_sent(frame)
        return self._in_a_row < FAILURES_IN_A_ROW
