"""Rules of the house that no linter knows, read from the sources."""

import ast
from collections import Counter
from pathlib import Path

import pytest
from rooms import ROOT, files, nodes_of, text_of, tree_of

import strainfmu

pytestmark = pytest.mark.fast

TESTS = ROOT / "tests"
PACKAGES = ("strainfmu", "builder", "fmus")

TOP_LEVEL = ("pyproject.toml", "strainfmu", "builder", "tests", "fmus", "README.md")

MAX_POSITIONAL = 6
"""Arguments a call may pass by position."""

POSITIONAL_ONLY = {"CFUNCTYPE", "_series", "add_row", "pack"}
"""Functions of other packages that take many arguments by position alone (ctypes, rich, struct)."""


def sources(*folders: str) -> list[Path]:
    """Return the Python files of the folders, by their paths in the project."""
    return [path for path in files() if path.suffix == ".py" and path.parts[0] in folders]


def name_of(node: ast.expr) -> str:
    """Return the last part of a dotted name, of a call's or a subscript's too; empty for anything else."""
    if isinstance(node, ast.Call):
        return name_of(node.func)
    if isinstance(node, ast.Subscript):
        return name_of(node.value)
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def test_the_top_level_names_are_there() -> None:
    assert [name for name in TOP_LEVEL if not (ROOT / name).exists()] == []


def test_the_command_line_alone_imports_the_builder() -> None:
    importing = set()
    for path in sources("strainfmu"):
        for node in nodes_of(path):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if any(name.split(".")[0] == "builder" for name in names):
                importing.add(path.parts[1])
    assert importing == {"cli"}


def test_array_types_are_defined_in_one_module() -> None:
    """Names that end with "Array" are given to an array type of numpy in ``strainfmu/arrays.py`` alone."""
    defining = set()
    for path in sources(*PACKAGES):
        for node in tree_of(path).body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            if any(name_of(target).endswith("Array") for target in targets):
                defining.add(path.as_posix())
    assert defining == {"strainfmu/arrays.py"}


def test_long_calls_name_their_arguments() -> None:
    long = [
        f"{path}:{node.lineno}: {name_of(node)} with {len(node.args)} arguments by position"
        for path in sources(*PACKAGES)
        for node in nodes_of(path)
        if isinstance(node, ast.Call) and len(node.args) > MAX_POSITIONAL and name_of(node) not in POSITIONAL_ONLY
    ]
    assert long == []


def test_dataclasses_of_arrays_compare_by_identity() -> None:
    """``==`` of dataclasses compares their fields as tuples, which raises ValueError for arrays."""
    wrong = [
        f"{path}:{node.lineno}: {node.name}"
        for path in sources(*PACKAGES)
        for node in nodes_of(path)
        if isinstance(node, ast.ClassDef) and compares_fields(node) and any(map(holds_array, node.body))
    ]
    assert wrong == []


def compares_fields(node: ast.ClassDef) -> bool:
    """Return whether a class is a dataclass without ``eq=False``."""
    for decorator in node.decorator_list:
        if name_of(decorator) == "dataclass":
            options = decorator.keywords if isinstance(decorator, ast.Call) else []
            return not any(one.arg == "eq" and ast.unparse(one.value) == "False" for one in options)
    return False


def holds_array(field: ast.stmt) -> bool:
    """Return whether a statement of a class declares a field that holds arrays; functions do not."""
    if not isinstance(field, ast.AnnAssign) or name_of(field.annotation) in ("Callable", "ClassVar"):
        return False
    names = {name_of(node) for node in ast.walk(field.annotation) if isinstance(node, ast.expr)}
    return any(name.endswith("Array") or name in ("ndarray", "csr_array", "csc_array") for name in names)


def test_the_version_stands_in_one_place() -> None:
    paths = sources(*PACKAGES)
    paths += [Path(name) for name in ("pyproject.toml", "CITATION.cff", "docs/conf.py") if (ROOT / name).exists()]
    quoted = (f'"{strainfmu.__version__}"', f"'{strainfmu.__version__}'")
    holding = [path.as_posix() for path in paths if any(text in text_of(path) for text in quoted)]
    assert holding == ["strainfmu/version.py"]


def test_every_folder_of_tests_takes_part_in_the_quick_look() -> None:
    """All but the acceptance tests, which run the commands on whole demonstrations."""
    marked: Counter[str] = Counter()
    for path in TESTS.rglob("test_*.py"):
        marked[path.parent.relative_to(TESTS).as_posix()] += "mark.fast" in path.read_text(encoding="utf-8")
    without = {folder for folder, count in marked.items() if not count}
    assert without <= {"acceptance", "aero/euler/openfoam"}


def test_test_files_have_names_of_their_own() -> None:
    """pytest imports them by their names alone."""
    names = Counter(path.name for path in TESTS.rglob("*.py") if path.name != "conftest.py")
    assert [name for name, count in names.items() if count > 1] == []
