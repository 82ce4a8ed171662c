"""Which frames are taken in at all: known identifier, right format, not our own, not too many."""

from __future__ import annotations

from collections.abc import Iterable

from strainfmu.can.cycle.frame_account import FrameClass
from strainfmu.can.guards import ALL_GUARDS, Guards
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame import EXTENDED_FLAG, Frame
from strainfmu.can.wire.frame_layout import InputLayout


class Acceptance:
    """The filter at the door, cheap enough for a bus that is overloaded many times over.

    Its verdict depends on the frames and their times alone; so one may sit in the receiver and another behind it.
    """

    def __init__(
        self, layout: InputLayout, own_keys: Iterable[int], settings: BridgeSettings, guards: Guards = ALL_GUARDS
    ) -> None:
        self._guards = guards
        self._own = frozenset(own_keys)
        self._formats = {f.layout.key: (f.layout.is_fd, f.layout.length) for f in layout.frames}
        # Multiplexed frames share an identifier: each of them may come once a cycle.
        sharing = [f.layout.key for f in layout.frames]
        self._rate = {key: settings.rate * sharing.count(key) / layout.cycle_time for key in self._formats}
        self._capacity = settings.burst
        self._tokens = dict.fromkeys(self._formats, settings.burst)
        self._last = dict.fromkeys(self._formats, 0.0)

    def refused(self, frame: Frame) -> FrameClass | None:
        """Return the class of a frame that is not taken in, None of one that is."""
        guards, key = self._guards, frame.key
        if frame.is_error and guards.error_frames:
            return FrameClass.ERROR_FRAME
        if key in self._own and guards.own_frames:
            return FrameClass.OWN
        if key not in self._formats:
            if key ^ EXTENDED_FLAG not in self._formats:
                return FrameClass.UNKNOWN_IDENTIFIER
            if guards.format:
                return FrameClass.WRONG_FORMAT
            key ^= EXTENDED_FLAG
        if frame.is_remote and guards.remote_frames:
            return FrameClass.REMOTE_FRAME
        if guards.format and (frame.is_fd, len(frame.data)) != self._formats[key]:
            return FrameClass.WRONG_FORMAT
        if guards.babbling and not self._take_token(key, frame.time):
            return FrameClass.SHED
        return None

    def _take_token(self, key: int, time: float) -> bool:
        """Take a token from the identifier's bucket, which fills with time; false if it is empty."""
        elapsed = max(time - self._last[key], 0.0)
        self._last[key] = time
        tokens = min(self._tokens[key] + elapsed * self._rate[key], self._capacity)
        self._tokens[key] = tokens - 1.0 if tokens >= 1.0 else tokens
        return tokens >= 1.0
