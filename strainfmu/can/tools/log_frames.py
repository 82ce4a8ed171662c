"""The frames of a log, in order, with their time stamps."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from strainfmu.can.tools.recording import check_log, whole_microseconds
from strainfmu.can.wire.frame import Frame, from_message
from strainfmu.can.wire.libraries import import_can
from strainfmu.errors import InputError


@dataclass
class LogState:
    """Findings of reading a log.

    Attributes
    ----------
    ends_early : reason, for a log that was not closed.
    backwards : number of frames with a time before the previous one; they count at the time of that one.
    """

    ends_early: str = ""
    backwards: int = 0


def log_frames(
    path: Path, origin: float, state: LogState, progress: Callable[[int, int], None] | None = None
) -> Iterator[tuple[Frame, bool]]:
    """Yield frames and whether they were received; times [s], those of ASC from ``origin`` on.

    The log of a killed process may end anywhere; all whole frames are read.

    Raises
    ------
    InputError
        The file is missing, of another format, or no log.
    """
    check_log(path)
    can = import_can()
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    size = path.stat().st_size
    from can.io.blf import BLFParseError

    last, count = -float("inf"), 0
    with path.open("rb") as raw:
        damaged = (
            struct.error,
            zlib.error,
            ValueError,
            IndexError,
            EOFError,
            KeyError,
            can.CanError,
            BLFParseError,
        )
        try:
            for message in _reader(path, raw):
                time = whole_microseconds(message.timestamp + (origin if path.suffix.lower() == ".asc" else 0.0))
                state.backwards += time < last
                last = max(time, last)
                count += 1
                if progress is not None and count % 2000 == 0:
                    progress(raw.tell(), size)
                yield from_message(message, last), message.is_rx
        except damaged as error:
            if count == 0:
                raise InputError(f"{path}: damaged, or no log of this format") from error
            state.ends_early = f"the log ends in the middle of a frame, after {count} whole ones"
    if progress is not None:
        progress(size, size)


def _reader(path: Path, raw: Any) -> Any:
    """Return python-can's reader on the open file."""
    from can.io import ASCReader, BLFReader, CanutilsLogReader

    kind = path.suffix.lower()
    if kind == ".blf":
        return BLFReader(raw)
    text = io.TextIOWrapper(raw, encoding="utf-8", errors="replace")
    return ASCReader(text) if kind == ".asc" else CanutilsLogReader(text)
