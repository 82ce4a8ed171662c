"""Everything on the bus into a log: BLF, ASC or candump's log, by a thread of its own, on disk within a second.

Beside the log lies LOG.json: the bridge's options, its start and its end, so that a replay is the run again.
"""

from __future__ import annotations

import hashlib
import json
import struct
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any, get_args, get_type_hints

from strainfmu.can.bridge.bus import import_can
from strainfmu.can.bridge.setup import BridgeOptions
from strainfmu.can.wire.frame import Frame, to_message
from strainfmu.can.wire.profiles import Identifiers
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically

LOG_SUFFIXES = (".blf", ".asc", ".log")

FLUSH_PERIOD = 0.25
"""Time between two flushes [s]: a quarter of what may be lost when the process is killed."""

WAITING_FRAMES = 200_000
"""Frames that wait for the disk at most; what comes beyond is counted, not kept."""

_SIDECAR_VERSION = 1
_BUFFER = 1 << 20
"""Bytes of the file's buffer: a flush is one write, so that a kill finds a container whole or not at all."""


class MicrosecondClock:
    """A monotonic clock of whole microseconds, set to the time of day, to the millisecond, at its start.

    All log formats hold such times exactly, so that a replay sees the times that the live run saw.
    """

    def __init__(self) -> None:
        self.start = round(1e3 * time.time()) / 1e3
        self._start = 1000 * round(1e3 * self.start)
        self._origin = time.monotonic_ns()

    def __call__(self) -> float:
        """Return the time [s] since 1970, as it would be without leaps since the start."""
        return (self._start + (time.monotonic_ns() - self._origin) // 1000) / 1e6


def whole_microseconds(timestamp: float) -> float:
    """Return the time [s] that :class:`MicrosecondClock` gave, from the same time read from a log."""
    return round(1e6 * timestamp) / 1e6


class Recorder:
    """Writes frames to a log until it is closed; neither a slow disk nor a full one holds up the bridge.

    Raises
    ------
    InputError
        The format is not one that holds all of a bus, or the file is there already.
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
        self._waiting: deque[tuple[Frame, bool]] = deque()
        self._description: dict[str, Any] = {}
        self._stop = threading.Event()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._log = _LogFile(path, clock.start)
        except OSError as error:
            raise StrainfmuError(f"{path}: could not be written: {error.strerror or error}") from error
        self._thread = threading.Thread(target=self._run, name="CAN recorder", daemon=True)
        self._thread.start()

    def describe(self, fmu: Path, options: BridgeOptions, start: float) -> None:
        """Write what a replay needs to know: which FMU, which options, when the core began [s]."""
        self._description = {
            "version": _SIDECAR_VERSION,
            "fmu": fmu.name,
            "fmu_sha256": hashlib.sha256(fmu.read_bytes()).hexdigest(),
            "options": _plain_options(options),
            "log_start": self.clock.start,
            "start": start,
        }
        self._write_sidecar()

    def received(self, frame: Frame) -> None:
        """Take a frame that was received; its time is when."""
        self._put(frame, True)

    def sent(self, frame: Frame) -> None:
        """Take a frame that was sent; its time is when."""
        self._put(frame, False)

    def close(
        self,
        end: float | None = None,
        skips: Sequence[tuple[float, float]] = (),
        unanswered: Sequence[tuple[float, float]] = (),
    ) -> None:
        """Write what waits and close the log, at the first call.

        Parameters
        ----------
        end : up to when the core was advanced [s].
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
            self._write_sidecar()

    def _put(self, frame: Frame, is_received: bool) -> None:
        if self.failure or len(self._waiting) >= WAITING_FRAMES:
            self.lost += 1
            return
        self._waiting.append((frame, is_received))

    def _run(self) -> None:
        try:
            while not self._stop.wait(FLUSH_PERIOD):
                self._drain()
            self._drain()
            self._log.close()
        except Exception as error:  # a full disk, in most cases; the bridge must go on
            self.failure = " ".join(str(getattr(error, "strerror", None) or error).split()) or type(error).__name__
            self.lost += len(self._waiting)
            self._waiting.clear()

    def _drain(self) -> None:
        for _ in range(len(self._waiting)):
            frame, is_received = self._waiting.popleft()
            try:
                self._log.write(frame, is_received)
            except (struct.error, ValueError, TypeError, OverflowError):
                # One frame that the format cannot hold, unless it is the file; a disk that fails raises OSError.
                if self._log.is_closed:
                    raise
                self.lost += 1
            else:
                self.recorded += 1
        self._log.flush()

    def _write_sidecar(self) -> None:
        write_bytes_atomically(sidecar(self.path), json.dumps(self._description, indent=1).encode())


class _LogFile:
    """One of python-can's writers, made to put onto the disk what it has when it is told to."""

    def __init__(self, path: Path, start: float) -> None:
        import_can()
        from can.io import ASCWriter, BLFWriter, CanutilsLogWriter

        kind = path.suffix.lower()
        self._is_blf = kind == ".blf"
        self._writer: Any
        if self._is_blf:
            self._file: Any = path.open("xb", buffering=_BUFFER)
            self._writer = BLFWriter(self._file, compression_level=1)
            # Set here and not by the first frame, so that the header is right from the first flush on.
            self._writer.start_timestamp = self._writer.stop_timestamp = start
            self.flush()
            return
        self._file = path.open("x", encoding="utf-8", newline="\n", buffering=_BUFFER)
        self._writer = (ASCWriter if kind == ".asc" else CanutilsLogWriter)(self._file)
        if kind == ".asc":
            self._writer.log_event("strainfmu bridge", start)
        self.flush()

    def write(self, frame: Frame, is_received: bool) -> None:
        message = to_message(frame)
        message.timestamp, message.is_rx = frame.time, is_received
        self._writer.on_message_received(message)

    @property
    def is_closed(self) -> bool:
        return bool(self._file.closed)

    def flush(self) -> None:
        """Bring everything to the operating system, which keeps it whatever becomes of this process.

        BLFWriter has no public way to end a container early, nor to bring the header up to date.
        """
        if self._is_blf:
            while self._writer._buffer_size:
                self._writer._flush()
            self._file.flush()
            end = self._file.tell()
            self._file.seek(0)
            self._writer._write_header(end)
            self._file.flush()
            self._file.seek(end)
            return
        self._file.flush()

    def close(self) -> None:
        self._writer.stop()
        self._file.close()


def check_log(path: Path) -> None:
    """Refuse a log format that loses something.

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
        ".csv": "it does not tell CAN FD frames from others",
        ".mf4": "it is not on the disk before its end",
    }
    reason = reasons.get(path.suffix.lower())
    raise InputError(
        f"{path}: '{path.suffix}' found, one of {', '.join(LOG_SUFFIXES)} wanted{f'; {reason}' if reason else ''}"
    )


def sidecar(path: Path) -> Path:
    """Return where the description of a log lies."""
    return path.with_name(f"{path.name}.json")


def load_description(path: Path) -> dict[str, Any] | None:
    """Return the description of the log at ``path``, None if there is none.

    Raises
    ------
    InputError
        It is damaged or of another version.
    """
    beside = sidecar(path)
    if not beside.is_file():
        return None
    try:
        found = json.loads(beside.read_text())
        if found.get("version") != _SIDECAR_VERSION:
            raise InputError(f"{beside}: version {found.get('version')} found, {_SIDECAR_VERSION} wanted")
        return {**found, **_run(found), "options": _options(found["options"])}
    except KeyError as error:
        raise InputError(f"{beside}: damaged: no entry {error}") from error
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(f"{beside}: damaged: {' '.join(str(error).split())[:200]}") from error


def _run(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a description says of the run itself, times in s; raise if an entry is of another kind."""
    run: dict[str, Any] = {name: _checked(name, found[name], str) for name in ("fmu", "fmu_sha256")}
    run |= {name: _checked(name, found[name], float) for name in ("start", "log_start")}
    run["end"] = _checked("end", found.get("end"), float | None)
    run["lost"] = _checked("lost", found.get("lost", 0), int)
    for name in ("skips", "unanswered"):
        run[name] = [(_checked(name, a, float), _checked(name, b, float)) for a, b in found.get(name, ())]
    return run


def _checked(name: str, value: Any, kind: Any) -> Any:
    """Return ``value`` if it is of ``kind``, a type or a union; a whole number is a float too.

    Raises
    ------
    ValueError
        It is of another kind, or no finite number.
    """
    kinds = get_args(kind) or (kind,)
    if type(value) is int and float in kinds:
        value = float(value)
    is_bool = isinstance(value, bool) and bool not in kinds
    if is_bool or not isinstance(value, kinds) or (isinstance(value, float) and not isfinite(value)):
        wanted = " or ".join("null" if one is type(None) else one.__name__ for one in kinds)
        raise ValueError(f"entry '{name}': {str(value)[:40]!r} found, {wanted} wanted")
    return value


def _plain_options(options: BridgeOptions) -> dict[str, Any]:
    """Return the options as JSON holds them; files by their whole path."""
    held = asdict(options)
    for name in ("dbc", "mapping"):
        held[name] = None if held[name] is None else str(Path(held[name]).resolve())
    return held


def _options(held: Mapping[str, Any]) -> BridgeOptions:
    """Return the options that :func:`_plain_options` gave; raise if one is missing or of another kind."""
    numbers = _checked("identifiers", held["identifiers"], dict)
    texts = _checked("bus_options", held["bus_options"], list)
    options: dict[str, Any] = {
        "identifiers": Identifiers(
            **{name: _checked(name, numbers[name], kind) for name, kind in _kinds(Identifiers)}
        ),
        "bus_options": tuple(_checked("bus_options", text, str) for text in texts),
    }
    for name in ("dbc", "mapping"):
        text = _checked(name, held[name], str | None)
        options[name] = None if text is None else Path(text)
    for name, kind in _kinds(BridgeOptions):
        if name not in options and name in held:
            options[name] = _checked(name, held[name], kind)
    return BridgeOptions(**options)


def _kinds(record: type) -> list[tuple[str, Any]]:
    """Return the names and types of a dataclass's entries."""
    return list(get_type_hints(record).items())
