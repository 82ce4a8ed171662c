"""Damaged, missing and foreign maps, and the paths they lie in: one message of what is wrong, no crash."""

from __future__ import annotations

import ctypes
import struct
import zlib
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from native_case import NativeCase
from raw_fmu import ERROR, Fmu2, Fmu3, shipped_library

from strainfmu.errors import InputError
from strainfmu.fmu.resource.map_file import CHECKED_FROM, native_resource

pytestmark = pytest.mark.fast

HEADER_SIZE = 128
VALUES_AT = HEADER_SIZE + 32


def messages_for(resources: Path, n: int, guid: str | None = None) -> list[tuple[int, str, str]]:
    """What both FMI versions log, having refused to instantiate."""
    collected = []
    for location, kind in ((resources.as_uri(), Fmu2), (str(resources), Fmu3)):
        fmu = kind(location, n) if guid is None else kind(location, n, guid)
        assert not fmu.instance.value
        assert [message[:2] for message in fmu.messages] == [(ERROR, "logStatusError")]
        collected += fmu.messages
    assert collected[0][2] == collected[1][2]
    return collected


def refused(tmp_path: Path, content: bytes, n: int) -> str:
    """The message about a map.bin of ``content``."""
    (tmp_path / "map.bin").write_bytes(content)
    return messages_for(tmp_path, n)[0][2]


def sealed(content: bytes) -> bytes:
    """``content`` with the checksum that belongs to it."""
    return content[:24] + struct.pack("<I", zlib.crc32(content[CHECKED_FROM:])) + content[28:]


def without_sections(case: NativeCase) -> bytes:
    """Its map.bin, of arrays alone."""
    content = (case.resources / "map.bin").read_bytes()
    content = content[: content.index(b"TARE\0\0\0\0")]
    content = content[:16] + struct.pack("<Q", len(content)) + content[24:152] + bytes(4) + content[156:]
    return sealed(content)


def test_whole_map_is_taken(small: NativeCase) -> None:
    for fmu in (Fmu2(small.uri, small.n), Fmu3(str(small.resources), small.n)):
        assert fmu.instance.value
        assert fmu.messages == []
        fmu.free()


def test_every_region_of_the_file_is_checked(small: NativeCase, tmp_path: Path) -> None:
    content = (small.resources / "map.bin").read_bytes()
    positions = [*range(VALUES_AT), *range(VALUES_AT, len(content), 97), len(content) - 1]
    for position in positions:
        altered = bytearray(content)
        altered[position] ^= 0x10
        text = refused(tmp_path, bytes(altered), small.n)
        assert text.startswith(f"{tmp_path}/map.bin "), (position, text)


def test_truncated_and_extended(small: NativeCase, tmp_path: Path) -> None:
    content = (small.resources / "map.bin").read_bytes()
    for length in (0, 1, 7, 31, 127, 128, 129, len(content) // 2, len(content) - 1):
        assert "bytes" in refused(tmp_path, content[:length], small.n)
    assert f"has {len(content) + 1} bytes, must have {len(content)}" in refused(tmp_path, content + b"\0", small.n)


@pytest.mark.parametrize(
    ("position", "value", "text"),
    [
        (8, 1, "has format version 1, must be 4: export the FMU again"),
        (12, 0x04030201, "has another byte order than this machine"),
        (32, 0, "is for 0 gauges"),
        (32, 9, "which is wrong for 9 gauges and 3 states"),
        (32, 0xFFFFFFFF, "is for 4294967295 gauges"),
        (36, 4, "which is wrong for 8 gauges and 4 states"),
        (36, 0x7FFFFFFF, "which cannot be"),
        (40, 0, "0 degrees of freedom, which cannot be"),
        (40, 9, "9 degrees of freedom, which cannot be"),
        (44, 2, "which cannot be"),
        (128, 2, "is of form 2 with 0 free states"),
        (132, 1, "is of form 0 with 1 free states"),
        (136, 70_000, "70000 half-spaces"),
        (136, 1, "which is wrong for 8 gauges"),
        (140, 0, "0 layers of air"),
        (144, 1, "which cannot be"),
        (148, 1, "1 error terms"),
        (152, 1, "which is wrong for 8 gauges"),
        (152, 6, "which is wrong for 8 gauges"),
        (152, 11, "which cannot be"),
        (156, 1, "which cannot be"),
    ],
)
def test_header_that_cannot_be(small: NativeCase, tmp_path: Path, position: int, value: int, text: str) -> None:
    content = bytearray(without_sections(small))
    struct.pack_into("<I", content, position, value)
    assert text in refused(tmp_path, sealed(bytes(content)), small.n)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_value_that_is_not_finite(small: NativeCase, tmp_path: Path, value: float) -> None:
    content = bytearray(without_sections(small))
    for position in range(VALUES_AT, len(content), 8 * 37):
        altered = content[:position] + struct.pack("<d", value) + content[position + 8 :]
        text = refused(tmp_path, sealed(bytes(altered)), small.n)
        assert text.endswith(f"holds a value that is not finite (number {(position - VALUES_AT) // 8})")


@pytest.mark.parametrize(
    ("number", "value", "text"),
    [
        (0, np.nan, "limits of a tare that cannot be"),
        (2, -1.0, "limits of a tare that cannot be"),
        (3, 16.0, "a tare of fewer samples than there can be"),
        (10, 0.0, "limits of a tare that cannot be"),
    ],
)
def test_tare_that_cannot_be(small: NativeCase, tmp_path: Path, number: int, value: float, text: str) -> None:
    content = bytearray((small.resources / "map.bin").read_bytes())
    begin = content.index(b"TARE\0\0\0\0")
    struct.pack_into("<d", content, begin + 24 + 8 * number, value)
    struct.pack_into("<I", content, begin + 16, zlib.crc32(content[begin + 24 :]))
    assert text in refused(tmp_path, sealed(bytes(content)), small.n)


def test_reference_that_is_not_positive(small: NativeCase, tmp_path: Path) -> None:
    content = bytearray((small.resources / "map.bin").read_bytes())
    struct.pack_into("<d", content, VALUES_AT, 0.0)
    assert "not positive" in refused(tmp_path, sealed(bytes(content)), small.n)


def test_guid_without_an_end(small: NativeCase, tmp_path: Path) -> None:
    content = bytearray((small.resources / "map.bin").read_bytes())
    content[48:HEADER_SIZE] = b"x" * 80
    assert "guid without an end" in refused(tmp_path, sealed(bytes(content)), small.n)


def test_wrong_guid(small: NativeCase) -> None:
    text = messages_for(small.resources, small.n, "{other}")[0][2]
    assert text.startswith("guid '{other}' found, but the map in this FMU is '{8c4e810f")


def test_guid_too_long_to_write(small: NativeCase) -> None:
    with pytest.raises(InputError, match="must be shorter than 80 bytes"):
        native_resource(small.inverse_map, "x" * 80)


def test_missing_file(tmp_path: Path) -> None:
    assert messages_for(tmp_path, 8)[0][2] == f"{tmp_path}/map.bin cannot be opened"


def test_folder_in_place_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "map.bin").mkdir()
    assert "/map.bin cannot be " in messages_for(tmp_path, 8)[0][2]


@pytest.mark.parametrize(
    "name",
    [
        "with space",
        "Jürgen Groß",
        "a+b",
        "a(b)",
        "100%",
        "a%20b",
        "#1",
        "what?",
        "日本語",
        "x&y=z;",
        "~'!@$",
        "[1]",
    ],
)
def test_names_of_folders(small: NativeCase, tmp_path: Path, name: str) -> None:
    folder = tmp_path / name
    folder.mkdir()
    (folder / "map.bin").write_bytes((small.resources / "map.bin").read_bytes())
    locations = [folder.as_uri(), f"{folder.as_uri()}/", str(folder), f"file:{quote(str(folder))}"]
    locations.append(f"file://localhost{quote(str(folder))}")
    if "%" not in name:
        locations.append(f"file://{folder}")  # importers that do not encode
    for location in locations:
        fmu = Fmu2(location, small.n)
        assert fmu.instance.value, (location, fmu.messages)
        fmu.free()


def test_path_of_300_characters(small: NativeCase, tmp_path: Path) -> None:
    folder = tmp_path / ("ü" * 60) / ("a long name " * 10) / ("+(x)" * 30)
    folder.mkdir(parents=True)
    assert len(str(folder)) > 300
    (folder / "map.bin").write_bytes((small.resources / "map.bin").read_bytes())
    for fmu in (Fmu2(folder.as_uri(), small.n), Fmu3(str(folder), small.n)):
        assert fmu.instance.value, fmu.messages
        fmu.free()


@pytest.mark.parametrize(
    "location",
    ["", "file:", "file://", "http://host/x", "file://host/share", "file:///a%2", "file:///a%zz", "file:///a%00b"],
)
def test_locations_that_are_none(small: NativeCase, location: str) -> None:
    fmu = Fmu2(location, small.n)
    assert not fmu.instance.value
    assert "is no file URI or path" in fmu.messages[0][2]


def test_location_beyond_all_bounds(small: NativeCase) -> None:
    for length in (4000, 4080, 4096, 5000, 100_000):
        fmu = Fmu2("file:///" + "x" * length, small.n)
        assert not fmu.instance.value
        assert len(fmu.messages) == 1
        assert len(fmu.messages[0][2]) < 1400


def test_arguments_of_instantiate(small: NativeCase) -> None:
    library = shipped_library()
    library.fmi2Instantiate.restype = ctypes.c_void_p
    location = small.uri.encode()
    assert library.fmi2Instantiate(b"name", 1, b"guid", location, None, 0, 0) is None
    empty = (ctypes.c_void_p * 5)()  # no logger either
    for arguments in ((None, 1, b"guid"), (b"", 1, b"guid"), (b"name", 7, b"guid"), (b"name", 1, None)):
        assert library.fmi2Instantiate(*arguments, location, empty, 0, 0) is None
    assert library.fmi2Instantiate(b"name", 1, b"guid", None, empty, 0, 0) is None
    assert library.fmi3InstantiateScheduledExecution(b"name", b"", b"", 0, 0, None, None, None, None, None) == 0
