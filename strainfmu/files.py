"""Files that are either whole or not there: atomic writes, HDF5 images, content hashes, files written in parts.

HDF5 is composed in memory and written as one block of bytes, so that a full disk or a kill leaves
the previous file untouched and never a half-written one. What is too long for that is written to a temporary file.
"""

import hashlib
import io
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any, Protocol, TypeVar

import h5py
import numpy as np

from strainfmu.errors import InputError, StrainfmuError

HASH_ATTRIBUTE = "content_hash"
BUILT_ATTRIBUTE = "built"
"""Time at which a file was made, which is no part of its content."""

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


def kept_json(path: Path) -> Any:
    """Return what a JSON file holds that is made again where it is missing or damaged: None."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


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


def stated_time() -> datetime | None:
    """Return the time by SOURCE_DATE_EPOCH (reproducible-builds.org), None where it is not set.

    Raises
    ------
    InputError
        SOURCE_DATE_EPOCH is no number of seconds.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    try:
        if epoch is None or int(epoch) >= 0:
            return None if epoch is None else datetime.fromtimestamp(int(epoch), UTC)
        raise ValueError("before 1970")
    except (ValueError, OverflowError, OSError) as error:
        raise InputError(f"SOURCE_DATE_EPOCH: expected whole seconds since 1970, got '{epoch}'") from error


def build_time() -> str:
    """Return the time to state in a file that is made, as XML has it: :func:`stated_time`, else now."""
    return f"{stated_time() or datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"


def write_hdf5_atomically(
    path: str | PathLike[str],
    schema: str,
    schema_version: int,
    fill: Callable[[h5py.File], None],
    built_at: str = "",
) -> str:
    """Compose an HDF5 file in memory with ``fill``, stamp it and write it atomically.

    The file gets the root attributes ``schema``, ``schema_version``, ``content_hash`` and, unless it is "",
    ``built_at``, the time at which it was made, which is no part of the hash; and ahead of the HDF5
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
        if built_at:
            file.attrs[BUILT_ATTRIBUTE] = built_at
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
            if not (name == "/" and key in (HASH_ATTRIBUTE, BUILT_ATTRIBUTE)):
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


def built_time_of(path: str | PathLike[str], schema: str, schema_version: int) -> str:
    """Return the time at which the artefact at ``path`` was made, "" where it states none.

    Raises
    ------
    InputError
        As :func:`open_hdf5`.
    """
    with open_hdf5(path, schema, schema_version) as file:
        return str(file.attrs.get(BUILT_ATTRIBUTE, ""))


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


class PartWriter(Protocol):
    """An open file that is written in parts."""

    def finish(self) -> None:
        """Write what is missing and bring all to the disk; raises OSError if it cannot."""
        ...

    def close(self) -> None:
        """Close the file, in order or not."""
        ...


Writer = TypeVar("Writer", bound=PartWriter)


@contextmanager
def whole_file(path: Path, opened: Callable[[Path], Writer]) -> Iterator[Writer]:
    """Write ``path`` by what ``opened`` returns of a temporary file next to it.

    The file is finished and renamed into place at the end, and removed if there was an error.

    Raises
    ------
    StrainfmuError
        It cannot be written; an earlier file remains unchanged.
    """
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            writer = opened(temporary)
        try:
            yield writer
            with writing(path):
                writer.finish()
        finally:
            writer.close()
        with writing(path):
            os.replace(temporary, path)
    finally:
        with suppress(OSError):  # there is none, or nothing can be written there
            temporary.unlink()


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an error of the operating system into one line that names ``path``."""
    try:
        yield
    except OSError as error:
        raise StrainfmuError(f"{path}: could not be written: {error.strerror or error}") from error


class GuardedFile(io.RawIOBase):
    """A new file for HDF5 to write to, which never fails towards it; :attr:`error` is the first error.

    When a write fails (a full disk), HDF5 keeps what it could not write, fails again while it closes, and crashes
    the process at the latest at its end. Here the error is kept for the caller; what could not be written is in
    memory, so that HDF5 closes the file in order. The file is to be closed and removed then.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.error: OSError | None = None
        self._file = path.open("w+b", buffering=0)
        self._position = 0
        self._end = 0
        self._unwritten: list[tuple[int, bytes]] = []

    def raise_error(self) -> None:
        """Raise what went wrong so far, if anything did."""
        if self.error is not None:
            raise self.error

    def write(self, data: Any) -> int:
        """Write ``data``, any buffer, at the position; return its length in bytes, whatever happened to it."""
        content = memoryview(data).cast("B")
        if self.error is None:
            self._to_disk(content)
        if self.error is not None:
            self._unwritten.append((self._position, bytes(content)))
        self._position += len(content)
        self._end = max(self._end, self._position)
        return len(content)

    def readinto(self, buffer: Any) -> int:
        """Fill ``buffer`` from the position on; return the number of bytes read."""
        view = memoryview(buffer).cast("B")
        first = self._position
        n = max(min(len(view), self._end - first), 0)
        content = bytearray(n)
        self._from_disk(content)
        for start, part in self._unwritten:
            low, high = max(start, first), min(start + len(part), first + n)
            if low < high:
                content[low - first : high - first] = part[low - start : high - start]
        view[:n] = content
        self._position += n
        return n

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to ``offset`` [bytes] and return the position."""
        origin = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._end}[whence]
        self._position = origin + offset
        return self._position

    def tell(self) -> int:
        """Return the position [bytes]."""
        return self._position

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file [bytes]."""
        self._end = self._position if size is None else size
        if self.error is None:
            try:
                self._file.truncate(self._end)
            except OSError as error:
                self.error = error
        return self._end

    def sync(self) -> None:
        """Bring all to the disk itself, which may be where a lack of space shows; raises OSError if it cannot."""
        self.raise_error()
        os.fsync(self._file.fileno())

    def readable(self) -> bool:
        """Return true."""
        return True

    def writable(self) -> bool:
        """Return true."""
        return True

    def seekable(self) -> bool:
        """Return true."""
        return True

    def close(self) -> None:
        """Close the file; an error of this is kept too."""
        if not self.closed:
            try:
                self._file.close()
            except OSError as error:
                self.error = self.error or error
            super().close()

    def _to_disk(self, rest: memoryview) -> None:
        try:
            self._file.seek(self._position)
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = error

    def _from_disk(self, content: bytearray) -> None:
        """Fill ``content`` from the position on, as far as the file reaches."""
        view = memoryview(content)
        try:
            self._file.seek(self._position)
            while view and (read := self._file.readinto(view)):
                view = view[read:]
        except OSError as error:
            self.error = self.error or error
