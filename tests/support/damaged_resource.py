"""Resources of a native FMU changed after they were written, with check sums put right."""

from __future__ import annotations

import zlib
from pathlib import Path

from raw_fmu import GUID, Fmu2

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.resource.map_file import CHECKED_FROM, native_resource

HEAD = 24
"""Bytes of a section ahead of its content: name, length, check sum."""


def written(content: bytearray, folder: Path) -> str:
    """Write ``content`` with the check sum of the whole file put right; the URI of the folder of resources."""
    content[CHECKED_FROM - 8 : CHECKED_FROM - 4] = zlib.crc32(content[CHECKED_FROM:]).to_bytes(4, "little")
    resources = folder / "resources"
    resources.mkdir(exist_ok=True)
    (resources / "map.bin").write_bytes(bytes(content))
    return resources.as_uri()


def with_value(inverse_map: InverseMap, folder: Path, section: bytes, at: int, value: bytes) -> str:
    """As :func:`written`, with ``value`` from byte ``at`` of a section on, its check sum put right too.

    Negative ``at`` count from the section's end.
    """
    content = bytearray(native_resource(inverse_map, GUID))
    start = content.rindex(section)
    length = int.from_bytes(content[start + 8 : start + 16], "little")
    end = start + HEAD + length
    first = (start if at >= 0 else end) + at
    content[first : first + len(value)] = value
    content[start + 16 : start + 20] = zlib.crc32(content[start + HEAD : end]).to_bytes(4, "little")
    return written(content, folder)


def with_flipped_bit(inverse_map: InverseMap, folder: Path, section: bytes, at: int) -> str:
    """As :func:`written`, with a bit of byte ``at`` of a section flipped: its check sum is wrong."""
    content = bytearray(native_resource(inverse_map, GUID))
    content[content.rindex(section) + at] ^= 0x01
    return written(content, folder)


def refusal(fmu: Fmu2) -> str:
    """The message of an instance that was not made."""
    assert fmu.instance.value is None
    return str(fmu.messages[-1][2])
