"""Frames altered so that check sums and authenticators fit again: faults of values, of senders and of keys."""

from dataclasses import replace

import numpy as np
from can_faults import Fault, FaultKind

from strainfmu.can.authentic import authenticated, freshness_of, is_authentic, sent_freshness
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import FD_LENGTHS, Frame, Protection, crc_of, protect
from strainfmu.can.frame_layout import FLOAT, InputFrame, InputLayout


def crc_in(data: bytes | bytearray, protection: Protection) -> int:
    """Return the CRC in ``data``."""
    return data[0] if protection.profile == 1 else data[0] | data[1] << 8


def counter_in(data: bytes | bytearray, protection: Protection) -> int:
    """Return the counter in ``data``."""
    return data[1] & 0x0F if protection.profile == 1 else data[2]


class AlteredFrames:
    """Alters the frames of one sender: the frames of ``layout``, made by ``encoder``."""

    def __init__(self, layout: InputLayout, encoder: StrainEncoder) -> None:
        self._layout, self._encoder = layout, encoder

    def with_other_strains(self, frames: list[Frame]) -> list[Frame]:
        """Return the intact ones of ``frames`` as another sender with the same counter and time sends them."""
        trailer, true, altered, altered_frames = self._layout.trailer, b"", b"", []
        strain_keys = {frame.layout.key for frame in self._layout.strain_frames}
        for frame in frames:
            item = self._item_of(frame)
            if item is None:
                continue
            protection, covered = item.layout.protection, true if item is trailer else b""
            if protection and crc_in(frame.data, protection) != crc_of(frame.data, protection, covered):
                continue
            data = bytearray(frame.data)
            for signal in (item.layout.signals[index] for index in item.indices):
                # 16 quanta of an integer, a quarter to a half of a float.
                data[signal.bits[0 if signal.length == 16 else 16] // 8] ^= 0x40
            changed = bytes(data)
            if protection:
                covered = altered if item is trailer else b""
                changed = protect(changed, protection, counter_in(changed, protection), covered)
            if frame.key in strain_keys:
                true, altered = true + frame.data, altered + changed
            if item.indices or item is trailer:
                altered_frames.append(replace(frame, data=changed))
        return altered_frames

    def at_end_of_range(self, frames: list[Frame], fault: Fault) -> list[Frame]:
        """Put one gauge at the end of its range, with a correct CRC: the converter is overdriven, not the bus."""
        item = self._layout.strain_frames[fault.seed % len(self._layout.strain_frames)]
        signal = item.layout.signals[item.indices[fault.seed % len(item.indices)]]
        raw = int.from_bytes(np.float32(2.0e15).tobytes(), "little") if signal.kind == FLOAT else 0x7FFF
        return self._rewritten(frames, item, bits=signal.bits, raw=raw)

    def _rewritten(self, frames: list[Frame], item: InputFrame, bits: tuple[int, ...], raw: int) -> list[Frame]:
        """Write ``raw`` into ``bits`` of one frame and recompute its CRC."""
        trailer = self._layout.trailer
        changed, covered = [], b""
        strain_keys = {frame.layout.key for frame in self._layout.strain_frames}
        for frame in frames:
            data = frame.data
            if frame.key == item.layout.key and len(data) == item.layout.length:
                number = int.from_bytes(data, "little")
                for index, bit in enumerate(bits):
                    number = number & ~(1 << bit) | (raw >> index & 1) << bit
                data = number.to_bytes(len(data), "little")
                if item.layout.protection is not None:
                    data = self._signed(protect(data, item.layout.protection, data[2]), frame.data, item)
            covered += data if frame.key in strain_keys else b""
            if trailer is not None and frame.key == trailer.layout.key and len(data) == trailer.layout.length:
                assert trailer.layout.protection is not None
                data = protect(data, trailer.layout.protection, counter=data[2], covered=covered)
            changed.append(replace(frame, data=data))
        return changed

    def forged(self, frame: Frame) -> Frame:
        """Return a frame whose values are altered and whose CRC fits; the authenticator is the true frame's."""
        item = self._item_of(frame)
        if item is None or item.layout.protection is None:
            return frame
        data = bytearray(frame.data)
        altered = [*item.indices, *(flow.index for flow in item.flow)]
        altered += [] if item.heard_time is None else [item.heard_time]
        for signal in (item.layout.signals[index] for index in altered):
            data[signal.bits[0] // 8] ^= 0x7F
        return replace(frame, data=protect(bytes(data), item.layout.protection, data[2]))

    def of_earlier_run(self, frame: Frame) -> Frame:
        """Return a frame with values of another time, in every other way as the sender sent it one trip before."""
        forged = self.forged(frame)
        item = self._item_of(frame)
        return (
            frame
            if item is None
            else replace(forged, data=self._signed(forged.data, frame.data, item, trips_back=1))
        )

    def _item_of(self, frame: Frame) -> InputFrame | None:
        """Return what a frame is in the layout; None of a frame of another kind or length."""
        for item in self._layout.frames:
            if item.layout.key == frame.key and item.layout.length == len(frame.data):
                return item
        return None

    def _signed(self, data: bytes, before: bytes, item: InputFrame, trips_back: int = 0) -> bytes:
        """Return ``data`` with an authenticator that fits, if the one ``before`` it was altered did."""
        secured, key = item.layout.secured, self._layout.key
        if secured is None or key is None or len(before) != item.layout.length:
            return data
        freshness = sent_freshness(before, secured, freshness_of(self._encoder.trip, 0))
        if not is_authentic(before, secured, key, freshness=freshness):
            return data
        return authenticated(data, secured, key, freshness=freshness - freshness_of(trips_back, 0))

    def of_other_sender(self, fault: Fault, frames: list[Frame]) -> list[Frame]:
        """Return the frames of a sender with its gauges in another order, and another DataID or configuration."""
        protections = {f.layout.key: (f, f.layout.protection) for f in self._layout.frames}
        changed = []
        for frame in frames:
            item, protection = protections.get(frame.key, (None, None))
            data = bytearray(frame.data)
            if item is None or len(data) != item.layout.length:
                changed.append(frame)
                continue
            if item.indices:
                # The strains of this frame in another order.
                bits = [bit for index in item.indices for bit in item.layout.signals[index].bits]
                first, last = min(bits) // 8, max(bits) // 8 + 1
                size = len(item.layout.signals[item.indices[0]].bits) // 8
                data[first:last] = data[first + size : last] + data[first : first + size]
            if fault.kind is FaultKind.CONFIGURATION and item.configuration is not None:
                signal = item.layout.signals[item.configuration]
                # Not of what the frame holds: a second such sender must not turn it back into the right number.
                data[signal.bits[0] // 8] = ((signal.initial or 0) & 0xFF) ^ 0x5A
            elif protection is not None:
                protection = Protection(protection.profile, protection.data_id ^ 0x0101)
            if protection is not None:
                data = bytearray(protect(bytes(data), protection, counter_in(data, protection)))
            changed.append(replace(frame, data=bytes(data)))
        return changed


def of_other_length(frame: Frame, random: np.random.Generator) -> bytes:
    """Return the data cut or padded to another length that the format allows."""
    lengths = [n for n in (FD_LENGTHS if frame.is_fd else FD_LENGTHS[:9]) if n != len(frame.data)]
    length = lengths[int(random.integers(len(lengths)))]
    return frame.data.ljust(length, b"\0")[:length]


def with_flipped_bits(data: bytes, wide: bool, random: np.random.Generator) -> bytes:
    """Return the data with up to three bits flipped anywhere, or any within eight neighbouring ones."""
    if not data:
        return data
    number = int.from_bytes(data, "little")
    size = 8 * len(data)
    if wide:
        for bit in random.choice(size, size=int(random.integers(1, 4)), replace=False):
            number ^= 1 << int(bit)
    else:
        number ^= int(random.integers(1, 256)) << int(random.integers(size - 7))
    return number.to_bytes(len(data), "little")
