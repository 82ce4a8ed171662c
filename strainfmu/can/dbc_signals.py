"""What cantools found in a DBC file as our description of it: signals, multiplexer values, periods."""

from __future__ import annotations

import re
from typing import Any

from strainfmu.can.frame_layout import BIG, FLOAT, LITTLE, SIGNED, UNSIGNED, SignalLayout
from strainfmu.errors import InputError

_NOT_AVAILABLE = re.compile(r"sna|not[ _]?available|invalid|error|signal[ _]?not[ _]?available", re.IGNORECASE)


def period(message: Any, where: str) -> float | None:
    """Return the cycle time of a frame [s], None if the DBC file does not give it."""
    stated = message.cycle_time
    if not stated:
        return None
    if not isinstance(stated, int | float) or not 0.0 < stated < 1e6:
        raise InputError(f"{where}: cycle time {stated!r} ms found, a positive number wanted")
    return float(stated) / 1e3


def signal_layout(signal: Any, with_ends: bool = False) -> SignalLayout:
    """Return our description of cantools' ``signal``; ``with_ends`` looks for its "not available" as well.

    Raises
    ------
    InputError
        Its numbers cannot be used.
    """
    try:
        none = _not_available(signal) if with_ends else None
        return SignalLayout(
            signal.name,
            int(signal.start),
            int(signal.length),
            LITTLE if signal.byte_order == "little_endian" else BIG,
            FLOAT if signal.is_float else SIGNED if signal.is_signed else UNSIGNED,
            float(signal.scale),
            float(signal.offset),
            signal.unit or "",
            None if signal.minimum is None else float(signal.minimum),
            None if signal.maximum is None else float(signal.maximum),
            none,
            None if signal.raw_initial is None else int(signal.raw_initial),
        )
    except (OverflowError, ValueError, TypeError) as error:
        raise InputError(f"signal '{signal.name}': numbers that cannot be used: {error}") from error


def _not_available(signal: Any) -> int | None:
    """Return the raw number that the DBC file names "not available" or the like."""
    for number, text in (signal.choices or {}).items():
        if _NOT_AVAILABLE.fullmatch(str(text).strip()) and -(2**63) <= int(number) < 2**63:
            return int(number)
    return None


def selector_value(signal: Any, name: str) -> int | None:
    """Return the multiplexer's value that ``signal`` comes with, None if it always comes."""
    identifiers = signal.multiplexer_ids
    if not identifiers:
        return None
    if len(identifiers) != 1:
        raise InputError(f"{name}: signal '{signal.name}': {len(identifiers)} multiplexer values found, 1 allowed")
    return int(identifiers[0])
