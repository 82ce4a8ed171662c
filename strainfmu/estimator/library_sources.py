"""The C sources of each compiled library, and the digest of them that a library carries.

The build compiles the digest in, after :data:`MARK`. A checkout or an installation has sources too: no FMU gets a
library of other ones, and Python loads none.

Where no library is shipped for the machine, or the shipped one was built from other sources, in a checkout after
an edit, :func:`development_library` makes one by the compiler at hand. Each source becomes an object, kept in the
user's cache by a digest of the source and of all headers it includes, so that an edit compiles one file. The
library is kept by the digest of its objects.
"""

import hashlib
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from strainfmu.errors import InputError, StrainfmuError

LIBRARIES = {
    "estimator": ("core", "estimator"),
    "plant": ("core", "system", "plant", "autopilot", "schedule"),
}
"""Folders below ``fmus/native`` of the models in each library; ``plant`` serves autopilot and schedule too."""

BESIDE = {"estimator": ("bus", "network", "ecu", "bridge"), "plant": ("bus", "network", "nodes")}
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
    """Refuse a library for ``platform`` whose ``content`` carries another digest than ``digest``, "" for any."""
    if not is_of_sources(content, digest):
        raise InputError(
            f"fmus/native/{BINARIES}/{platform}/{library}: expected a library of the C sources in fmus/native, got"
            f" one of other sources; build it: python -m strainfmu.fmu.native.build {platform}"
        )


FLAGS = ("-std=c99", "-O2", "-DNDEBUG", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden")
_POSITION_INDEPENDENT = () if sys.platform == "win32" else ("-fPIC",)
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")

_INCLUDE = re.compile(rb'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)


class NoCoreError(StrainfmuError):
    """No library of the compiled estimator serves this machine, and none can be compiled."""


def development_library(native: Path, reason: str) -> Path:
    """Return the library of the sources in ``native``, made once.

    Parameters
    ----------
    native : folder of the C sources.
    reason : why it is made, for the line that says so and for the error.

    Raises
    ------
    NoCoreError
        There is no compiler, or it fails.
    """
    parts = (*LIBRARIES["estimator"], *BESIDE["estimator"])
    sources = [file for part in parts for file in sorted((native / part).rglob("*.c"))]
    compiler = _compiler(reason)
    objects = {source: _key((*compiler, *FLAGS, platform.machine()), source) for source in sources}
    cache = _cache_folder()
    target = cache / f"estimator-{_digest(objects.values())}{SUFFIX}"
    if target.exists():
        return target
    cache.mkdir(parents=True, exist_ok=True)
    with _lock(cache):  # tests run in parallel: one process compiles, the others wait
        if not target.exists():
            print(f"strainfmu: {reason}; compiling {len(sources)} C files to {cache}, once", file=sys.stderr)
            _build(compiler, {source: cache / f"{key}.o" for source, key in objects.items()}, target)
    return target


def _build(compiler: Sequence[str], objects: dict[Path, Path], target: Path) -> None:
    """Compile the sources whose objects are not there, and link ``target``."""
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:

        def compiled(source: Path) -> None:
            made = Path(folder) / objects[source].name
            _run([*compiler, *FLAGS, *_POSITION_INDEPENDENT, "-c", str(source), "-o", str(made)])
            made.replace(objects[source])

        missing = [source for source, made in objects.items() if not made.exists()]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(compiled, missing))
        made = Path(folder) / target.name
        _run([*compiler, "-shared", *map(str, objects.values()), "-o", str(made), "-lm"])
        made.replace(target)


def _run(command: Sequence[str]) -> None:
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode != 0:
        lines = finished.stderr.strip().splitlines()
        fault = next((line for line in lines if "error" in line), lines[-1] if lines else "no message")
        raise NoCoreError(f"the compiled estimator: {command[0]} failed: {fault}")


def _compiler(reason: str) -> tuple[str, ...]:
    """Return the command of the system's C compiler, else of zig's, which the extra ``test`` installs."""
    names = (os.environ.get("CC"), "cc", "gcc", "clang")
    if compiler := next((path for name in names if name and (path := shutil.which(name))), None):
        return (compiler,)
    if _has_zig():
        return (sys.executable, "-m", "ziglang", "cc")
    raise NoCoreError(
        f"the compiled estimator: {reason}, and no C compiler (CC, cc, gcc, clang) found: install one, or ziglang"
    )


def _has_zig() -> bool:
    try:
        return importlib.util.find_spec("ziglang") is not None
    except ValueError:  # of a module that is None
        return False


def _key(how: tuple[str, ...], source: Path) -> str:
    """Return a digest of ``source`` with all headers it includes, compiled as ``how`` says."""
    read, todo = set[Path](), [source.resolve()]
    while todo:
        file = todo.pop()
        if file not in read:
            read.add(file)
            todo += _included(file, file.stat().st_mtime_ns)
    return _digest([*how, *(_content(file, file.stat().st_mtime_ns).hex() for file in sorted(read))])


@lru_cache(maxsize=1000)
def _content(file: Path, _changed: int) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest()


@lru_cache(maxsize=1000)
def _included(file: Path, _changed: int) -> list[Path]:
    """Return the headers of the project that ``file`` includes."""
    names = (name.decode() for name in _INCLUDE.findall(file.read_bytes()))
    return [path for name in names if (path := (file.parent / name).resolve()).is_file()]


def _digest(texts: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:24]


@contextmanager
def _lock(folder: Path) -> Iterator[None]:
    """Let one process at a time in; without effect where there is no ``flock``."""
    with (folder / "lock").open("w") as stream:
        try:
            from fcntl import LOCK_EX, flock
        except ImportError:
            yield
            return
        flock(stream, LOCK_EX)
        yield


def _cache_folder() -> Path:
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "strainfmu"
