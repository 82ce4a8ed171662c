"""Acceptance of frames: known identifier, right format, not the bridge's own, not too many."""

from __future__ import annotations

from collections.abc import Iterable

from strainfmu.can.cycle.frame_account import FrameClass
from strainfmu.can.cycle.own_frames import OwnFrames, own_frames
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame import EXTENDED_FLAG, Frame
from strainfmu.can.wire.frame_layout import InputLayout

_OWN, _SECOND_BRIDGE = FrameClass.OWN, FrameClass.SECOND_BRIDGE


class Acceptance:
    """The first filter of received frames, cheap enough for a bus that is overloaded many times over.

    Its verdict depends on the frames received and sent and their times alone, so the receiver and the core may
    each have one. ``own`` is the frames that the bridge sends, or their keys.
    """

    def __init__(self, layout: InputLayout, own: OwnFrames | Iterable[int], settings: BridgeSettings) -> None:
        self._own_frames = own_frames(own)
        self._own = self._own_frames.keys
        self._cycle_time, self._last_reported = layout.cycle_time, -float("inf")
        self._formats = {f.layout.key: (f.layout.is_fd, f.layout.length) for f in layout.frames}
        # Multiplexed frames have one identifier in common: each of them may come once a cycle.
        keys = [f.layout.key for f in layout.frames]
        self._rate = {key: settings.rate * keys.count(key) / layout.cycle_time for key in self._formats}
        self._capacity = settings.burst
        # Tokens left and the time at which they were counted [s], by key.
        self._buckets = dict.fromkeys(self._formats, (settings.burst, 0.0))

    def refused(self, frame: Frame) -> FrameClass | None:
        """Return the class of a frame that is refused, None of one that is accepted."""
        key = frame.key
        form = self._formats.get(key)
        if form is None or frame.is_error or frame.is_remote or key in self._own:
            return self._why_refused(frame)
        if frame.is_fd != form[0] or len(frame.data) != form[1]:
            return FrameClass.WRONG_FORMAT
        return None if self._take_token(key, frame.time) else FrameClass.SHED

    def _why_refused(self, frame: Frame) -> FrameClass:
        """Return the class of a frame that is no data frame of the layout."""
        key = frame.key
        if frame.is_error:
            return FrameClass.ERROR_FRAME
        if key in self._own:
            return _OWN if self._comes_back(frame) else _SECOND_BRIDGE
        if key not in self._formats:
            other_width = key ^ EXTENDED_FLAG in self._formats
            return FrameClass.WRONG_FORMAT if other_width else FrameClass.UNKNOWN_IDENTIFIER
        return FrameClass.REMOTE_FRAME

    def is_reported(self, refused: FrameClass, frame: Frame) -> bool:
        """Return whether the core is to know of a refused frame: of another bridge's, once a cycle is enough."""
        if refused is _OWN:
            return False
        if refused is _SECOND_BRIDGE and frame.time - self._last_reported >= self._cycle_time:
            self._last_reported = frame.time
            return True
        return refused is FrameClass.ERROR_FRAME

    def _comes_back(self, frame: Frame) -> bool:
        """Return whether a frame on an identifier of ours is one that we sent."""
        return self._own_frames.comes_back(frame)

    def _take_token(self, key: int, time: float) -> bool:
        """Take a token from the identifier's bucket, which fills with time; return False if it is empty."""
        tokens, last = self._buckets[key]
        if time > last:
            tokens += (time - last) * self._rate[key]
            if tokens > self._capacity:
                tokens = self._capacity
        is_left = tokens >= 1.0
        self._buckets[key] = (tokens - 1.0 if is_left else tokens, time)
        return is_left
