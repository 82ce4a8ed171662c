"""C sources of the native FMUs: which folders make a library, and what ``sources/`` of an FMU holds.

Every FMU brings the sources of its model and of its FMI version, and two ways to build them: ``CMakeLists.txt``,
and ``buildDescription.xml`` for importers that compile by themselves.
"""

import posixpath
import re
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from strainfmu.estimator.library_sources import BESIDE, FRONTS, LIBRARIES

ARITHMETIC_FLAGS = (
    # Without fused multiply-adds every platform computes the same bits.
    "-ffp-contract=off",
    # sqrt becomes one instruction, and nothing of libm is needed.
    "-fno-math-errno",
)
"""What each compiler of the sources must be given; ``library.cmake`` gives it too."""


_CORE = "core"
"""Folder of what models and fronts have in common."""

_INCLUDE = re.compile(rb'^#include "([^"]+)"', re.MULTILINE)


_NO_PORTS = b'#include "core/ports.h"\n\nconst NodeKind *const NODE_KINDS[] = {0};\n'
"""A source for FMUs of FMI 3.0 that are on no bus."""


def native_sources(library: str, fmi_version: str, on_bus: bool = False) -> dict[str, bytes]:
    """Return content by name inside ``sources/`` of what the FMUs of one library and FMI version have in common.

    Those ``on_bus`` bring what the library has in addition to its model.

    The names are those below ``fmus/native``. The standard's headers are there as one file, which CMake uses where
    it knows no others: FMI excludes them by their own names from ``sources/``.
    """
    native = resources.files("fmus").joinpath("native")
    front = FRONTS[fmi_version]
    names = ["library.cmake", f"headers/{front}.h"]
    for folder in (*LIBRARIES[library], *(BESIDE[library] if on_bus else ()), front):
        files = _files_below(native.joinpath(folder))
        names += [f"{folder}/{name}" for name in files if name.endswith((".c", ".h"))]
    sources = {name: native.joinpath(*name.split("/")).read_bytes() for name in sorted(names)}
    return sources | ({"ports.c": _NO_PORTS} if fmi_version == "3" and not on_bus else {})


def model_sources(library: str) -> dict[str, bytes]:
    """Return content by name of the sources that the models of a library need without a front of FMI.

    The names are relative to ``fmus/native``. Of ``core``, which the fronts use too, these are the headers that
    the models include, directly or through others, and the file of the same name next to each.
    """
    native = resources.files("fmus").joinpath("native")
    contents = {
        f"{folder}/{name}": native.joinpath(folder, *name.split("/")).read_bytes()
        for folder in LIBRARIES[library]
        for name in _files_below(native.joinpath(folder))
        if name.endswith((".c", ".h"))
    }
    needed = set[str]()
    new = {name for name in contents if not name.startswith(f"{_CORE}/")}
    while new:
        needed |= new
        headers = {header for name in new for header in _included(name, contents[name])}
        new = {
            name for header in headers for name in (header, f"{header.removesuffix('.h')}.c") if name in contents
        } - needed
    return {name: contents[name] for name in sorted(needed)}


def _included(name: str, content: bytes) -> set[str]:
    """Return the headers that a source includes, by names as its own."""
    folder = posixpath.dirname(name)
    return {posixpath.normpath(posixpath.join(folder, include.decode())) for include in _INCLUDE.findall(content)}


def _files_below(folder: Traversable) -> Iterator[str]:
    """Yield the names of the files in ``folder`` and in the folders below it."""
    for item in folder.iterdir():
        if item.is_dir():
            yield from (f"{item.name}/{name}" for name in _files_below(item))
        else:
            yield item.name


def compiled_files(sources: Mapping[str, bytes]) -> list[str]:
    """Return the names of the files to compile."""
    return [name for name in sources if name.endswith(".c")]


def cmake_lists(model_identifier: str, source_files: Sequence[str]) -> bytes:
    """Return ``sources/CMakeLists.txt`` of an FMU."""
    files = "\n".join(f"  {name}" for name in source_files)
    text = f"""\
# The shared library of this FMU: cmake -S sources -B build && cmake --build build
# The result is build/{model_identifier} with the suffix of the platform; it belongs into binaries/<platform>/.

cmake_minimum_required(VERSION 3.10)
project({model_identifier} LANGUAGES C)
include(library.cmake)

add_fmi_library({model_identifier}
{files}
)
"""
    return text.encode()


def build_description(model_identifier: str, source_files: Sequence[str]) -> bytes:
    """Return ``sources/buildDescription.xml``, with the options of gcc and clang that equal bits need.

    Source: FMI 3.0.2, section 2.6; FMI 2.0.4 and later allow the same file, next to ``SourceFiles`` (section 2.3).
    """
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": model_identifier})
    options = " ".join(("-std=c99", "-O2", *ARITHMETIC_FLAGS))
    source_set = {"language": "C99", "compiler": "clang", "compilerOptions": options}
    files = SubElement(configuration, "SourceFileSet", source_set)
    for name in source_files:
        SubElement(files, "SourceFile", {"name": name})
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True)
