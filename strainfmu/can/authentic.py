"""The authenticator of a frame: truncated CMAC with AES-128 over data ID, authentic bytes and freshness value.

Layout and order are as in AUTOSAR SecOC: the authenticator is computed over the data ID (16 bit, high byte
first), the authentic bytes and the complete freshness value (64 bit, high byte first). In the frame the low 48
bits of the freshness value and the first 8 bytes of the authenticator follow the authentic bytes.
Sources: AUTOSAR PRS_SecOcProtocol (document 969), SWS_SecureOnboardCommunication (document 654); CMAC: NIST
SP 800-38B, RFC 4493.

A freshness value is accepted once per frame: the values of a frame rise strictly, and are never of an earlier trip
than the newest, and never at or below the value that earlier runs have reached. So a recording is refused,
whenever it was made, and a sender that was restarted shows itself by a new trip.

A file remembers the value across runs. A bridge reserves: the file names a value that its run has not reached yet,
so that after a kill nothing that was used is accepted again. A good end writes the value reached. A sender takes
the next trip before its first frame.
"""

from __future__ import annotations

import hmac
import json
import re
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import Any

from strainfmu.can.frame import import_cmac
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import check_private, write_bytes_atomically

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
        actual = f"{len(digits)} of them" if are_hex else f"{len(digits)} characters, not all of them such digits"
        raise InputError(f"{path}: expected a key of AES-128, 32 hexadecimal digits, got {actual}")
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
    message = secured.data_id.to_bytes(2, "big") + head + freshness.to_bytes(8, "big")
    return key.mac(message)[:AUTHENTICATOR_BYTES]


# --- freshness of the frames of one sender -----------------------------------------------------------------------

NOTHING = -1
"""Freshness value below all others."""


class Authenticity(Enum):
    """Verdict on one frame."""

    __hash__ = object.__hash__

    AUTHENTIC = "authentic"
    FORGED = "authenticator does not fit"
    NOT_FRESH = "authenticator fits, but the freshness value is not new"


class Authentication:
    """Checks the frames of one sender, by slot.

    Parameters
    ----------
    secured : authentication of each frame, None of those that have none.
    key : of all frames.
    """

    def __init__(self, secured: Sequence[Secured | None], key: AuthenticationKey) -> None:
        self._secured, self._key = tuple(secured), key
        self.on_first: Callable[[int], None] | None = None
        """Called with the freshness value of a run's and of a trip's first frame, before the frame is used."""
        self.begin(None)

    def begin(self, reached: int | None) -> None:
        """Start above the freshness value that earlier runs have ``reached``; None: any is new."""
        self.floor = NOTHING if reached is None else reached
        self.newest = self.floor
        self._last = [NOTHING] * len(self._secured)

    def check(self, slot: int, data: bytes) -> Authenticity:
        """Return the verdict on ``data`` of the frame ``slot``, and store its freshness value if it is used."""
        secured = self._secured[slot]
        if secured is None:
            return Authenticity.AUTHENTIC
        freshness = sent_freshness(data, secured, max(self.newest, 0))
        if not is_authentic(data, secured, self._key, freshness=freshness):
            return Authenticity.FORGED
        trip, newest_trip = freshness >> MESSAGE_BITS, self.newest >> MESSAGE_BITS
        if trip < newest_trip or freshness <= self.floor or freshness <= self._last[slot]:
            return Authenticity.NOT_FRESH
        if (trip > newest_trip or self.newest == self.floor) and self.on_first is not None:
            self.on_first(freshness)
        self._last[slot] = freshness
        self.newest = max(self.newest, freshness)
        return Authenticity.AUTHENTIC


# --- the file of the freshness value -----------------------------------------------------------------------------

FIRST_TRIP = 2
"""Trip counter of a sender without a file: there was an earlier trip, for the fault that repeats one."""

FORMAT, VERSION = "strainfmu freshness value", 1

RESERVED_TIME = 2.0
"""Time for which a bridge reserves [s]: so long, at most, does it refuse a sender after it was killed."""

_WATCH_PERIOD = 0.25


def freshness_file(key_file: Path, end: str) -> Path:
    """Return where the freshness value of one ``end`` of the bus lies unless it is stated: next to the key."""
    return key_file.with_name(f"{key_file.name}.{end}.json")


def load_freshness(path: Path, key: AuthenticationKey) -> int | None:
    """Return the freshness value in the file ``path``, None if there is no such file.

    Raises
    ------
    InputError
        The file is damaged, belongs to another key, or others than its owner may read or write it.
    """
    check_private(path)
    try:
        stored = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputError(f"{path}: could not be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: damaged: no JSON; without it a recording passes for the sender") from error
    numbers = _numbers(stored)
    if numbers is None:
        raise InputError(f"{path}: expected the format '{FORMAT}', version {VERSION}, with trip and message")
    if stored.get("key_check_value") != key.check_value:
        raise InputError(
            f"{path}: is of another key, check value {str(stored.get('key_check_value'))[:20]!r}, not "
            f"{key.check_value!r}; state another file as input.freshness"
        )
    return freshness_of(*numbers)


def _numbers(stored: Any) -> tuple[int, int] | None:
    """Return trip and message counter of the content of a file, None of another content."""
    if not isinstance(stored, dict) or (stored.get("format"), stored.get("version")) != (FORMAT, VERSION):
        return None
    trip, message = stored.get("trip"), stored.get("message")
    if type(trip) is not int or type(message) is not int:
        return None
    limit = 1 << MESSAGE_BITS
    return (trip, message) if 0 <= trip < limit and 0 <= message < limit else None


def save_freshness(path: Path, key: AuthenticationKey, freshness: int) -> None:
    """Write the freshness value atomically.

    Raises
    ------
    StrainfmuError
        The file cannot be written; it keeps its old content.
    """
    content = {
        "format": FORMAT,
        "version": VERSION,
        "key_check_value": key.check_value,
        "trip": freshness >> MESSAGE_BITS,
        "message": freshness % (1 << MESSAGE_BITS),
    }
    write_bytes_atomically(path, json.dumps(content, indent=1).encode(), is_private=True)


def next_trip(path: Path, key: AuthenticationKey) -> int:
    """Return the trip counter of a sender that starts now; it is written first.

    Raises
    ------
    InputError
        The file is damaged or of another key, or the trips are used up.
    StrainfmuError
        It cannot be written.
    """
    before = load_freshness(path, key)
    trip = FIRST_TRIP if before is None else (before >> MESSAGE_BITS) + 1
    save_freshness(path, key, freshness_of(trip, 0))
    return trip


class FreshnessKeeper:
    """Keeps the file of a running bridge ahead of the freshness values that its ``authentication`` accepts.

    A context: the file is written at the start, ahead of the first frame of the run and of every new trip,
    by a thread of its own while messages pass, and at the end.

    Parameters
    ----------
    path : of the file, which need not exist.
    authentication : begins where the file says.
    cycle_time : nominal period of the input [s].
    """

    def __init__(
        self, path: Path, key: AuthenticationKey, authentication: Authentication, cycle_time: float
    ) -> None:
        self._path, self._key, self._authentication = path, key, authentication
        self._margin = max(round(RESERVED_TIME / cycle_time), 1)
        self.start = load_freshness(path, key)
        """Freshness value that earlier runs reached, None without a file."""
        self.failure = ""
        """Why the file could not be written the last time; empty if it could."""
        self._reserved = -1
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="Freshness value", daemon=True)
        authentication.begin(self.start)
        authentication.on_first = self._reserve

    def __enter__(self) -> FreshnessKeeper:
        """Write the file, to show that it can be written, and start to keep it."""
        save_freshness(self._path, self._key, self.start or 0)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the value reached."""
        self._stop.set()
        self._thread.join(10.0)
        self._authentication.on_first = None
        if self._authentication.newest > self._authentication.floor:
            with self._lock:
                self._save(self._authentication.newest)

    @property
    def first_run_text(self) -> str:
        """What a user is to know before the first run with a key; empty before any other."""
        if self.start:
            return ""
        return f"{self._path}: no earlier run: recordings made with this key before now pass for the sender"

    @property
    def failure_text(self) -> str:
        """What a user is to know after a run whose file could not be written; empty if it could."""
        text = f"{self.failure}: the next bridge may take a recording of this run for the sender"
        return text if self.failure else ""

    def _run(self) -> None:
        while not self._stop.wait(_WATCH_PERIOD):
            newest = self._authentication.newest
            if newest > self._authentication.floor and newest + self._margin // 2 > self._reserved:
                self._reserve(newest)

    def _reserve(self, freshness: int) -> None:
        """Write a value that lies ahead of ``freshness``. Two threads do: never one below the last."""
        with self._lock:
            if freshness + self._margin > self._reserved:
                self._save(freshness + self._margin)

    def _save(self, freshness: int) -> None:
        """Write a value; the lock must be held."""
        try:
            save_freshness(self._path, self._key, freshness)
        except StrainfmuError as error:
            self.failure = str(error)
            return
        self._reserved, self.failure = freshness, ""
