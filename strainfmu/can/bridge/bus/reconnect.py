"""The times at which a lost bus is opened again: exponential back-off, a bounded number of attempts."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class BackOffSettings:
    """Waiting before each attempt.

    Attributes
    ----------
    first, longest : waiting time before the first attempt, and the longest ever [s]; it doubles in between.
    attempts : attempts in a row before the bridge gives up.
    settle : time [s] a bus must work before the count starts again.
    """

    first: float = 0.1
    longest: float = 5.0
    attempts: int = 10
    settle: float = 2.0


class BackOff:
    """Counts attempts; all times come from the caller's monotonic clock [s]."""

    def __init__(self, settings: BackOffSettings) -> None:
        self._settings = settings
        self._failures = 0
        self._opened: float | None = None
        self.due: float | None = None
        self.reconnects = 0

    @property
    def exhausted(self) -> bool:
        """No further attempt is allowed."""
        return self._failures > self._settings.attempts

    def failed(self, now: float) -> None:
        """Note that the bus, or an attempt to open it, failed; :attr:`due` is the time of the next attempt."""
        if self._opened is not None and now - self._opened >= self._settings.settle:
            self._failures = 0
        self._opened = None
        wait = min(self._settings.first * 2.0**self._failures, self._settings.longest)
        self._failures += 1
        self.due = now + wait

    def opened(self, now: float) -> None:
        """Note that a new bus is open."""
        self._opened, self.due = now, None
        self.reconnects += 1
