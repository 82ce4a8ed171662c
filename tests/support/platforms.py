"""Programs that run what is built for other processors and systems; without one, the test is skipped."""

import os
import shutil
from pathlib import Path

import pytest

# Targets of zig.
LINUX = "x86_64-linux-gnu.2.17"
AARCH64 = "aarch64-linux-gnu.2.17"
WINDOWS = "x86_64-windows-gnu"

NARROWER = ("Nehalem", "Haswell")
"""Processors with SSE2 alone, and with AVX2 but without AVX-512."""


def program(*names: str, install: str) -> str:
    """The first of the programs that is installed."""
    for name in names:
        path = shutil.which(name) or (name if os.access(name, os.X_OK) else None)
        if path is not None:
            return path
    return pytest.skip(f"needs {names[0]}: {install}")


def by_processor(name: str) -> list[str]:
    """The command that runs a program of x86-64 by one of :data:`NARROWER`."""
    return [program("qemu-x86_64", install="apt install qemu-user"), "-cpu", name]


def by_aarch64() -> list[str]:
    """The command that runs a program of :data:`AARCH64`."""
    emulator = program("qemu-aarch64", install="apt install qemu-user libc6-arm64-cross")
    sysroot = Path("/usr/aarch64-linux-gnu")
    if not sysroot.is_dir():
        pytest.skip("needs the C library of aarch64: apt install libc6-arm64-cross")
    return [emulator, "-L", str(sysroot)]


def by_windows() -> list[str]:
    """The command that runs a program of :data:`WINDOWS`."""
    return [program("wine64", "wine", "/usr/lib/wine/wine64", install="apt install wine64")]


def clang() -> str:
    """The compiler with sanitizers."""
    return program("clang", "clang-14", "clang-16", "clang-19", install="apt install clang libclang-rt-14-dev")
