"""A folder of results with a record of what each was made from, so that nothing is computed twice."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import fingerprint, write_bytes_atomically
from strainfmu.version import __version__

MANIFEST = "manifest.json"


class Workspace:
    """Results in ``folder``, with ``manifest.json``: per file its inputs' fingerprint and its own hash.

    A result is up to date if its inputs are those it was made from and its bytes are those then written, so a
    damaged or edited file is made again.

    Raises
    ------
    InputError
        ``folder`` exists and is no folder.
    StrainfmuError
        It cannot be written: raised before the long work.
    """

    def __init__(self, folder: Path) -> None:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: is a file, must be a folder")
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
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

    def ensure(self, name: str, inputs: Mapping[str, Any], make: Callable[[Path], object]) -> bool:
        """Make ``name`` with ``make(path)`` unless it is up to date; return whether it was reused.

        ``make`` must write its file atomically. The manifest is written only after it.
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
        text = json.dumps(entries, indent=1, sort_keys=True)
        write_bytes_atomically(self.path(MANIFEST), text.encode())
        return False

    def _manifest(self) -> dict[str, dict[str, str]]:
        """Return the manifest; one that cannot be read counts as empty, so that all is made again."""
        try:
            entries = json.loads(self.path(MANIFEST).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return entries if isinstance(entries, dict) else {}


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
