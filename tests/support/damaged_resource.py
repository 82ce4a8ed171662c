"""Resources of a native FMU whose arrays were changed after they were written, with the checksum put right."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from raw_fmu import GUID, Fmu2

from strainfmu import resource_file
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.resource.map_file import FORMAT_VERSION, MAGIC, native_resource
from strainfmu.resource_file import HEADER_SIZE, container, with_header


def sealed(content: bytes) -> bytes:
    """Return ``content`` with the header that belongs to what follows its first 32 bytes."""
    return with_header(MAGIC, FORMAT_VERSION, content[HEADER_SIZE:])


def pack(arrays: Mapping[str, Any]) -> bytes:
    """Return the ``map.bin`` of ``arrays``."""
    return with_header(MAGIC, FORMAT_VERSION, container(arrays))


def unpack(content: bytes) -> dict[str, np.ndarray]:
    """The arrays of a container by name."""
    table, entry = resource_file._TABLE, resource_file._ENTRY
    arrays = dict[str, np.ndarray]()
    (count,) = table.unpack_from(content, HEADER_SIZE)
    for k in range(count):
        name, kind, rank, *lengths, position = entry.unpack_from(
            content, HEADER_SIZE + table.size + k * entry.size
        )
        shape = tuple(lengths[:rank])
        values = np.frombuffer(content, resource_file._KINDS[kind], int(np.prod(shape)), position)
        arrays[name.rstrip(b"\0").decode()] = values.reshape(shape)
    return arrays


@lru_cache(maxsize=8)
def arrays_of(inverse_map: InverseMap) -> Mapping[str, np.ndarray]:
    """The arrays of ``map.bin`` by name."""
    return unpack(native_resource(inverse_map, GUID))


def changed(arrays: Mapping[str, np.ndarray], changes: Mapping[str, Any]) -> bytes:
    """``map.bin`` of ``arrays`` with ``changes``: an array, a function of the old one, or None for none."""
    after = dict(arrays)
    for name, change in changes.items():
        value = change(after[name].copy()) if callable(change) else change
        if value is None:
            del after[name]
        else:
            after[name] = value
    return pack(after)


def put(place: Any, value: float) -> Callable[[np.ndarray], np.ndarray]:
    """A change of the value at ``place`` of an array."""

    def change(array: np.ndarray) -> np.ndarray:
        array[place] = value
        return array

    return change


def written(content: bytes, folder: Path) -> str:
    """Write ``content`` as ``map.bin``; the URI of the folder of resources."""
    resources = folder / "resources"
    resources.mkdir(exist_ok=True)
    (resources / "map.bin").write_bytes(content)
    return resources.as_uri()


def with_arrays(inverse_map: InverseMap, folder: Path, changes: Mapping[str, Any]) -> str:
    """As :func:`written`, of a map with :func:`changed` arrays."""
    return written(changed(arrays_of(inverse_map), changes), folder)


def refusal(fmu: Fmu2) -> str:
    """The message of an instance that was not made."""
    assert fmu.instance.value is None
    return str(fmu.messages[-1][2])
