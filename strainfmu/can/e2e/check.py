"""The E2E check of a protected frame against the one before it.

Status names, their order of precedence and what happens to the stored counter are as in AUTOSAR's E2E_P05Check
(PRS_E2EProtocol, profile 5); profile 1 is reported in the same terms, its first reception as WRONG_SEQUENCE.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from strainfmu.can.wire.compiled import ARRAY, INTEGER, NUMBER, Record, function, pointer
from strainfmu.can.wire.crc import Protection


class E2EStatus(Enum):
    """Result of one check."""

    __hash__ = object.__hash__  # in C, and by identity as equality is

    OK = "OK"
    """CRC correct, counter next in sequence."""
    OK_SOME_LOST = "OKSOMELOST"
    """CRC correct; up to max_delta - 1 frames before it are missing."""
    REPEATED = "REPEATED"
    """CRC correct, counter equal to the counter of the frame before."""
    WRONG_SEQUENCE = "WRONGSEQUENCE"
    """CRC correct, counter further off than max_delta."""
    ERROR = "ERROR"
    """CRC wrong: the frame was altered, or is of another sender or meaning."""
    NO_NEW_DATA = "NONEWDATA"
    """Nothing was received when something was due."""


USABLE = frozenset({E2EStatus.OK, E2EStatus.OK_SOME_LOST})
STATUSES = tuple(E2EStatus)
"""In the order of strainbus.h."""

_LONGEST = 64
"""Bytes of a frame, for which there is room from the start."""


class CheckRecord(Record):
    """CRC and counter of one frame for compiled code."""

    position = 7
    _fields_ = (
        *((name, INTEGER) for name in ("profile", "data_id", "end", "counter_byte", "counter_bits", "modulus")),
        *((name, INTEGER) for name in ("max_delta", "capacity")),
        ("period", NUMBER),
        *((name, ARRAY) for name in ("heard", "content", "content_before")),
        *((name, INTEGER) for name in ("n_content", "n_content_before", "counter", "before")),
        *((name, INTEGER) for name in ("conflicts", "alternates")),
    )


class ReceptionCheck:
    """CRC and counter of successive receptions of one frame, in compiled code.

    Parameters
    ----------
    protection : of this frame.
    max_delta : maximum counter step that is accepted (MaxDeltaCounter).
    n_covered : maximum number of bytes of other frames under the same CRC.
    period : nominal time from one frame to the next [s]; a counter that comes again after half its values' time
        may be of the same sender.
    """

    def __init__(self, protection: Protection, max_delta: int, n_covered: int = 0, *, period: float) -> None:
        byte, bits = protection.counter_place
        modulus, capacity = protection.counter_modulus, _LONGEST + n_covered
        self.record = CheckRecord(
            profile=protection.profile,
            data_id=protection.data_id,
            end=-1 if protection.end is None else protection.end,
            counter_byte=byte,
            counter_bits=bits,
            modulus=modulus,
            max_delta=max_delta,
            capacity=capacity,
            period=period,
            heard=np.full(modulus, -np.inf),
            content=np.zeros(capacity, dtype=np.uint8),
            content_before=np.zeros(capacity, dtype=np.uint8),
            n_content=-1,
            n_content_before=-1,
            counter=modulus - 1,
            before=modulus - 1,
            conflicts=0,
            alternates=0,
        )
        self._at, self._check = pointer(self.record), function("sb_check", CheckRecord)
        self._time = np.zeros(1)
        self._at_time = pointer(self._time)

    def check(self, data: bytes, covered: bytes = b"", time: float = 0.0) -> E2EStatus:
        """Return the status of ``data`` (with ``covered``, bytes of other frames under the same CRC).

        ``time`` is when it came [s].

        Raises
        ------
        ValueError
            They are longer than a frame and ``n_covered``.
        """
        if len(data) + len(covered) > self.record.capacity:
            raise ValueError(f"expected up to {self.record.capacity} bytes, got {len(data) + len(covered)}")
        self._time[0] = time
        return STATUSES[self._check(self._at, self._at_time, data, len(data), covered, len(covered))]

    @property
    def conflicts(self) -> bool:
        """The last frame had a correct CRC and, too early for it, the counter of one of the two before it.

        Its data are other ones than theirs.
        """
        return bool(self.record.conflicts)

    @property
    def alternates(self) -> bool:
        """It had the counter next to the counter of the frame before the last, as with two senders in turns.

        A frame that was missing and comes late is none.
        """
        return bool(self.record.alternates)
