"""Maps that were damaged or written by others: the compiled estimator refuses each in one line."""

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from damaged_resource import arrays_of, changed, pack, sealed, unpack
from flight_fmu import whole_map
from other_load_maps import with_further_tables
from random_map import random_map
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from strainfmu.estimator.core import library

pytestmark = pytest.mark.fast

DAMAGES = 1500
ENTRY_SIZE, TABLE_AT = 80, 48
FREE_LENGTH = {
    "tare.pattern",
    "envelope.layers",
    "flight.common_error",
    "flight.shapes",
    "flight.table",
    "flight_loads.table",
    "thermal.apparent_strain",
}
"""Arrays of which a map may have more or fewer rows or channels, whatever the others are."""

VALUES = (0.0, -1.0, np.nan, np.inf, 1e300, -1e300, 5e-324, 1e9)


@pytest.fixture(scope="module")
def arrays() -> Mapping[str, np.ndarray]:
    """The arrays of a nonlinear map with section loads, sensors and temperature modes."""
    return arrays_of(with_temperature(with_sensors(with_further_tables(whole_map()))))


@pytest.fixture(scope="module")
def content(arrays: Mapping[str, np.ndarray]) -> bytes:
    """The map.bin of these."""
    return pack(arrays)


def said(content: bytes) -> str | None:
    """What ``sl_open`` says of ``content``; None if it opens."""
    text = ctypes.create_string_buffer(256)
    handle = library().sl_open(content, len(content), text)
    if handle:
        library().sl_close(handle)
        return None
    line = text.value.decode("ascii")
    assert line
    assert line.isprintable()
    return line


def test_the_map_opens(arrays: Mapping[str, np.ndarray], content: bytes) -> None:
    assert said(content) is None
    assert unpack(content).keys() == arrays.keys()
    parts = {name.split(".")[0] for name in arrays}
    assert parts >= {
        "linear",
        "scaled",
        "flight",
        "flight_loads",
        "filter",
        "other_loads",
        "thermal",
        "sensors",
        "tare",
    }


def test_flipped_bits(content: bytes) -> None:
    random, damaged = np.random.default_rng(1), bytearray(content)
    table = TABLE_AT + ENTRY_SIZE * len(unpack(content))
    for k in range(DAMAGES):
        place, bit = int(random.integers(table if k % 2 else len(content))), 1 << int(random.integers(8))
        damaged[place] ^= bit
        assert said(bytes(damaged)) is not None, place
        damaged[place] ^= bit


def test_truncations(content: bytes) -> None:
    for length in np.random.default_rng(2).integers(len(content), size=DAMAGES).tolist():
        assert said(content[:length]) is not None, length


def test_sealed_truncations(content: bytes) -> None:
    """Length and checksum are right, and the arrays do not fit."""
    for length in np.random.default_rng(3).integers(TABLE_AT, len(content), size=200).tolist():
        assert said(sealed(content[:length])) is not None, length


def test_swapped_renamed_and_reshaped_entries(content: bytes) -> None:
    """Entries of the table, under the old checksum and under a right one."""
    random, n = np.random.default_rng(4), len(unpack(content))
    table = np.frombuffer(content, np.uint8, n * ENTRY_SIZE, TABLE_AT).reshape(n, ENTRY_SIZE)
    head, data = content[:TABLE_AT], content[TABLE_AT + n * ENTRY_SIZE :]
    for k in range(DAMAGES):
        other = table.copy()
        one, two = random.choice(n, 2, replace=False).tolist()
        if k % 3 == 0:  # names of two arrays
            other[[one, two], :48] = table[[two, one], :48]
        elif k % 3 == 1:  # a letter of a name
            other[one, int(random.integers(np.argmin(table[one, :48])))] ^= 1 << int(random.integers(8))
        else:  # kind, rank, a length or the position
            other[one, 48:].view("<u4")[random.integers(8)] ^= np.uint32(1 << int(random.integers(32)))
        damaged = head + other.tobytes() + data
        assert said(damaged) is not None, (k, one, two)
        assert said(sealed(damaged)) is not None, (k, one, two)


def test_every_array_is_needed(arrays: Mapping[str, np.ndarray]) -> None:
    for name in arrays:
        assert f"'{name}'" in str(said(changed(arrays, {name: None}))), name
        assert said(changed(arrays, {name: None, f"{name}_": arrays[name]})) is not None, name


def test_every_shape_and_kind_is_checked(arrays: Mapping[str, np.ndarray]) -> None:
    opened = set()
    for name, array in arrays.items():
        other = np.ones(array.shape, np.float64 if array.dtype.kind != "f" else np.int32)
        changes: list[Any] = [array[None] if array.ndim < 4 else array.reshape(-1), other]
        for axis in range(array.ndim):
            changes.append(np.concatenate([array, array.take([-1] if array.shape[axis] else [], axis)], axis))
            changes.append(np.zeros([0 if k == axis else size for k, size in enumerate(array.shape)]))
        for change in changes:
            if change.shape != array.shape or change.dtype != array.dtype:
                opened |= {name} if said(changed(arrays, {name: change})) is None else set()
    assert opened == FREE_LENGTH


def test_numbers_that_are_not_finite(arrays: Mapping[str, np.ndarray]) -> None:
    random = np.random.default_rng(5)
    for name, array in arrays.items():
        if array.dtype.kind == "f" and array.size > 0:
            other = array.copy()
            other.reshape(-1)[random.integers(array.size)] = random.choice([np.nan, np.inf, -np.inf])
            assert f"'{name}': holds a value that is not finite" in str(said(changed(arrays, {name: other})))


def test_counts(arrays: Mapping[str, np.ndarray]) -> None:
    for name, array in arrays.items():
        if array.dtype.kind == "i":
            for value in (-1, -(2**31), 2**31 - 1):
                assert f"'{name}': expected " in str(said(changed(arrays, {name: np.int32(value)})))


def test_free_states_that_there_are_not() -> None:
    held = arrays_of(random_map())
    freedom = held["linear.degrees_of_freedom"]
    assert said(pack(held)) is None
    for other in (freedom - 1, freedom + 1):
        assert "'linear.degrees_of_freedom'" in str(said(changed(held, {"linear.degrees_of_freedom": other})))


def test_values_of_others_do_no_harm(arrays: Mapping[str, np.ndarray]) -> None:
    """Swapped arrays, and numbers of any size: refused or harmless."""
    random, names = np.random.default_rng(6), list(arrays)
    for _ in range(150):
        one, two = random.choice(len(names), 2, replace=False).tolist()
        said(changed(arrays, {names[one]: arrays[names[two]], names[two]: arrays[names[one]]}))
        other = arrays[names[one]].copy()
        if other.dtype.kind == "f" and other.size > 0:
            other.reshape(-1)[random.integers(other.size)] = random.choice(VALUES)
            said(changed(arrays, {names[one]: other}))


@pytest.mark.parametrize("name", ["", "x" * 48, "linear.Mean", "linear mean", "linear.mean\n"])
def test_names_that_no_array_has(name: str) -> None:
    with pytest.raises(ValueError, match="name of an array"):
        pack({name: 1.0})
