"""The built libraries: what they export and need, and that they are those of the sources."""

import re
import shutil
import struct
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import pytest
from raw_fmu import shipped_library

from strainfmu.errors import InputError
from strainfmu.estimator.library_sources import LIBRARIES, MARK, library_digest
from strainfmu.fmu.native.build import (
    NATIVE,
    PLATFORMS,
    ZIG_VERSION,
    build_library,
    fmi_headers,
    library_file,
    main,
    source_files,
    universal_library,
)

HAVE_ZIG = find_spec("ziglang") is not None and version("ziglang") == ZIG_VERSION
needs_zig = pytest.mark.skipif(not HAVE_ZIG, reason=f"needs zig {ZIG_VERSION}: pip install 'strainfmu[native]'")


def functions(fmi: int) -> list[str]:
    """Names of all functions of an FMI version, by its header."""
    header = (fmi_headers() / f"fmi{fmi}Functions.h").read_text("latin-1")
    return re.findall(rf"FMI{fmi}_Export\s+\w+TYPE\s+(fmi{fmi}\w+);", header)


@pytest.mark.parametrize(("fmi", "count"), [(2, 44), (3, 75)])
def test_all_functions_are_there(fmi: int, count: int) -> None:
    names = functions(fmi)
    assert len(names) == count
    assert [name for name in names if not hasattr(shipped_library(), name)] == []


@pytest.mark.parametrize("library", list(LIBRARIES))
@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_every_platform_has_its_libraries(platform: str, library: str) -> None:
    content = library_file(platform, library).read_bytes()
    magic = {"linux64": b"\x7fELF", "aarch64-linux": b"\x7fELF", "win64": b"MZ", "darwin64": b"\xca\xfe\xba\xbe"}
    assert content.startswith(magic.get(platform, b"\xcf\xfa\xed\xfe"))
    names = [name.encode() for fmi in (2, 3) for name in functions(fmi)]
    assert [name for name in names if name not in content] == []
    assert b"/native/" not in content  # nothing of the folder it was built in
    assert set(re.findall(MARK.encode() + rb"(\w+)", content)) == {library_digest(library, NATIVE).encode()}


@pytest.mark.parametrize("library", list(LIBRARIES))
def test_nothing_but_libc_is_needed(library: str) -> None:
    content = library_file("linux64", library).read_bytes()
    assert re.findall(rb"lib[a-z]+\.so\.\d+", content) == [b"libc.so.6"]
    assert set(re.findall(rb"GLIBC_[\d.]+", content)) <= {b"GLIBC_2.2.5", b"GLIBC_2.14"}
    windows = set(re.findall(rb"[\w-]+\.dll", library_file("win64", library).read_bytes()))
    assert all(name.startswith((b"api-ms-win-crt-", b"KERNEL32", library.encode())) for name in windows), windows


def test_sources_are_short_and_complete() -> None:
    names = {path.name for path in source_files()}
    assert names >= {"estimator.c", "dense.c", "fmi2.c", "fmi3_instance.c"}
    assert not list(NATIVE.rglob("fmi[23]Function*.h"))  # an FMU must not bring the standard's headers


@pytest.mark.parametrize("library", list(LIBRARIES))
def test_no_two_sources_have_the_same_name(library: str) -> None:
    """Importers compile them all at once, and some compilers write all objects into one folder."""
    files = source_files(library)
    assert len({path.name.lower() for path in files}) == len(files)


def test_universal_library() -> None:
    parts = [struct.pack("<3I", 0xFEEDFACF, kind, 3) + bytes([kind]) * 100 for kind in (7, 12)]
    content = universal_library(parts)
    assert struct.unpack_from(">2I", content) == (0xCAFEBABE, 2)
    for k, part in enumerate(parts):
        processor, _, position, size, alignment = struct.unpack_from(">5I", content, 8 + 20 * k)
        assert (processor, size, position % (1 << alignment)) == ((7, 12)[k], len(part), 0)
        assert content[position : position + size] == part


def test_unknown_platform() -> None:
    with pytest.raises(InputError, match="'amiga' found, must be one of linux64"):
        main(["amiga"])


def copied_sources(folder: Path) -> Path:
    """The C sources in another folder: the same bytes are built there."""
    return Path(shutil.copytree(NATIVE, folder / "copy", ignore=shutil.ignore_patterns("binaries")))


@pytest.mark.slow
@needs_zig
@pytest.mark.parametrize("library", list(LIBRARIES))
@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_all_libraries_are_those_of_the_sources(platform: str, library: str, tmp_path: Path) -> None:
    """Built from a copy of the sources, the shipped ones in their own folder: no path is in the bytes.

    In every run each library states the digest of its sources, above.
    """
    assert (
        build_library(platform, library, copied_sources(tmp_path)) == library_file(platform, library).read_bytes()
    )


@pytest.mark.parametrize(("fmi", "first"), [(2, "fmi2TypesPlatform"), (3, "fmi3PlatformTypes")])
def test_copied_headers_are_those_of_the_standard(fmi: int, first: str) -> None:
    """One file holds the three headers of a version, without the lines that include each other."""
    parts = [
        (fmi_headers() / f"{name}.h").read_text("ascii")
        for name in (first, f"fmi{fmi}FunctionTypes", f"fmi{fmi}Functions")
    ]
    expected = [re.sub(r'(?m)^#include "fmi\d\w+\.h"\n', "", part).rstrip() for part in parts]
    assert (NATIVE / "headers" / f"fmi{fmi}.h").read_text("ascii") == "\n\n".join(expected) + "\n"
