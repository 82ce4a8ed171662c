"""The C sources of the estimator lie in layers: a file includes headers of its own layer and of those below.

A module of ``core`` is a ``.c`` file with the header of its name, or either alone; every other folder is one
module with one interface. A header declares what the files of its module define, so that an ``#include`` is the
one way to another module's functions, and arrows between modules are those lines.
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

import pytest

pytestmark = pytest.mark.fast

NATIVE = Path(__file__).parents[3] / "fmus" / "native"

LAYERS: tuple[tuple[str, ...], ...] = (
    ("core",),
    ("estimator/numerics",),
    ("estimator/map",),
    ("estimator/sample", "estimator/temperature", "estimator/zeros"),
    ("estimator/update",),
    ("estimator/linear", "estimator/nonlinear"),
    ("estimator/filter",),
    ("estimator/policies",),
    ("estimator",),
    ("estimator/interface",),
)
"""Folders from the lowest layer to the highest; those of one line do not know each other.

``map`` is data, ``sample`` what is given and put out, ``update`` prepares a set of rows and conditions samples,
``policies`` decide: search or go on, drop air data, fall back, return. ``estimator`` puts the parts together.
"""

GROUND = ("core", "estimator/numerics")
"""Layers whose headers any number of modules may include."""

INTERFACES = {"core/model"}
"""Headers whose functions are defined above: each model has its own."""

SCREEN = 50
"""Most lines of a function, its head included."""

_BODY = re.compile(
    r"^(?!typedef|enum|struct|static const |const |extern )\w[^\n;=]*(?:\n[ \t]+[^\n;=]*)*\{\n.*?^\}",
    re.DOTALL | re.MULTILINE,
)
_INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
_COMMENT = re.compile(r"/\*.*?\*/|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.DOTALL | re.MULTILINE)
_FUNCTION = re.compile(
    r"^(?!static|EVERYWHERE|AVX|FOR_AVX|typedef|else|return)\w[\w \*]*?\b(\w+)\([^;{}]*\)\s*([;{])", re.MULTILINE
)


def sources() -> dict[str, str]:
    """Content by name below ``fmus/native``, without comments."""
    files = [file for part in ("core", "estimator") for file in sorted((NATIVE / part).rglob("*.[ch]"))]
    return {file.relative_to(NATIVE).as_posix(): file.read_text(encoding="utf-8") for file in files}


def module_of(name: str) -> str:
    """The name of a file of ``core`` without its suffix; the folder of another file."""
    return name.rpartition(".")[0] if name.startswith("core/") else PurePosixPath(name).parent.as_posix()


def of_modules(files: Mapping[str, str], suffix: str, end: str) -> dict[str, set[str]]:
    """Functions that the files with ``suffix`` of each module declare or define: :func:`functions`."""
    found = defaultdict[str, set[str]](set)
    for name, text in files.items():
        if name.endswith(suffix):
            found[module_of(name)] |= functions(text, end)
    return found


def layer_of(module: str) -> int:
    """The rank of the folder of ``module``; -1 where no layer has it."""
    folder = PurePosixPath(module).parent.as_posix() if module.startswith("core/") else module
    return next((rank for rank, folders in enumerate(LAYERS) if folder in folders), -1)


def arrows(files: Mapping[str, str]) -> set[tuple[str, str]]:
    """Pairs of modules of which the first includes the header of the second."""
    found = set()
    for name, text in files.items():
        for include in _INCLUDE.findall(text):
            target = module_of(resolved(name, include))
            if target != module_of(name):
                found.add((module_of(name), target))
    return found


def resolved(name: str, include: str) -> str:
    """The name of the file that ``name`` includes."""
    parts = list(PurePosixPath(name).parent.parts)
    for part in PurePosixPath(include).parts:
        if part == "..":
            parts.pop()
        else:
            parts.append(part)
    return "/".join(parts)


def circles(graph: set[tuple[str, str]]) -> Iterator[tuple[str, ...]]:
    """Sets of two modules or more that reach each other."""
    reached = {first: {second for one, second in graph if one == first} for first, _ in graph}
    grows = True
    while grows:
        before = sum(map(len, reached.values()))
        for found in reached.values():
            found |= {beyond for one in found for beyond in reached.get(one, ())}
        grows = sum(map(len, reached.values())) > before
    seen = set[str]()
    for module in sorted(reached):
        if module in reached[module] and module not in seen:
            circle = {other for other in reached[module] if module in reached.get(other, ())}
            seen |= circle
            yield tuple(sorted(circle))


def functions(text: str, end: str) -> set[str]:
    """Names of the functions with external linkage that ``text`` declares (";") or defines ("{")."""
    return {name for name, mark in _FUNCTION.findall(_COMMENT.sub("", text)) if mark == end}


def listed(title: str, offences: list[str]) -> str:
    """What a failing test prints: an offence a line."""
    return "\n".join([f"{len(offences)} {title}:", *offences])


def test_every_module_has_one_layer() -> None:
    unknown = [name for name in sources() if layer_of(module_of(name)) < 0]
    assert not unknown, listed("files in no layer", unknown)
    folders = [folder for layer in LAYERS for folder in layer]
    assert len(folders) == len(set(folders))
    empty = [folder for folder in folders if not list((NATIVE / folder).glob("*.[ch]"))]
    assert not empty, listed("folders of LAYERS without a source", empty)


def test_included_headers_are_there() -> None:
    files = sources()
    included = [(name, resolved(name, one)) for name, text in files.items() for one in _INCLUDE.findall(text)]
    missing = sorted(f"{name} includes {header}" for name, header in included if header not in files)
    assert not missing, listed("headers that are not there", missing)


def test_no_arrow_to_a_layer_above() -> None:
    upward = sorted(
        f"{one} -> {two}"
        for one, two in arrows(sources())
        if layer_of(two) > layer_of(one) or (layer_of(two) == layer_of(one) and not one.startswith("core/"))
    )
    assert not upward, listed("arrows to a layer above or beside", upward)


def test_no_circle() -> None:
    found = [" - ".join(circle) for circle in circles(arrows(sources()))]
    assert not found, listed("circles", found)


def test_a_header_declares_what_its_own_module_defines() -> None:
    files = sources()
    defined, declared = of_modules(files, ".c", "{"), of_modules(files, ".h", ";")
    elsewhere = [
        f"{module}: {one}"
        for module in declared
        if module not in INTERFACES
        for one in sorted(declared[module] - defined[module])
    ]
    assert not elsewhere, listed("functions declared away from their module", elsewhere)


def test_a_function_that_others_call_is_declared_in_a_header() -> None:
    files = sources()
    defined, declared = of_modules(files, ".c", "{"), of_modules(files, ".h", ";")
    of_models = set[str]().union(*(declared[module] for module in INTERFACES))
    loose = [
        f"{module}: {one}" for module in defined for one in sorted(defined[module] - declared[module] - of_models)
    ]
    assert not loose, listed("functions that no header of their own declares", loose)


def test_a_file_includes_a_header_of_its_module() -> None:
    files = sources()
    with_header = {module_of(name) for name in files if name.endswith(".h")}
    without = [
        name
        for name, text in files.items()
        if name.endswith(".c")
        and module_of(name) in with_header
        and module_of(name) not in {module_of(resolved(name, one)) for one in _INCLUDE.findall(text)}
    ]
    assert not without, listed("files that do not include a header of their own", without)


def test_no_header_is_everywhere() -> None:
    files = sources()
    graph, modules = arrows(files), {module_of(name) for name in files}
    wide = []
    for module in sorted(modules):
        users = {one for one, two in graph if two == module}
        if not module.startswith(GROUND) and 2 * len(users) > len(modules) - 1:
            wide.append(f"{module}: {len(users)} of {len(modules) - 1} modules")
    assert not wide, listed("headers that more than half of the modules include", wide)


def test_a_function_fits_a_screen() -> None:
    """Of all folders; macros are read as the functions that they make."""
    long = [
        f"{file.relative_to(NATIVE)}:{text[: match.start()].count(chr(10)) + 1}: {lines} lines"
        for file in sorted(NATIVE.rglob("*.[ch]"))
        if file.parent.name != "headers"
        for text in [file.read_text(encoding="utf-8")]
        for match in _BODY.finditer(text)
        if (lines := match[0].count("\n") + 1) > SCREEN
    ]
    assert not long, listed(f"functions of more than {SCREEN} lines", long)
