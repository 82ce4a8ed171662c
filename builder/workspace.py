"""A folder of results with a record of what each was made from, so that nothing is computed twice."""

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import fingerprint, kept_json, write_bytes_atomically
from strainfmu.version import __version__

MANIFEST = "manifest.json"
MISFITS_NAMED = 3
FILES = (".h5", ".fmu", ".csv", ".toml")
"""Suffixes of files of results: a folder of such a name is a mistake."""

SHARED, SHARED_VARIABLE = ".strainfmu", "STRAINFMU_CACHE"
"""The cache next to a vehicle file, and the environment variable that names another folder."""
LARGEST_CACHE = 4e9
"""Bytes of a cache; the files that were used longest ago go first."""


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """An entry in which a file differs from what is expected of it; the values as a user reads them."""

    entry: str
    expected: str
    actual: str

    def __str__(self) -> str:
        return f"{self.entry}: expected {self.expected}, got {self.actual}"


def refuse_misfits(path: Path | str, misfits: Sequence[Misfit], remedy: str = "") -> None:
    """Refuse a file, or what is named so, that does not fit, in one line; ``remedy`` ends it.

    Raises
    ------
    InputError
        There are misfits: the first are named, the others counted.
    """
    if not misfits:
        return
    named = "; ".join(map(str, misfits[:MISFITS_NAMED]))
    more = len(misfits) - MISFITS_NAMED
    counted = f"; and {more} more" if more > 0 else ""
    raise InputError(f"{path}: {named}{counted}{f'; {remedy}' if remedy else ''}")


class Cache:
    """Files that the commands on the vehicle files of a folder share, by the fingerprint of their inputs.

    A file's name has its own hash, so a damaged one is not used. The shipped vehicles have a cache only where
    ``STRAINFMU_CACHE`` names one; empty, nothing is shared. A folder that cannot be written is no error.
    """

    def __init__(self, vehicle_folder: Path) -> None:
        setting = os.environ.get(SHARED_VARIABLE)
        shipped = vehicle_folder.resolve() == Path(__file__).parent / "vehicles"
        self.folder = (
            Path(setting) if setting else None if shipped or setting is not None else vehicle_folder / SHARED
        )

    def find(self, name: str, inputs: Mapping[str, Any]) -> Path | None:
        """Return the file ``name`` that a command made from ``inputs``, None where there is none."""
        path = Path(name)
        for file in self.folder.glob(f"{path.stem}-{made_from_of(inputs)}-*{path.suffix}") if self.folder else ():
            if file.stem.endswith(f"-{_sha256(file)}"):
                with suppress(OSError):
                    file.touch()
                return file
        return None

    def take(self, name: str, inputs: Mapping[str, Any], path: Path) -> str:
        """Make ``path`` the file that :meth:`find` returns; return from where, "" where there is none."""
        file = self.find(name, inputs)
        if file is None:
            return ""
        path.parent.mkdir(parents=True, exist_ok=True)
        _link(file, path)
        return f"from {file.parent}"

    def add(self, name: str, inputs: Mapping[str, Any], path: Path) -> None:
        """Add the file at ``path`` as ``name``; it takes no space of its own where the file system links files."""
        if self.folder is None:
            return
        with suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            stem, suffix = Path(name).stem, Path(name).suffix
            _link(path, self.folder / f"{stem}-{made_from_of(inputs)}-{_sha256(path)}{suffix}")
            size = 0.0
            for file in sorted(self.folder.iterdir(), key=lambda file: -file.stat().st_mtime):
                size += file.stat().st_size
                if size > LARGEST_CACHE:
                    file.unlink()


class Workspace:
    """Results in ``folder``, with ``manifest.json``: per file its inputs' fingerprint and its own hash.

    A result is up to date if its inputs are those it was made from and its bytes are those then written, so a
    damaged or edited file is made again. Files that are made ``shared`` are taken from ``cache`` and added to it.

    Raises
    ------
    InputError
        ``folder`` exists and is no folder, or lies in a file.
    StrainfmuError
        It cannot be written: raised before the long work.
    """

    def __init__(self, folder: Path, cache: Cache | None = None) -> None:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: is a file, must be a folder")
        if not folder.exists() and folder.suffix in FILES:
            raise InputError(f"{folder}: expected a folder of results, got the name of a {folder.suffix} file")
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        if not existing.is_dir():
            raise InputError(f"{folder}: expected a path in folders, got the file {existing} instead of one")
        if not os.access(existing, os.W_OK):
            raise StrainfmuError(f"{folder}: cannot be written, no permission in {existing}")
        self.folder, self.cache = folder, cache
        self._made_from: dict[str, str] = {}

    def path(self, name: str) -> Path:
        """Return the path of a result."""
        return self.folder / name

    def made_from(self, name: str) -> str:
        """Return the fingerprint that ``name`` was made from, to be an input of what follows."""
        return self._made_from[name]

    def use(self, name: str, made_from: str) -> None:
        """Take ``name`` as made elsewhere, of the content that ``made_from`` identifies; nothing is written."""
        self._made_from[name] = made_from

    def holds_foreign(self, name: str) -> bool:
        """Return whether there is a file ``name`` that was not made here, or not left as it was made."""
        path = self.path(name)
        return path.is_file() and self._manifest().get(name, {}).get("sha256") != _sha256(path)

    def knows(self, name: str) -> bool:
        """Return whether a file ``name`` was made here, whatever has become of it."""
        return name in self._manifest()

    def files_given(self, name: str) -> dict[str, str]:
        """Return what was given besides the inputs when ``name`` was made here."""
        files = self._manifest().get(name, {}).get("given", {})
        return files if isinstance(files, dict) and self.path(name).is_file() else {}

    def ensure(
        self,
        name: str,
        inputs: Mapping[str, Any],
        make: Callable[[Path], object],
        files_given: Mapping[str, str] | None = None,
        *,
        shared: bool = False,
    ) -> str:
        """Make ``name`` with ``make(path)`` unless it is up to date; return from where it was reused, else "".

        ``make`` must write its file atomically. The manifest is written only after it; it keeps ``files_given``.
        """
        made_from = made_from_of(inputs)
        self._made_from[name] = made_from
        path = self.path(name)
        entry = self._manifest().get(name, {})
        if entry.get("made_from") == made_from and path.is_file() and entry.get("sha256") == _sha256(path):
            return "up to date"
        cache = self.cache if shared else None
        source = cache.take(name, inputs, path) if cache else ""
        if not source:
            make(path)
        entries = self._manifest()
        entries[name] = {"made_from": made_from, "sha256": _sha256(path)}
        if files_given:
            entries[name]["given"] = dict(files_given)
        text = json.dumps(entries, indent=1, sort_keys=True)
        write_bytes_atomically(self.path(MANIFEST), text.encode())
        if cache and not source:
            cache.add(name, inputs, path)
        return source

    def _manifest(self) -> dict[str, dict[str, Any]]:
        """Return the manifest; one that cannot be read counts as empty, so that all is made again."""
        entries = kept_json(self.path(MANIFEST))
        return entries if isinstance(entries, dict) else {}


def made_from_of(inputs: Mapping[str, Any]) -> str:
    """Return the fingerprint of a file's inputs, and of the version that makes it."""
    return fingerprint({"strainfmu_version": __version__, **inputs})


def _link(source: Path, path: Path) -> None:
    """Make ``path`` the file ``source``, at once: by a link, or by a copy where the file system has none."""
    new = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        os.link(source, new)
    except OSError:
        shutil.copyfile(source, new)
    new.replace(path)


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
