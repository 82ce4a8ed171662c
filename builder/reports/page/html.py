"""A page of HTML that needs no other file: no font, no external picture or script.

A page is a title and sections; a section holds paragraphs, lists, tables, figures and further sections. All text
is escaped. Figures are embedded as data URIs. Each SVG is an image of its own, so that the names inside one cannot
collide with those inside another.

Values of a figure show under the pointer: transparent shapes over the picture, each with its text as title. A
browser shows a title after a moment, without scripts. A few lines of script show it at once, under touch, too.
"""

from __future__ import annotations

import io
import re
from base64 import b64encode
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from builder.figures.drawing import Place, Rectangle, ValuedFigure, settle
from builder.reports.page.page_tables import Table, is_number, shown
from strainfmu.files import write_bytes_atomically
from strainfmu.pages import STYLE, table_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'"
)
"""Content security policy of every page: a browser fetches nothing for it."""

UNITS = 4000
"""Units of the shapes along each side of a picture: integers keep pages small."""


def overlay(places: Iterable[Place]) -> str:
    """Return the shapes for ``places`` as SVG that fills the box of its picture; empty without places."""
    shapes = "".join(map(_shape, places))
    if not shapes:
        return ""
    size = f'viewBox="0 0 {UNITS} {UNITS}" preserveAspectRatio="none"'
    return f'<svg class="values" {size} role="group" aria-label="Values in the figure">\n{shapes}</svg>\n'


def _shape(place: Place) -> str:
    """Return one path with its title; nothing for a text without any area."""
    path = "".join(map(_outline, place.rectangles))
    return f'<path d="{path}"><title>{escape(place.text, quote=False)}</title></path>\n' if path else ""


def _outline(rectangle: Rectangle) -> str:
    left, top, width, height = rectangle
    x0, y0, x1, y1 = (round(UNITS * value) for value in (left, top, left + width, top + height))
    return f"M{x0} {y0}H{x1}V{y1}H{x0}z" if x1 > x0 and y1 > y0 else ""


POINTER_STYLE = """\
.picture > div { position: relative; display: inline-block; max-width: 100%; } .picture img { display: block; }
.picture svg.values { position: absolute; left: 0; top: 0; width: 100%; height: 100%; }
svg.values path { fill: transparent; vector-effect: non-scaling-stroke; }
svg.values path:hover { fill: rgb(255 255 255 / 0.4); stroke: #000; stroke-width: 1px; }
#value { position: fixed; z-index: 1; pointer-events: none; white-space: pre-line; max-width: 90vw;
  padding: 0.25rem 0.5rem; background: #fff; border: 1px solid #444; font-size: 0.85rem; line-height: 1.35;
  font-variant-numeric: tabular-nums; }
#value[hidden] { display: none; }
@media screen and (max-width: 700px) { .picture { overflow-x: auto; }
  .picture > div { min-width: 42rem; max-width: none; } }
@media print { #value { display: none; } }
"""

SCRIPT = """\
"use strict";
const box = document.body.appendChild(document.createElement("div"));
box.id = "value";
box.setAttribute("role", "tooltip");
box.hidden = true;
const hide = () => { box.hidden = true; };
const show = event => {
  const place = event.target instanceof Element ? event.target.closest("svg.values path") : null;
  if (!place) return hide();
  const title = place.querySelector("title");
  if (title) {  // the browser would show it a second time
    place.setAttribute("aria-label", title.textContent);
    title.remove();
  }
  box.textContent = place.getAttribute("aria-label");
  box.hidden = false;
  const { offsetWidth: width, offsetHeight: height } = box;
  const gap = event.pointerType === "touch" ? 32 : 14;
  const above = event.clientY - gap - height;
  const below = event.clientY + gap;
  const isAbove = above >= 0 && (event.pointerType === "touch" || below + height > innerHeight);
  box.style.left = `${Math.max(4, Math.min(event.clientX + gap, innerWidth - width - 4))}px`;
  box.style.top = `${isAbove ? above : below}px`;
};
document.addEventListener("pointermove", show);
document.addEventListener("pointerdown", show);
// A finger leaves the page when it is lifted: its text stays to be read.
document.addEventListener("pointerleave", event => { if (event.pointerType !== "touch") hide(); });
document.addEventListener("scroll", hide, { capture: true, passive: true });
document.addEventListener("keydown", event => { if (event.key === "Escape") hide(); });
"""


PACKAGES = {"matplotlib": "figures and PDF", "reportlab": "PDF"}
"""What each package is needed for."""


def without_packages(name: str) -> str:
    """Return the line on what the page ``name`` is without; empty where nothing is missing."""
    missing = [package for package in PACKAGES if find_spec(package) is None]
    if not missing:
        return ""
    return (
        f"{name}: without {PACKAGES[missing[0]]}, {' and '.join(missing)} missing: pip install 'strainfmu[report]'"
    )


PICTURE_RESOLUTION = 110
"""Dots per inch of figures as PNG."""


@dataclass(frozen=True)
class Paragraph:
    """Plain text."""

    text: str


@dataclass(frozen=True)
class Items:
    """A list of plain texts."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Preformatted:
    """Text with its spaces and line breaks kept, such as a file or a command."""

    text: str


@dataclass(frozen=True)
class Files:
    """Hyperlinks to files next to the page, with what each holds.

    ``names_and_contents`` are relative paths with descriptions. The page can be read without them.
    """

    names_and_contents: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Picture:
    """A figure inside the page.

    Attributes
    ----------
    content : the bytes of a PNG or SVG file.
    kind : "png" or "svg".
    caption : text below the figure; numbers and units of axes belong into the figure.
    alternative : description for readers who cannot see the figure.
    places : its texts under the pointer.
    """

    content: bytes
    kind: Literal["png", "svg"]
    caption: str
    alternative: str
    places: tuple[Place, ...] = ()


@dataclass(frozen=True)
class Cards:
    """Short lists side by side, two in a row.

    ``cards`` are titles, a colour of :data:`CARD_COLOURS` each, and items; an empty list shows ``nothing``.
    """

    cards: tuple[tuple[str, str, tuple[str, ...]], ...]
    nothing: str = "Nothing."


@dataclass(frozen=True)
class Section:
    """A heading and its blocks, in order; sections inside it get smaller headings."""

    title: str
    blocks: tuple[Block, ...]


Block = Paragraph | Items | Cards | Preformatted | Files | Picture | Table | Section


@dataclass(frozen=True)
class Page:
    """A whole page: title, opening blocks, a table of contents, sections."""

    title: str
    opening: tuple[Block, ...]
    sections: tuple[Section, ...]


def picture(
    figure: Figure | ValuedFigure,
    caption: str,
    alternative: str,
    kind: Literal["png", "svg"] = "png",
    resolution: float = PICTURE_RESOLUTION,
) -> Picture:
    """Draw a matplotlib figure into a page; "svg" for lines and rasterised meshes, "png" for meshes in 3-D.

    ``resolution`` is in dots per inch.
    """
    from matplotlib import rc_context

    canvas = figure.figure if isinstance(figure, ValuedFigure) else figure
    stream = io.BytesIO()
    # Without a date, and with fixed names, the same figure gives the same bytes.
    metadata = {"Date": None} if kind == "svg" else {"Software": None}
    with rc_context({"svg.hashsalt": "strainfmu"}):
        settle(canvas, resolution)
        canvas.savefig(stream, format=kind, dpi=resolution, metadata=metadata)
    places = figure.places() if isinstance(figure, ValuedFigure) else ()
    return Picture(content=stream.getvalue(), kind=kind, caption=caption, alternative=alternative, places=places)


def write_page(page: Page, path: Path) -> None:
    """Write ``page`` to ``path`` atomically.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """
    write_bytes_atomically(path, page_html(page).encode("utf-8"))


def page_html(page: Page) -> str:
    """Return the page as HTML 5."""
    anchors = _Anchors()
    script = f"<script>\n{SCRIPT}</script>\n" if any(map(_has_values, (*page.opening, *page.sections))) else ""
    body = "\n".join(_section(section, 2, anchors) for section in page.sections)
    opening = "\n".join(_block(block, 2, anchors) for block in page.opening)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f"<title>{escape(page.title)}</title>\n<style>\n{PAGE_STYLE}{STYLE}{POINTER_STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{escape(page.title)}</h1>\n{opening}\n{_contents(anchors)}\n{body}\n{script}</body>\n</html>\n"
    )


def _has_values(block: Block) -> bool:
    """Return whether a block holds a figure with values under the pointer."""
    if isinstance(block, Section):
        return any(map(_has_values, block.blocks))
    return isinstance(block, Picture) and bool(block.places)


class _Anchors:
    """Names of sections inside a page, each used once, with titles and levels in order."""

    def __init__(self) -> None:
        self.entries: list[tuple[str, str, int]] = []

    def add(self, title: str, level: int) -> str:
        stem = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "section"
        used, name, number = {entry[0] for entry in self.entries}, stem, 1
        while name in used:
            number += 1
            name = f"{stem}-{number}"
        self.entries.append((name, title, level))
        return name


def _contents(anchors: _Anchors) -> str:
    """Return the table of contents, two levels deep."""
    lines = [
        f'<li class="level{level}"><a href="#{name}">{escape(title)}</a></li>'
        for name, title, level in anchors.entries
        if level <= 3
    ]
    return '<nav aria-label="Contents">\n<ul>\n' + "\n".join(lines) + "\n</ul>\n</nav>" if lines else ""


def _section(section: Section, level: int, anchors: _Anchors) -> str:
    name = anchors.add(section.title, level)
    inside = "\n".join(_block(block, level + 1, anchors) for block in section.blocks)
    heading = f"h{min(level, 6)}"
    return f'<section id="{name}">\n<{heading}>{escape(section.title)}</{heading}>\n{inside}\n</section>'


def _block(block: Block, level: int, anchors: _Anchors) -> str:
    if isinstance(block, Section):
        return _section(block, level, anchors)
    if isinstance(block, Table):
        return _table(block)
    if isinstance(block, Picture):
        return _picture(block)
    if isinstance(block, Paragraph):
        return f"<p>{escape(block.text)}</p>"
    if isinstance(block, Preformatted):
        return f"<pre>{escape(block.text)}</pre>"
    if isinstance(block, Cards):
        return _cards(block)
    if isinstance(block, Files):
        return _list(
            f'<a href="{escape(name)}">{escape(name)}</a>: {escape(content)}'
            for name, content in block.names_and_contents
        )
    return _list(escape(item) for item in block.items)


def _list(items: Iterable[str]) -> str:
    return "<ul>\n" + "\n".join(f"<li>{item}</li>" for item in items) + "\n</ul>"


def _cards(block: Cards) -> str:
    inside = "\n".join(
        f'<div class="card {escape(colour)}"><h2>{escape(title)}</h2>\n'
        + _list(map(escape, items or (block.nothing,)))
        + "</div>"
        for title, colour, items in block.cards
    )
    return f'<div class="cards">\n{inside}\n</div>'


def _table(table: Table) -> str:
    """Return a table; a column is aligned as numbers where all its cells are."""
    return table_html(
        [column.title for column in table.columns],
        [[shown(cell, column) for cell, column in zip(row, table.columns, strict=True)] for row in table.rows],
        caption=table.caption,
        name=f"table-{table.name}",
        number_columns=[
            bool(table.rows) and all(is_number(row[i]) for row in table.rows) for i in range(len(table.columns))
        ],
    )


def _picture(picture: Picture) -> str:
    kind = "image/svg+xml" if picture.kind == "svg" else "image/png"
    content = b64encode(picture.content).decode("ascii")
    return (
        '<figure>\n<div class="picture"><div>\n'
        f'<img src="data:{kind};base64,{content}" alt="{escape(picture.alternative)}">\n{overlay(picture.places)}'
        f"</div></div>\n<figcaption>{escape(picture.caption)}</figcaption>\n</figure>"
    )


CARD_COLOURS = {"green": "#2c7a3f", "amber": "#a86400", "red": "#b3202c", "blue": "#0b4f9c"}
"""Colours of the edge of a card, by name."""

PAGE_STYLE = """\
body { font: 16px/1.5 system-ui, "Segoe UI", "Liberation Sans", Arial, sans-serif; color: #1a1a1a;
  background: #fff; max-width: 76rem; margin: 0 auto; padding: 1.5rem; }
h1 { font-size: 1.7rem; line-height: 1.2; } h2 { font-size: 1.3rem; margin-top: 2.2rem;
  border-bottom: 1px solid #bbb; } h3 { font-size: 1.08rem; margin-top: 1.6rem; } h4 { font-size: 1rem; }
p, li { max-width: 46rem; } a { color: #0b4f9c; }
nav ul { list-style: none; padding: 0.6rem 1rem; border: 1px solid #ccc; }
nav li.level3 { margin-left: 1.5rem; font-size: 0.93rem; }
table { margin: 1rem 0; font-size: 0.88rem; }
caption { padding-bottom: 0.3rem; color: #333; font-weight: 600; }
th, td { padding: 0.16rem 0.7rem; vertical-align: top; }
thead th { border-bottom: 2px solid #444; vertical-align: bottom; }
tbody tr:nth-child(even) { background: #f4f4f4; } tbody tr { border-bottom: 1px solid #e2e2e2; }
figure { margin: 1.2rem 0; }
figcaption { font-size: 0.9rem; color: #333; max-width: 46rem; }
pre { background: #f4f4f4; padding: 0.6rem; font-size: 0.85rem; }
.cards { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 0.8rem; margin: 1rem 0; }
.card { border: 1px solid #ccc; border-left-width: 5px; padding: 0.5rem 0.9rem; }
.card h2 { font-size: 1.05rem; margin: 0; border: 0; }
.card ul { margin: 0.3rem 0; padding-left: 1.1rem; font-size: 0.92rem; line-height: 1.4; }
@media screen and (max-width: 700px) { .cards { grid-template-columns: minmax(0, 1fr); }
  table:not(.many) { display: block; overflow-x: auto; } }
@media print { body { font-size: 10pt; max-width: none; padding: 0; }
  h2, h3 { break-after: avoid; } figure, tr { break-inside: avoid; } thead { display: table-header-group; }
  a { color: inherit; text-decoration: none; } }
""" + "".join(f".card.{name} {{ border-left-color: {colour}; }}\n" for name, colour in CARD_COLOURS.items())
