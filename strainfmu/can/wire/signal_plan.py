"""The decoder and encoder of all signals of a frame, for any start, length, byte order and kind.

Compiled code decodes them, see :class:`~strainfmu.can.wire.cycle_plan.CyclePlan`. Frames are encoded as one long
integer.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, floor, nan
from operator import itemgetter

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.can.wire.cycle_plan import CyclePlan, checked_signal
from strainfmu.can.wire.frame_layout import BIG, FLOAT, LITTLE, SIGNED, FrameLayout, SignalLayout
from strainfmu.errors import InputError

_FLOAT_TYPES = {16: "<f2", 32: "<f4", 64: "<f8"}
_FLOATS = {16: struct.Struct("<e"), 32: struct.Struct("<f"), 64: struct.Struct("<d")}
_UNSIGNED_CODES = {8: "B", 16: "H", 32: "I"}
_SIGNED_CODES = {8: "b", 16: "h", 32: "i"}
"""Codes of ``struct`` by bits."""


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
        self._layout, self.length = layout, layout.length
        self.signals = layout.signals
        self._encoders = [_encoder(signal, layout.length) for signal in layout.signals]
        whole = _whole_bytes(layout)
        self._whole = _WholeBytes(self._encoders, whole) if len(whole) > 1 else None
        self._others = [
            (index, one.raw, one.mask, one.shift, one.is_big, *one.plain_range)
            for index, one in enumerate(self._encoders)
            if self._whole is None or index not in whole
        ]

    @cached_property
    def _decoder(self) -> CyclePlan:
        return CyclePlan([self._layout], [(0, index) for index in range(len(self.signals))])

    def raw(self, data: bytes) -> IntArray:
        """Return the (k,) raw numbers in ``data``, sign extended; of floats, their bit patterns.

        Raises
        ------
        ValueError
            The length of ``data`` is not the frame's.
        """
        return self._decoder.raw([data])

    def physical(self, raw: IntArray) -> FloatArray:
        """Return the (k,) values of ``raw`` in the signals' units; NaN of a float that is NaN."""
        return self._decoder.physical(raw)

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


def _raw_range(signal: SignalLayout) -> tuple[float, float]:
    """Return the smallest and largest raw number that a value may be encoded as."""
    if signal.kind == FLOAT:
        largest = float(np.finfo(_FLOAT_TYPES[signal.length]).max)
        return -largest, largest
    if signal.kind == SIGNED:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1
