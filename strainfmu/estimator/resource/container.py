"""A container of named arrays, the format of ``map.bin``.

Little endian. A header of 32 bytes, as every resource of a native FMU has it: magic, format version, byte order
mark, length of the file, CRC-32 of all that follows, a zero. Then the number of arrays and 12 zeros. Then an entry
of 80 bytes for each array, by ascending names: name, kind, rank, four lengths, position. Then the arrays, row by
row, each from a multiple of 16 bytes on. ``fmus/native/estimator/map/container.h`` reads it.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

MAGIC = b"SFMUMAP\0"
FORMAT_VERSION = 8
CHECKED_FROM = 32
"""Position of the first byte that the checksum covers."""

NAME_SIZE = 48
"""Bytes of a name, with its final zero."""

_NAME = re.compile(rf"[a-z0-9_.]{{1,{NAME_SIZE - 1}}}")
_HEADER = struct.Struct("<8s2IQ2I")
_TABLE = struct.Struct("<I12x")
_ENTRY = struct.Struct(f"<{NAME_SIZE}s6IQ")
_BYTE_ORDER_MARK = 0x01020304
_ALIGNMENT, _MOST_AXES = 16, 4
_KINDS = (np.dtype("<f8"), np.dtype("<i4"), np.dtype("u1"))
_KIND_OF = {"f": 0, "i": 1, "b": 1, "u": 2}
"""By the kind of a numpy type: numbers, whole numbers, bytes of text."""

Values = Mapping[str, Any]
"""Numbers and arrays of up to four axes by name: floats, whole numbers, or bytes of text (uint8)."""


def pack(arrays: Values) -> bytes:
    """Return the container of ``arrays``."""
    entries, contents = list[bytes](), list[bytes]()
    position = CHECKED_FROM + _TABLE.size + len(arrays) * _ENTRY.size
    for name in sorted(arrays):
        if not _NAME.fullmatch(name):
            raise ValueError(f"name of an array: '{name}' found, must match {_NAME.pattern}")
        array = np.asarray(arrays[name])
        kind = _KIND_OF[array.dtype.kind]
        content = array.astype(_KINDS[kind]).tobytes()
        lengths = (*array.shape, *[0] * (_MOST_AXES - array.ndim))
        entries.append(_ENTRY.pack(name.encode(), kind, array.ndim, *lengths, position))
        contents.append(content + bytes(-len(content) % _ALIGNMENT))
        position += len(contents[-1])
    return sealed(bytes(CHECKED_FROM) + _TABLE.pack(len(arrays)) + b"".join(entries) + b"".join(contents))


def sealed(content: bytes) -> bytes:
    """Return ``content`` with the header that belongs to what follows its first 32 bytes."""
    checked = content[CHECKED_FROM:]
    header = _HEADER.pack(MAGIC, FORMAT_VERSION, _BYTE_ORDER_MARK, len(content), zlib.crc32(checked), 0)
    return header + checked


def texts(lines: list[str], width: int) -> np.ndarray:
    """Return (n, ``width``) bytes of ``lines``, each ended by zeros."""
    rows = [line.encode() for line in lines]
    for row in rows:
        if len(row) >= width or b"\0" in row:
            raise ValueError(f"'{row.decode()}' found, must be shorter than {width} bytes")
    return np.frombuffer(b"".join(row.ljust(width, b"\0") for row in rows), np.uint8).reshape(len(rows), width)
