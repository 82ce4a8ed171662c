"""The decoder of one signal per gauge out of the frames of a whole cycle, all at once, in compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.can.wire.compiled import ARRAY, INTEGER, Record, function, pointer
from strainfmu.can.wire.frame_layout import FLOAT, LITTLE, SIGNED, UNSIGNED, FrameLayout, SignalLayout
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import STRAIN

_WIDTH, _WHOLE = 64, 1 << 64
_KINDS = (UNSIGNED, SIGNED, FLOAT)
"""In the order of strainbus.h."""

FLOAT_LENGTHS = (16, 32, 64)
"""Bits of a float (IEEE 754)."""


class _Decoder(Record):
    position = 0
    _fields_ = (
        ("n", INTEGER),
        *((name, ARRAY) for name in ("byte", "count", "shift", "length", "is_big", "kind")),
        *((name, ARRAY) for name in ("scale", "offset", "to_strain", "low", "high")),
        *((name, ARRAY) for name in ("has_ends", "first", "last", "first_code", "code", "frame")),
    )


class _Cycle(Record):
    position = 1
    _fields_ = tuple((name, ARRAY) for name in (STRAIN, "raw", "present", "refused"))


class DecodedCycle:
    """Strains of one cycle; a decoder writes the next one into the same arrays.

    Attributes
    ----------
    strain : (n_d,) [m/m]; NaN where the frame is missing.
    raw : (n_d,) raw numbers.
    present : (n_d,) gauges whose frame has arrived.
    refused : (n_d,) gauges without a value, or outside their signal's limits.
    record, address : of the arrays, for compiled code.
    """

    __slots__ = ("address", "present", "raw", "record", "refused", STRAIN)

    def __init__(self, n_gauges: int) -> None:
        self.strain, self.raw = np.full(n_gauges, np.nan), np.zeros(n_gauges, dtype=np.int64)
        self.present, self.refused = np.zeros(n_gauges, dtype=bool), np.zeros(n_gauges, dtype=bool)
        self.record = _Cycle(strain=self.strain, raw=self.raw, present=self.present, refused=self.refused)
        self.address = pointer(self.record)


class CyclePlan:
    """Chosen signals of successive frames, prepared for repeated decoding.

    Parameters
    ----------
    frames : of a cycle, in order.
    chosen : (n,) pairs of the index of a frame and of a signal in it.
    to_strain : (n,) factors from the signals' units to m/m; 1 where there are none.

    Raises
    ------
    InputError
        A signal does not fit into its frame or into 64 bits, or is of a kind that does not exist.
    NoCoreError
        There is no compiled code for this machine.
    """

    def __init__(
        self,
        frames: Sequence[FrameLayout],
        chosen: Sequence[tuple[int, int]],
        to_strain: Sequence[float] | None = None,
    ) -> None:
        self.signals = [frames[frame].signals[index] for frame, index in chosen]
        for (frame, _), signal in zip(chosen, self.signals, strict=True):
            checked_signal(signal, frames[frame])
        starts = np.cumsum([0, *(frame.length for frame in frames)]).tolist()
        ends = [raw_ends(signal) for signal in self.signals]
        codes = [signal.no_value_codes for signal in self.signals]
        self.record = _Decoder(
            n=len(chosen),
            **places(self.signals, [starts[frame] for frame, _ in chosen]),
            to_strain=np.array([1.0] * len(chosen) if to_strain is None else to_strain),
            frame=integers([frame for frame, _ in chosen]),
            low=np.array([-inf if s.minimum is None else s.minimum for s in self.signals]),
            high=np.array([inf if s.maximum is None else s.maximum for s in self.signals]),
            has_ends=integers([end is not None for end in ends]),
            first=integers([(end or (0, 0))[0] for end in ends]),
            last=integers([(end or (0, 0))[1] for end in ends]),
            first_code=np.cumsum([0, *map(len, codes)], dtype=np.int64),
            code=np.array([code % _WHOLE for own in codes for code in own], dtype=np.uint64).view(np.int64),
        )
        self.size = starts[-1]
        self._at = pointer(self.record)
        self._raw, self._physical = function("sb_raw", _Decoder), function("sb_physical", _Decoder)

    def raw(self, data: Sequence[bytes]) -> IntArray:
        """Return the (n,) raw numbers in the ``data`` of all frames; sign extended, of floats the bit patterns."""
        joined, raw = b"".join(data), np.empty(len(self.signals), dtype=np.int64)
        if len(joined) != self.size:
            raise ValueError(f"expected {self.size} bytes, got {len(joined)}")
        self._raw(self._at, joined, pointer(raw))
        return raw

    def physical(self, raw: IntArray) -> FloatArray:
        """Return the (n,) values of ``raw`` in the signals' units; NaN of a float that is NaN."""
        value = np.empty(len(self.signals))
        self._physical(self._at, pointer(raw), pointer(value))
        return value


def raw_ends(signal: SignalLayout) -> tuple[int, int] | None:
    """Return the first and the last raw number of an integer; None of a float, or of 64 bits, which none fills."""
    if signal.kind == FLOAT or signal.length >= _WIDTH:
        return None
    if signal.kind == SIGNED:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def places(signals: Sequence[SignalLayout], starts: Sequence[int]) -> dict[str, Any]:
    """Return where ``signals`` lie behind the bytes ``starts`` of their frames, and how they are read."""
    found = [_place(signal) for signal in signals]
    return {
        "byte": integers([start + place[0] for start, place in zip(starts, found, strict=True)]),
        "count": integers([place[1] for place in found]),
        "shift": integers([place[2] for place in found]),
        "length": integers([signal.length for signal in signals]),
        "is_big": integers([signal.byte_order != LITTLE for signal in signals]),
        "kind": integers([_KINDS.index(signal.kind) for signal in signals]),
        "scale": np.array([signal.scale for signal in signals]),
        "offset": np.array([signal.offset for signal in signals]),
    }


def _place(signal: SignalLayout) -> tuple[int, int, int]:
    """Return first byte and number of bytes of a signal, and its lowest bit in the number that they make."""
    if signal.byte_order == LITTLE:
        first, last = signal.start // 8, (signal.start + signal.length - 1) // 8
        return first, last - first + 1, signal.start % 8
    # Big endian runs from the most significant bit down through a byte, then on to the next byte's bit 7.
    begin = 8 * (signal.start // 8) + 7 - signal.start % 8
    end = begin + signal.length - 1
    return begin // 8, end // 8 - begin // 8 + 1, 7 - end % 8


def integers(numbers: Sequence[Any]) -> IntArray:
    """Return ``numbers`` for a record."""
    return np.array(numbers, dtype=np.int64)


def checked_signal(signal: SignalLayout, layout: FrameLayout) -> SignalLayout:
    """Return a signal of ``layout`` that can be decoded.

    Raises
    ------
    InputError
        It does not fit into the frame or into 64 bits, or is of a kind that does not exist.
    """
    where = f"frame '{layout.name}', signal '{signal.name}'"
    if not 1 <= signal.length <= _WIDTH:
        raise InputError(f"{where}: {signal.length} bits found, 1 to {_WIDTH} allowed")
    if signal.kind not in (UNSIGNED, SIGNED, FLOAT):
        raise InputError(f"{where}: expected unsigned, signed or float, got kind '{signal.kind}'")
    if signal.kind == FLOAT and signal.length not in FLOAT_LENGTHS:
        raise InputError(f"{where}: a float of {signal.length} bits found, 16, 32 or 64 allowed")
    if not (np.isfinite(signal.scale) and signal.scale != 0.0 and np.isfinite(signal.offset)):
        raise InputError(f"{where}: expected finite numbers, got scale {signal.scale:g}, offset {signal.offset:g}")
    if min(signal.bits) < 0 or max(signal.bits) >= 8 * layout.length:
        raise InputError(f"{where}: reaches beyond the frame's {layout.length} bytes")
    return signal
