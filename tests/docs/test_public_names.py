"""Documentation through public names only: pages, examples in docstrings and the gallery."""

import ast
import doctest
import inspect
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from typing import Any

import pytest
from rooms import files, nodes_of
from snippets import ROOT, pages, snippets

pytestmark = pytest.mark.fast

PACKAGES = ("strainfmu", "builder")
REFERENCE = ROOT / "docs" / "reference" / "api.md"


def programs(that_run: bool = False) -> Iterator[tuple[str, str]]:
    """Yield place and text of the Python programs of the documentation, of all or of those that tests run."""
    yield from examples()
    for page in pages():
        for snippet in snippets(page):
            if snippet.language == "python" and not (that_run and snippet.kind == "skip"):
                yield str(snippet), snippet.text
    for path in sorted((ROOT / "docs" / "gallery_src").glob("*.py")):
        yield path.name, path.read_text("utf-8")


@cache
def examples() -> list[tuple[str, str]]:
    """Return place and text of the examples in docstrings."""
    found = []
    for path in (one for one in files() if one.suffix == ".py" and one.parts[0] in PACKAGES):
        for node in nodes_of(path):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
                lines = (one.source for one in doctest.DocTestParser().get_examples(text))
                found.append((f"{path.name}:{getattr(node, 'name', '')}", "".join(lines)))
    return found


def names_of_packages(text: str) -> Iterator[str]:
    """Yield each name of the packages that a program uses: ``package.name``, or a module that it imports from."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and str(node.module).split(".")[0] in PACKAGES:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (a.name for a in node.names if "." in a.name and a.name.split(".")[0] in PACKAGES)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in PACKAGES:
            yield f"{node.value.id}.{node.attr}"


def public() -> set[str]:
    return {f"{package}.{name}" for package in PACKAGES for name in import_module(package).__all__}


def value_of(name: str) -> Any:
    package, _, own = name.partition(".")
    return getattr(import_module(package), own)


def test_documentation_uses_public_names_only() -> None:
    used = {(name, place) for place, text in programs() for name in names_of_packages(text)}
    assert len(used) > 60
    assert [place for place in sorted(used) if place[0] not in public()] == []


def test_every_public_class_has_an_example_that_runs() -> None:
    """Programs of pages that are marked to be skipped do not count."""
    used = {name for _, text in programs(that_run=True) for name in names_of_packages(text)}
    classes = [name for name in sorted(public()) if inspect.isclass(value_of(name))]
    without_example = [name for name in classes if name not in used and ">>> " not in str(value_of(name).__doc__)]
    assert without_example == []


def test_the_reference_lists_the_public_names_of_both_packages() -> None:
    assert re.findall(r"^```\{public-names\} (\w+)$", REFERENCE.read_text("utf-8"), re.MULTILINE) == [*PACKAGES]


@pytest.mark.parametrize("name", sorted(public()))
def test_a_public_name_is_there_and_says_what_it_is(name: str) -> None:
    value = value_of(name)
    if inspect.isclass(value) or inspect.isfunction(value):
        assert inspect.getdoc(value)
