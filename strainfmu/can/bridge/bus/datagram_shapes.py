"""Shapes of python-can's datagrams: what all frames of an identifier, format and length have in common.

A datagram of udp_multicast is a map of msgpack in which, from one frame of an identifier to the next, only the
time stamp and the data differ. Where they lie is found once, and proven by a datagram with others in their place.
Then a frame is read and written without unpacking and packing the map.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from strainfmu.can.wire.frame import Frame

_STAMP = b"\xa9timestamp\xcb"
"""The key of the time stamp, and the mark of a float64 behind it."""

_DATA = b"\xa4data\xc4"
"""The key of the data, and the mark of up to 255 bytes behind it; then comes their number."""

_MOST_SHAPES = 64
"""Shapes that are kept: a sender of ever new identifiers must not fill the memory."""

_OTHER_STAMP = 1.5


class DatagramShapes:
    """Known shapes; ``unpack`` is msgpack's."""

    def __init__(self, unpack: Callable[[bytes], Any]) -> None:
        self._unpack = unpack
        # By the length of the datagram: begin of the time stamp, begin and end of the data; what cuts a datagram
        # into what lies before the time stamp, what lies behind it, the data, and what lies behind these.
        self._places: dict[int, tuple[int, int, int]] = {}
        self._cuts: dict[int, Callable[[bytes], tuple[bytes, ...]]] = {}
        self._frames: dict[tuple[bytes, bytes, bytes], Frame] = {}
        self._parts: dict[tuple[int, int, bool, bool], tuple[bytes, bytes]] = {}

    def frame(self, datagram: bytes, time: float) -> Frame | None:
        """Return the frame of ``datagram``, received at ``time`` [s]; None if its shape is not known."""
        cut = self._cuts.get(len(datagram))
        if cut is None:
            return None
        head, middle, data, tail = cut(datagram)
        known = self._frames.get((head, middle, tail))
        return None if known is None else known.with_data(data, time)

    def datagram(self, frame: Frame) -> bytes | None:
        """Return the datagram of a data ``frame``; None if its shape is not known."""
        parts = self._parts.get((frame.key, len(frame.data), frame.is_fd, frame.bitrate_switch))
        if parts is None or frame.is_error or frame.is_remote:
            return None
        return parts[0] + frame.data + parts[1]

    def learn(self, datagram: bytes, frame: Frame) -> None:
        """Keep the shape of ``datagram``, which is the shape of the data ``frame``."""
        if len(self._frames) >= _MOST_SHAPES or frame.is_error or frame.is_remote:
            return
        stamp, begin = datagram.find(_STAMP) + len(_STAMP), datagram.find(_DATA) + len(_DATA) + 1
        end = begin + len(frame.data)
        if not (len(_STAMP) <= stamp <= begin - 8 and len(_DATA) < begin and end <= len(datagram)):
            return
        if not self._holds(datagram, (stamp, begin, end)):
            return
        if self._places.setdefault(len(datagram), (stamp, begin, end)) != (stamp, begin, end):
            return
        cut = struct.Struct(f"{stamp}s8x{begin - stamp - 8}s{end - begin}s{len(datagram) - end}s").unpack
        self._cuts[len(datagram)] = cut
        head, middle, _, tail = cut(datagram)
        self._frames[head, middle, tail] = frame
        self._parts[frame.key, len(frame.data), frame.is_fd, frame.bitrate_switch] = (
            datagram[:begin],
            datagram[end:],
        )

    def _holds(self, datagram: bytes, places: tuple[int, int, int]) -> bool:
        """Return whether another time stamp and other data in these places change these two entries alone."""
        stamp, begin, end = places
        data = bytes(byte ^ 0xFF for byte in datagram[begin:end])
        number = struct.pack(">d", _OTHER_STAMP)
        other = datagram[:stamp] + number + datagram[stamp + 8 : begin] + data + datagram[end:]
        try:
            before, after = self._unpack(datagram), self._unpack(other)
            return bool(after == {**before, "timestamp": _OTHER_STAMP, "data": data})
        except Exception:  # whatever msgpack raises
            return False
