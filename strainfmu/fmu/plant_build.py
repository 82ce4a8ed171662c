"""Build the C run-time of plant, autopilot and schedule: ``python -m strainfmu.fmu.plant_build [platform ...]``.

Flags, platforms and what it needs are those of :mod:`strainfmu.fmu.native_build`. One library holds all
three models.
"""

from __future__ import annotations

from pathlib import Path

from strainfmu.fmu.native_build import NATIVE, PLATFORMS, compile_library, run_build, write_libraries

SOURCES = NATIVE / "plant"
"""Folder of the C sources, with the built libraries in ``binaries``."""

SHARED_SOURCES = ("map_resource", "uri_path")
"""Names of the estimator's files that are used here too: reading a file, its header and checksum, and its path."""


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
    return compile_library(platform, "plant", source_files(), (NATIVE, SOURCES))


def main(platforms: list[str]) -> None:
    """Build the libraries for ``platforms``, all if there are none."""
    write_libraries(platforms, build_library, library_file)


if __name__ == "__main__":
    run_build(main)
