"""The frames of a log, in order, with their time stamps: by python-can's readers, whose gaps are closed here."""

import gzip
import io
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from strainfmu.can.frame import Frame, error_line, from_message, import_can
from strainfmu.can.recording import whole_microseconds
from strainfmu.errors import InputError
from strainfmu.first_look import read_apart
from strainfmu.recorded.formats.mdf import opened_mdf
from strainfmu.recorded.formats.text import is_table

MF4, CSV = ".mf4", ".csv"
READABLE = (".asc", ".blf", CSV, ".log", MF4, ".trc")
"""Kinds of logs that are read, all but MF4 packed (.gz), too."""

_FROM_ZERO = (".asc", ".blf")
"""Kinds whose channels python-can counts from 0, and the file from 1."""

_CSV_HEAD = b"timestamp,arbitration_id,extended,"

_PLAIN = re.compile(
    r"\s*\((?P<time>\d+\.\d+)\)\s+(?P<channel>\S+)\s+(?:(?P<way>[RT]X)\s+\S\s+\S\s+)?(?P<id>[0-9A-Fa-f]{3,8})"
    r"\s+\[(?P<length>\d{1,2})\]\s*(?P<data>remote request|(?:[0-9A-Fa-f]{2}\b\s*)*)"
)
"""A frame as candump shows it without -L; CAN FD has two digits of length."""

_UNTIMED = re.compile(r"\s*\S+\s+[0-9A-Fa-f]{3,8}\s+\[\d{1,2}\]")
_ERROR_FRAME, _LARGEST_IDENTIFIER = 0x2000_0000, 0x1FFF_FFFF

_BUS_EVENT, _BUS, _CAN = 2, 2, 2
"""Flag of a channel group whose records are events of a bus, type of its source, and of the bus (ASAM MDF 4)."""

_LARGEST_TIME = 2.0**53 / 1e6
"""Time [s] from which on a float does not hold whole microseconds: no time stamp, but a damage."""

_RELATIVE = re.compile(r"\s*base\s+\w+\s+timestamps\s+relative\b", re.IGNORECASE)
_EVENT = re.compile(r"\s*(\d+\.\d+)(\s.*)", re.DOTALL)

FRAME_CHANNEL = "CAN_DataFrame"
"""Channel of an MF4 file that holds the frames of a bus (ASAM MDF, bus logging)."""


def is_bus_log(path: Path) -> bool:
    """Return whether a file is a log of a bus: by its name, unless it is a table of numbers, of MF4 if it holds
    frames and no other channels.
    """
    kind = log_kind(path)
    if kind == CSV:
        if not path.is_file():
            return False
        with (gzip.open if path.suffix.lower() == ".gz" else open)(path, "rb") as head:
            return bytes(head.read(len(_CSV_HEAD))) == _CSV_HEAD
    if kind != MF4:
        is_text = path.suffix.lower() in (".asc", ".log") and path.is_file()
        return kind in READABLE and not (is_text and is_table(path))
    with opened_mdf(path) as file:
        groups = [group for group in file.groups if group.channel_group.cycles_nr]
        are_of_bus = [any(channel.name.startswith("CAN_") for channel in group.channels) for group in groups]
        return FRAME_CHANNEL in file.channels_db and all(are_of_bus)


def log_kind(path: Path) -> str:
    """Return the suffix of a log's kind, in lower case; of a packed one (.gz) of what is in it."""
    return Path(path.stem if path.suffix.lower() == ".gz" else path.name).suffix.lower()


@dataclass
class LogState:
    """What is read of a log, and findings.

    Attributes
    ----------
    channel : the one whose frames are read, as the file names it; None: all.
    keys : of frames that may come on one channel alone.
    ends_early : reason, for a log that was not closed.
    backwards : number of frames with a time before the previous one; they count at the time of that one.
    channels : of all frames.
    """

    channel: str | None = None
    keys: frozenset[int] = frozenset()
    ends_early: str = ""
    backwards: int = 0
    channels: set[str] = field(default_factory=set)
    _channels: dict[int, str] = field(default_factory=dict)

    def is_read(self, path: Path, frame: Frame, channel: str) -> bool:
        """Return whether a frame is of the channel that is read.

        Raises
        ------
        InputError
            None is stated, and it comes on two.
        """
        self.channels.add(channel)
        if self.channel is not None or frame.key not in self.keys:
            return self.channel in (None, channel)
        first = self._channels.setdefault(frame.key, channel)
        if first != channel:
            raise InputError(
                f"{path}: frame 0x{frame.identifier:X} is on channels {first} and {channel}: state one as "
                f"bus.log_channel, by --set bus.log_channel={first} for instance"
            )
        return True


def log_frames(
    path: Path, origin: float, state: LogState, progress: Callable[[int, int], None] | None = None
) -> Iterator[tuple[Frame, bool]]:
    """Yield frames and whether they were received; times [s], of ASC from ``origin`` on.

    The log of a killed process may end anywhere; all whole frames are read.

    Raises
    ------
    InputError
        The file is missing, of another format, or no log.
    """
    kind = log_kind(path)
    if kind not in READABLE:
        raise InputError(f"{path}: expected one of {', '.join(READABLE)}, or one of them packed (.gz)")
    can = import_can()
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if kind == MF4:
        _check_mf4(path)
    size = path.stat().st_size
    from can.io.blf import BLFParseError

    last, count = -float("inf"), 0
    with ExitStack() as stack:
        raw = stack.enter_context(path.open("rb"))
        content = stack.enter_context(gzip.open(raw)) if path.suffix.lower() == ".gz" else raw
        damaged = (
            struct.error,
            zlib.error,
            ValueError,
            IndexError,
            EOFError,
            KeyError,
            can.CanError,
            BLFParseError,
            gzip.BadGzipFile,
        )
        try:
            for message in _reader(path, kind, content):
                stamp = message.timestamp + (origin if kind == ".asc" else 0.0)
                if not abs(stamp) <= _LARGEST_TIME:
                    raise ValueError(f"a time stamp of {stamp:g} s")
                time = whole_microseconds(stamp)
                state.backwards += time < last
                last = max(time, last)
                count += 1
                if progress is not None and count % 2000 == 0:
                    progress(raw.tell(), size)
                frame, channel = from_message(message, last), message.channel
                if kind in _FROM_ZERO and isinstance(channel, int):
                    channel += 1
                if state.is_read(path, frame, str(channel)):
                    yield frame, message.is_rx
        except damaged as error:
            if count == 0:
                raise InputError(f"{path}: damaged, or no log of this format") from error
            state.ends_early = f"the log is damaged, or ends in the middle of a frame, after {count} whole ones"
    if progress is not None:
        progress(size, size)


def _reader(path: Path, kind: str, raw: Any) -> Any:
    """Return python-can's reader on the open file, or what reads candump's log without -L."""
    from can.io import ASCReader, BLFReader, CanutilsLogReader, CSVReader, TRCReader

    if kind == MF4:
        return read_apart(path, lambda: _mf4_messages(path))
    if kind == ".blf":
        return _whole_objects(BLFReader)(raw)
    text = (_AscText if kind == ".asc" else io.TextIOWrapper)(raw, encoding="utf-8", errors="replace")
    if kind != ".log":
        return {".asc": ASCReader, CSV: CSVReader, ".trc": TRCReader}[kind](text)
    begin = next((line for line in text if line.strip()), "")
    text.seek(0)
    if _UNTIMED.match(begin):
        raise InputError(f"{path}: expected times of the frames, got none: record by candump -L, or with -ta")
    return _plain_frames(text) if _PLAIN.match(begin) else CanutilsLogReader(text)


def _plain_frames(lines: Iterator[str]) -> Iterator[Any]:
    """Yield the messages of a log of candump without -L."""
    can = import_can()
    for line in lines:
        if not (fields := _PLAIN.match(line)):
            if line.strip():
                raise ValueError(line)
            continue
        word, is_remote = int(fields["id"], 16), fields["data"] == "remote request"
        yield can.Message(
            timestamp=float(fields["time"]),
            channel=fields["channel"],
            arbitration_id=word & _LARGEST_IDENTIFIER,
            is_extended_id=len(fields["id"]) > 3,
            is_error_frame=bool(word & _ERROR_FRAME),
            is_remote_frame=is_remote,
            is_fd=len(fields["length"]) == 2,
            is_rx=fields["way"] != "TX",
            dlc=int(fields["length"]),
            data=b"" if is_remote else bytes.fromhex(fields["data"]),
            check=True,
        )


class _AscText(io.TextIOWrapper):
    """Lines of an ASC log with times since its start: python-can takes each time for one.

    With ``timestamps relative`` in the header a time counts from the event before, which need not be a frame.
    """

    _sum: float | None = None

    def __next__(self) -> str:  # type: ignore[override]  # as of TextIOWrapper itself
        line = super().__next__()
        if self._sum is None:
            self._sum = 0.0 if _RELATIVE.match(line) else None
        elif event := _EVENT.match(line):
            self._sum += float(event[1])
            return f"{self._sum:.9f}{event[2]}"
        return line


def _whole_objects(reader: Any) -> Any:
    """Return the class ``reader`` of BLF, ended by an object that states a size below its own header's.

    python-can would read it again and again.
    """
    from can.io.blf import OBJ_HEADER_BASE_STRUCT, BLFParseError

    class Reader(reader):
        def _parse_data(self, data: bytes) -> Iterator[Any]:
            end = _first_damaged(data, OBJ_HEADER_BASE_STRUCT)
            yield from super()._parse_data(data if end is None else data[:end])
            if end is not None:
                raise BLFParseError(f"an object states a size below its header's, {end} bytes into its container")

    return Reader


def _first_damaged(data: bytes, header: struct.Struct) -> int | None:
    """Return where an object begins that is not as long as its ``header``, None if all that are whole are."""
    place = data.find(b"LOBJ", 0, 8)
    while 0 <= place <= len(data) - header.size:
        size = header.unpack_from(data, place)[3]
        if size < header.size:
            return place
        place += size
        place = data.find(b"LOBJ", place, place + 8)
    return None


def _mf4_messages(path: Path) -> Iterator[Any]:
    """Yield the messages of an MF4 file, the messages of all its channel groups by their times."""
    from can.io.mf4 import MF4Reader

    reader = MF4Reader(path)
    try:
        yield from reader
    except Exception as error:  # asammdf raises whatever its parsers do
        raise ValueError(error_line(error)) from error
    finally:
        reader.stop()


def _check_mf4(path: Path) -> None:
    """Refuse an MF4 file whose frames python-can would pass over, or that holds none."""
    with opened_mdf(path) as file:
        if FRAME_CHANNEL not in file.channels_db:
            raise InputError(
                f"{path}: expected a log of a CAN bus, with the channel {FRAME_CHANNEL}, got other channels"
            )
        for group, _ in file.channels_db[FRAME_CHANNEL]:
            channel_group = file.groups[group].channel_group
            source = channel_group.acq_source
            is_can = source is not None and source.source_type & _BUS and source.bus_type == _CAN
            if not channel_group.flags & _BUS_EVENT or not is_can:
                raise InputError(
                    f"{path}: channel group {group}: {FRAME_CHANNEL} is not marked as an event of a CAN bus"
                )
