"""A page as PDF for print: the blocks of :mod:`builder.reports.page.html` on sheets of A4, drawn by matplotlib.

Text is set in matplotlib's own font, so that the file is the same everywhere. Tables shrink to the width of the
sheet and go on with their headings on the next one. Pictures are the page's; SVG, which matplotlib does not
read, and links to files are left out.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from builder.figures.drawing.canvas import blank_figure
from builder.reports.page.html import (
    CARD_COLOURS,
    Block,
    Cards,
    Files,
    Items,
    Page,
    Paragraph,
    Picture,
    Preformatted,
    Section,
)
from builder.reports.page.tables import Table, is_number, shown
from strainfmu.files import write_bytes_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHEET = (8.27, 11.69)
"""A4 [in]."""

LEFT, TOP, BOTTOM = 0.7, 0.75, 0.75
"""Margins [in]; the right one is the left one."""

TEXT, SMALL, SMALLEST = 9.0, 8.0, 5.5
"""Sizes of text, of tables and captions, and of tables that are wide [pt]."""

HEADINGS = (15.0, 12.0, 10.5, 9.5)
"""Sizes of the title and of headings by level [pt]."""

LEADING = 1.35
"""Distance of lines over the size of the text."""

GAP = 0.14
"""Space between columns of a table [in]."""

GREY = "0.35"

PNG = b"\x89PNG"


def write_pdf(page: Page, path: Path) -> None:
    """Write ``page`` to ``path`` atomically.

    Raises
    ------
    StrainfmuError
        matplotlib is not installed, or the file could not be written.
    """
    write_bytes_atomically(path, page_pdf(page))


def page_pdf(page: Page) -> bytes:
    """Return the page as PDF; the same page gives the same bytes.

    Raises
    ------
    StrainfmuError
        matplotlib is not installed.
    """
    sheets = _Sheets(page.title)
    sheets.words(page.title, HEADINGS[0], weight="bold")
    for block in page.opening:
        _put(sheets, block, 2)
    for section in page.sections:
        _put(sheets, section, 2)
    return sheets.written()


@dataclass
class _Sheets:
    """Sheets that are filled from top to bottom.

    Attributes
    ----------
    title : at the foot of every sheet.
    figures : the sheets.
    y : where the next line begins, from the bottom of the sheet [in].
    """

    title: str
    figures: list[Figure] = field(default_factory=list)
    y: float = 0.0

    def room(self, height: float) -> None:
        """Begin another sheet where less than ``height`` [in] is left."""
        if not self.figures or self.y - height < BOTTOM:
            self.figures.append(blank_figure(*SHEET, layout=None))
            self.y = SHEET[1] - TOP

    def text(self, x: float, y: float, text: str, size: float, **style: Any) -> None:
        """Set one line with its top at ``y`` [in] on the present sheet."""
        self.figures[-1].text(x / SHEET[0], y / SHEET[1], text, fontsize=size, va="top", parse_math=False, **style)

    def words(self, text: str, size: float, indent: float = 0.0, after: float = 0.0, **style: Any) -> None:
        """Set a paragraph, ``indent`` and the space ``after`` it in [in]."""
        width = SHEET[0] - 2.0 * LEFT - indent
        for line in wrapped(text, width, size, bold=style.get("weight") == "bold"):
            self.room(size * LEADING / 72.0)
            self.text(LEFT + indent, self.y, line, size, **style)
            self.y -= size * LEADING / 72.0
        self.y -= after

    def rule(self, colour: str, width: float = 0.6) -> None:
        """Draw a line across the sheet."""
        from matplotlib.lines import Line2D

        across, height = [LEFT / SHEET[0], 1.0 - LEFT / SHEET[0]], [self.y / SHEET[1]] * 2
        self.figures[-1].add_artist(Line2D(across, height, color=colour, linewidth=width))

    def written(self) -> bytes:
        """Return the file, sheets numbered."""
        from matplotlib import rc_context
        from matplotlib.backends.backend_pdf import PdfPages

        stream = io.BytesIO()
        about = {"Title": self.title, "Creator": None, "Producer": None, "CreationDate": None}
        with rc_context({"pdf.fonttype": 42}), PdfPages(stream, metadata=about) as file:
            for number, figure in enumerate(self.figures, start=1):
                foot = f"{self.title}    {number} of {len(self.figures)}"
                figure.text(LEFT / SHEET[0], 0.4 / SHEET[1], foot, fontsize=7.0, color=GREY, parse_math=False)
                file.savefig(figure)
        return stream.getvalue()


def _put(sheets: _Sheets, block: Block, level: int) -> None:
    """Set a block; headings of its sections are of ``level``."""
    match block:
        case Section():
            size = HEADINGS[min(level, len(HEADINGS)) - 1]
            sheets.y -= 0.12
            sheets.room(_least_height(block.blocks[0]) if block.blocks else 0.5)
            sheets.words(block.title, size, after=0.06, weight="bold")
            for one in block.blocks:
                _put(sheets, one, level + 1)
        case Paragraph():
            sheets.words(block.text, TEXT, after=0.08)
        case Preformatted():
            for line in block.text.splitlines():
                sheets.words(line, SMALL, family="monospace")
            sheets.y -= 0.08
        case Items():
            _items(sheets, block.items, 0.0)
        case Cards():
            for title, colour, items in block.cards:
                sheets.room(0.6)
                sheets.words(title, TEXT + 0.5, after=0.02, weight="bold", color=CARD_COLOURS[colour])
                _items(sheets, items or (block.nothing,), 0.05)
        case Picture():
            _picture(sheets, block)
        case Table():
            _table(sheets, block)
        case Files():
            pass


def _items(sheets: _Sheets, items: tuple[str, ...], indent: float) -> None:
    for item in items:
        sheets.room(TEXT * LEADING / 72.0)
        sheets.text(LEFT + indent, sheets.y, "–", TEXT)
        sheets.words(item, TEXT, indent=indent + 0.15, after=0.02)
    sheets.y -= 0.06


def _picture(sheets: _Sheets, block: Picture) -> None:
    """Set a picture over the width of the sheet, with its caption."""
    if not block.content.startswith(PNG):
        return
    from matplotlib.image import imread

    image = imread(io.BytesIO(block.content))
    width, height = _size_on_sheet(image.shape[1], image.shape[0])
    sheets.room(height + 0.4)
    box = (LEFT / SHEET[0], (sheets.y - height) / SHEET[1], width / SHEET[0], height / SHEET[1])
    axes = sheets.figures[-1].add_axes(box)
    axes.imshow(image, aspect="auto", interpolation="none")
    axes.set_axis_off()
    sheets.y -= height + 0.03
    sheets.words(block.caption, SMALL, after=0.1, color=GREY)


def _size_on_sheet(columns: int, rows: int) -> tuple[float, float]:
    """Return width and height [in] of a picture of so many dots: as wide as the text, with room for a heading."""
    width = SHEET[0] - 2.0 * LEFT
    height = min(width * rows / columns, SHEET[1] - TOP - BOTTOM - 1.1)
    return height * columns / rows, height


def _least_height(block: Block) -> float:
    """Return the height [in] that a heading needs with the block below it, or with the first lines of that."""
    if not isinstance(block, Picture) or not block.content.startswith(PNG):
        return 1.3
    columns, rows = (int.from_bytes(block.content[at : at + 4], "big") for at in (16, 20))  # of the header
    return _size_on_sheet(columns, rows)[1] + 0.9


def _table(sheets: _Sheets, table: Table) -> None:
    """Set a table; its columns share the sheet, words wrap where they must."""
    if not table.rows:
        return
    cells = [[shown(cell, column) for cell, column in zip(row, table.columns, strict=True)] for row in table.rows]
    heads = [column.title for column in table.columns]
    number = [all(is_number(row[i]) for row in table.rows) for i in range(len(heads))]
    size, widths = _fitted(heads, cells)
    sheets.room(0.9)
    sheets.words(table.caption, SMALL, after=0.04, weight="bold")
    _head(sheets, heads, widths, size, number)
    for row in cells:
        height = _height(row, widths, size)
        if sheets.y - height < BOTTOM:
            sheets.room(SHEET[1])
            _head(sheets, heads, widths, size, number)
        _row(sheets, row, widths, size, number)
        sheets.rule("0.85", 0.4)
    sheets.y -= 0.14


def _head(sheets: _Sheets, heads: list[str], widths: list[float], size: float, number: list[bool]) -> None:
    """Set the headings of a table."""
    _row(sheets, heads, widths, size, number, bold=True)
    sheets.rule("black")
    sheets.y -= 0.03


def _fitted(heads: list[str], cells: list[list[str]]) -> tuple[float, list[float]]:
    """Return size of the text [pt] and widths of the columns [in] that fit on the sheet.

    A heading may wrap at its words, as may the cells of the widest columns.
    """
    room = SHEET[0] - 2.0 * LEFT - GAP * (len(heads) - 1)
    for size in (SMALL, 7.5, 7.0, 6.5, 6.0, SMALLEST):
        least = [
            max(
                0.4 * text_width(head, size, bold=True),
                *(text_width(word, size, bold=True) for word in head.split()),
            )
            for head in heads
        ]
        natural = [max(low, *(text_width(row[i], size) for row in cells)) for i, low in enumerate(least)]
        if sum(natural) <= room:
            return size, natural
        # Columns of long texts wrap: at most so wide that all together fit.
        broken = [
            max(low, *(text_width(word, size) for row in cells for word in [*row[i].split(), ""]))
            for i, low in enumerate(least)
        ]
        narrow = [wide if wide <= room / len(heads) else None for wide in natural]
        rest = room - sum(wide for wide in narrow if wide is not None)
        wide_ones = narrow.count(None)
        found = [wide if wide is not None else rest / wide_ones for wide in narrow]
        if all(have >= need for have, need in zip(found, broken, strict=True)):
            return size, found
    return SMALLEST, [room * wide / sum(natural) for wide in natural]


def _height(row: list[str], widths: list[float], size: float, bold: bool = False) -> float:
    lines = max(len(wrapped(text, width, size, bold=bold)) for text, width in zip(row, widths, strict=True))
    return lines * size * LEADING / 72.0 + 0.02


def _row(
    sheets: _Sheets, row: list[str], widths: list[float], size: float, number: list[bool], bold: bool = False
) -> None:
    """Set one row of a table, numbers to the right."""
    x, style = LEFT, {"weight": "bold"} if bold else {}
    for text, width, right in zip(row, widths, number, strict=True):
        for k, line in enumerate(wrapped(text, width, size, bold=bold)):
            y = sheets.y - k * size * LEADING / 72.0
            if right:
                sheets.text(x + width, y, line, size, ha="right", **style)
            else:
                sheets.text(x, y, line, size, **style)
        x += width + GAP
    sheets.y -= _height(row, widths, size, bold)


def wrapped(text: str, width: float, size: float, bold: bool = False) -> list[str]:
    """Return a text in lines no wider than ``width`` [in]; a word that is longer is broken."""
    lines, line = list[str](), ""
    for word in text.split():
        joined = f"{line} {word}" if line else word
        if text_width(joined, size, bold) <= width:
            line = joined
            continue
        if line:
            lines.append(line)
        while text_width(word, size, bold) > width and len(word) > 1:
            fits = max(k for k in range(1, len(word)) if k == 1 or text_width(word[:k], size, bold) <= width)
            lines.append(word[:fits])
            word = word[fits:]
        line = word
    return [*lines, line] if line or not lines else lines


def text_width(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a line [in]."""
    return size * sum(_advance(letter, bold) for letter in text) / 72.0


@cache
def _advance(letter: str, bold: bool) -> float:
    """Return the width of a letter over the size of the text."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    font = get_font(findfont(FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")))
    font.set_size(100.0, 72.0)
    return float(font.load_char(ord(letter)).linearHoriAdvance) / 65536.0 / 100.0
