"""Sections of ``resources/map.bin``: what not every map has, behind the arrays that every map has.

``fmus/native/estimator/map/sections.h`` describes the same to the C code.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

from strainfmu.arrays import FloatArray


def section(name: bytes, content: bytes) -> bytes:
    """Return the section ``name``, of 8 bytes: length and CRC-32 of its content, four zeros, then the content."""
    return name + struct.pack("<Q2I", len(content), zlib.crc32(content), 0) + content


def sized_numbers(sizes: Sequence[int], arrays: Sequence[FloatArray]) -> bytes:
    """Return eight 32-bit integers, ``sizes`` and zeros, and the values of ``arrays`` as float64."""
    head = struct.pack("<8I", *sizes, *[0] * (8 - len(sizes)))
    return head + b"".join(array.astype("<f8").tobytes() for array in arrays)
