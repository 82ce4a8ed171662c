"""Decoder and encoder of all signals of a frame, for any start, length, byte order and kind; both are compiled."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cached_property
from math import inf

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.can.wire.compiled import ARRAY, INTEGER, Record, function, pointer
from strainfmu.can.wire.cycle_plan import CyclePlan, checked_signal, integers, places
from strainfmu.can.wire.frame_layout import FrameLayout, SignalLayout
from strainfmu.errors import InputError

_UNPROTECTED = -1
"""Counter of a frame without counter and CRC."""


class _EncoderRecord(Record):
    position = 18
    _fields_ = (
        *((name, INTEGER) for name in ("n", "n_bytes")),
        *((name, ARRAY) for name in ("byte", "count", "shift", "length", "is_big", "kind")),
        *((name, ARRAY) for name in ("scale", "offset", "low", "high", "has_none", "none")),
        *((name, INTEGER) for name in ("profile", "data_id", "end")),
    )


class SignalPlan:
    """The signals of one frame, prepared for repeated decoding and encoding by one thread.

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

    @cached_property
    def _encoder(self) -> _Encoder:
        return _Encoder(self._layout)

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
        if len(values) != len(self.signals):
            raise ValueError(f"expected {len(self.signals)} values, got {len(values)}")
        return self._encoder.encode(values, _UNPROTECTED)

    def protected(self, values: Sequence[float], counter: int) -> bytes:
        """Return the frame as :meth:`encode`, with its ``counter`` (in its range) and CRC."""
        return self._encoder.encode(values, counter)


class _Encoder:
    """Writes the signals of a frame into its bytes, and its counter and CRC."""

    def __init__(self, layout: FrameLayout) -> None:
        signals, protection = layout.signals, layout.protection
        none = [(0 if s.not_available is None else s.not_available) % (1 << 64) for s in signals]
        self.record = _EncoderRecord(
            n=len(signals),
            n_bytes=layout.length,
            **places(signals, [0] * len(signals)),
            low=np.array([-inf if s.minimum is None else s.minimum for s in signals]),
            high=np.array([inf if s.maximum is None else s.maximum for s in signals]),
            has_none=integers([s.not_available is not None for s in signals]),
            none=np.array(none, dtype=np.uint64).view(np.int64),
            profile=0 if protection is None else protection.profile,
            data_id=0 if protection is None else protection.data_id,
            end=-1 if protection is None or protection.end is None else protection.end,
        )
        self._signals, self._n_bytes = signals, layout.length
        self._data, value = np.zeros(max(layout.length, 1), dtype=np.uint8), np.zeros(max(len(signals), 1))
        self._view, self._value = self._data.data, value.data
        self._pack = struct.Struct(f"={len(signals)}d").pack_into
        self._at, self._at_value, self._at_data = pointer(self.record), pointer(value), pointer(self._data)
        self._encode = function("sb_encode", _EncoderRecord)

    def encode(self, values: Sequence[float] | FloatArray, counter: int) -> bytes:
        """Return the frame of ``values``, protected with ``counter`` unless that is below 0."""
        self._pack(self._value, 0, *values)
        refused = self._encode(self._at, self._at_value, counter, self._at_data)
        if refused >= 0:
            raise _cannot_hold(self._signals[refused], values[refused])
        return bytes(self._view[: self._n_bytes])


def _cannot_hold(signal: SignalLayout, value: float) -> InputError:
    unit = f" {signal.unit}" if signal.unit else ""
    return InputError(
        f"signal '{signal.name}': expected what fits into {signal.length} bits of {signal.scale:g}{unit}, "
        f"got {value:g}{unit}"
    )
