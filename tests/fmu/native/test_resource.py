"""Damaged, missing and foreign maps, and the paths they lie in: one message of what is wrong, no crash."""

import ctypes
import struct
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from damaged_resource import arrays_of, changed, put, sealed
from native_case import NativeCase
from raw_fmu import ERROR, Fmu2, Fmu3, shipped_library

from strainfmu.errors import InputError
from strainfmu.estimator.resource.map_file import native_resource
from strainfmu.resource_file import NAME_SIZE

pytestmark = pytest.mark.fast


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


def test_whole_map_is_taken(small: NativeCase) -> None:
    for fmu in (Fmu2(small.uri, small.n), Fmu3(str(small.resources), small.n)):
        assert fmu.instance.value
        assert fmu.messages == []
        fmu.free()


def test_truncated_and_extended(small: NativeCase, tmp_path: Path) -> None:
    content = (small.resources / "map.bin").read_bytes()
    for length in (0, 1, 7, 31, 127, 128, 129, len(content) // 2, len(content) - 1):
        assert "bytes" in refused(tmp_path, content[:length], small.n)
    assert f"has {len(content) + 1} bytes, must have {len(content)}" in refused(tmp_path, content + b"\0", small.n)


@pytest.mark.parametrize(
    ("position", "value", "text"),
    [
        (8, 4, "has format version 4, must be 8: export the FMU again"),
        (12, 0x04030201, "has another byte order than this machine"),
    ],
)
def test_header_that_cannot_be(small: NativeCase, tmp_path: Path, position: int, value: int, text: str) -> None:
    content = bytearray((small.resources / "map.bin").read_bytes())
    struct.pack_into("<I", content, position, value)
    assert text in refused(tmp_path, bytes(content), small.n)


@pytest.mark.parametrize(
    ("name", "change", "text"),
    [
        ("linear.degrees_of_freedom", np.int32(0), "expected a whole number from 1 to 8, found 0"),
        ("linear.degrees_of_freedom", np.int32(9), "expected a whole number from 1 to 8, found 9"),
        ("linear.degrees_of_freedom", np.float64(3.0), "expected one whole number, found one number"),
        ("linear.known_prior", np.int32(2), "expected a whole number from 0 to 1, found 2"),
        ("linear.gauge_covariance", lambda old: old[:-1], "expected 8 x 8 numbers, found 7 x 8 numbers"),
        ("linear.load_per_state", lambda old: old[:-1], "expected 3 x 5 numbers, found 2 x 5 numbers"),
        ("linear.gauge_covariance", lambda old: 0.0 * old, "expected numbers above zero, found 0"),
        ("linear.gauge_covariance", lambda old: old.max() * (2.0 - np.eye(len(old))), "expected a covariance"),
        ("linear.error_load", lambda old: old[:-1], "expected 5 x 5 numbers, found 4 x 5 numbers"),
        ("linear.regularisation", np.float64(-1.0), "expected a number from 0 to 1.79769e+308, found -1"),
        ("linear.error_load", None, "is missing"),
        ("linear.remainders", np.float64(1.0), "is no array of this map"),
        ("settings.reference_area", np.float64(0.0), "expected a number from 1e-09 to 1e+09, found 0"),
        ("settings.sensor_range", np.float64(2e9), "expected a number from 1e-09 to 1e+09, found 2e+09"),
        ("settings.largest", np.float64(0.5), "expected a number from 1 to "),
        ("envelope.layers", lambda old: old[:0], "expected 1 to 4096 values along axis 0, found 0"),
        ("envelope.limit", lambda old: np.zeros(70_000), "expected 0 to 65536 values along axis 0, found 70000"),
        ("guid", lambda old: np.where(old == 0, ord("x"), old), "expected texts with an end"),
        ("guid", lambda old: np.zeros((1, 81), np.uint8), "expected 1 to 80 values along axis 1, found 81"),
        ("tare.zero", np.float64(-1.0), "expected a number from 0 to "),
        ("tare.least_samples", np.float64(16.0), "expected a number from "),
        ("tare.noise_std", put(0, 0.0), "expected numbers above zero, found 0 (number 0)"),
    ],
)
def test_arrays_that_cannot_be(small: NativeCase, tmp_path: Path, name: str, change: Any, text: str) -> None:
    content = changed(arrays_of(small.inverse_map), {name: change})
    assert f"/map.bin '{name}': {text}" in refused(tmp_path, content, small.n)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_value_that_is_not_finite(small: NativeCase, tmp_path: Path, value: float) -> None:
    for name, array in arrays_of(small.inverse_map).items():
        if array.dtype.kind == "f" and array.size > 0:
            last = tuple(length - 1 for length in array.shape)
            text = refused(tmp_path, changed(arrays_of(small.inverse_map), {name: put(last, value)}), small.n)
            assert text.endswith(f"'{name}': holds a value that is not finite (number {array.size - 1})")


@pytest.mark.parametrize(("place", "name"), [(1, 0), (3, 2), (2, 4)])
def test_names_twice_or_out_of_order(small: NativeCase, tmp_path: Path, place: int, name: int) -> None:
    """Array ``place`` is called as array ``name`` is."""
    content = (small.resources / "map.bin").read_bytes()
    names = sorted(arrays_of(small.inverse_map))
    first = content.index(names[0].encode())
    size = content.index(names[1].encode()) - first
    text, at = names[name].encode().ljust(NAME_SIZE, b"\0"), first + size * place
    damaged = sealed(content[:at] + text + content[at + NAME_SIZE :])
    assert "stands twice or out of order" in refused(tmp_path, damaged, small.n)


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
