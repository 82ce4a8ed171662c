"""The Python kind of FMU: run-time sources under a name of their own, PythonFMU around them, one zip.

Python keeps one module per name in a process, so two FMUs with modules of the same name would both run the
code that was loaded first. Hence the slave's file and the copied package carry a hash of the
content in their names.
"""

import hashlib
import json
import re
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from strainfmu.errors import StrainfmuError
from strainfmu.fmu.description.fmu_description import FmuDescription
from strainfmu.fmu.description.model_description import model_description_bytes

CAPABILITIES = {
    "needsExecutionTool": "true",
    "canHandleVariableCommunicationStepSize": "true",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
"""What a PythonFMU slave of this project can do (attributes of CoSimulation, FMI 2.0, section 4.3.1)."""

_WITHOUT_VARIABLES = """
from pythonfmu import Fmi2Slave


class Slave(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.modelName = {model_identifier!r}

    def do_step(self, current_time, step_size):
        return True
"""
_OWN_IMPORT = re.compile(r"^(\s*from )strainfmu(?=[. ])", re.MULTILINE)
# Modules that FMUs of this project bring along: PythonFMU's and those with a hash in their names.
_FMU_MODULE = re.compile(r"(pythonfmu|(strainfmu|\w+_slave)_[0-9a-f]{12})(\..*)?")


@dataclass(frozen=True)
class SlaveCode:
    """The sources of one slave.

    Attributes
    ----------
    name : name of its file in ``fmus/python``, without ``.py``.
    sources : text by path inside the package ``strainfmu``, its imports unchanged.
    text : the slave's own source.
    """

    name: str
    sources: Mapping[str, str]
    text: str

    @property
    def digest(self) -> str:
        """Hash of all sources."""
        content = json.dumps([self.name, self.text, dict(self.sources)], sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()


def slave_code(name: str, sources: Sequence[str]) -> SlaveCode:
    """Read the source of a slave and of the parts of ``strainfmu`` that it needs.

    ``sources`` are paths such as ``fmu/x.py``; one that ends in a slash stands for every module of that folder.
    """
    package = resources.files("strainfmu")
    modules: list[str] = []
    for source in sources:
        if source.endswith("/"):
            names = (entry.name for entry in package.joinpath(source).iterdir())
            modules += sorted(f"{source}{name}" for name in names if name.endswith(".py"))
        else:
            modules.append(source)
    return SlaveCode(
        name,
        {path: package.joinpath(*path.split("/")).read_text("utf-8") for path in modules},
        resources.files("fmus").joinpath("python", f"{name}.py").read_text("utf-8"),
    )


def with_own_package(source: str, package: str) -> str:
    """Return ``source`` with ``from strainfmu...`` turned into ``from <package>...``."""
    return _OWN_IMPORT.sub(rf"\g<1>{package}", source)


def python_entries(description: FmuDescription, code: SlaveCode, payload: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return what PythonFMU packs into an FMU, content by name: description, binaries and ``resources/``.

    ``payload`` is the data, content by name, that the slave reads from ``resources/``.

    Raises
    ------
    StrainfmuError
        PythonFMU is not installed, or a temporary file could not be written.
    """
    suffix = hashlib.sha256(f"{description.guid}{code.digest}".encode()).hexdigest()[:12]
    package, module = f"strainfmu_{suffix}", f"{code.name}_{suffix}"
    model_description = model_description_bytes(description)
    files = {
        **payload,
        "fmu.json": json.dumps({"model_identifier": description.model_identifier}).encode(),
        f"{module}.py": with_own_package(code.text, package).encode(),
        **{f"{package}/{name}": with_own_package(text, package).encode() for name, text in code.sources.items()},
    }
    try:
        entries = _packed_by_pythonfmu(module, description.model_identifier)
    except OSError as error:
        raise StrainfmuError(f"the FMU could not be packed: {error.strerror or error}") from error
    entries |= {f"resources/{name}": content for name, content in files.items()}
    entries["modelDescription.xml"] = model_description
    return entries


def _packed_by_pythonfmu(module: str, model_identifier: str) -> dict[str, bytes]:
    """Let PythonFMU pack a slave without variables; return the content of the entries by name.

    PythonFMU imports what it packs, and asks it for a description: of the slave itself that would take half a
    second, for a description that is not used.
    """
    with tempfile.TemporaryDirectory(prefix="strainfmu_") as folder, imports_put_back():
        try:
            from pythonfmu.builder import FmuBuilder
        except ImportError as error:
            raise StrainfmuError("PythonFMU is not installed: pip install 'strainfmu[fmu]'") from error
        script = Path(folder, f"{module}.py")
        script.write_bytes(_WITHOUT_VARIABLES.format(model_identifier=model_identifier).encode())
        packed = FmuBuilder.build_FMU(script, dest=Path(folder, "packed.fmu"))
        with zipfile.ZipFile(packed) as archive:
            return {name: archive.read(name) for name in archive.namelist()}


@contextmanager
def imports_put_back() -> Iterator[None]:
    """Undo what packing does to the interpreter's imports, and pack with the installed PythonFMU.

    PythonFMU imports the slave and leaves it and its folder behind. And an FMU that ran in this process has
    left its own copy of ``pythonfmu``, which lacks the binaries to pack, and slaves that build on that copy.
    """
    path = list(sys.path)
    before = {name: sys.modules.pop(name) for name in list(sys.modules) if _FMU_MODULE.fullmatch(name)}
    sys.path[:] = [entry for entry in path if not Path(entry, "slavemodule.txt").exists()]
    try:
        yield
    finally:
        sys.path[:] = path
        for name in list(sys.modules):
            if _FMU_MODULE.fullmatch(name):
                del sys.modules[name]
        sys.modules.update(before)
