"""A folder of results with a record of what each was made from, so that nothing is computed twice."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import fingerprint, write_bytes_atomically
from strainfmu.version import __version__

MANIFEST = "manifest.json"
MISFITS_NAMED = 3


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """An entry in which a file differs from what is expected of it; the values as a user reads them."""

    entry: str
    expected: str
    found: str

    def __str__(self) -> str:
        return f"{self.entry}: expected {self.expected}, got {self.found}"


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


class Workspace:
    """Results in ``folder``, with ``manifest.json``: per file its inputs' fingerprint and its own hash.

    A result is up to date if its inputs are those it was made from and its bytes are those then written, so a
    damaged or edited file is made again.

    Raises
    ------
    InputError
        ``folder`` exists and is no folder, or lies in a file.
    StrainfmuError
        It cannot be written: raised before the long work.
    """

    def __init__(self, folder: Path) -> None:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: is a file, must be a folder")
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        if not existing.is_dir():
            raise InputError(f"{folder}: expected a path in folders, got the file {existing} instead of one")
        if not os.access(existing, os.W_OK):
            raise StrainfmuError(f"{folder}: cannot be written, no permission in {existing}")
        self.folder = folder
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

    def given(self, name: str) -> dict[str, str]:
        """Return what was given besides the inputs when ``name`` was made here."""
        held = self._manifest().get(name, {}).get("given", {})
        return held if isinstance(held, dict) and self.path(name).is_file() else {}

    def ensure(
        self,
        name: str,
        inputs: Mapping[str, Any],
        make: Callable[[Path], object],
        given: Mapping[str, str] | None = None,
    ) -> bool:
        """Make ``name`` with ``make(path)`` unless it is up to date; return whether it was reused.

        ``make`` must write its file atomically. The manifest is written only after it; it keeps ``given``.
        """
        made_from = fingerprint({"strainfmu_version": __version__, **inputs})
        self._made_from[name] = made_from
        path = self.path(name)
        entry = self._manifest().get(name, {})
        if entry.get("made_from") == made_from and path.is_file() and entry.get("sha256") == _sha256(path):
            return True
        make(path)
        entries = self._manifest()
        entries[name] = {"made_from": made_from, "sha256": _sha256(path)}
        if given:
            entries[name]["given"] = dict(given)
        text = json.dumps(entries, indent=1, sort_keys=True)
        write_bytes_atomically(self.path(MANIFEST), text.encode())
        return False

    def _manifest(self) -> dict[str, dict[str, Any]]:
        """Return the manifest; one that cannot be read counts as empty, so that all is made again."""
        try:
            entries = json.loads(self.path(MANIFEST).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return entries if isinstance(entries, dict) else {}


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
