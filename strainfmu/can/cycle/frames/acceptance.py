"""Acceptance of frames: known identifier, right format, not the bridge's own, not too many."""

from __future__ import annotations

from collections.abc import Iterable

from strainfmu.can.cycle.frames.account import FrameClass
from strainfmu.can.cycle.frames.own_frames import OwnFrames, own_frames
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire.compiled import INTEGER, NUMBER, Record, function, pointer
from strainfmu.can.wire.frame import EXTENDED_FLAG, Frame
from strainfmu.can.wire.frame_layout import InputLayout

_OWN, _SECOND_BRIDGE = FrameClass.OWN, FrameClass.SECOND_BRIDGE


_ACCEPTED, _WRONG_FORMAT = 0, 1
"""Results of strainbus.h."""


class BucketRecord(Record):
    """One identifier of a layout for compiled code: its format, and a bucket of tokens that fills with time."""

    position = 14
    _fields_ = (
        *((name, INTEGER) for name in ("is_fd", "length")),
        *((name, NUMBER) for name in ("rate", "capacity", "tokens", "time")),
    )


class Acceptance:
    """The first filter of received frames, cheap enough for a bus that is overloaded many times over.

    Its verdict depends on the frames received and sent and their times alone, so the receiver and the core may
    each have one. ``own`` is the frames that the bridge sends, or their keys.
    """

    def __init__(self, layout: InputLayout, own: OwnFrames | Iterable[int], settings: BridgeSettings) -> None:
        self._own_frames = own_frames(own)
        self._own = self._own_frames.keys
        self._cycle_time, self._last_reported = layout.cycle_time, -float("inf")
        # Multiplexed frames have one identifier in common: each of them may come once a cycle.
        keys = [f.layout.key for f in layout.frames]
        self.buckets = {
            f.layout.key: BucketRecord(
                is_fd=f.layout.is_fd,
                length=f.layout.length,
                rate=settings.rate * keys.count(f.layout.key) / layout.cycle_time,
                capacity=settings.burst,
                tokens=settings.burst,
                time=0.0,
            )
            for f in layout.frames
            if f.layout.key not in self._own
        }
        """By key, for compiled code."""
        self._at = {key: pointer(bucket) for key, bucket in self.buckets.items()}
        self._time = NUMBER()
        self._take, self._at_time = function("sb_bucket_take", BucketRecord), pointer(self._time)

    def refused(self, frame: Frame) -> FrameClass | None:
        """Return the class of a frame that is refused, None of one that is accepted."""
        bucket = self._at.get(frame.key)
        if bucket is None or frame.is_error or frame.is_remote:
            return self._why_refused(frame)
        self._time.value = frame.time
        found = self._take(bucket, len(frame.data), frame.is_fd, self._at_time)
        if found == _ACCEPTED:
            return None
        return FrameClass.WRONG_FORMAT if found == _WRONG_FORMAT else FrameClass.SHED

    def _why_refused(self, frame: Frame) -> FrameClass:
        """Return the class of a frame that is no data frame of the layout."""
        key = frame.key
        if frame.is_error:
            return FrameClass.ERROR_FRAME
        if key in self._own:
            return _OWN if self._comes_back(frame) else _SECOND_BRIDGE
        if key not in self.buckets:
            other_width = key ^ EXTENDED_FLAG in self.buckets
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

    def is_own(self, frame: Frame) -> bool:
        """Return whether a frame is one that we sent and that comes back."""
        return frame.key in self._own and self._comes_back(frame)

    def _comes_back(self, frame: Frame) -> bool:
        """Return whether a frame on an identifier of ours is one that we sent."""
        return self._own_frames.comes_back(frame)
