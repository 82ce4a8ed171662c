"""The compiled library of the bus, and signals of a frame for it: their places, decoded and encoded."""

import ctypes
import struct
from collections.abc import Sequence
from functools import cache
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.can.frame_layout import FLOAT, LITTLE, SIGNED, UNSIGNED, FrameLayout, SignalLayout
from strainfmu.cosim.estimators.exchange import ESTIMATOR, EXCHANGE
from strainfmu.errors import InputError
from strainfmu.estimator.core import library


def _record(*fields: tuple[Any, str]) -> np.dtype[Any]:
    """Return a record as a C compiler lays it out; ``fields`` are pairs of a type and the names of that type."""
    return np.dtype([(name, kind) for kind, names in fields for name in names.split()], align=True)


_WORD, _LONG, _NUMBER, _MASK, _ADDRESS = "i4", "i8", "f8", "u4", "u8"

SIGNAL = _record(
    (_WORD, "byte count shift length is_big kind target has_ends first_code n_codes has_none"),
    (_MASK, "lost"),
    (_LONG, "first last none"),
    (_NUMBER, "scale offset low high factor added smallest largest max_age"),
)
"""``SbSignal``."""

SLOT = _record(
    (_WORD, "length is_fd kind next profile data_id crc_end is_secured selector value"),
    (_WORD, "sample_time status configuration request session heard_counter heard_time heard_delay"),
    (_WORD, "first n_signals data shares_clock"),
    (_LONG, "expected"),
    (_NUMBER, "period hold tick rate"),
)
"""``SbSlot``."""

PLAN = _record(
    (_NUMBER, "cycle max_age tolerance deadline timeout invalid_after alarm tick synchronised shift"),
    (_NUMBER, "sensor_range rate_limit zero_jump fixed_pressure pressure_max_age period_tolerance burst"),
    (
        _WORD,
        "n_slots n_gauges n_flow n_cycle trailer state pressure n_data covered n_covered is_timed bits modulus",
    ),
    (_WORD, "is_answered accepts is_protected is_authentic first_result n_counters heal late_limit recovery"),
    (_WORD, "stuck padding"),  # a copy has other bytes in places without a name
    (_ADDRESS, "slot signal code change"),
)
"""``SbPlan``."""

RESULT = _record(
    (_NUMBER, "time arrival age uncertainty held stated_pressure"),
    (_LONG, "sample_time"),
    (_WORD, "counter is_silent n_used"),
    (_MASK, "causes"),
    (_WORD, "quality usable request"),
)
"""``SbResult``."""

FRAME = _record(
    (_MASK, "identifier"),
    (_WORD, "is_extended is_fd length kind modulus first n_signals"),
    (SLOT, "protection"),
)
"""``SentFrame``."""

LOGGED = _record((_NUMBER, "time"), (_MASK, "key"), ("u1", "n flags is_received verdict"), (("u1", 64), "data"))
"""``SbLogged``."""

QUEUE = _record((_ADDRESS, "frame"), (_LONG, "size room put taken lost"))
"""``SbQueue``."""

BRIDGE = _record(
    (_ADDRESS, "plan state estimator place output frame signal source counter data other step value"),
    (_ADDRESS, "key slot has_come heard queue"),
    ("V136", "last"),
    (_NUMBER, "last_step pressure alarm"),
    (
        _WORD,
        "n_outputs n_frames n_others mask score configuration needs_pressure health n_gauges is_stepped n_keys",
    ),
    (_WORD, "bus_state send_failures reconnects"),
)
"""``SbBridge``."""

N_CLASSES = 23
ACCOUNT = _record((_LONG, "received pending"), ((_LONG, N_CLASSES), "count"), ((_NUMBER, N_CLASSES), "first last"))
"""``SbAccount``."""


@cache
def functions() -> ctypes.PyDLL:
    """Return the library, whose functions keep Python to themselves: they work for microseconds.

    Raises
    ------
    NoCoreError
        There is no library for this machine and no compiler to make one.
    """
    core = library()
    native = ctypes.PyDLL(core._name, handle=core._handle)
    native.sb_size.restype = ctypes.c_int64
    _check_sizes(native)
    return native


PLACES: dict[str, int] = {}
"""Places in the state [bytes]: of the result, of the account, of the table of places of its parts."""


def _check_sizes(native: ctypes.PyDLL) -> None:
    """Compare the records with the library's, and keep the places of the state's parts."""
    size = np.zeros(14, dtype=np.int64)
    native.sb_sizes(pointer(size))
    records = (SIGNAL, SLOT, PLAN, RESULT, ACCOUNT, FRAME, BRIDGE, ESTIMATOR, EXCHANGE, LOGGED, QUEUE)
    assert size[:11].tolist() == [record.itemsize for record in records], size
    PLACES.update(zip(("result", "account", "parts"), size[11:].tolist(), strict=True))


def pointer(array: NDArray[Any]) -> Any:
    """Return the address of an array as an argument of a function; the array must outlive it."""
    assert array.flags.c_contiguous
    return ctypes.c_void_p(array.ctypes.data)


def frame_table(frames: Sequence[tuple[FrameLayout, int]]) -> np.ndarray:
    """Return the rows of frames that are sent, each with its kind."""
    rows, first = np.zeros(len(frames), dtype=FRAME), 0
    for row, (layout, kind) in zip(rows, frames, strict=True):
        row["identifier"], row["is_extended"] = layout.identifier, layout.is_extended
        row["is_fd"], row["length"], row["kind"] = layout.is_fd, layout.length, kind
        row["first"], row["n_signals"] = first, len(layout.signals)
        if (protection := layout.protection) is not None:
            row["modulus"] = protection.counter_modulus
            row["protection"]["profile"], row["protection"]["data_id"] = protection.profile, protection.data_id
            row["protection"]["crc_end"] = -1 if protection.end is None else protection.end
        first += len(layout.signals)
    return rows


_KINDS = (UNSIGNED, SIGNED, FLOAT)
"""Kinds of a signal, in the order of bus.h."""

_WIDTH, _WHOLE = 64, 1 << 64
FLOAT_LENGTHS = (16, 32, 64)
"""Bits of a float (IEEE 754)."""

_UNPROTECTED = -1
"""Counter of a frame without counter and CRC."""


def signal_table(layout: FrameLayout, codes: list[int] | None = None) -> Any:
    """Return the table of a frame's signals; ``codes`` takes in the numbers that stand for "no value"."""
    table = np.zeros(len(layout.signals), dtype=SIGNAL)
    codes = [] if codes is None else codes
    for row, signal in zip(table, layout.signals, strict=True):
        checked_signal(signal, layout)
        row["byte"], row["count"], row["shift"] = _place(signal)
        row["length"], row["is_big"] = signal.length, signal.byte_order != LITTLE
        row["kind"], row["target"] = _KINDS.index(signal.kind), -1
        row["scale"], row["offset"], row["factor"] = signal.scale, signal.offset, 1.0
        row["low"] = -inf if signal.minimum is None else signal.minimum
        row["high"] = inf if signal.maximum is None else signal.maximum
        row["smallest"], row["largest"], row["max_age"] = -inf, inf, inf
        ends = raw_ends(signal)
        row["has_ends"] = ends is not None
        row["first"], row["last"] = ends or (0, 0)
        row["first_code"], row["n_codes"] = len(codes), len(signal.no_value_codes)
        codes += signal.no_value_codes
        row["has_none"] = signal.not_available is not None
        row["none"] = int64(signal.not_available or 0)
    return table


def int64(number: int) -> int:
    """Return the number with the same 64 bits that int64 can hold."""
    return (number + _WHOLE // 2) % _WHOLE - _WHOLE // 2


def raw_ends(signal: SignalLayout) -> tuple[int, int] | None:
    """Return the first and the last raw number of an integer; None of a float, or of 64 bits, which none fills."""
    if signal.kind == FLOAT or signal.length >= _WIDTH:
        return None
    if signal.kind == SIGNED:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def _place(signal: SignalLayout) -> tuple[int, int, int]:
    """Return first byte and number of bytes of a signal, and its lowest bit in the number that they make."""
    if signal.byte_order == LITTLE:
        first, last = signal.start // 8, (signal.start + signal.length - 1) // 8
        return first, last - first + 1, signal.start % 8
    # Big endian runs from the most significant bit down through a byte, then on to the next byte's bit 7.
    begin = 8 * (signal.start // 8) + 7 - signal.start % 8
    end = begin + signal.length - 1
    return begin // 8, end // 8 - begin // 8 + 1, 7 - end % 8


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
    if signal.kind not in _KINDS:
        raise InputError(f"{where}: expected unsigned, signed or float, got kind '{signal.kind}'")
    if signal.kind == FLOAT and signal.length not in FLOAT_LENGTHS:
        raise InputError(f"{where}: a float of {signal.length} bits found, 16, 32 or 64 allowed")
    if not (np.isfinite(signal.scale) and signal.scale != 0.0 and np.isfinite(signal.offset)):
        raise InputError(
            f"{where}: expected finite numbers, a scale other than 0, got scale {signal.scale:g}, offset "
            f"{signal.offset:g}"
        )
    if min(signal.bits) < 0 or max(signal.bits) >= 8 * layout.length:
        raise InputError(f"{where}: reaches beyond the frame's {layout.length} bytes")
    return signal


class SignalPlan:
    """The signals of one frame, prepared for repeated decoding and encoding by one thread."""

    def __init__(self, layout: FrameLayout) -> None:
        self.signals, self.length = layout.signals, layout.length
        n = len(layout.signals)
        self._table, self._slot = signal_table(layout), np.zeros(1, dtype=SLOT)
        self._value, self._data = np.zeros(max(n, 1)), np.zeros(max(layout.length, 1), dtype=np.uint8)
        self._pack, self._written = struct.Struct(f"={n}d").pack_into, self._value.data
        self._bytes = self._data.data
        self._signal_at, self._value_at = pointer(self._table), pointer(self._value)
        self._encoded = pointer(self._slot), pointer(self._data), layout.length
        self._library = functions()

    def raw(self, data: bytes) -> IntArray:
        """Return the (k,) raw numbers in ``data``, sign extended; of floats, their bit patterns.

        Raises
        ------
        ValueError
            The length of ``data`` is not the frame's.
        """
        if len(data) != self.length:
            raise ValueError(f"expected {self.length} bytes, got {len(data)}")
        raw = np.empty(len(self.signals), dtype=np.int64)
        self._library.sb_raw(self._signal_at, len(raw), bytes(data), pointer(raw))
        return raw

    def physical(self, raw: IntArray) -> FloatArray:
        """Return the (k,) values of ``raw`` in the signals' units; NaN of a float that is NaN."""
        value = np.empty(len(self.signals))
        self._library.sb_physical(self._signal_at, len(value), pointer(raw), pointer(value))
        return value

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
        self._pack(self._written, 0, *values)
        encode = self._library.sb_encode
        refused = encode(self._signal_at, len(values), self._value_at, _UNPROTECTED, *self._encoded)
        if refused >= 0:
            signal, value = self.signals[refused], values[refused]
            unit = f" {signal.unit}" if signal.unit else ""
            raise InputError(
                f"signal '{signal.name}': expected what fits into {signal.length} bits of {signal.scale:g}{unit}, "
                f"got {value:g}{unit}"
            )
        return bytes(self._bytes[: self.length])
