"""The decoder of one signal per gauge out of the frames of a whole cycle, all at once."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor, inf, isfinite

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.can.wire.frame_layout import FLOAT, LITTLE, SIGNED, UNSIGNED, FrameLayout, SignalLayout
from strainfmu.can.wire.signal_plan import bit_indices, checked_signal

_WIDTH = 64
_WHOLE = (8, 16, 32, 64)
_LONGEST_EXACT = 32
"""Longest integer [bits] whose limits are looked for in raw numbers: float64 holds these and their neighbours."""


class CyclePlan:
    """Chosen signals of successive frames, prepared for repeated decoding.

    Where all chosen ones are whole numbers of one width and byte order at multiples of it, the cycle is read as
    one array of these, otherwise bit by bit.

    Parameters
    ----------
    frames : of a cycle, in order.
    chosen : (n,) pairs of the index of a frame and of a signal in it.

    Raises
    ------
    InputError
        A signal does not fit into its frame or into 64 bits, or is of a kind that does not exist.
    """

    def __init__(self, frames: Sequence[FrameLayout], chosen: Sequence[tuple[int, int]]) -> None:
        self.signals = [frames[frame].signals[index] for frame, index in chosen]
        for (frame, _), signal in zip(chosen, self.signals, strict=True):
            checked_signal(signal, frames[frame])
        starts = np.cumsum([0, *(frame.length for frame in frames)]).tolist()
        firsts = [starts[frame] for frame, _ in chosen]
        self._whole = _whole_numbers(self.signals, firsts, starts[-1])
        bits = [
            [8 * first + bit if bit < 8 * frames[frame].length else 8 * starts[-1] for bit in own]
            for (frame, _), signal, first in zip(chosen, self.signals, firsts, strict=True)
            for own in [bit_indices(signal, 8 * frames[frame].length)]
        ]
        self._bits = np.array(bits, dtype=np.intp).reshape(-1)
        self._scale = np.array([signal.scale for signal in self.signals])
        self._offset = np.array([signal.offset for signal in self.signals])
        self._has_offset = bool(self._offset.any())
        self._is_linear = all(map(_is_linear, self.signals))
        self._unsigned = np.array([s.kind == UNSIGNED and s.length == _WIDTH for s in self.signals], dtype=bool)
        self._floats = [
            (np.flatnonzero([s.kind == FLOAT and s.length == width for s in self.signals]), f"<u{b}", f"<f{b}")
            for width, b in ((16, 2), (32, 4), (64, 8))
        ]

    def raw(self, data: Sequence[bytes]) -> IntArray:
        """Return the (n,) raw numbers in the ``data`` of all frames; sign extended, of floats the bit patterns."""
        joined = b"".join(data)
        if self._whole is not None:
            kind, places = self._whole
            return np.frombuffer(joined, kind)[places].astype(np.int64)
        bits = np.unpackbits(np.frombuffer(joined + b"\0", dtype=np.uint8), bitorder="little")
        return np.packbits(bits[self._bits], bitorder="little").view("<i8").astype(np.int64)

    def exact_scale(self) -> FloatArray | None:
        """Return (n,) the scales if values are raw numbers times these, without round-off; None of others."""
        mantissa, _ = np.frexp(self._scale)
        is_exact = self._is_linear and not self._has_offset and bool((np.abs(mantissa) == 0.5).all())
        is_short = all(signal.length <= _LONGEST_EXACT for signal in self.signals)
        return self._scale if is_exact and is_short else None

    def physical(self, raw: IntArray) -> FloatArray:
        """Return the (n,) values of ``raw`` in the signals' units; NaN of a float that is NaN."""
        if self._is_linear:
            value = raw * self._scale
            return value + self._offset if self._has_offset else value
        number = raw.astype(np.float64)
        number[self._unsigned] = raw[self._unsigned].view("<u8")
        # A value beyond float64 is refused as out of range, a signalling NaN as any other.
        with np.errstate(over="ignore", invalid="ignore"):
            for places, pattern, kind in self._floats:
                number[places] = raw[places].astype(pattern).view(kind)
            return number * self._scale + self._offset


class InnerRange:
    """The raw numbers that are certainly usable: within the limits, no code for "no value", no converter's end.

    Where a limit is nearly reached, or codes lie between usable numbers, it is narrower than it could be. So what
    is inside needs no other check, and what is outside needs all of them.
    """

    def __init__(self, signals: Sequence[SignalLayout]) -> None:
        ranges = [_inner(signal) for signal in signals]
        self._low, self._high = np.array(ranges, dtype=np.int64).T
        self._is_common = len(set(ranges)) == 1
        # A common range as what is near its middle; of an odd width it is narrower by one number.
        n, (first, last) = len(ranges), ranges[0]
        middle = (first + last + 1) // 2
        half = min(middle - first, last - middle)
        # Arrays, as numpy makes one of a single number in every call.
        self._middle, self._half = np.full(n, middle), np.full(n, half)
        self._is_about_zero = middle == 0
        self._about, self._is_inside = np.empty(n, dtype=np.int64), np.empty(n, dtype=bool)
        self._is_empty = any(first > last for first, last in ranges)

    def holds(self, raw: IntArray) -> bool:
        """Return whether all of the (n,) ``raw`` numbers are inside."""
        if self._is_empty:
            return False
        if self._is_common:
            about = raw if self._is_about_zero else raw - self._middle
            np.absolute(about, self._about)
            np.less_equal(self._about, self._half, self._is_inside)
            return 0 not in self._is_inside.tobytes()
        return bool(((raw >= self._low) & (raw <= self._high)).all())


def raw_ends(signal: SignalLayout) -> tuple[int, int] | None:
    """Return the first and the last raw number of an integer; None of a float, or of 64 bits, which none fills."""
    if signal.kind == FLOAT or signal.length >= _WIDTH:
        return None
    if signal.kind == SIGNED:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def _inner(signal: SignalLayout) -> tuple[int, int]:
    """Return the ends of a signal's inner range, (1, 0) for none."""
    ends = raw_ends(signal)
    if ends is None or signal.length > _LONGEST_EXACT or not _is_linear(signal):
        return 1, 0
    low, high = ends[0] + 1, ends[1] - 1
    limits = [limit for limit in (signal.minimum, signal.maximum) if limit is not None]
    for limit in limits:
        at = (limit - signal.offset) / signal.scale
        is_upper = (limit == signal.maximum) == (signal.scale > 0.0)
        # One number of margin for the round-off of this division.
        if is_upper:
            high = min(high, floor(at) - 1) if isfinite(at) else high
        else:
            low = max(low, ceil(at) + 1) if isfinite(at) else low
    if signal.minimum is not None and signal.minimum == signal.maximum:
        return 1, 0
    for code in signal.no_value_codes:
        if low <= code <= high:
            low, high = (low, code - 1) if code - low > high - code else (code + 1, high)
    if low > high or not all(_is_within(signal, number) for number in (low, high)):
        return 1, 0
    return low, high


def _is_within(signal: SignalLayout, number: int) -> bool:
    """Return whether the value of a raw number is within the limits; all between two such numbers are, too."""
    value = float(number) * signal.scale + signal.offset
    low = -inf if signal.minimum is None else signal.minimum
    return low <= value <= (inf if signal.maximum is None else signal.maximum)


def _is_linear(signal: SignalLayout) -> bool:
    """Return whether values are int64 times a scale plus an offset, and none overflows."""
    is_whole = signal.kind == SIGNED or (signal.kind == UNSIGNED and signal.length < _WIDTH)
    return is_whole and isfinite(abs(signal.scale) * 2.0**signal.length + abs(signal.offset))


def _whole_numbers(
    signals: Sequence[SignalLayout], firsts: Sequence[int], n_bytes: int
) -> tuple[np.dtype[np.signedinteger], IntArray] | None:
    """Return type and places of signals that make one array over all frames, None of others.

    ``firsts`` is where each signal's frame begins, of ``n_bytes`` in all.
    """
    kinds = {(s.length, s.byte_order if s.length > 8 else LITTLE, s.kind == SIGNED) for s in signals}
    length, order, is_signed = next(iter(kinds))
    if len(kinds) != 1 or length not in _WHOLE or n_bytes % (length // 8):
        return None
    first_bit = 0 if order == LITTLE else 7
    places = []
    for signal, first in zip(signals, firsts, strict=True):
        byte, bit = divmod(signal.start, 8)
        # A single byte of a big endian signal begins at its bit 7.
        expected = 7 if signal.byte_order != LITTLE else first_bit
        if bit != expected or (first + byte) % (length // 8):
            return None
        places.append((first + byte) // (length // 8))
    # 64 bits always as int64, as everywhere.
    kind = "i" if is_signed or length == _WIDTH else "u"
    return np.dtype(f"{'<' if order == LITTLE else '>'}{kind}{length // 8}"), np.array(places, dtype=np.intp)
