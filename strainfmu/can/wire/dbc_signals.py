"""Signals, multiplexer values and periods of a DBC file, from cantools' description to ours."""

from __future__ import annotations

import re
import struct
from typing import Any

from strainfmu.can.wire.frame_layout import BIG, FLOAT, LITTLE, SIGNED, UNSIGNED, SignalLayout
from strainfmu.errors import InputError

_NO_VALUE = re.compile(
    r"(?<![a-z])sna(?![a-z])|fail|(?<![a-z])fault|error|invalid|undefined|unavailable"
    r"|not[ _-]?(available|valid|defined)|no[ _-]?(data|value|signal)",
    re.IGNORECASE,
)
"""These words, anywhere in the name of a value, mark it as "no value"."""

_ALL_WELL = re.compile(r"(?<![a-z])no[ _-]?(fail(ure)?|fault|error)", re.IGNORECASE)


def period(message: Any, where: str) -> float | None:
    """Return the cycle time of a frame [s], None if the DBC file does not state it."""
    stated = message.cycle_time
    if not stated:
        return None
    if not isinstance(stated, int | float) or not 0.0 < stated < 1e6:
        raise InputError(f"{where}: cycle time: expected a positive number of ms, got {stated!r}")
    return float(stated) / 1e3


def signal_layout(signal: Any, with_names: bool = False) -> SignalLayout:
    """Return our description of cantools' ``signal``; ``with_names`` evaluates the names of its values.

    Raises
    ------
    InputError
        Its numbers cannot be used.
    """
    try:
        codes = _no_value_codes(signal) if with_names else []
        return SignalLayout(
            name=signal.name,
            start=int(signal.start),
            length=int(signal.length),
            byte_order=LITTLE if signal.byte_order == "little_endian" else BIG,
            kind=FLOAT if signal.is_float else SIGNED if signal.is_signed else UNSIGNED,
            scale=float(signal.scale),
            offset=float(signal.offset),
            unit=signal.unit or "",
            minimum=None if signal.minimum is None else float(signal.minimum),
            maximum=None if signal.maximum is None else float(signal.maximum),
            not_available=codes[0] if codes else None,
            initial=None if signal.raw_initial is None else int(signal.raw_initial),
            other_no_value=tuple(codes[1:]),
        )
    except (OverflowError, ValueError, TypeError) as error:
        raise InputError(f"signal '{signal.name}': numbers that cannot be used: {error}") from error


def _no_value_codes(signal: Any) -> list[int]:
    """Return the raw numbers, as int64, that the DBC file names "not available" or the like."""
    names = [(int(number), _ALL_WELL.sub("", str(text))) for number, text in (signal.choices or {}).items()]
    codes = [_int64(number, signal) for number, text in names if _NO_VALUE.search(text)]
    return [code for code in codes if code is not None]


def _int64(number: int, signal: Any) -> int | None:
    """Return the raw number of ``signal`` as decoding gives it, of a float its bits; None if there is none."""
    if signal.is_float:
        kind = {16: "<e", 32: "<f", 64: "<d"}.get(signal.length)
        try:
            return (
                None if kind is None else int.from_bytes(struct.pack(kind, number), "little", signed=kind == "<d")
            )
        except OverflowError:
            return None
    if signal.length == 64 and not signal.is_signed:
        number -= (number >> 63) << 64
    return number if -(2**63) <= number < 2**63 else None


def selector_value(signal: Any, name: str) -> int | None:
    """Return the multiplexer's value with which ``signal`` is sent, None if it is always sent."""
    identifiers = signal.multiplexer_ids
    if not identifiers:
        return None
    if len(identifiers) != 1:
        raise InputError(f"{name}: signal '{signal.name}': {len(identifiers)} multiplexer values found, 1 allowed")
    return int(identifiers[0])
