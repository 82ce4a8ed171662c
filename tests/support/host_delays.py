"""How long the host lets a thread wait that has something to do: what a test of the wall clock may ask of it."""

from __future__ import annotations

import threading
import time
from types import TracebackType

_PERIOD, _LATE = 2e-3, 1e-2
BUSY = 0.02
"""Share of the time for which a thread was held up, from which on a host counts as busy."""


class HostDelays:
    """Measures, for as long as the context lasts, by a thread that sleeps shortly again and again.

    A test whose answers are due in milliseconds asks for their number where the host is not busy, and for their
    account, which says what came late, where it is.
    """

    def __init__(self) -> None:
        self._late = 0.0
        self._start = self._end = time.monotonic()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> HostDelays:
        self._start = time.monotonic()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join()
        self._end = time.monotonic()

    @property
    def share(self) -> float:
        """Share of the time for which the thread was held up by more than 10 ms."""
        return self._late / max(self._end - self._start, 1e-9)

    @property
    def is_busy(self) -> bool:
        """Return whether the host was too busy to be on time."""
        return self.share > BUSY

    def _run(self) -> None:
        while not self._stop.is_set():
            begin = time.monotonic()
            time.sleep(_PERIOD)
            over = time.monotonic() - begin - _PERIOD
            if over > _LATE:
                self._late += over
