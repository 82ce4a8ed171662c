"""Pages of the programming interface, one per room: every module of it with its public names.

They are written to ``reference/generated`` before Sphinx looks for pages, and only where they changed, so that a
second build does not read them again.
"""

from __future__ import annotations

from pathlib import Path
from pkgutil import iter_modules

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
PACKAGES = ("strainfmu", "builder")


def rooms(package: str) -> list[tuple[str, list[str]]]:
    """Return every room below ``package`` with the names of its modules, itself first."""
    folder = ROOT.joinpath(*package.split("."))
    found = sorted(iter_modules([str(folder)]), key=lambda module: module.name)
    modules = [f"{package}.{m.name}" for m in found if not m.ispkg]
    below = [room for m in found if m.ispkg for room in rooms(f"{package}.{m.name}")]
    return [(package, modules), *below]


def page(room: str, modules: list[str]) -> str:
    """Return the page of one room in reStructuredText."""
    lines = [_heading(room, "="), f".. automodule:: {room}\n   :no-members:\n"]
    for module in modules:
        lines += [_heading(module.removeprefix(f"{room}."), "-"), f".. automodule:: {module}\n"]
    return "\n".join(lines)


def _heading(text: str, line: str) -> str:
    return f"{text}\n{line * len(text)}\n"


def write_pages(app: Sphinx) -> None:
    """Write what differs from what is there; remove pages of rooms that are no more."""
    target = Path(app.srcdir) / "reference" / "generated"
    target.mkdir(parents=True, exist_ok=True)
    wanted = {f"{room}.rst": page(room, modules) for name in PACKAGES for room, modules in rooms(name)}
    for path in target.glob("*.rst"):
        if path.name not in wanted:
            path.unlink()
    for name, text in wanted.items():
        path = target / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages when the build begins."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
