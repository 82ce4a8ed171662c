"""Files that are either whole or not there: atomic writes, HDF5 images, content hashes.

HDF5 is composed in memory and written as one block of bytes, so that a full disk or a kill leaves
the previous file untouched and never a half-written one.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.errors import InputError, StrainfmuError

HASH_ATTRIBUTE = "content_hash"


def write_bytes_atomically(path: Path, content: bytes) -> None:
    """Write ``content`` to a temporary file beside ``path``, then rename it into place.

    Raises
    ------
    StrainfmuError
        The operating system refused (disk full, no permission, ...); ``path`` keeps its old content.
    """
    temporary: str | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o666 & ~_current_umask())
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)
        raise StrainfmuError(f"{path}: could not be written: {error.strerror or error}") from error


def _current_umask() -> int:
    """Return the process's file-mode mask (reading it means setting it twice)."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_hdf5_atomically(path: Path, fill: Callable[[h5py.File], None]) -> str:
    """Compose an HDF5 file in memory with ``fill``, stamp its content hash and write it atomically.

    Returns
    -------
    str
        The content hash (see :func:`content_hash`), also stored as root attribute ``content_hash``.
    """
    with h5py.File(path.name, "w", driver="core", backing_store=False) as file:
        fill(file)
        digest = content_hash(file)
        file.attrs[HASH_ATTRIBUTE] = digest
        file.flush()
        image = file.id.get_file_image()
    write_bytes_atomically(path, image)
    return digest


def content_hash(file: h5py.File) -> str:
    """Return the SHA-256 over names, types, shapes, values and attributes of everything in ``file``.

    The hash depends on content alone: not on time stamps, nor on how HDF5 laid the bytes out.
    """
    digest = hashlib.sha256()

    def add_attributes(name: str, item: h5py.HLObject) -> None:
        for key in sorted(item.attrs):
            if not (name == "/" and key == HASH_ATTRIBUTE):
                digest.update(f"{name}@{key}={item.attrs[key]!r}".encode())

    add_attributes("/", file)
    names: list[str] = []
    file.visit(names.append)
    for name in sorted(names):
        item = file[name]
        add_attributes(name, item)
        if isinstance(item, h5py.Dataset):
            values = item[()]
            array = np.asarray(values)
            digest.update(f"{name}:{array.shape}:{item.dtype.str}".encode())
            digest.update(repr(array.tolist()).encode() if array.dtype == object else array.tobytes())
    return digest.hexdigest()


def open_hdf5(path: Path, schema: str, schema_version: int) -> h5py.File:
    """Open an artefact for reading after checking its kind, version and content hash.

    Raises
    ------
    InputError
        The file is missing, is not HDF5, is of another kind or version, or its content was altered.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise InputError(f"{path}: damaged, or not an HDF5 file") from error
    try:
        found_schema = file.attrs.get("schema")
        if found_schema != schema:
            raise InputError(f"{path}: expected a file of schema '{schema}', found '{found_schema}'")
        found_version = file.attrs.get("schema_version")
        if found_version != schema_version:
            raise InputError(
                f"{path}: schema version {found_version} found, {schema_version} wanted; build it again"
            )
        if content_hash(file) != file.attrs.get(HASH_ATTRIBUTE):
            raise InputError(f"{path}: damaged, content and content hash do not agree")
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        file.close()
        raise InputError(f"{path}: damaged, cannot be read to its end") from error
    except InputError:
        file.close()
        raise
    return file


def fingerprint(inputs: Mapping[str, Any]) -> str:
    """Return a short hash of the inputs of a computation, to tell whether its result is up to date."""
    text = json.dumps(inputs, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: Any) -> Any:
    """Turn arrays and paths into what JSON can hold."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (np.floating, np.integer)):
        return value.item()
    return str(value)
