"""The check of authenticated frames: authenticator and freshness value of all frames of one sender.

A freshness value is accepted once per frame: the values of a frame rise strictly, and are never of an earlier trip
than the newest, and never at or below the value that earlier runs have reached. So a recording is refused,
whenever it was made, and a sender that was restarted shows itself by a new trip.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum

from strainfmu.can.wire.authenticator import MESSAGE_BITS, AuthenticationKey, Secured, is_authentic, sent_freshness

NOTHING = -1
"""Freshness value below all others."""


class Authenticity(Enum):
    """Verdict on one frame."""

    __hash__ = object.__hash__

    AUTHENTIC = "authentic"
    FORGED = "authenticator does not fit"
    NOT_FRESH = "authenticator fits, but the freshness value is not new"


class Authentication:
    """Checks the frames of one sender, by slot.

    Parameters
    ----------
    secured : authentication of each frame, None of those that have none.
    key : of all frames.
    """

    def __init__(self, secured: Sequence[Secured | None], key: AuthenticationKey) -> None:
        self._secured, self._key = tuple(secured), key
        self.on_first: Callable[[int], None] | None = None
        """Called with the freshness value of a run's and of a trip's first frame, before the frame is used."""
        self.begin(None)

    def begin(self, reached: int | None) -> None:
        """Start above the freshness value that earlier runs have ``reached``; None: any is new."""
        self.floor = NOTHING if reached is None else reached
        self.newest = self.floor
        self._last = [NOTHING] * len(self._secured)

    def check(self, slot: int, data: bytes) -> Authenticity:
        """Return the verdict on ``data`` of the frame ``slot``, and store its freshness value if it is used."""
        secured = self._secured[slot]
        if secured is None:
            return Authenticity.AUTHENTIC
        freshness = sent_freshness(data, secured, max(self.newest, 0))
        if not is_authentic(data, secured, self._key, freshness=freshness):
            return Authenticity.FORGED
        trip, newest_trip = freshness >> MESSAGE_BITS, self.newest >> MESSAGE_BITS
        if trip < newest_trip or freshness <= self.floor or freshness <= self._last[slot]:
            return Authenticity.NOT_FRESH
        if (trip > newest_trip or self.newest == self.floor) and self.on_first is not None:
            self.on_first(freshness)
        self._last[slot] = freshness
        self.newest = max(self.newest, freshness)
        return Authenticity.AUTHENTIC
