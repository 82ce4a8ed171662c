"""The bridge's own frames as they come back, known by their content: another bridge's are not taken for them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from threading import Lock

from strainfmu.can.wire.frame import Frame

_REMEMBERED = 200
"""Sent frames of an identifier that may still come back: fewer than their counter has values."""


class OwnFrames:
    """Remembers what was sent. Each frame may come back once; sending and receiving may be different threads.

    Parameters
    ----------
    keys : of the frames that the bridge sends.
    """

    def __init__(self, keys: Iterable[int]) -> None:
        self.keys = frozenset(keys)
        self.by_identifier = False
        """Take every frame with one of the keys for an own one, as in a log that does not mark own frames."""
        self._sent: dict[int, deque[bytes]] = {key: deque(maxlen=_REMEMBERED) for key in self.keys}
        self._lock = Lock()

    def sending(self, frame: Frame) -> None:
        """Remember a frame that is about to be sent."""
        sent = self._sent.get(frame.key)
        if sent is not None:
            with self._lock:
                sent.append(frame.data)

    def comes_back(self, frame: Frame) -> bool:
        """Return whether a received frame with one of the keys is one that was sent."""
        if self.by_identifier:
            return True
        with self._lock:
            try:
                self._sent[frame.key].remove(frame.data)
            except ValueError:
                return False
        return True


def own_frames(own: OwnFrames | Iterable[int]) -> OwnFrames:
    """Return ``own`` itself, or the frames of these keys of which none has been sent."""
    return own if isinstance(own, OwnFrames) else OwnFrames(own)
