"""Signs of a second sender: frames with correct CRC that one sender cannot have sent."""

from __future__ import annotations

from collections import deque

from strainfmu.can.e2e.check import ReceptionCheck

_ALTERNATIONS = 3
"""Frames whose counters alternate between two sequences: fewer are late frames or a single repetition."""


class SecondSender:
    """Follows the signs; which of two senders is the true one cannot be told.

    Parameters
    ----------
    alarm : time [s] for which a sign counts.
    """

    def __init__(self, alarm: float) -> None:
        self._alarm = alarm
        self._heard = -float("inf")
        self._alternations: dict[int, deque[float]] = {}

    def take(self, check: ReceptionCheck, slot: int, time: float) -> None:
        """Take in the last check of the frame ``slot``, received at ``time`` [s]."""
        if check.conflicts:
            self._heard = time
        if check.alternates:
            times = self._alternations.setdefault(slot, deque(maxlen=_ALTERNATIONS))
            times.append(time)
            if len(times) == _ALTERNATIONS and time - times[0] <= self._alarm:
                self._heard = time

    def was_heard(self, now: float) -> bool:
        """Return whether there was a sign less than the alarm's time ago."""
        return now - self._heard <= self._alarm
