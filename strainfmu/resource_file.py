"""Files of ``resources/`` of the native FMUs: a header with a check sum, and the container of named arrays.

Little endian. A header of 32 bytes: magic, format version, byte order mark, length of the file, CRC-32 of all that
follows, a zero. ``fmus/native/core/resource.c`` reads it.

In a container follow the number of arrays and 12 zeros. Then an entry of 80 bytes for each array, by ascending
names: name, kind, rank, four lengths, position. Then the arrays, row by row, each from a multiple of 16 bytes on.
``fmus/native/estimator/map/container.c`` reads it.
"""

import re
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from strainfmu.errors import InputError

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

HEADER_SIZE = _HEADER.size
"""Position of the first byte that the check sum covers."""


def with_header(magic: bytes, version: int, body: bytes) -> bytes:
    """Return the file of ``body``."""
    length = HEADER_SIZE + len(body)
    return _HEADER.pack(magic, version, _BYTE_ORDER_MARK, length, zlib.crc32(body), 0) + body


def is_whole(content: bytes) -> bool:
    """Tell whether a file has the length and the CRC-32 of its header."""
    if len(content) < HEADER_SIZE:
        return False
    *_, length, checked, reserved = _HEADER.unpack_from(content)
    return (length, checked, reserved) == (len(content), zlib.crc32(content[HEADER_SIZE:]), 0)


def container(arrays: Mapping[str, Any]) -> bytes:
    """Return what follows the header in a file of ``arrays``.

    These are numbers and arrays of up to four axes by name: floats, whole numbers, or bytes of text (uint8).
    """
    entries, contents = list[bytes](), list[bytes]()
    position = HEADER_SIZE + _TABLE.size + len(arrays) * _ENTRY.size
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
    return _TABLE.pack(len(arrays)) + b"".join(entries) + b"".join(contents)


def texts(where: str, lines: Sequence[str], width: int) -> np.ndarray:
    """Return (n, ``width``) bytes of ``lines``, each ended by zeros; ``where`` is what a refusal calls them."""
    rows = [line.encode() for line in lines]
    for row in rows:
        if len(row) >= width or b"\0" in row:
            raise InputError(f"{where}: '{row.decode()}' found, must be shorter than {width} bytes")
    return np.frombuffer(b"".join(row.ljust(width, b"\0") for row in rows), np.uint8).reshape(len(rows), width)
