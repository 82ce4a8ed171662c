"""The C sources of each compiled library, and the digest of them that a library carries.

The build compiles the digest in, after :data:`MARK`. A checkout or an installation has sources too: no FMU gets a
library of other ones, and Python loads none.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from pathlib import Path

from strainfmu.errors import InputError

LIBRARIES = {
    "estimator": ("core", "estimator"),
    "plant": ("core", "system", "plant", "autopilot", "schedule"),
}
"""Folders below ``fmus/native`` of the models in each library; ``plant`` serves autopilot and schedule too."""

BESIDE = {"estimator": ("bus", "network", "ecu"), "plant": ("bus", "network", "nodes")}
"""Folders that the built library holds next to the model, for Python and for FMUs on a bus, which bring their
sources."""

FRONTS = {"2": "fmi2", "3": "fmi3"}
"""Folder below ``fmus/native`` of the front of each FMI version; a library holds both."""

BINARIES = "binaries"
"""Folder below ``fmus/native`` of the built libraries, in one folder for each platform."""

MARK = "strainfmu sources: sha256 "
"""What stands in a library before the digest of its sources."""

_MARKED = re.compile(MARK.encode() + rb"([0-9a-f]{64})")


def library_folders(library: str) -> tuple[str, ...]:
    """Return the folders that make ``library``, a key of :data:`LIBRARIES`."""
    return (*FRONTS.values(), *LIBRARIES[library], *BESIDE[library])


def sources_digest(sources: Mapping[str, bytes]) -> str:
    """Return a hash of names and content of ``sources``."""
    digest = hashlib.sha256()
    for name, content in sources.items():
        digest.update(f"{name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def library_digest(library: str, native: Path) -> str:
    """Return the digest of all sources of ``library`` in the folder ``native``; "" without any.

    Line ends of any system are equal.
    """
    root = os.fspath(native)
    names = [
        os.path.join(folder, name)[len(root) + 1 :].replace(os.sep, "/")
        for part in library_folders(library)
        for folder, _, files in os.walk(os.path.join(root, part))
        for name in files
        if name.endswith((".c", ".h"))
    ]
    sources = {}
    for name in sorted(names):
        with open(os.path.join(root, name), "rb", buffering=0) as stream:  # pathlib takes twice as long
            sources[name] = stream.read().replace(b"\r\n", b"\n")
    return sources_digest(sources) if sources else ""


def is_of_sources(content: bytes, digest: str) -> bool:
    """Return whether the library ``content`` carries ``digest``, "" for any."""
    return not digest or set(_MARKED.findall(content)) == {digest.encode()}


def require_digest(content: bytes, digest: str, platform: str, library: str) -> None:
    """Refuse a library for ``platform`` whose ``content`` carries another digest than ``digest``, "" for any.

    Raises
    ------
    InputError
        It was built from other sources, or by a build that compiles no digest in.
    """
    if not is_of_sources(content, digest):
        raise InputError(
            f"fmus/native/{BINARIES}/{platform}/{library}: expected a library of the C sources in fmus/native, got"
            f" one of other sources; build it: python -m strainfmu.fmu.native.build {platform}"
        )
