"""Build of the native libraries: ``python -m strainfmu.fmu.native.build [platform ...]``, all by default.

The libraries lie in ``fmus/native/binaries``, so that exporting an FMU needs no compiler. Building them again
needs the extra ``native``: zig's C compiler, which carries headers and libraries of every target, and fmpy for the
FMI headers. The same sources and the same version of zig give the same bytes, on any machine and in any folder.
"""

import importlib.util
import struct
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.library_sources import BINARIES, LIBRARIES, MARK, library_digest, library_folders
from strainfmu.files import write_bytes_atomically
from strainfmu.fmu.native.sources import ARITHMETIC_FLAGS

NATIVE = Path(__file__).parents[3] / "fmus" / "native"
"""Folder of the C sources, with the built libraries in ``binaries``."""

ZIG_VERSION = "0.17.1"
"""The version of zig that the libraries were built with."""

COMPILER_FLAGS = (
    "-std=c99",
    "-O2",
    "-DNDEBUG",
    *ARITHMETIC_FLAGS,
    # Measured on x86-64: 2 % less for a step with a gauge that does not fit; the bits are the same.
    "-falign-loops=32",
    "-Wall",
    "-Wextra",
    "-Werror",
)
LIBRARY_FLAGS = ("-shared", "-s", "-fvisibility=hidden")


_DIGEST = """\
#ifdef _WIN32
__declspec(dllexport)
#else
__attribute__((visibility("default")))
#endif
const char strainfmu_sources[] = "{mark}{digest}";
"""
"""A source that keeps the digest of all others in the library."""


@dataclass(frozen=True)
class Platform:
    """A platform of FMI.

    Attributes
    ----------
    suffix : of its shared libraries.
    targets : zig's name of each processor that one library serves.
    flags : in addition to :data:`COMPILER_FLAGS` and :data:`LIBRARY_FLAGS`; ``{name}`` stands for the library.
    """

    suffix: str
    targets: tuple[str, ...]
    flags: tuple[str, ...] = ()


# zig would leave the path of the build in a dylib, and ask for its own version of macOS.
_MACOS = ("-Wl,-install_name,@rpath/{name}.dylib",)

PLATFORMS = {
    "linux64": Platform(".so", ("x86_64-linux-gnu.2.17",), ("-fPIC",)),
    "win64": Platform(".dll", ("x86_64-windows-gnu",)),
    "darwin64": Platform(".dylib", ("x86_64-macos.11.0", "aarch64-macos.11.0"), _MACOS),
    "aarch64-linux": Platform(".so", ("aarch64-linux-gnu.2.17",), ("-fPIC",)),
    "aarch64-darwin": Platform(".dylib", ("aarch64-macos.11.0",), _MACOS),
}
"""By the name of FMI 2.0, or the name of FMI 3.0 where 2.0 has none. ``darwin64`` is a universal library."""


def source_files(library: str = "estimator", native: Path = NATIVE) -> tuple[Path, ...]:
    """Return the C files that make a library, a key of :data:`~strainfmu.estimator.library_sources.LIBRARIES`."""
    return tuple(
        file for folder in library_folders(library) for file in sorted(native.joinpath(folder).rglob("*.c"))
    )


def library_file(platform: str, library: str = "estimator", folder: Path = NATIVE / BINARIES) -> Path:
    """Return the path of a library for ``platform`` under ``folder``."""
    return folder / platform / f"{library}{PLATFORMS[platform].suffix}"


def fmi_headers() -> Path:
    """Return the folder of the FMI headers, which fmpy brings.

    Raises
    ------
    InputError
        fmpy is not installed.
    """
    spec = importlib.util.find_spec("fmpy")
    if spec is None or spec.origin is None:
        raise InputError("the FMI headers come with fmpy: pip install 'strainfmu[fmu]'")
    return Path(spec.origin).parent / "c-code"


def zig_compiler() -> list[str]:
    """Return the command of zig's C compiler.

    Raises
    ------
    InputError
        It is not installed.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise InputError("compiling for all platforms needs zig: pip install 'strainfmu[native]'")
    return [sys.executable, "-m", "ziglang", "cc"]


def compile_with_zig(target: str, arguments: list[str]) -> None:
    """Compile for ``target`` with :data:`COMPILER_FLAGS` and ``arguments``.

    Raises
    ------
    StrainfmuError
        The compiler reported an error.
    """
    command = [*zig_compiler(), "-target", target, *COMPILER_FLAGS, f"-I{fmi_headers()}", *arguments]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode != 0:
        raise StrainfmuError(f"{target}: compiling failed: {finished.stderr.strip()}")


def build_library(platform: str, library: str = "estimator", native: Path = NATIVE) -> bytes:
    """Return a library for ``platform``, a key of :data:`PLATFORMS`, made of the sources under ``native``.

    Raises
    ------
    StrainfmuError
        The compiler reported an error.
    """
    chosen = PLATFORMS[platform]
    flags = [flag.format(name=library) for flag in chosen.flags]
    arguments = [*LIBRARY_FLAGS, *flags, *map(str, source_files(library, native))]
    digest = _DIGEST.format(mark=MARK, digest=library_digest(library, native))
    with tempfile.TemporaryDirectory() as folder:
        parts = []
        source = Path(folder) / "strainfmu_sources.c"
        source.write_text(digest, "ascii")
        for target in chosen.targets:
            output = Path(folder) / f"{library}{chosen.suffix}"
            compile_with_zig(target, [*arguments, str(source), "-o", str(output)])
            parts.append(output.read_bytes())
    return parts[0] if len(parts) == 1 else universal_library(parts)


def universal_library(libraries: list[bytes]) -> bytes:
    """Return one macOS library of several, each for another processor.

    Source: Apple, ``mach-o/fat.h``: a big-endian header with processor, position, size and alignment of each.
    """
    alignment = 14  # as a power of two: 16 KiB pages of Apple's processors
    entries, body = b"", b""
    position = _aligned(8 + 20 * len(libraries), alignment)
    start = position
    for library in libraries:
        processor, kind = struct.unpack_from("<II", library, 4)
        entries += struct.pack(">5I", processor, kind, position, len(library), alignment)
        body += library
        position = _aligned(position + len(library), alignment)
        body += bytes(position - start - len(body))
    header = struct.pack(">2I", 0xCAFEBABE, len(libraries)) + entries
    return header + bytes(start - len(header)) + body


def _aligned(position: int, alignment: int) -> int:
    return (position + (1 << alignment) - 1) >> alignment << alignment


def main(platforms: Sequence[str]) -> None:
    """Write the libraries for ``platforms``, all if there are none, to their files.

    Raises
    ------
    InputError
        There is no such platform.
    StrainfmuError
        The compiler reported an error.
    """
    for platform in platforms or PLATFORMS:
        if platform not in PLATFORMS:
            raise InputError(f"platform: '{platform}' found, must be one of {', '.join(PLATFORMS)}")
        for library in LIBRARIES:
            content = build_library(platform, library)
            write_bytes_atomically(library_file(platform, library), content)
            print(f"{library_file(platform, library)}: {len(content)} bytes")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except StrainfmuError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
