"""Signs of a second sender: frames with correct CRC that one sender cannot have sent."""

from __future__ import annotations

from collections import deque

from strainfmu.can.e2e.check import ReceptionCheck

_ALTERNATIONS = 3
"""Frames whose counters alternate between two sequences: fewer are late frames or a single repetition."""


_PATIENCE, _GROWTH, _LONGEST = 10.0, 4.0, 250.0
"""A sign that comes again within the first number of alarms makes the next alarm longer by the second, up to the
third times the first alarm: a foreign sender that comes seldom is foreign in between, too."""


class SecondSender:
    """Follows the signs; which of two senders is the true one cannot be determined.

    Parameters
    ----------
    alarm : time [s] for which the first sign counts.
    """

    def __init__(self, alarm: float) -> None:
        self._alarm, self._shortest = alarm, alarm
        self._heard = self._until = -float("inf")
        self._alternations: dict[int, deque[float]] = {}

    def take(self, check: ReceptionCheck, slot: int, time: float) -> None:
        """Take in the last check of the frame ``slot``, received at ``time`` [s]."""
        if check.conflicts:
            self._hear(time)
        if check.alternates:
            times = self._alternations.setdefault(slot, deque(maxlen=_ALTERNATIONS))
            times.append(time)
            if len(times) == _ALTERNATIONS and time - times[0] <= self._shortest:
                self._hear(time)

    def _hear(self, time: float) -> None:
        """Note a sign; one behind the shortest alarm makes the alarm longer."""
        since = time - self._heard
        if since > _PATIENCE * self._alarm:
            self._alarm = self._shortest
        elif since > self._shortest:
            self._alarm = min(_GROWTH * self._alarm, _LONGEST * self._shortest)
        self._heard = time
        self._until = max(self._until, time + self._alarm)

    def was_heard(self, now: float) -> bool:
        """Return whether an alarm lasts."""
        return now <= self._until
