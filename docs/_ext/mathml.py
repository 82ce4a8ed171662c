"""Formulas as MathML: browsers set them, so a page needs no script, no font server and no TeX installation."""

from __future__ import annotations

import re
from html import unescape

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.math import get_node_equation_number
from sphinx.writers.html5 import HTML5Translator

STYLED = re.compile(r'<(m[ion]) mathvariant="([a-z-]+)">([^<]*)</')
FIRST_LATIN = {"bold": 0x1D400, "bold-italic": 0x1D468, "script": 0x1D49C}
FIRST_GREEK = {"bold": 0x1D6A8, "bold-italic": 0x1D71C}
FIRST_DIGIT = {"bold": 0x1D7CE}


def mathml(latex: str, *, block: bool) -> str:
    """Return a formula as MathML. MathML Core has no ``mathvariant``: styled letters become Unicode's own."""
    written = convert(latex, display="block" if block else "inline")
    return STYLED.sub(lambda found: f"<{found[1]}>{_styled(unescape(found[3]), found[2])}</", written)


def _styled(text: str, style: str) -> str:
    return "".join(_letter(character, style) for character in text)


def _letter(character: str, style: str) -> str:
    for first, last, offset, table in (
        ("A", "Z", 0, FIRST_LATIN),
        ("a", "z", 26, FIRST_LATIN),
        ("Α", "Ω", 0, FIRST_GREEK),
        ("α", "ω", 26, FIRST_GREEK),
        ("0", "9", 0, FIRST_DIGIT),
    ):
        if first <= character <= last and style in table:
            return chr(table[style] + offset + ord(character) - ord(first))
    return {"∇": "𝛁"}.get(character, character) if style.startswith("bold") else character


def visit_math(self: HTML5Translator, node: nodes.math) -> None:
    """Write a formula of the running text."""
    self.body.append(mathml(node.astext(), block=False))
    raise nodes.SkipNode


def visit_math_block(self: HTML5Translator, node: nodes.math_block) -> None:
    """Write a displayed formula with its number."""
    self.body.append(self.starttag(node, "div", CLASS="math-block"))
    self.body.append(mathml(node.astext(), block=True))
    if node["number"]:
        number = get_node_equation_number(self, node)
        self.body.append(f'<span class="eqno">({number})')
        self.add_permalink_ref(node, "Link to this equation")
        self.body.append("</span>")
    self.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
