"""All signals of a frame decoded and encoded by a few numpy calls, for any start, length, byte order and kind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from strainfmu.can.frame_layout import FLOAT, SIGNED, UNSIGNED, FrameLayout, SignalLayout
from strainfmu.errors import InputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_WIDTH = 64
_FLOAT_TYPES = {16: "<f2", 32: "<f4", 64: "<f8"}


class SignalPlan:
    """The signals of one frame, ready for the loop: each is 64 bit numbers of the frame, gathered at once.

    Raises
    ------
    InputError
        A signal does not fit into the frame or into 64 bits, or is of a kind that does not exist.
    """

    def __init__(self, layout: FrameLayout) -> None:
        for signal in layout.signals:
            _check(signal, layout)
        self.length = layout.length
        self.signals = layout.signals
        index = [_gather(signal, 8 * layout.length) for signal in layout.signals]
        self._index = np.array(index, dtype=np.intp).reshape(-1)
        self._own_bits = np.array(
            [[bit < signal.length for bit in range(_WIDTH)] for signal in layout.signals], dtype=bool
        ).reshape(-1)
        # Only unsigned numbers of all 64 bits do not fit into int64.
        self._unsigned = np.array([s.kind == UNSIGNED and s.length == _WIDTH for s in layout.signals], dtype=bool)
        self._any_unsigned = bool(self._unsigned.any())
        self._floats = [
            (place, _FLOAT_TYPES[s.length]) for place, s in enumerate(layout.signals) if s.kind == FLOAT
        ]
        self._scale = np.array([s.scale for s in layout.signals])
        self._offset = np.array([s.offset for s in layout.signals])
        self._low = np.array([-np.inf if s.minimum is None else s.minimum for s in layout.signals])
        self._high = np.array([np.inf if s.maximum is None else s.maximum for s in layout.signals])
        ranges = [_raw_range(signal) for signal in layout.signals]
        self._raw_low = np.array([low for low, _ in ranges])
        self._raw_high = np.array([high for _, high in ranges])
        # The last bit stays 0: it pads unsigned numbers.
        self._bits = np.zeros(8 * layout.length + 1, dtype=np.uint8)

    def raw(self, data: bytes) -> IntArray:
        """Return the (k,) raw numbers in ``data``, sign extended; of floats, their bit patterns.

        Raises
        ------
        ValueError
            ``data`` has not the length of the frame.
        """
        self._bits[:-1] = np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="little")
        return np.packbits(self._bits[self._index], bitorder="little").view("<i8")

    def physical(self, raw: IntArray) -> FloatArray:
        """Return the (k,) values of ``raw`` in the signals' units; NaN of a float that is none."""
        number = raw.astype(np.float64)
        if self._any_unsigned:
            number = np.where(self._unsigned, raw.view("<u8").astype(np.float64), number)
        for place, kind in self._floats:
            number[place] = raw[place : place + 1].view(kind)[0]
        with np.errstate(over="ignore", invalid="ignore"):  # what a float64 cannot hold is refused as out of range
            return number * self._scale + self._offset

    def encode(self, values: FloatArray) -> bytes:
        """Return the frame that holds the (k,) ``values`` [the signals' units], nearest raw number.

        What is not finite or out of range becomes the signal's "not available".

        Raises
        ------
        InputError
            Such a value belongs to a signal that has no way to say so.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            scaled = (np.asarray(values, dtype=float) - self._offset) / self._scale
            usable = (values >= self._low) & (values <= self._high)
            number = np.rint(scaled)
            usable &= (number >= self._raw_low) & (number <= self._raw_high)
        raw = np.where(usable, number, 0.0).astype(np.int64)
        if self._any_unsigned:
            raw = np.where(self._unsigned, np.where(usable, number, 0.0).astype(np.uint64).view(np.int64), raw)
        floats = dict(self._floats)
        for place in np.flatnonzero(~usable).tolist():
            if place not in floats:
                raw[place] = self._not_available(place, float(values[place]))
        for place, kind in self._floats:
            raw[place] = 0
            raw[place : place + 1].view(kind)[0] = scaled[place] if usable[place] else np.nan
        bits = np.zeros(8 * self.length + 1, dtype=np.uint8)
        of_raw = np.unpackbits(raw.astype("<i8").view(np.uint8), bitorder="little")
        bits[self._index[self._own_bits]] = of_raw[self._own_bits]
        return np.packbits(bits[:-1], bitorder="little").tobytes()

    def _not_available(self, place: int, value: float) -> int:
        signal = self.signals[place]
        if signal.not_available is None:
            raise InputError(
                f"signal '{signal.name}': {value:g} {signal.unit} found, what fits into "
                f"{signal.length} bits of {signal.scale:g} {signal.unit} wanted"
            )
        return signal.not_available


def _check(signal: SignalLayout, layout: FrameLayout) -> None:
    """Refuse a signal that cannot be decoded."""
    where = f"frame '{layout.name}', signal '{signal.name}'"
    if not 1 <= signal.length <= _WIDTH:
        raise InputError(f"{where}: {signal.length} bits found, 1 to {_WIDTH} allowed")
    if signal.kind not in (UNSIGNED, SIGNED, FLOAT):
        raise InputError(f"{where}: kind '{signal.kind}' found, unsigned, signed or float wanted")
    if signal.kind == FLOAT and signal.length not in _FLOAT_TYPES:
        raise InputError(f"{where}: a float of {signal.length} bits found, 16, 32 or 64 allowed")
    if not (np.isfinite(signal.scale) and signal.scale != 0.0 and np.isfinite(signal.offset)):
        raise InputError(f"{where}: scale {signal.scale:g}, offset {signal.offset:g} found, finite numbers wanted")
    if min(signal.bits) < 0 or max(signal.bits) >= 8 * layout.length:
        raise InputError(f"{where}: reaches beyond the frame's {layout.length} bytes")


def _gather(signal: SignalLayout, padding: int) -> list[int]:
    """Return which bit of the frame each of the 64 bits of the number is."""
    bits = list(signal.bits)
    fill = bits[-1] if signal.kind == SIGNED else padding
    return bits + [fill] * (_WIDTH - len(bits))


def _raw_range(signal: SignalLayout) -> tuple[float, float]:
    """Return the smallest and largest raw number that a value may be encoded as."""
    if signal.kind == FLOAT:
        largest = float(np.finfo(_FLOAT_TYPES[signal.length]).max)
        return -largest, largest
    if signal.kind == SIGNED:
        return -(2.0 ** (signal.length - 1)), 2.0 ** (signal.length - 1) - 1.0
    return 0.0, 2.0**signal.length - 1.0
