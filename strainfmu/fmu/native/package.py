"""The native kind of FMU: prebuilt libraries for several platforms, their sources, and a resource they read.

No compiler is needed: the libraries lie in ``fmus/native/binaries``, one folder per platform, each library with
the functions of FMI 2.0 and FMI 3.0. The export renames it to the model identifier.
"""

import struct
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.library_sources import BINARIES, library_digest, require_digest
from strainfmu.fmu.description.fmu_description import FmuDescription
from strainfmu.fmu.description.model_description import model_description_bytes
from strainfmu.fmu.native.sources import build_description, cmake_lists

CAPABILITIES = {
    "2": {
        "needsExecutionTool": "false",
        "canHandleVariableCommunicationStepSize": "true",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    },
    "3": {
        "needsExecutionTool": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
        "canHandleVariableCommunicationStepSize": "true",
    },
}
"""What the library can do: attributes of CoSimulation, by FMI version."""

CAPABILITIES_ON_BUS = {
    **{name: value for name, value in CAPABILITIES["3"].items() if not name.startswith("provides")},
    "hasEventMode": "true",
}
"""The same of an FMU whose inputs come in frames."""

MODEL_EXCHANGE = {
    version: {name: value for name, value in of_steps.items() if name != "canHandleVariableCommunicationStepSize"}
    for version, of_steps in CAPABILITIES.items()
}
MODEL_EXCHANGE["3"]["needsCompletedIntegratorStep"] = "true"
"""What the estimator's library can do for model exchange: no states, but events when health changes."""

FOLDERS = {
    "x86_64-linux": "linux64",
    "x86_64-windows": "win64",
    "x86-windows": "win32",
    "x86_64-darwin": "darwin64",
    "aarch64-linux": "aarch64-linux",
    "aarch64-darwin": "aarch64-darwin",
    "aarch64-windows": "aarch64-windows",
}
"""Folder in FMI 2.0 by that in FMI 3.0; 2.0 names four platforms and takes the names of 3.0 for the others."""

_SUFFIXES = (".so", ".dll", ".dylib")

_X86_64 = 0x01000007
"""CPU_TYPE_X86_64 of Apple's ``mach/machine.h``."""


def shipped_libraries(library: str) -> dict[str, tuple[str, bytes]]:
    """Return suffix and content of a library by platform, as FMI 3.0 names it, in alphabetical order.

    ``library`` is a key of :data:`~strainfmu.estimator.library_sources.LIBRARIES`.
    """
    libraries = {}
    folder = resources.files("fmus").joinpath("native", BINARIES)
    if folder.is_dir():
        tuples = {name: platform for platform, name in FOLDERS.items()}
        for item in folder.iterdir():
            platform = tuples.get(item.name, item.name)
            for file in item.iterdir() if item.is_dir() and platform in FOLDERS else ():
                for suffix in _SUFFIXES:
                    if file.name == f"{library}{suffix}":
                        libraries[platform] = (suffix, file.read_bytes())
    return dict(sorted(libraries.items()))


def processor_library(universal: bytes, processor: int) -> bytes:
    """Return the library for ``processor``, a CPU_TYPE, of a universal macOS library; any other as it is.

    Source: Apple, ``mach-o/fat.h``; :func:`~strainfmu.fmu.native.build.universal_library` writes them.
    """
    magic, count = struct.unpack_from(">2I", universal)
    if magic == 0xCAFEBABE:
        for index in range(count):
            kind, _, position, length, _ = struct.unpack_from(">5I", universal, 8 + 20 * index)
            if kind == processor:
                return universal[position : position + length]
    return universal


def _for_version(libraries: Mapping[str, tuple[str, bytes]], fmi_version: str) -> dict[str, tuple[str, bytes]]:
    """Return ``libraries`` without what an FMU of ``fmi_version`` would hold twice.

    In FMI 3.0 Apple's two processors have a folder each. In 2.0 importers look for both of them in ``darwin64``,
    whose library is universal; the name of 3.0, which 2.0.4 recommends, would repeat half of it.
    """
    usable = dict(libraries)
    if "x86_64-darwin" in usable and fmi_version == "3":
        suffix, content = usable["x86_64-darwin"]
        usable["x86_64-darwin"] = (suffix, processor_library(content, _X86_64))
    elif "x86_64-darwin" in usable:
        usable.pop("aarch64-darwin", None)
    return usable


def chosen_libraries(
    library: str, platforms: Sequence[str] | None, fmi_version: str
) -> dict[str, tuple[str, bytes]]:
    """Return a library for ``platforms``, by either version's names.

    None stands for all that are shipped, each processor once (see ``_for_version``); a platform that is named
    is there under its own name, too.

    Raises
    ------
    InputError
        A platform has no such library, or one of other sources than there are.
    StrainfmuError
        The library is not shipped at all.
    """
    chosen = _chosen(library, platforms, fmi_version)
    digest = library_digest(library, Path(str(resources.files("fmus"))) / "native")
    for platform, (_, content) in chosen.items():
        require_digest(content, digest, FOLDERS[platform], library)
    return chosen


def _chosen(library: str, platforms: Sequence[str] | None, fmi_version: str) -> dict[str, tuple[str, bytes]]:
    """Return what :func:`chosen_libraries` does, of any sources."""
    shipped = shipped_libraries(library)
    if not shipped:
        raise StrainfmuError(
            f"fmus/native/binaries holds no library '{library}': this installation cannot make native FMUs"
        )
    if platforms is None:
        return _for_version(shipped, fmi_version)
    tuples = {name: platform for platform, name in FOLDERS.items()}
    chosen = {}
    for name in platforms:
        platform = tuples.get(name, name)
        if platform not in shipped:
            raise InputError(
                f"platform '{name}': no library for it, there are {', '.join(FOLDERS[known] for known in shipped)}"
            )
        chosen[platform] = shipped[platform]
    return dict(sorted(chosen.items()))


def native_entries(
    description: FmuDescription,
    libraries: Mapping[str, tuple[str, bytes]],
    sources: Mapping[str, bytes],
    resource_files: Mapping[str, bytes],
) -> dict[str, bytes]:
    """Return what a native FMU holds, content by name.

    Parameters
    ----------
    libraries : suffix and content by platform, as FMI 3.0 names it.
    sources : content by name inside ``sources/``.
    resource_files : content by name inside ``resources/``.
    """
    second = description.fmi_version == "2"
    identifier, files = description.model_identifier, description.source_files
    entries = {"modelDescription.xml": model_description_bytes(description)}
    for platform, (suffix, content) in libraries.items():
        folder = FOLDERS[platform] if second else platform
        entries[f"binaries/{folder}/{identifier}{suffix}"] = content
    entries |= {f"sources/{name}": content for name, content in sources.items()}
    entries |= {f"resources/{name}": content for name, content in resource_files.items()}
    entries["sources/CMakeLists.txt"] = cmake_lists(identifier, files)
    entries["sources/buildDescription.xml"] = build_description(identifier, files)
    return entries
