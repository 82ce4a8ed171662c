"""Docstrings as this project writes them, made into what Sphinx reads.

A parameter stands in one line with its meaning, ``name : meaning``; numpy's style has the type there. Bars are
absolute values.
"""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

SECTIONS = ("Parameters", "Attributes", "Returns", "Raises", "Yields")
ENTRY = re.compile(r"^(\s*)([\w*., ]+?) : (.+)$")
LITERAL = re.compile(r"(``.+?``|:\w+:`.+?`)")


def rewrite(lines: list[str]) -> list[str]:
    """Return a docstring's lines in numpy's style."""
    section, written = "", []
    for number, line in enumerate(lines):
        below = lines[number + 1] if number + 1 < len(lines) else ""
        if line and set(below.strip()) == {"-"}:
            section = line.strip()
        entry = ENTRY.match(line)
        if section in ("Parameters", "Attributes") and entry and not entry[1]:
            written += [entry[2], f"    {_escaped(entry[3])}"]
        else:
            written.append(_escaped(line))
    return written


def _escaped(line: str) -> str:
    """Escape bars outside literals."""
    parts = LITERAL.split(line)
    return "".join(part if LITERAL.fullmatch(part) else part.replace("|", r"\|") for part in parts)


def process(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Rewrite one docstring in place, ahead of napoleon."""
    lines[:] = rewrite(lines)


def escape_types(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Keep numpy's ``object_`` in a type that napoleon wrote from being a reference."""
    lines[:] = [re.sub(r"_(?=\W|$)", r"\_", line) if ":vartype" in line else line for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen to autodoc."""
    app.connect("autodoc-process-docstring", process, priority=400)
    app.connect("autodoc-process-docstring", escape_types, priority=600)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
