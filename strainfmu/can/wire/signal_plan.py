"""The decoder and encoder of all signals of a frame, for any start, length, byte order and kind.

Frames of whole bytes are decoded by one call of ``struct``, all others bit by bit through numpy. Frames are
encoded as one long integer.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, floor, nan
from operator import itemgetter

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.can.wire.frame_layout import BIG, FLOAT, LITTLE, SIGNED, UNSIGNED, FrameLayout, SignalLayout
from strainfmu.errors import InputError

_WIDTH = 64
_FLOAT_TYPES = {16: "<f2", 32: "<f4", 64: "<f8"}
_FLOATS = {16: struct.Struct("<e"), 32: struct.Struct("<f"), 64: struct.Struct("<d")}
_UNSIGNED_CODES = {8: "B", 16: "H", 32: "I", 64: "q"}
_SIGNED_CODES = {8: "b", 16: "h", 32: "i", 64: "q"}
"""Codes of ``struct``; 64 bits always as int64."""


class SignalPlan:
    """The signals of one frame, prepared for repeated decoding and encoding.

    Raises
    ------
    InputError
        A signal does not fit into the frame or into 64 bits, or is of a kind that does not exist.
    """

    def __init__(self, layout: FrameLayout) -> None:
        for signal in layout.signals:
            checked_signal(signal, layout)
        self.length = layout.length
        self.signals = layout.signals
        self._packed = _packed(layout)
        index = [bit_indices(signal, 8 * layout.length) for signal in layout.signals]
        self._index = np.array(index, dtype=np.intp).reshape(-1)
        # Only unsigned numbers of all 64 bits do not fit into int64.
        self._unsigned = np.array([s.kind == UNSIGNED and s.length == _WIDTH for s in layout.signals], dtype=bool)
        self._any_unsigned = bool(self._unsigned.any())
        self._floats = [
            (index, _FLOAT_TYPES[s.length]) for index, s in enumerate(layout.signals) if s.kind == FLOAT
        ]
        self._scale = np.array([s.scale for s in layout.signals])
        self._offset = np.array([s.offset for s in layout.signals])
        self._encoders = [_encoder(signal, layout.length) for signal in layout.signals]
        whole = _whole_bytes(layout)
        self._whole = _WholeBytes(self._encoders, whole) if len(whole) > 1 else None
        self._others = [
            (index, one.raw, one.mask, one.shift, one.is_big, *one.plain_range)
            for index, one in enumerate(self._encoders)
            if self._whole is None or index not in whole
        ]
        # The last bit stays 0: it pads unsigned numbers.
        self._bits = np.zeros(8 * layout.length + 1, dtype=np.uint8)

    def raw(self, data: bytes) -> IntArray:
        """Return the (k,) raw numbers in ``data``, sign extended; of floats, their bit patterns.

        Raises
        ------
        ValueError
            The length of ``data`` is not the frame's.
        """
        if self._packed is not None:
            if len(data) != self.length:
                raise ValueError(f"expected {self.length} bytes, got {len(data)}")
            return np.array(self._packed.unpack(data), dtype=np.int64)
        self._bits[:-1] = np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="little")
        return np.packbits(self._bits[self._index], bitorder="little").view("<i8")

    def numbers(self, data: bytes) -> Sequence[int]:
        """Return the k raw numbers in ``data`` as :meth:`raw` does, without the cost of an array."""
        if self._packed is not None and len(data) == self.length:
            return self._packed.unpack(data)
        return self.raw(data).tolist()

    def physical(self, raw: IntArray) -> FloatArray:
        """Return the (k,) values of ``raw`` in the signals' units; NaN of a float that is NaN."""
        number = raw.astype(np.float64)
        if self._any_unsigned:
            number = np.where(self._unsigned, raw.view("<u8").astype(np.float64), number)
        with np.errstate(over="ignore", invalid="ignore"):  # a value beyond float64 is refused as out of range
            for index, kind in self._floats:
                number[index] = raw[index : index + 1].view(kind)[0]
            return number * self._scale + self._offset

    def value_reader(self, index: int) -> Callable[[int], float]:
        """Return a function from the raw number of a signal to its value, as :meth:`physical` has it."""
        signal = self.signals[index]
        scale, offset, mask, n_bytes = signal.scale, signal.offset, (1 << signal.length) - 1, signal.length // 8
        if signal.kind == FLOAT:
            unpack, to_bytes = _FLOATS[signal.length].unpack, int.to_bytes
            return lambda raw: unpack(to_bytes(raw & mask, n_bytes, "little"))[0] * scale + offset
        # Of 64 bits the largest come as negative numbers.
        beyond = 1 << _WIDTH if signal.kind == UNSIGNED else 0
        return lambda raw: float(raw if raw >= 0 else raw + beyond) * scale + offset

    def encode(self, values: FloatArray | Sequence[float]) -> bytes:
        """Return the frame that holds the (k,) ``values`` [the signals' units], nearest raw number.

        A value that is not finite or out of range becomes the signal's "not available".

        Raises
        ------
        InputError
            Such a value belongs to a signal without a "not available".
        """
        little = big = 0
        numbers = values.tolist() if isinstance(values, np.ndarray) else values
        if len(numbers) != len(self._encoders):
            raise ValueError(f"expected {len(self._encoders)} values, got {len(numbers)}")
        if self._whole is not None:
            little = self._whole.encoded(numbers)
        for index, raw_of, mask, shift, is_big, low, high in self._others:
            raw = numbers[index]
            if type(raw) is not int or not low <= raw <= high:
                raw = raw_of(raw)
            if raw and is_big:
                big |= (raw & mask) << shift
            elif raw:
                little |= (raw & mask) << shift
        if big:
            little |= int.from_bytes(big.to_bytes(self.length, "big"), "little")
        return little.to_bytes(self.length, "little")


_LARGEST_EXACT = 1 << 53
"""Largest whole number up to which float64 holds all."""

_LARGEST_FLOAT = float(np.finfo(np.float32).max)


def _whole_bytes(layout: FrameLayout) -> list[int]:
    """Return the signals of whole bytes, little endian and of up to 32 bits, in the order of their places."""
    found, end = [], 0
    for index, signal in sorted(enumerate(layout.signals), key=lambda item: item[1].start):
        is_little = signal.byte_order == LITTLE or signal.length == 8
        first = signal.bits[0]
        if is_little and signal.length in (8, 16, 32) and first % 8 == 0 and first >= end:
            found.append(index)
            end = first + signal.length
    return found


class _WholeBytes:
    """The signals of whole bytes of a frame, encoded by one call of ``struct``.

    Numbers that are their own raw numbers go into it as they are; it refuses the same of them as their encoders.

    Parameters
    ----------
    encoders : of all signals of the frame.
    indices : signals of whole bytes, at least two, in the order of their places.
    """

    def __init__(self, encoders: Sequence[_Encoder], indices: Sequence[int]) -> None:
        own = [encoders[index] for index in indices]
        self._pick = itemgetter(*indices)
        self._raws = [None if one.is_plain_float else one.raw for one in own]
        self._scaled = [(at, one.raw) for at, one in enumerate(own) if not (one.is_plain_float or one.is_plain)]
        self._floats = [at for at, one in enumerate(own) if one.is_plain_float]
        code, end = "<", 0
        for one in own:
            first, length = one.shift // 8, one.signal.length
            kinds = _SIGNED_CODES if one.signal.kind == SIGNED else _UNSIGNED_CODES
            code += f"{first - end}x{'f' if one.is_plain_float else kinds[length]}"
            end = first + length // 8
        self._pack = struct.Struct(code).pack

    def encoded(self, numbers: Sequence[float]) -> int:
        """Return the bits of the frame that hold their part of the ``numbers`` of all signals."""
        held: list[float] = list(self._pick(numbers))
        for at, raw_of in self._scaled:
            held[at] = raw_of(held[at])
        for at in self._floats:
            if not -_LARGEST_FLOAT <= held[at] <= _LARGEST_FLOAT:
                held[at] = nan
        try:
            data = self._pack(*held)
        except struct.error:
            picked = zip(self._pick(numbers), held, self._raws, strict=True)
            data = self._pack(*[one if raw_of is None else raw_of(number) for number, one, raw_of in picked])
        return int.from_bytes(data, "little")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Encoder:
    """Encoding of one signal into a frame that is one integer of the signal's byte order.

    Attributes
    ----------
    shift, mask : bit number of its least significant bit, and its bits.
    low, high : smallest and largest value.
    raw_low, raw_high : smallest and largest raw number; half a number beyond them, ``least`` and ``most``: only
        values in range are rounded.
    scale, offset : of the signal.
    packed : format of a float, else None.
    """

    signal: SignalLayout
    shift: int
    mask: int
    is_big: bool
    low: float
    high: float
    raw_low: float
    raw_high: float
    least: float
    most: float
    scale: float
    offset: float
    packed: struct.Struct | None

    @property
    def is_plain_float(self) -> bool:
        """It is a float32 without scale, offset or limits: none is refused that float32 holds."""
        is_unlimited = self.signal.minimum is None and self.signal.maximum is None
        is_single = self.packed is not None and self.signal.length == 32
        return is_single and is_unlimited and self.scale == 1.0 and self.offset == 0.0

    @property
    def is_plain(self) -> bool:
        """Every whole number that its bits can hold is its own raw number."""
        return self.plain_range == _raw_range(self.signal)

    @property
    def plain_range(self) -> tuple[int, int]:
        """First and last whole number that is its own raw number; the first is above the last where none is."""
        is_plain = self.scale == 1.0 and self.offset == 0.0 and self.packed is None
        if not is_plain or self.raw_high > _LARGEST_EXACT:
            return 1, 0
        return ceil(max(self.low, self.raw_low)), floor(min(self.high, self.raw_high))

    def raw(self, value: float) -> int:
        """Return the raw number of ``value``; of a float its bit pattern."""
        scaled = (value - self.offset) / self.scale
        usable = self.low <= value <= self.high and self.least <= scaled <= self.most  # False of NaN
        if self.packed is not None:
            held = scaled if usable and abs(scaled) <= self.raw_high else nan
            return int.from_bytes(self.packed.pack(held), "little")
        if usable:
            number = round(scaled)
            if self.raw_low <= number <= self.raw_high:
                return number
        signal = self.signal
        if signal.not_available is None:
            unit = f" {signal.unit}" if signal.unit else ""
            raise InputError(
                f"signal '{signal.name}': expected what fits into {signal.length} bits of {signal.scale:g}{unit}, "
                f"got {value:g}{unit}"
            )
        return signal.not_available


def _encoder(signal: SignalLayout, n_bytes: int) -> _Encoder:
    """Return the encoding of ``signal`` into a frame of ``n_bytes``."""
    lowest = signal.bits[0]
    is_big = signal.byte_order == BIG
    # Bits of a big endian integer count from the last byte on.
    shift = 8 * (n_bytes - 1 - lowest // 8) + lowest % 8 if is_big else lowest
    raw_low, raw_high = _raw_range(signal)
    return _Encoder(
        signal=signal,
        shift=shift,
        mask=(1 << signal.length) - 1,
        is_big=is_big,
        low=-np.inf if signal.minimum is None else signal.minimum,
        high=np.inf if signal.maximum is None else signal.maximum,
        raw_low=raw_low,
        raw_high=raw_high,
        least=raw_low - 0.5,
        most=raw_high + 0.5,
        scale=signal.scale,
        offset=signal.offset,
        packed=_FLOATS[signal.length] if signal.kind == FLOAT else None,
    )


def _packed(layout: FrameLayout) -> struct.Struct | None:
    """Return the format of a frame of whole bytes, one byte order, signals in order; None of other frames."""
    orders = {signal.byte_order for signal in layout.signals}
    if len(orders) != 1:
        return None
    is_little = orders == {LITTLE}
    code, end = "<" if is_little else ">", 0
    for signal in layout.signals:
        first, bit = divmod(signal.start, 8)
        if signal.length not in _UNSIGNED_CODES or bit != (0 if is_little else 7) or first < end:
            return None
        kinds = _SIGNED_CODES if signal.kind == SIGNED else _UNSIGNED_CODES
        code += f"{first - end}x{kinds[signal.length]}"
        end = first + signal.length // 8
    return struct.Struct(f"{code}{layout.length - end}x")


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
    if signal.kind == FLOAT and signal.length not in _FLOAT_TYPES:
        raise InputError(f"{where}: a float of {signal.length} bits found, 16, 32 or 64 allowed")
    if not (np.isfinite(signal.scale) and signal.scale != 0.0 and np.isfinite(signal.offset)):
        raise InputError(f"{where}: expected finite numbers, got scale {signal.scale:g}, offset {signal.offset:g}")
    if min(signal.bits) < 0 or max(signal.bits) >= 8 * layout.length:
        raise InputError(f"{where}: reaches beyond the frame's {layout.length} bytes")
    return signal


def bit_indices(signal: SignalLayout, padding: int) -> list[int]:
    """Return the bit of the frame for each of the 64 bits of the number."""
    bits = list(signal.bits)
    fill = bits[-1] if signal.kind == SIGNED else padding
    return bits + [fill] * (_WIDTH - len(bits))


def _raw_range(signal: SignalLayout) -> tuple[float, float]:
    """Return the smallest and largest raw number that a value may be encoded as."""
    if signal.kind == FLOAT:
        largest = float(np.finfo(_FLOAT_TYPES[signal.length]).max)
        return -largest, largest
    if signal.kind == SIGNED:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1
