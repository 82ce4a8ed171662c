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
COLON = "\N{MODIFIER LETTER COLON}"
LITERAL = re.compile(r"(``.+?``|:\w+:`.+?`)")


ALIASES = {"float64": "FloatArray", "bool": "BoolArray", "bool_": "BoolArray", "int64": "IntArray"}
ARRAY = re.compile(r"~?(?:numpy\.)?ndarray\[tuple\[.*?, \.\.\.\], ~?(?:numpy\.)?dtype\[~?(?:numpy\.)?(\w+)\]\]")
FORWARD = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")


def rewrite(lines: list[str]) -> list[str]:
    """Return a docstring's lines in numpy's style; indented blocks of the text become code."""
    section, written, in_code = "", [], False
    for number, line in enumerate(lines):
        below = lines[number + 1] if number + 1 < len(lines) else ""
        if line and set(below.strip()) == {"-"}:
            section = line.strip()
        if not section and _begins_code(lines, number):
            written += ["::", ""]
            in_code = True
        in_code = in_code and (not line or line.startswith("    "))
        entry = ENTRY.match(line)
        if in_code:
            written.append(line)
        elif section in ("Parameters", "Attributes") and entry and not entry[1]:
            written += [entry[2], f"    {_escaped(entry[3])}"]
        else:
            written.append(_escaped(line))
    return written


def _begins_code(lines: list[str], number: int) -> bool:
    """Tell whether an indented block begins here that nothing marks as a list, a table or a quotation."""
    if not lines[number].startswith("    ") or number < 2 or lines[number - 1]:
        return False
    above = next((line for line in reversed(lines[:number]) if line), "")
    return not (above.startswith((" ", "- ", "* ", "..", "=", "``")) or above.endswith("::"))


def _escaped(line: str) -> str:
    """Escape bars outside literals."""
    parts = LITERAL.split(line)
    return "".join(part if LITERAL.fullmatch(part) else part.replace("|", r"\|") for part in parts)


def process(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Rewrite one docstring in place, ahead of napoleon."""
    lines[:] = rewrite(lines)
    if what in ("attribute", "data", "property") and lines:
        lines[0] = lines[0].replace(":", COLON)


def shorten_types(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Name arrays in a signature as the code does."""
    return _short(signature), _short(returns)


def _short(text: str | None) -> str | None:
    if text is None:
        return None
    text = ARRAY.sub(lambda found: ALIASES.get(found[1], f"array of {found[1]}"), text)
    return FORWARD.sub(r"\1", text)


def restore(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Put back the colons that napoleon would have taken for the end of a type."""
    lines[:] = [line.replace(COLON, ":") for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen to autodoc."""
    app.connect("autodoc-process-docstring", process, priority=400)
    app.connect("autodoc-process-docstring", restore, priority=600)
    app.connect("autodoc-process-signature", shorten_types)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
