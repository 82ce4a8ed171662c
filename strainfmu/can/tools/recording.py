"""The recorder of a bus: BLF, ASC or candump's log, written by a thread of its own, on disk within a second.

Beside the log lies LOG.json, with which a replay repeats the run.
"""

from __future__ import annotations

import hashlib
import json
import struct
import threading
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from time import monotonic_ns
from typing import Any

from strainfmu.can.bridge.options import BridgeOptions
from strainfmu.can.tools.log_description import SIDECAR_VERSION, plain_options, sidecar
from strainfmu.can.tools.log_files import open_log
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.libraries import error_line
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically

LOG_SUFFIXES = (".blf", ".asc", ".log")

FLUSH_PERIOD = 0.25
"""Time between two flushes [s]: a quarter of the time that a killed process may lose."""

WAITING_FRAMES = 200_000
"""Maximum number of frames that wait for the disk; further ones are counted and dropped."""
HELD_BACK = 0.1
"""Time for which frames wait to be put in order [s]: what waited in a socket is older than what was sent."""

AT_A_TIME = 50
"""Frames after which the recorder lets the bridge's thread run: it must not wait for a whole flush."""


class MicrosecondClock:
    """A monotonic clock of whole microseconds, set to the time of day, to the millisecond, at its start.

    All log formats hold such times exactly, so that a replay sees the times that the live run saw.
    """

    def __init__(self) -> None:
        self.start = round(1e3 * time.time()) / 1e3
        # What the time since 1970 is ahead of the monotonic one [ns].
        self._ahead = 1_000_000 * round(1e3 * self.start) - monotonic_ns()

    def __call__(self) -> float:
        """Return the time since 1970 [s], without steps of the system's clock after the start."""
        return (monotonic_ns() + self._ahead) // 1000 / 1e6


def whole_microseconds(timestamp: float) -> float:
    """Return the time [s] that :class:`MicrosecondClock` gave, from the same time read from a log."""
    return round(1e6 * timestamp) / 1e6


class Recorder:
    """Writes frames to a log until it is closed; neither a slow disk nor a full one holds up the bridge.

    Raises
    ------
    InputError
        The format does not hold all frames of a bus, or the file exists already.
    StrainfmuError
        The file cannot be written, or python-can is not installed.
    """

    def __init__(self, path: Path, clock: MicrosecondClock) -> None:
        check_log(path)
        if path.exists() or sidecar(path).exists():
            raise InputError(f"{path}: is there already; a recording overwrites nothing")
        self.path, self.clock = path, clock
        self.recorded = self.lost = 0
        self.failure = ""
        self._unflushed = 0
        self._waiting: deque[tuple[Frame, bool]] = deque()
        self._room = WAITING_FRAMES  # 0 after a failure
        self._held: list[tuple[Frame, bool]] = []
        self._description: dict[str, Any] = {}
        self._stop = threading.Event()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._log = open_log(path, clock.start)
        except OSError as error:
            raise StrainfmuError(f"{path}: could not be written: {error.strerror or error}") from error
        self._thread = threading.Thread(target=self._run, name="CAN recorder", daemon=True)
        self._thread.start()

    def describe(self, fmu: Path, options: BridgeOptions, start: float, freshness: int | None = None) -> None:
        """Write the description for a replay: FMU, options, start of the core [s], freshness value then."""
        self._description = {
            "version": SIDECAR_VERSION,
            "fmu": fmu.name,
            "fmu_sha256": hashlib.sha256(fmu.read_bytes()).hexdigest(),
            "options": plain_options(options),
            "log_start": self.clock.start,
            "start": start,
            "freshness": freshness,
        }
        self._write_sidecar()

    def received(self, frame: Frame) -> None:
        """Record a frame that was received at its time."""
        if len(self._waiting) < self._room:
            self._waiting.append((frame, True))
        else:
            self.lost += 1

    def sent(self, frame: Frame) -> None:
        """Record a frame that was sent at its time."""
        if len(self._waiting) < self._room:
            self._waiting.append((frame, False))
        else:
            self.lost += 1

    def close(
        self,
        end: float | None = None,
        skips: Sequence[tuple[float, float]] = (),
        unanswered: Sequence[tuple[float, float]] = (),
    ) -> None:
        """Write the waiting frames and close the log; further calls do nothing.

        Parameters
        ----------
        end : time to which the core was advanced [s].
        skips, unanswered : the core's.
        """
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join(60.0)
        if self._description:
            self._description |= {
                "end": end,
                "skips": list(skips),
                "unanswered": list(unanswered),
                "recorded": self.recorded,
                "lost": self.lost,
            }
            try:
                self._write_sidecar()
            except (OSError, StrainfmuError) as error:  # the first one stays, without the end of the run
                self.failure = self.failure or f"description not completed: {error_line(error)}"

    def _run(self) -> None:
        try:
            while not self._stop.wait(FLUSH_PERIOD):
                self._drain(HELD_BACK)
            self._drain(0.0)
            self._log.close()
        except Exception as error:  # a full disk, in most cases; the bridge must go on
            self._room = 0
            self.failure = " ".join(str(getattr(error, "strerror", None) or error).split()) or type(error).__name__
            self._log.give_up()
            self.lost += len(self._waiting) + len(self._held) + self._unflushed
            self.recorded -= self._unflushed
            self._waiting.clear()
            self._held.clear()

    def _drain(self, held_back: float) -> None:
        """Write the waiting frames in the order of their times, but for frames of the last ``held_back`` [s]."""
        self._held += [self._waiting.popleft() for _ in range(len(self._waiting))]
        self._held.sort(key=_time_of)
        end = len(self._held)
        if held_back and end:
            end = bisect_right(self._held, self._held[-1][0].time - held_back, key=_time_of)
        ready, self._held = self._held[:end], self._held[end:]
        self._unflushed = 0
        for number, (frame, is_received) in enumerate(ready):
            try:
                self._log.add(frame, is_received)
            except (struct.error, ValueError, TypeError, OverflowError):  # the format cannot hold this frame
                self.lost += 1
            else:
                self.recorded += 1
                self._unflushed += 1
            if number % AT_A_TIME == 0:
                time.sleep(0.0)
        self._log.flush()
        self._unflushed = 0

    def _write_sidecar(self) -> None:
        write_bytes_atomically(sidecar(self.path), json.dumps(self._description, indent=1).encode())


def _time_of(entry: tuple[Frame, bool]) -> float:
    return entry[0].time


def check_log(path: Path) -> None:
    """Refuse a log format that loses data.

    Raises
    ------
    InputError
        It is none of LOG_SUFFIXES.
    """
    if path.suffix.lower() in LOG_SUFFIXES:
        return
    reasons = {
        ".db": "python-can loses rows of it on stop",
        ".trc": "it holds neither CAN FD nor error frames",
        ".csv": "it does not distinguish CAN FD frames from others",
        ".mf4": "it is on disk only at its end",
    }
    reason = reasons.get(path.suffix.lower())
    raise InputError(
        f"{path}: expected one of {', '.join(LOG_SUFFIXES)}, got '{path.suffix}'{f'; {reason}' if reason else ''}"
    )
