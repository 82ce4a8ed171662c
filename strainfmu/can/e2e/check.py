"""The E2E check of a protected frame against the one before it.

Status names, their order of precedence and what happens to the stored counter are those of AUTOSAR's E2E_P05Check
(PRS_E2EProtocol, profile 5); profile 1 is reported in the same terms, its first reception as WRONG_SEQUENCE.
"""

from __future__ import annotations

from enum import Enum

from strainfmu.can.wire.crc import Protection, crc_check


class E2EStatus(Enum):
    """Result of one check."""

    __hash__ = object.__hash__  # in C, and by identity as equality is

    OK = "OK"
    """CRC correct, counter next in sequence."""
    OK_SOME_LOST = "OKSOMELOST"
    """CRC correct; up to max_delta - 1 frames before it are missing."""
    REPEATED = "REPEATED"
    """CRC correct, counter equal to that of the frame before."""
    WRONG_SEQUENCE = "WRONGSEQUENCE"
    """CRC correct, counter further off than max_delta."""
    ERROR = "ERROR"
    """CRC wrong: the frame was altered, or is of another sender or meaning."""
    NO_NEW_DATA = "NONEWDATA"
    """Nothing was received when something was due."""


USABLE = frozenset({E2EStatus.OK, E2EStatus.OK_SOME_LOST})
_OK = E2EStatus.OK


class ReceptionCheck:
    """CRC and counter of successive receptions of one frame.

    Parameters
    ----------
    protection : of this frame.
    max_delta : maximum counter step that is accepted (MaxDeltaCounter).
    """

    def __init__(self, protection: Protection, max_delta: int) -> None:
        self._protection = protection
        self._max_delta = max_delta
        self._modulus = protection.counter_modulus
        self._fits = crc_check(protection)
        self._byte, self._bits = protection.counter_place
        self.counter = self._before = self._modulus - 1
        self._content: tuple[bytes, bytes] | None = None
        self._content_before: tuple[bytes, bytes] | None = None
        self.conflicts = self.alternates = False
        """The last frame had a correct CRC and the counter of one of the two before, with other data; or the
        counter next to that of the one before the last, as with two senders in turns."""

    def check(self, data: bytes, covered: bytes = b"") -> E2EStatus:
        """Return the status of ``data`` (with ``covered``, bytes of other frames under the same CRC)."""
        self.conflicts = self.alternates = False
        fits = self._fits  # a function, not a method: called as one it is looked up twice
        if not fits(data, covered):
            return E2EStatus.ERROR
        counter, modulus = data[self._byte] & self._bits, self._modulus
        if counter >= modulus:
            return E2EStatus.ERROR
        last = self.counter
        delta = (counter - last) % modulus
        if delta == 0:
            self.conflicts = self._content is not None and self._content != (data, covered)
            return E2EStatus.REPEATED
        before, self._before, self.counter = self._before, last, counter
        content, self._content_before = self._content_before, self._content
        self._content = data, covered
        if delta == 1:
            return _OK
        if delta <= self._max_delta:
            return E2EStatus.OK_SOME_LOST
        self.alternates = 1 <= (counter - before) % self._modulus <= self._max_delta
        self.conflicts = counter == before and content is not None and content != self._content
        return E2EStatus.WRONG_SEQUENCE
