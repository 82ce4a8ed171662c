"""Journal of a campaign: its finished flows, on disk as soon as each is solved.

A file next to the result to which records are appended, each forced to the disk before the next is begun. So a
kill or a power cut loses no finished flow, and at worst leaves a torn record at the end, which the next reader
drops.

One record: ``FLOW``, length of the payload (8 bytes, little-endian), SHA-256 of what follows (32 bytes),
fingerprint of the engine's inputs (16 ASCII characters), payload: the flow as an uncompressed numpy archive.
"""

from __future__ import annotations

import hashlib
import io
import os
import struct
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np

from builder.aero.engine import Flow, FlowKey
from strainfmu.errors import StrainfmuError

MARK = b"FLOW"
HEADER = struct.Struct("<4sQ32s16s")


class Journal:
    """The journal of the campaign whose result is ``result``, open for reading and appending by one process.

    Flows of other engine inputs are left in it: they are valid again when those inputs come back.

    Raises
    ------
    StrainfmuError
        Another campaign is writing it, or it cannot be written.
    """

    def __init__(self, result: Path) -> None:
        self.path = journal_path(result)
        try:
            self._stream = _open_locked(self.path)
        except BlockingIOError as error:
            raise StrainfmuError(f"{result}: another campaign is writing it") from error
        except OSError as error:
            raise StrainfmuError(f"{self.path}: could not be written: {error.strerror or error}") from error
        self._flows: dict[tuple[str, FlowKey], Flow] = {}
        sound_bytes = self.reread()
        if sound_bytes < os.fstat(self._stream.fileno()).st_size:
            self._write(lambda: self._stream.truncate(sound_bytes))
        self._stream.seek(sound_bytes)

    def reread(self) -> int:
        """Take the flows from the disk, which after an interrupt may be one more; return the bytes they fill."""
        self._stream.seek(0)
        self._flows, sound_bytes = read_records(self._stream.read())
        return sound_bytes

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it; an empty one is removed."""
        if not self._flows:
            self.remove()
        self._stream.close()

    def flows(self, fingerprint: str) -> dict[FlowKey, Flow]:
        """Return the flows that were solved with the engine inputs of this fingerprint."""
        return {key: flow for (engine_hash, key), flow in self._flows.items() if engine_hash == fingerprint}

    def append(self, fingerprint: str, flow: Flow) -> None:
        """Add one flow; it is on the disk when this returns.

        Raises
        ------
        StrainfmuError
            The operating system refused; what was there before can still be read.
        """
        record = encode_record(fingerprint, flow)
        self._write(lambda: _write_whole(self._stream, record))
        self._flows[fingerprint, flow.key] = flow

    def remove(self) -> None:
        """Remove the file, once everything in it is in the result or there is nothing in it."""
        with suppress(OSError):
            self.path.unlink()
        self._flows.clear()

    def _write(self, change: Callable[[], object]) -> None:
        try:
            change()
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise StrainfmuError(f"{self.path}: could not be written: {error.strerror or error}") from error


def journal_path(result: Path) -> Path:
    """Return where the journal of ``result`` is: next to it."""
    return result.with_name(f"{result.name}.journal")


def encode_record(fingerprint: str, flow: Flow) -> bytes:
    """Return one record of the journal."""
    stream = io.BytesIO()
    # Arrays have names of the engine's choice; the prefix keeps them apart from ours.
    entries: dict[str, Any] = {f"array.{name}": values for name, values in flow.arrays.items()}
    entries |= {"key": np.array(flow.key), "repairs": flow.repairs}
    entries |= {"momentum_error": flow.momentum_error, "mass_error": flow.mass_error}
    np.savez(stream, allow_pickle=False, **entries)
    name, payload = fingerprint.encode(), stream.getvalue()
    return HEADER.pack(MARK, len(payload), hashlib.sha256(name + payload).digest(), name) + payload


def read_records(content: bytes) -> tuple[dict[tuple[str, FlowKey], Flow], int]:
    """Return the flows by (fingerprint, key), and how many bytes of ``content`` hold whole records.

    Reading ends at the first record that is torn or whose hash is wrong.
    """
    flows: dict[tuple[str, FlowKey], Flow] = {}
    start = 0
    while start + HEADER.size <= len(content):
        mark, length, digest, name = HEADER.unpack_from(content, start)
        end = start + HEADER.size + length
        payload = content[start + HEADER.size : end]
        if mark != MARK or end > len(content) or hashlib.sha256(name + payload).digest() != digest:
            break
        try:
            flow = _decode(payload)
        except (ValueError, KeyError, zipfile.BadZipFile):
            break
        flows[name.decode("ascii", "replace"), flow.key] = flow
        start = end
    return flows, start


def _decode(payload: bytes) -> Flow:
    with np.load(io.BytesIO(payload), allow_pickle=False) as stored:
        return Flow(
            key=tuple(stored["key"].tolist()),
            arrays={
                name.removeprefix("array."): stored[name] for name in stored.files if name.startswith("array.")
            },
            momentum_error=float(stored["momentum_error"]),
            mass_error=float(stored["mass_error"]) if "mass_error" in stored.files else float("nan"),
            repairs=int(stored["repairs"]),
        )


def _open_locked(path: Path) -> BinaryIO:
    """Open ``path`` for one process at a time.

    Raises
    ------
    BlockingIOError
        Another process has it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    while True:
        # Unbuffered: a record is one write, and a failed one leaves nothing behind to be written later.
        stream = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+b", buffering=0)
        try:
            _lock(stream)
            # Whoever had the lock may have removed the file meanwhile: then this one is nobody's journal.
            if path.exists() and os.path.samestat(os.fstat(stream.fileno()), path.stat()):
                return stream
        except BaseException:
            stream.close()
            raise
        stream.close()


def _write_whole(stream: BinaryIO, record: bytes) -> None:
    rest = memoryview(record)
    while rest:
        rest = rest[stream.write(rest) :]


def _lock(stream: BinaryIO) -> None:
    """Take the file until it is closed, however the process ends; without effect where there is no ``flock``."""
    try:
        from fcntl import LOCK_EX, LOCK_NB, flock
    except ImportError:
        return
    flock(stream, LOCK_EX | LOCK_NB)
