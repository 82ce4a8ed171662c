"""The file that remembers the freshness value across runs, of a bridge and of a virtual sender.

A bridge reserves: the file names a value that its run has not reached yet, so that after a kill nothing that was
used is accepted again. A good end writes the value reached. A sender takes the next trip before its first frame.
"""

from __future__ import annotations

import json
import threading
from pathlib import Path
from types import TracebackType
from typing import Any

from strainfmu.can.e2e.authentication import Authentication
from strainfmu.can.wire.authenticator import MESSAGE_BITS, AuthenticationKey, freshness_of
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import check_private, write_bytes_atomically

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
        found = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputError(f"{path}: could not be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: damaged: no JSON; without it a recording passes for the sender") from error
    numbers = _numbers(found)
    if numbers is None:
        raise InputError(f"{path}: expected the format '{FORMAT}', version {VERSION}, with trip and message")
    if found.get("key_check_value") != key.check_value:
        raise InputError(
            f"{path}: is of another key, check value {str(found.get('key_check_value'))[:20]!r}, not "
            f"{key.check_value!r}; state another file as input.freshness"
        )
    return freshness_of(*numbers)


def _numbers(found: Any) -> tuple[int, int] | None:
    """Return trip and message counter of the content of a file, None of another content."""
    if not isinstance(found, dict) or (found.get("format"), found.get("version")) != (FORMAT, VERSION):
        return None
    trip, message = found.get("trip"), found.get("message")
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

    Raises
    ------
    InputError
        The file is damaged or of another key.
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
        """Write the file, to show that it can be written, and start to keep it.

        Raises
        ------
        StrainfmuError
            It cannot be written.
        """
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
