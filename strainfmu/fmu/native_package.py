"""The native kind of FMU: prebuilt libraries for several platforms, their sources, and a map they read.

No compiler is needed: the libraries lie in ``fmus/native/binaries``, one folder per platform, each holding the
functions of FMI 2.0 and FMI 3.0. The export renames them to the model identifier.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from importlib import resources
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.fmu.description import FmuDescription
from strainfmu.fmu.model_description import model_description_bytes
from strainfmu.fmu.model_description_3 import model_description_3_bytes

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

MODEL_EXCHANGE = {
    "2": {
        "needsExecutionTool": "false",
        "completedIntegratorStepNotNeeded": "true",
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
    },
}
"""What the estimator's library can do for model exchange: it has no states, so that this costs nothing."""

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


def shipped_libraries(model: str = "native") -> dict[str, tuple[str, bytes]]:
    """Return suffix and content of the library by platform, as FMI 3.0 names it, in alphabetical order.

    ``model`` is the folder below ``fmus`` that holds the sources and ``binaries``.
    """
    found = {}
    folder = resources.files("fmus").joinpath(*model.split("/"), "binaries")
    if folder.is_dir():
        tuples = {name: platform for platform, name in FOLDERS.items()}
        for item in folder.iterdir():
            platform = tuples.get(item.name, item.name)
            for file in item.iterdir() if item.is_dir() and platform in FOLDERS else ():
                if file.name.endswith(_SUFFIXES):
                    found[platform] = (file.name[file.name.rindex(".") :], file.read_bytes())
    return dict(sorted(found.items()))


def chosen_libraries(
    platforms: Sequence[str] | None = None, model: str = "native"
) -> dict[str, tuple[str, bytes]]:
    """Return the libraries of ``platforms``, by either version's names; None for all that are shipped.

    Raises
    ------
    InputError
        A platform has no such library.
    StrainfmuError
        No library is shipped at all.
    """
    shipped = shipped_libraries(model)
    if not shipped:
        raise StrainfmuError(f"fmus/{model}/binaries holds no library: this installation cannot make native FMUs")
    if platforms is None:
        return shipped
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


def native_sources(fmi_version: str) -> dict[str, bytes]:
    """Return the C files of one FMI version, content by name; headers of FMI itself are not among them."""
    other = "fmi3" if fmi_version == "2" else "fmi2"
    folder = resources.files("fmus").joinpath("native")
    files = {
        item.name: item.read_bytes()
        for item in (folder.iterdir() if folder.is_dir() else ())
        if item.name.endswith((".c", ".h")) and other not in item.name
    }
    return dict(sorted(files.items()))


def sources_digest(sources: Mapping[str, bytes]) -> str:
    """Return a hash of names and content of ``sources``."""
    digest = hashlib.sha256()
    for name, content in sources.items():
        digest.update(f"{name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


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
    describe = model_description_bytes if second else model_description_3_bytes
    entries = {"modelDescription.xml": describe(description)}
    for platform, (suffix, content) in libraries.items():
        folder = FOLDERS[platform] if second else platform
        entries[f"binaries/{folder}/{description.model_identifier}{suffix}"] = content
    entries |= {f"sources/{name}": content for name, content in sources.items()}
    entries |= {f"resources/{name}": content for name, content in resource_files.items()}
    if not second:
        entries["sources/buildDescription.xml"] = build_description(description)
    return entries


def build_description(description: FmuDescription) -> bytes:
    """Return ``sources/buildDescription.xml`` (FMI 3.0.2, section 2.5.2)."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": description.model_identifier})
    files = SubElement(configuration, "SourceFileSet", {"language": "C99"})
    for name in description.source_files:
        SubElement(files, "SourceFile", {"name": name})
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True)
