"""A page as PDF for print: the blocks of :mod:`builder.reports.page.html` on sheets of A4, set by reportlab.

Text is set in matplotlib's own font, which has Greek letters, so that the file is the same everywhere. Tables
shrink to the width of the sheet and go on with their headings on the next one. Headings are the file's outline.
Pictures are the page's; SVG, which reportlab does not read, and links to files are left out.

This module needs reportlab: import it where a PDF is written.
"""

import io
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from matplotlib import get_data_path
from reportlab import platypus, rl_config
from reportlab.lib.colors import HexColor, black
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import inch
from reportlab.pdfbase.pdfmetrics import getRegisteredFontNames, registerFont, stringWidth
from reportlab.pdfbase.ttfonts import TTFont

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
from builder.reports.page.page_tables import Table, is_number, shown
from strainfmu.files import write_bytes_atomically

MARGIN = 0.7 * inch
"""On all sides of a sheet [pt], as all lengths of this module."""

WIDTH = A4[0] - 2.0 * MARGIN
"""Of the text."""

TEXT, SMALL, SMALLEST = 9.0, 8.0, 5.5
"""Sizes of text, of tables and captions, and of tables that are wide."""

HEADINGS = (15.0, 12.0, 10.5, 9.5)
"""Sizes of the title and of headings by level."""

LEADING = 1.35
"""Distance of lines over the size of the text."""

GAP, LARGEST_GAP = 0.14 * inch, 0.3
"""Space between columns of a table, and at most so much of a column where they are many."""

ROUNDING = 0.01
"""By which a column is wider than its text, so that rounding breaks no word."""

PLAIN, BOLD, MONOSPACED = "DejaVuSans", "DejaVuSans-Bold", "DejaVuSansMono"
"""Fonts, by the names of matplotlib's files."""

GREY, PALE = HexColor("#595959"), HexColor("#d9d9d9")

PNG = b"\x89PNG"


def write_pdf(page: Page, path: Path) -> None:
    """Write ``page`` to ``path`` atomically.

    Raises
    ------
    StrainfmuError
        The file could not be written.
    """
    write_bytes_atomically(path, page_pdf(page))


def page_pdf(page: Page) -> bytes:
    """Return the page as PDF; the same page gives the same bytes."""
    _register_fonts()
    rl_config.useA85 = 0  # streams as they are, not as text: a smaller file in less time
    stream = io.BytesIO()
    margins = dict.fromkeys(("leftMargin", "rightMargin", "topMargin", "bottomMargin"), MARGIN)
    document = _Document(stream, title=page.title, pagesize=A4, invariant=True, **margins)
    story = [_heading(page.title, 1)]
    for block in (*page.opening, *page.sections):
        story += _set(block, 2)
    document.build([*story, _NumberOfSheets()])
    return stream.getvalue()


class _Document(platypus.BaseDocTemplate):
    """Sheets with the title and their number at the foot, and headings in the outline."""

    def __init__(self, stream: io.BytesIO, **options: Any) -> None:
        super().__init__(stream, **options)
        padding = dict.fromkeys(("leftPadding", "bottomPadding", "rightPadding", "topPadding"), 0.0)
        frame = platypus.Frame(MARGIN, MARGIN, WIDTH, A4[1] - 2.0 * MARGIN, **padding)
        self.addPageTemplates(platypus.PageTemplate(frames=[frame], onPage=_foot))

    def afterFlowable(self, flowable: platypus.Flowable) -> None:
        """Put a heading into the outline."""
        level = getattr(flowable, "level_in_outline", None)
        if level is not None:
            self.canv.bookmarkPage(key := f"heading {self.seq.next('heading')}")
            self.canv.addOutlineEntry(flowable.getPlainText(), key, level)


def _foot(canvas: Any, document: _Document) -> None:
    """Set the title and the number of a sheet."""
    text = f"{document.title}    {document.page} of "
    canvas.saveState()
    canvas.setFont(PLAIN, 7.0)
    canvas.setFillColor(GREY)
    canvas.drawString(MARGIN, 0.4 * inch, text)
    canvas.translate(MARGIN + stringWidth(text, PLAIN, 7.0), 0.4 * inch)
    canvas.doForm("sheets")  # known at the end
    canvas.restoreState()


class _NumberOfSheets(platypus.Flowable):
    """Says at the end how many sheets there are, for the feet of all of them."""

    def draw(self) -> None:
        """Define what the feet show."""
        self.canv.beginForm("sheets")
        self.canv.setFont(PLAIN, 7.0)
        self.canv.setFillColor(GREY)
        self.canv.drawString(0.0, 0.0, str(self.canv.getPageNumber()))
        self.canv.endForm()


def _set(block: Block, level: int) -> list[platypus.Flowable]:
    """Return a block as what flows onto sheets; headings of its sections are of ``level``."""
    match block:
        case Section():
            room = _least_height(block.blocks[0]) if block.blocks else 0.5 * inch
            start = [platypus.Spacer(0.0, 0.12 * inch), platypus.CondPageBreak(room)]
            below = [flowable for inner in block.blocks for flowable in _set(inner, level + 1)]
            return [*start, _heading(block.title, level), *below]
        case Paragraph():
            return [_words(block.text, after=6.0)]
        case Preformatted():
            letters = int(WIDTH / text_width("0", SMALL, MONOSPACED))
            style = _style(SMALL, MONOSPACED, after=6.0)
            return [platypus.Preformatted(block.text, style, maxLineLength=letters, newLineChars="")]
        case Items():
            return _items(block.items)
        case Cards():
            return [flowable for card in block.cards for flowable in _card(*card, nothing=block.nothing)]
        case Picture():
            return _picture(block)
        case Table():
            return _table(block)
        case Files():
            return []


def _heading(text: str, level: int) -> platypus.Paragraph:
    paragraph = _words(text, HEADINGS[min(level, len(HEADINGS)) - 1], BOLD, after=4.0)
    paragraph.level_in_outline = level - 1
    return paragraph


def _card(title: str, colour: str, items: tuple[str, ...], nothing: str) -> list[platypus.Flowable]:
    head = _words(title, TEXT + 0.5, BOLD, textColor=HexColor(CARD_COLOURS[colour]))
    return [platypus.CondPageBreak(0.6 * inch), head, *_items(items or (nothing,))]


def _items(items: tuple[str, ...]) -> list[platypus.Flowable]:
    indent: dict[str, Any] = {"leftIndent": 0.15 * inch, "bulletIndent": 0.0, "bulletFontName": PLAIN}
    style = _style(TEXT, after=1.5, bulletFontSize=TEXT, **indent)
    return [
        *(platypus.Paragraph(escape(item), style, bulletText="–") for item in items),
        platypus.Spacer(0.0, 4.0),
    ]


def _picture(block: Picture) -> list[platypus.Flowable]:
    """Return a picture over the width of the sheet with its caption."""
    if not block.content.startswith(PNG):
        return []
    image = platypus.Image(io.BytesIO(block.content), *_size_on_sheet(block.content), hAlign="LEFT")
    return [platypus.KeepTogether([image, _words(block.caption, SMALL, after=7.0, textColor=GREY)])]


def _size_on_sheet(png: bytes) -> tuple[float, float]:
    """Return width and height of a picture: as wide as the text, with room for a heading."""
    columns, rows = (int.from_bytes(png[offset : offset + 4], "big") for offset in (16, 20))  # of the header
    height = min(WIDTH * rows / columns, A4[1] - 2.0 * MARGIN - 1.1 * inch)
    return height * columns / rows, height


def _least_height(block: Block) -> float:
    """Return the height that a heading needs with the block below it, or with the first lines of that."""
    if not isinstance(block, Picture) or not block.content.startswith(PNG):
        return 1.3 * inch
    return _size_on_sheet(block.content)[1] + 0.9 * inch


def _table(table: Table) -> list[platypus.Flowable]:
    """Return a table; its columns share the sheet, words wrap where they must."""
    if not table.rows:
        return []
    cells = [[shown(cell, column) for cell, column in zip(row, table.columns, strict=True)] for row in table.rows]
    heads = [column.title for column in table.columns]
    right = [all(is_number(row[i]) for row in table.rows) for i in range(len(heads))]
    gap = min(GAP, LARGEST_GAP * WIDTH / len(heads))
    size, widths = _fitted(heads, cells, WIDTH - gap * len(heads))
    columns = list(zip(widths, right, strict=True))
    rows = [
        [_cell(text, size, font, *column) for text, column in zip(row, columns, strict=True)]
        for row, font in [(heads, BOLD), *((row, PLAIN) for row in cells)]
    ]
    style = [
        ("FONT", (0, 0), (-1, -1), PLAIN, size, size * LEADING),
        ("FONT", (0, 0), (-1, 0), BOLD, size, size * LEADING),
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("LEFTPADDING", (0, 0), (-1, -1), 0.0),
        ("RIGHTPADDING", (0, 0), (-1, -1), gap),
        ("TOPPADDING", (0, 0), (-1, -1), 1.0),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 1.0),
        ("LINEBELOW", (0, 0), (-1, 0), 0.6, black),
        ("LINEBELOW", (0, 1), (-1, -1), 0.4, PALE),
        *(("ALIGN", (i, 0), (i, -1), "RIGHT") for i, number in enumerate(right) if number),
    ]
    columns_with_gaps = [width + gap + ROUNDING for width in widths]
    pdf_table = platypus.Table(rows, columns_with_gaps, style=style, repeatRows=1, splitInRow=1, hAlign="LEFT")
    caption = _words(table.caption, SMALL, BOLD, after=3.0)
    return [platypus.CondPageBreak(0.9 * inch), caption, pdf_table, platypus.Spacer(0.0, 0.14 * inch)]


def _cell(text: str, size: float, font: str, width: float, right: bool) -> str | platypus.Paragraph:
    """Return a cell of a table: a line where it fits, as it is set faster, otherwise words that wrap."""
    if text_width(text, size, font) <= width:
        return text
    return platypus.Paragraph(escape(text), _style(size, font, alignment=2 if right else 0))


def _fitted(heads: list[str], cells: list[list[str]], room: float) -> tuple[float, list[float]]:
    """Return size of the text and widths of the columns that fit into the width ``room``.

    A heading may wrap at its words, as may the cells of the widest columns.
    """
    for size in (SMALL, 7.5, 7.0, 6.5, 6.0, SMALLEST):
        least = [
            max(
                0.4 * text_width(head, size, BOLD), *(text_width(word, size, BOLD) for word in [*head.split(), ""])
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
        widths = [wide if wide is not None else rest / narrow.count(None) for wide in narrow]
        if all(have >= need for have, need in zip(widths, broken, strict=True)):
            return size, widths
    return SMALLEST, [room * wide / sum(natural) for wide in natural]


def _words(
    text: str, size: float = TEXT, font: str = PLAIN, after: float = 0.0, **style: Any
) -> platypus.Paragraph:
    """Return a paragraph of plain text with the space ``after`` it."""
    return platypus.Paragraph(escape(text), _style(size, font, after, **style))


@cache
def _style(size: float, font: str = PLAIN, after: float = 0.0, **options: Any) -> ParagraphStyle:
    """Return the style of a paragraph; a word that is longer than the line is broken."""
    leading = size * LEADING
    return ParagraphStyle("", fontName=font, fontSize=size, leading=leading, spaceAfter=after, **options)


def text_width(text: str, size: float, font: str = PLAIN) -> float:
    """Return the width of a line."""
    _register_fonts()
    return float(stringWidth(text, font, size))


@cache
def _register_fonts() -> None:
    """Give reportlab the fonts of matplotlib."""
    for name in (PLAIN, BOLD, MONOSPACED):
        if name not in getRegisteredFontNames():
            registerFont(TTFont(name, Path(get_data_path()) / "fonts" / "ttf" / f"{name}.ttf"))
