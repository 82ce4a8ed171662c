"""Frozen dataclasses as HDF5 files: one data set per field, with its unit.

Arrays and numbers become data sets; a tuple of names a data set of byte strings; a string an attribute; a
dictionary an attribute holding JSON, or a data set where it is too long for one; a record inside a record is a
group of its own; None is left out and comes back as None. A field of :data:`OPTIONAL` metadata that a file leaves
out comes back as its default.
"""

import json
from collections.abc import Callable, Collection, Mapping
from dataclasses import Field, fields, is_dataclass
from os import PathLike
from textwrap import wrap
from types import NoneType, UnionType
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

import h5py
import numpy as np

from strainfmu.errors import InputError
from strainfmu.files import open_hdf5, write_hdf5_atomically

Record = TypeVar("Record")

LONGEST_ATTRIBUTE = 32_768
"""Bytes above which text goes into a data set: HDF5 holds attributes of less than 64 KiB."""

PACKED_FROM = 128
"""Rows of a square from which it is packed: most of a covariance of gauges is zeros, or one number."""

OPTIONAL: dict[str, Any] = {"optional": True}
"""Metadata of a field that files may leave out, with a default for it."""


def save_record(
    record: Any,
    path: str | PathLike[str],
    schema: str,
    schema_version: int,
    units: Mapping[str, str],
    left_out: Callable[[Any], Collection[str]] = lambda record: (),
    built_at: str = "",
) -> str:
    """Write a dataclass ``record`` to ``path`` atomically and return its content hash.

    ``units`` holds the unit of each field; fields without one have the ``unit`` of their metadata, or 1.
    ``left_out`` gives the fields of a record that are not written. ``built_at`` is the time that the file states,
    outside its hash; "" for none.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """

    return write_hdf5_atomically(
        path, schema, schema_version, lambda file: write_record(file, record, units, left_out), built_at
    )


def write_record(
    group: h5py.Group,
    record: Any,
    units: Mapping[str, str],
    left_out: Callable[[Any], Collection[str]] = lambda record: (),
) -> None:
    """Write the fields of a dataclass into ``group``, so that a file can hold a record and other things.

    A field that is a record states its type and units in its metadata, see :func:`inner_record`.
    """
    absent = left_out(record)
    for entry in fields(record):
        value = getattr(record, entry.name)
        if entry.name in absent:
            continue
        if isinstance(value, dict):
            # Entries inside keep their order: that of a map's parameters of the flow is that of their tables.
            text = json.dumps(dict(sorted(value.items())))
            if len(text) <= LONGEST_ATTRIBUTE:
                group.attrs[entry.name] = text
            else:
                group.create_dataset(entry.name, data=np.bytes_(text.encode()))
        elif isinstance(value, str):
            group.attrs[entry.name] = value
        elif isinstance(value, tuple):
            group.create_dataset(entry.name, data=np.array([name.encode() for name in value], dtype="S"))
        elif is_dataclass(value):
            write_record(group.create_group(entry.name), value, entry.metadata["units"], left_out)
        elif value is not None:
            unit = units.get(entry.name, entry.metadata.get("unit"))
            is_packed = np.ndim(value) == 2 and len(value) == np.shape(value)[1] >= PACKED_FROM
            packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if is_packed else {}
            group.create_dataset(entry.name, data=value, **packed).attrs["unit"] = unit or "1"


def load_record(kind: type[Record], path: str | PathLike[str], schema: str, schema_version: int) -> Record:
    """Read a dataclass of type ``kind`` that :func:`save_record` wrote.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, of another schema or version, or its values are refused by ``kind``.
    """
    with open_hdf5(path, schema, schema_version) as file:
        try:
            return read_record(kind, file)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error


def read_record(kind: type[Record], group: h5py.Group) -> Record:
    """Read a dataclass of type ``kind`` that :func:`write_record` wrote into ``group``.

    Raises
    ------
    InputError
        An entry is missing or no value of its type, or ``kind`` refuses the values.
    """
    try:
        types = get_type_hints(kind)
        entries = [entry for entry in fields(cast(Any, kind)) if not _is_left_out(group, entry)]
        values = {entry.name: _read_field(group, entry, types[entry.name]) for entry in entries}
    except (KeyError, ValueError) as error:
        raise InputError(f"damaged, {error.args[0]}") from error
    return kind(**values)


def inner_record(kind: type[Any], units: Mapping[str, str]) -> dict[str, Any]:
    """Return the metadata of a field that holds a record of type ``kind``, or None."""
    return {"record": kind, "units": units}


def _is_left_out(group: h5py.Group, entry: Field[Any]) -> bool:
    return bool(entry.metadata.get("optional")) and entry.name not in group


def _read_field(group: h5py.Group, entry: Field[Any], annotation: Any) -> Any:
    kind = entry.metadata.get("record")
    if kind is None:
        return _read(group, entry.name, annotation)
    return read_record(kind, group[entry.name]) if entry.name in group else None


def _read(group: h5py.Group, name: str, annotation: Any) -> Any:
    """Return one field; ``annotation`` is its type, None among a union's where it may be missing."""
    options = get_args(annotation) if isinstance(annotation, UnionType) else (annotation,)
    kind = get_origin(options[0]) or options[0]
    short = kind is str or (kind is dict and name in group.attrs)
    value = group.attrs.get(name) if short else _values(group, name)
    if value is None:
        if NoneType in options:
            return None
        raise KeyError(f"entry '{name}' is missing; build it again")
    if kind is str:
        return str(value)
    if kind is dict:
        return json.loads(str(value) if short else value.item())
    if kind is tuple:
        return tuple(item.decode() for item in value)
    return value.item() if np.ndim(value) == 0 else value


def _values(group: h5py.Group, name: str) -> np.ndarray | None:
    """Return the content of a data set, None if there is none of the name.

    By the calls below ``group[name][()]``, which takes ten times as long: a map has some fifty data sets.
    """
    try:
        item = h5py.h5o.open(group.id, name.encode())
    except KeyError:
        return None
    if not isinstance(item, h5py.h5d.DatasetID):
        raise KeyError(f"entry '{name}' is no data set")
    value = np.empty(item.shape, dtype=item.dtype)
    if value.size:
        item.read(h5py.h5s.ALL, h5py.h5s.ALL, value)
    return value


def brief(record: Any) -> str:
    """Return a dataclass in few lines: arrays by shape, collections by length, records by type."""
    parts = [f"{entry.name}{_in_short(getattr(record, entry.name))}" for entry in fields(record)]
    return "\n  ".join(wrap(f"{type(record).__name__}({', '.join(parts)})", 112))


def _in_short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f" {value.shape}".replace(",)", ")")
    if is_dataclass(value):
        return f": {type(value).__name__}"
    if isinstance(value, tuple | list | dict):
        return f": {len(value)}"
    return f"={value!r:.80}"
