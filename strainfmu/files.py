"""Files that are either whole or not there: atomic writes, HDF5 images, content hashes.

HDF5 is composed in memory and written as one block of bytes, so that a full disk or a kill leaves
the previous file untouched and never a half-written one.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.errors import InputError, StrainfmuError

HASH_ATTRIBUTE = "content_hash"
USER_BLOCK_SIZE = 512


def read_bytes(path: Path) -> bytes:
    """Return the bytes of a file.

    Raises
    ------
    InputError
        It is missing, cannot be read, or is a device, which may have no end.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
            raise InputError(f"{path}: expected a file, got a device")
        return path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def write_bytes_atomically(path: str | PathLike[str], content: bytes, *, is_private: bool = False) -> None:
    """Write ``content`` to a temporary file next to ``path``, then rename it into place.

    A private file can be read and written by its owner alone (:func:`check_private`).

    Raises
    ------
    StrainfmuError
        The operating system refused (disk full, no permission, ...); ``path`` keeps its old content.
    """
    path = Path(path)
    temporary: str | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o600 if is_private else 0o666 & ~_current_umask())
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)
        raise StrainfmuError(f"{path}: could not be written: {error.strerror or error}") from error


def check_private(path: Path) -> None:
    """Refuse a file that others than its owner may read or write; systems without POSIX modes check nothing.

    Raises
    ------
    InputError
        Its mode allows access by the group or by all.
    """
    if os.name != "posix" or not path.is_file():
        return
    mode = stat.S_IMODE(path.stat().st_mode)
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise InputError(f"{path}: expected a file of its owner alone, mode 600, got {mode:o}: chmod 600 '{path}'")


def _current_umask() -> int:
    """Return the process's file-mode mask (reading it means setting it twice)."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def check_new_folder(path: Path) -> None:
    """Refuse the name of a folder that is there, or anything else of that name.

    Raises
    ------
    InputError
        There is something at ``path``.
    """
    if os.path.lexists(path):
        raise InputError(f"{path}: expected the name of a new folder, got one that is there already")


def write_folder_atomically(path: str | PathLike[str], entries: Mapping[str, bytes]) -> None:
    """Write ``entries``, content by name with slashes, to a new folder ``path``: whole, or not at all.

    Raises
    ------
    InputError
        There is something at ``path`` already.
    StrainfmuError
        The operating system refused (disk full, no permission, ...).
    """
    path = Path(path)
    temporary: Path | None = None
    try:
        check_new_folder(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
        for name, content in entries.items():
            file = temporary.joinpath(*name.split("/"))
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        os.chmod(temporary, 0o777 & ~_current_umask())
        os.rename(temporary, path)
    except (OSError, ValueError) as error:  # the latter of names that no file can have
        reason = (error.strerror if isinstance(error, OSError) else None) or error
        raise StrainfmuError(f"{path}: could not be written: {reason}") from error
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)


def write_hdf5_atomically(
    path: str | PathLike[str], schema: str, schema_version: int, fill: Callable[[h5py.File], None]
) -> str:
    """Compose an HDF5 file in memory with ``fill``, stamp it and write it atomically.

    The file gets the root attributes ``schema``, ``schema_version`` and ``content_hash``, and ahead of the HDF5
    part a user block with one line of text: ``strainfmu SCHEMA VERSION sha256 DIGEST``, the digest of all bytes
    behind the block. So a damaged file is found out before HDF5, which may hang on one, sees it.

    Returns
    -------
    str
        The content hash (see :func:`content_hash`).
    """
    path = Path(path)
    with h5py.File(path.name, "w", driver="core", backing_store=False) as file:
        fill(file)
        file.attrs["schema"] = schema
        file.attrs["schema_version"] = schema_version
        digest = content_hash(file)
        file.attrs[HASH_ATTRIBUTE] = digest
        file.flush()
        image = file.id.get_file_image()
    line = f"strainfmu {schema} {schema_version} sha256 {hashlib.sha256(image).hexdigest()}\n"
    write_bytes_atomically(path, line.encode().ljust(USER_BLOCK_SIZE, b"\0") + image)
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


def open_hdf5(path: str | PathLike[str], schema: str, schema_version: int) -> h5py.File:
    """Open an artefact for reading after checking its kind, version and bytes.

    Raises
    ------
    InputError
        The file is missing, is not one of ours, is of another kind or version, or was altered.
    """
    path = Path(path)
    content = read_bytes(path)
    words = content[:USER_BLOCK_SIZE].split(b"\n")[0].decode("ascii", "replace").split(" ")
    if len(words) != 5 or words[0] != "strainfmu" or words[3] != "sha256":
        raise InputError(f"{path}: damaged, or not an HDF5 file written by strainfmu")
    if words[1] != schema:
        raise InputError(f"{path}: expected a file of schema '{schema}', found '{words[1]}'")
    if words[2] != str(schema_version):
        raise InputError(f"{path}: expected schema version {schema_version}, got {words[2]}; build it again")
    if words[4] != hashlib.sha256(content[USER_BLOCK_SIZE:]).hexdigest():
        raise InputError(
            f"{path}: damaged or altered since it was written as schema version {words[2]}; build it again"
        )
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise InputError(f"{path}: damaged, or not an HDF5 file") from error


def schema_of(path: str | PathLike[str]) -> str:
    """Return the schema that an artefact states, unchecked.

    Raises
    ------
    InputError
        The file is missing, cannot be read, or is not one of ours.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            words = stream.read(USER_BLOCK_SIZE).split(b"\n")[0].decode("ascii", "replace").split(" ")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(words) != 5 or words[0] != "strainfmu":
        raise InputError(f"{path}: damaged, or not an HDF5 file written by strainfmu")
    return words[1]


def content_hash_of(path: str | PathLike[str], schema: str, schema_version: int) -> str:
    """Return the content hash that identifies the artefact at ``path``.

    Raises
    ------
    InputError
        As :func:`open_hdf5`.
    """
    with open_hdf5(path, schema, schema_version) as file:
        return str(file.attrs[HASH_ATTRIBUTE])


def fingerprint(inputs: Mapping[str, Any]) -> str:
    """Return a short hash of the inputs of a computation, which decides whether its result is up to date."""
    text = json.dumps(inputs, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: Any) -> Any:
    """Turn arrays and paths into what JSON can hold."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (np.floating, np.integer)):
        return value.item()
    return str(value)
