"""The authenticator of a frame: truncated CMAC with AES-128 over data ID, authentic bytes and freshness value.

Layout and order are as in AUTOSAR SecOC: the authenticator is computed over the data ID (16 bit, high byte
first), the authentic bytes and the complete freshness value (64 bit, high byte first). In the frame the low 48
bits of the freshness value and the first 8 bytes of the authenticator follow the authentic bytes.
Sources: AUTOSAR PRS_SecOcProtocol (document 969), SWS_SecureOnboardCommunication (document 654); CMAC: NIST
SP 800-38B, RFC 4493.
"""

from __future__ import annotations

import hmac
import re
from dataclasses import dataclass
from pathlib import Path

from strainfmu.can.wire.libraries import import_cmac
from strainfmu.errors import InputError
from strainfmu.files import check_private

FRESHNESS_BYTES = 6
"""Bytes of the freshness value in a frame: 4 of the message counter, 2 of the trip counter, low byte first."""

AUTHENTICATOR_BYTES = 8
"""Bytes of the authenticator in a frame; NIST SP 800-38B asks for at least 64 bits."""

MESSAGE_BITS = 32
"""Bits of the message counter, the low part of the freshness value; the trip counter is above them."""

_SENT = 1 << 8 * FRESHNESS_BYTES
_LARGEST = (1 << 64) - 1
_KEY_BYTES = 16


class AuthenticationKey:
    """A key of AES-128. Its text shows the check value alone.

    Parameters
    ----------
    secret : 16 bytes.

    Raises
    ------
    InputError
        There are not 16 bytes.
    StrainfmuError
        The package cryptography is not installed.
    """

    def __init__(self, secret: bytes) -> None:
        if len(secret) != _KEY_BYTES:
            raise InputError(f"key: expected {_KEY_BYTES} bytes, got {len(secret)}")
        cmac, algorithms = import_cmac()
        self._cmac = cmac.CMAC(algorithms.AES(secret))
        self.check_value = self.mac(b"strainfmu check value")[:3].hex()
        """Text that differs between keys and does not give the key away."""

    def __repr__(self) -> str:
        return f"AuthenticationKey(check_value={self.check_value!r})"

    def mac(self, data: bytes) -> bytes:
        """Return the CMAC of ``data``, 16 bytes."""
        running = self._cmac.copy()
        running.update(data)
        return bytes(running.finalize())


@dataclass(frozen=True)
class Secured:
    """Authentication of one frame.

    Attributes
    ----------
    data_id : 16 bit number known to both ends and not in the frame; it distinguishes frames.
    length : authentic bytes; freshness value and authenticator follow.
    """

    data_id: int
    length: int


def load_key(path: Path) -> AuthenticationKey:
    """Return the key in the text file ``path``: 32 hexadecimal digits, blanks between them allowed.

    Raises
    ------
    InputError
        The file is missing, may be read or written by others than its owner, or holds anything else; the message
        does not show what.
    StrainfmuError
        The package cryptography is not installed.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: the key could not be read: {error.strerror or error}") from error
    check_private(path)
    digits = b"".join(content.split())
    if not re.fullmatch(rb"[0-9A-Fa-f]{32}", digits):
        are_hex = re.fullmatch(rb"[0-9A-Fa-f]*", digits) is not None
        found = f"{len(digits)} of them" if are_hex else f"{len(digits)} characters, not all of them such digits"
        raise InputError(f"{path}: expected a key of AES-128, 32 hexadecimal digits, got {found}")
    return AuthenticationKey(bytes.fromhex(digits.decode()))


def freshness_of(trip: int, message: int) -> int:
    """Return the freshness value of 64 bits; messages beyond 32 bits carry over into the trip counter.

    Raises
    ------
    InputError
        The counters are used up: it is time for another key.
    """
    value = (trip << MESSAGE_BITS) + message
    if not 0 <= value <= _LARGEST:
        raise InputError(
            f"freshness value: trip {trip}, message {message} found, 64 bits allowed: use another key"
        )
    return value


def sent_freshness(data: bytes, secured: Secured, newest: int) -> int:
    """Return the complete freshness value of a frame: of all that fit its 48 bits the nearest to ``newest``."""
    low = int.from_bytes(data[secured.length : secured.length + FRESHNESS_BYTES], "little")
    value = newest - newest % _SENT + low
    if value - newest > _SENT // 2 and value >= _SENT:
        return value - _SENT
    if newest - value > _SENT // 2 and value + _SENT <= _LARGEST:
        return value + _SENT
    return value


def authenticated(data: bytes, secured: Secured, key: AuthenticationKey, freshness: int) -> bytes:
    """Return ``data`` with freshness value and authenticator written into it."""
    head = data[: secured.length]
    sent = (freshness % _SENT).to_bytes(FRESHNESS_BYTES, "little")
    return head + sent + authenticator_of(head, secured, key, freshness)


def is_authentic(data: bytes, secured: Secured, key: AuthenticationKey, freshness: int) -> bool:
    """Return whether the authenticator in ``data`` is the one of its authentic bytes with ``freshness``."""
    expected = authenticator_of(data[: secured.length], secured, key, freshness)
    return hmac.compare_digest(expected, data[secured.length + FRESHNESS_BYTES :])


def authenticator_of(head: bytes, secured: Secured, key: AuthenticationKey, freshness: int) -> bytes:
    """Return the truncated authenticator of the authentic bytes ``head``."""
    whole = secured.data_id.to_bytes(2, "big") + head + freshness.to_bytes(8, "big")
    return key.mac(whole)[:AUTHENTICATOR_BYTES]
