"""Build the C run-time of plant, autopilot and schedule: ``python -m strainfmu.fmu.plant_build [platform ...]``.

Flags, platforms and what it needs are those of :mod:`strainfmu.fmu.native_build`. One library holds all
three models.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.files import write_bytes_atomically
from strainfmu.fmu.native_build import LIBRARY_FLAGS, NATIVE, PLATFORMS, compile_with_zig, universal_library

SOURCES = NATIVE / "plant"
"""Folder of the C sources, with the built libraries in ``binaries``."""

SHARED_SOURCES = ("map_resource", "uri_path")
"""Names of the estimator's files that are used here too: reading a file, its checksum, and its path."""


def source_files() -> tuple[Path, ...]:
    """Return the C files that make the library."""
    return (*sorted(SOURCES.glob("*.c")), *(NATIVE / f"{name}.c" for name in SHARED_SOURCES))


def library_file(platform: str, folder: Path = SOURCES / "binaries") -> Path:
    """Return where the library for ``platform`` lies under ``folder``."""
    return folder / platform / f"plant{PLATFORMS[platform].suffix}"


def build_library(platform: str) -> bytes:
    """Return the library for ``platform``, a key of :data:`~strainfmu.fmu.native_build.PLATFORMS`.

    Raises
    ------
    StrainfmuError
        The compiler reported an error.
    """
    chosen = PLATFORMS[platform]
    flags = [flag.replace("estimator", "plant") for flag in chosen.flags]
    includes = [f"-I{NATIVE}", f"-I{SOURCES}"]
    with tempfile.TemporaryDirectory() as folder:
        parts = []
        for target in chosen.targets:
            output = Path(folder) / f"plant{chosen.suffix}"
            sources = [str(path) for path in source_files()]
            compile_with_zig(target, [*LIBRARY_FLAGS, *flags, *includes, *sources, "-o", str(output)])
            parts.append(output.read_bytes())
    return parts[0] if len(parts) == 1 else universal_library(parts)


def main(platforms: list[str]) -> None:
    """Build the libraries for ``platforms``, all if there are none."""
    for platform in platforms or PLATFORMS:
        if platform not in PLATFORMS:
            raise InputError(f"platform: '{platform}' found, must be one of {', '.join(PLATFORMS)}")
        library = build_library(platform)
        write_bytes_atomically(library_file(platform), library)
        print(f"{library_file(platform)}: {len(library)} bytes")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except StrainfmuError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
