"""Acceptance of frames: known identifier, right format, not the bridge's own, not too many."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.own_frames import OwnFrames, own_frames
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.frame import EXTENDED_FLAG, Frame
from strainfmu.can.wire.frame_layout import InputLayout

_OWN, _SECOND_BRIDGE = FrameClass.OWN, FrameClass.SECOND_BRIDGE


@dataclass(eq=False, slots=True)
class _Bucket:
    """One identifier of the layout: its format, and the bucket of tokens that fills with time.

    Attributes
    ----------
    is_fd, length : of its frames.
    rate : tokens per second.
    tokens, time : that are left, and when they were counted [s].
    """

    is_fd: bool
    length: int
    rate: float
    tokens: float
    time: float = 0.0


class Acceptance:
    """The first filter of received frames, cheap enough for a bus that is overloaded many times over.

    Its verdict depends on the frames received and sent and their times alone, so the receiver and the core may
    each have one. ``own`` is the frames that the bridge sends, or their keys.
    """

    def __init__(self, layout: InputLayout, own: OwnFrames | Iterable[int], settings: BridgeSettings) -> None:
        self._own_frames = own_frames(own)
        self._own = self._own_frames.keys
        self._cycle_time, self._last_reported = layout.cycle_time, -float("inf")
        self._capacity = settings.burst
        # Multiplexed frames have one identifier in common: each of them may come once a cycle.
        keys = [f.layout.key for f in layout.frames]
        self._buckets = {
            f.layout.key: _Bucket(
                is_fd=f.layout.is_fd,
                length=f.layout.length,
                rate=settings.rate * keys.count(f.layout.key) / layout.cycle_time,
                tokens=settings.burst,
            )
            for f in layout.frames
            if f.layout.key not in self._own
        }

    def refused(self, frame: Frame) -> FrameClass | None:
        """Return the class of a frame that is refused, None of one that is accepted."""
        bucket = self._buckets.get(frame.key)
        if bucket is None or frame.is_error or frame.is_remote:
            return self._why_refused(frame)
        if frame.is_fd != bucket.is_fd or len(frame.data) != bucket.length:
            return FrameClass.WRONG_FORMAT
        tokens, time = bucket.tokens, frame.time
        if time > bucket.time:
            tokens += (time - bucket.time) * bucket.rate
            if tokens > self._capacity:
                tokens = self._capacity
        bucket.time = time
        if tokens >= 1.0:
            bucket.tokens = tokens - 1.0
            return None
        bucket.tokens = tokens
        return self._without_token()

    def _without_token(self) -> FrameClass | None:
        """Return the class of a frame for which its identifier's bucket has no token left."""
        return FrameClass.SHED

    def _why_refused(self, frame: Frame) -> FrameClass:
        """Return the class of a frame that is no data frame of the layout."""
        key = frame.key
        if frame.is_error:
            return FrameClass.ERROR_FRAME
        if key in self._own:
            return _OWN if self._comes_back(frame) else _SECOND_BRIDGE
        if key not in self._buckets:
            other_width = key ^ EXTENDED_FLAG in self._buckets
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
