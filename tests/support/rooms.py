"""Counts of the house: lines, files, imports and words of each room, as docs/developers/rooms.md states them.

A room is a folder or a file of the page's first table, with all below it that has no row of its own. Lines are
those of Python and C files, headers of FMI by the Modelica Association left out. Run as a program it prints the
page with the counts of today; with ``--write`` it writes them, with ``--walk`` it follows a vehicle through
``build_map``.
"""

import ast
import re
import sys
from collections import Counter, defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "developers" / "rooms.md"
TREES = ("strainfmu", "builder", "fmus", "tests")
SUFFIXES = (".py", ".pyi", ".c", ".h")
HEADERS_OF_FMI = re.compile(r"fmi[23](Functions|FunctionTypes|TypesPlatform|PlatformTypes)?\.h")
FILLER = frozenset(
    (
        *("found", "one", "ones", "held", "those", "these", "other", "others", "own"),
        *("told", "drawn", "built", "seen", "left", "there", "here", "kept", "given"),
        *("ways", "way", "behind", "beside", "beyond", "whole", "at", "of", "each"),
    )
)
"""Words that name nothing, as identifiers."""
OF_NUMPY = re.compile(r"\bnp\.(?:\w+\.)?(?:ones|at)\b")
"""Names that numpy gave."""
NAME = re.compile(
    r"""
    (?: [rRbBfFuU]{1,2} )?                          # strings
    (?: \"{3} (?: \\. | [^\\] )*? \"{3} | '{3} (?: \\. | [^\\] )*? '{3}
    | \" (?: \\. | [^\"\\\n] )* \" | ' (?: \\. | [^'\\\n] )* ' )
    | \# [^\n]*                                     # comments
    | ([^\W\d] \w*)
    """,
    re.DOTALL | re.VERBOSE,
)
"""A name of a program, or nothing for a string or a comment: in a sixth of the time of ``tokenize``."""
ROW = re.compile(r"^\| `(?P<name>[^`]+)` \|(?P<cells>.*)\|$", re.MULTILINE)


class Row(NamedTuple):
    """A row of a table of the page: its name and the cells behind it."""

    name: str
    cells: tuple[str, ...]


def rows(heading: str, text: str | None = None) -> list[Row]:
    """Return the rows of the table under a heading of the page."""
    section = (text or PAGE.read_text("utf-8")).split(f"## {heading}\n")[1].split("\n## ")[0]
    return [
        Row(match["name"], tuple(cell.strip() for cell in match["cells"].split("|")))
        for match in ROW.finditer(section)
    ]


@cache
def files() -> tuple[Path, ...]:
    """Return the files that count, by their paths in the project."""
    paths = (path for tree in TREES for path in (ROOT / tree).rglob("*") if path.suffix in SUFFIXES)
    counted = (path.relative_to(ROOT) for path in paths if not HEADERS_OF_FMI.fullmatch(path.name))
    return tuple(sorted(path for path in counted if "__pycache__" not in path.parts and "build" not in path.parts))


@cache
def text_of(path: Path) -> str:
    return (ROOT / path).read_text("utf-8")


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(text_of(path))


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """Return all nodes of a file: to find them takes as long as to parse it."""
    return tuple(ast.walk(tree_of(path)))


def room_of(path: Path, rooms: frozenset[str]) -> str | None:
    """Return the longest name among ``rooms`` that is the file or a folder above it."""
    above = [path, *path.parents]
    return next((parent.as_posix() for parent in above if parent.as_posix() in rooms), None)


def lines_of_rooms(rooms: frozenset[str]) -> Counter[str | None]:
    """Return the lines of each room; None has the lines of files without a room."""
    counts: Counter[str | None] = Counter(dict.fromkeys(rooms, 0))
    for path in files():
        counts[room_of(path, rooms)] += text_of(path).count("\n")
    return counts


@cache
def imports() -> dict[str, set[str]]:
    """Return which modules each module of the packages imports, by dotted names; imports for types alone too."""
    modules = {module_name(path): path for path in files() if path.suffix == ".py" and path.parts[0] in TREES[:2]}
    graph: dict[str, set[str]] = {}
    for name, path in modules.items():
        targets = set[str]()
        for node in nodes_of(path):
            if isinstance(node, ast.ImportFrom) and node.module:
                parts = {f"{node.module}.{alias.name}" for alias in node.names} & modules.keys()
                targets |= parts or ({node.module} & modules.keys())
            elif isinstance(node, ast.Import):
                targets |= {alias.name for alias in node.names} & modules.keys()
        graph[name] = targets - {name}
    return graph


def module_name(path: Path) -> str:
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


@cache
def circles() -> list[set[str]]:
    """Return the groups of modules that import each other, directly or through others."""
    graph = imports()

    def reached(start: str) -> set[str]:
        visited, waiting = set[str](), [*graph[start]]
        while waiting:
            module = waiting.pop()
            if module not in visited:
                visited.add(module)
                waiting += graph[module]
        return visited

    all_reached = {name: reached(name) for name in graph}
    groups = {frozenset(b for b in all_reached[a] if a in all_reached[b]) for a in graph if a in all_reached[a]}
    return [set(group) for group in groups]


def of_one_neighbour(tree: str) -> list[str]:
    """Return the modules of a tree that one module alone imports, which stands in the same folder."""
    users = defaultdict[str, set[str]](set)
    for name, targets in imports().items():
        for target in targets:
            users[target].add(name)
    return sorted(
        name
        for name, by in users.items()
        if name.split(".")[0] == tree
        and len(by) == 1
        and next(iter(by)).rpartition(".")[0] == name.rpartition(".")[0]
    )


def share_of_imports(tree: str) -> float:
    """Return the lines of import statements over all lines of a tree."""
    total = importing = 0
    for path in files():
        if path.suffix == ".py" and path.parts[0] == tree:
            total += text_of(path).count("\n")
            for node in nodes_of(path):
                if isinstance(node, ast.Import | ast.ImportFrom):
                    importing += (node.end_lineno or node.lineno) - node.lineno + 1
    return importing / total


def filler_words(tree: str) -> float:
    """Return the identifiers among :data:`FILLER` per 1,000 lines of a tree's Python."""
    total = words = 0
    for path in files():
        if path.suffix == ".py" and path.parts[0] == tree:
            total += text_of(path).count("\n")
            words += sum(name in FILLER for name in NAME.findall(OF_NUMPY.sub("np", text_of(path))))
    return 1000.0 * words / total


@cache
def walk() -> list[tuple[str, str]]:
    """Return the functions that get the whole vehicle in ``build_map``, by module and name, as they are entered.

    A call that is given a name of type Vehicle, or a method of one, enters; each function is entered once, its
    calls from top to bottom, whatever the branches.
    """
    modules = {module_name(path): path for path in files() if path.suffix == ".py" and path.parts[0] in TREES[:2]}
    functions: dict[tuple[str, str], ast.FunctionDef] = {}
    known: dict[str, dict[str, tuple[str, str]]] = defaultdict(dict)
    for module, path in modules.items():
        for node in nodes_of(path):
            if isinstance(node, ast.ImportFrom) and node.module:
                known[module] |= {alias.asname or alias.name: (node.module, alias.name) for alias in node.names}
        for node in tree_of(path).body:
            if isinstance(node, ast.FunctionDef):
                functions[module, node.name] = node
                known[module][node.name] = module, node.name
            elif isinstance(node, ast.ClassDef) and node.name == "Vehicle":
                functions |= {(module, part.name): part for part in node.body if isinstance(part, ast.FunctionDef)}
    entered: list[tuple[str, str]] = []

    def is_vehicle(annotation: ast.expr | None) -> bool:
        parts = [] if annotation is None else ast.walk(annotation)
        return any(isinstance(part, ast.Name) and part.id == "Vehicle" for part in parts)

    def called(module: str, call: ast.Call) -> tuple[str, str] | None:
        return known[module].get(call.func.id) if isinstance(call.func, ast.Name) else None

    def enter(place: tuple[str, str]) -> None:
        if place in entered:
            return
        entered.append(place)
        module, node = place[0], functions[place]
        names = {part.arg for part in ast.walk(node) if isinstance(part, ast.arg) and is_vehicle(part.annotation)}
        names |= {"self"} if module == OF_VEHICLE else set()
        for part in ast.walk(node):
            if isinstance(part, ast.Assign) and isinstance(part.value, ast.Call):
                maker = functions.get(called(module, part.value) or ("", ""))
                if maker is not None and is_vehicle(maker.returns):
                    names |= {target.id for target in part.targets if isinstance(target, ast.Name)}
        parts = [part for part in ast.walk(node) if isinstance(part, ast.Call | ast.Attribute)]
        for part in sorted(parts, key=lambda part: (part.lineno, part.col_offset)):
            target = None
            if isinstance(part, ast.Attribute):
                if isinstance(part.value, ast.Name) and part.value.id in names:
                    target = OF_VEHICLE, part.attr
            elif any(
                isinstance(value, ast.Name) and value.id in names
                for value in (*part.args, *(keyword.value for keyword in part.keywords))
            ):
                target = called(module, part)
            if target in functions:
                enter(target)

    enter(("builder.pipeline.stages", "build_map"))
    return entered


OF_VEHICLE = "builder.vehicle.file"


def stays(entered: list[tuple[str, str]]) -> list[str]:
    """Return the folders of functions ``entered``, one for each stay."""
    folders = [module.rpartition(".")[0] for module, _ in entered]
    return [folder for folder, before in zip(folders, ["", *folders], strict=False) if folder != before]


MEASURES = {
    "modules that import each other": lambda tree: float(
        sum(len(group) for group in circles() if min(group).split(".")[0] == tree)
    ),
    "modules imported by one neighbour alone": lambda tree: float(len(of_one_neighbour(tree))),
    "lines of imports [%]": lambda tree: 100.0 * share_of_imports(tree),
    "filler words as names, per 1,000 lines": filler_words,
}


def updated(text: str) -> str:
    """Return the page with the counts of today."""
    table = rows("Rooms", text)
    lines = lines_of_rooms(frozenset(row.name for row in table))
    for row in table:
        old = f"| `{row.name}` | {row.cells[0]} | {row.cells[1]} |"
        text = text.replace(old, f"| `{row.name}` | {row.cells[0]} | {lines[row.name]:,} |")
    for row in rows("Places", text):
        path, words = row.cells[0].strip("`"), row.cells[1].strip("`")
        if not (ROOT / path).is_file():  # moved: where the words stand now, if that is one place
            places = [
                place.as_posix() for place in files() if place.parts[0] != "tests" and words in text_of(place)
            ]
            text = text.replace(f"`{path}`", f"`{places[0]}`") if len(places) == 1 else text
    for row in rows("Measures", text):
        values = [f"{MEASURES[row.name](tree):.4g}" for tree in TREES[:2]]
        text = text.replace(
            f"| `{row.name}` | {' | '.join(row.cells)} |", f"| `{row.name}` | {' | '.join(values)} |"
        )
    return text


if __name__ == "__main__":
    if "--walk" in sys.argv[1:]:
        places, rooms_entered = walk(), stays(walk())
        print(*(f"{module}: {name}" for module, name in places), sep="\n")
        folders = len({*rooms_entered})
        print(f"{len(places)} functions, {folders} folders, {len(rooms_entered) - folders} returns into a folder")
        sys.exit()
    page = updated(PAGE.read_text("utf-8"))
    if "--write" in sys.argv[1:]:
        PAGE.write_text(page, "utf-8")
    else:
        print(page)
