"""Pages as PDF: whole, repeatable, nothing beyond the margins."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest

from builder.reports.page.html import Cards, Items, Page, Paragraph, Picture, Preformatted, Section
from builder.reports.page.pdf import LEFT, SHEET, page_pdf, text_width, wrapped
from builder.reports.page.tables import Column, make_table

pytestmark = pytest.mark.fast


def page(rows: int = 3) -> Page:
    table = make_table(
        "many",
        "A table that is longer than a sheet.",
        (Column("gauge"), Column("a heading of several words", "um/m"), Column("remark")),
        [
            [f"gauge_{k}", 0.1 * k, "a remark that is longer than the column it stands in, " * 3]
            for k in range(rows)
        ],
    )
    blocks = (Paragraph("Words. " * 60), Items(("one", "two $x$ 100 %")), Preformatted("a = 1\nb = 2"), table)
    cards = Cards((("Good", "green", ("a", "b")), ("Bad", "red", ())))
    return Page("A title", (cards,), (Section("First", blocks), Section("Second", (Section("Inner", blocks),))))


def test_the_same_page_gives_the_same_file() -> None:
    made = page_pdf(page())
    assert made.startswith(b"%PDF-1")
    assert made.rstrip().endswith(b"%%EOF")
    assert made == page_pdf(page())


def test_long_tables_go_on_with_their_headings() -> None:
    sheets = [len(re.findall(rb"/Type /Page\b", page_pdf(page(rows)))) for rows in (3, 60)]
    assert sheets[0] in (1, 2)
    assert sheets[1] > sheets[0] + 2


def test_pictures_are_set_and_others_left_out() -> None:
    from matplotlib.image import imsave

    stream = io.BytesIO()
    imsave(stream, np.random.default_rng(0).random((40, 60, 3)), format="png")
    picture = Picture(content=stream.getvalue(), kind="png", caption="Noise.", alternative="noise")
    none = Picture(content=b"<svg/>", kind="svg", caption="None.", alternative="none")
    empty = len(page_pdf(Page("t", (none,), ())))
    assert len(page_pdf(Page("t", (picture,), ()))) > empty + 3000


def test_widths_are_those_that_are_drawn_and_lines_keep_within_them() -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=SHEET, dpi=720)
    renderer = FigureCanvasAgg(figure).get_renderer()
    for text, bold in (("Measured less predicted, 0.25 um/m", False), ("Sigma in flight", True)):
        drawn = figure.text(0.0, 0.0, text, fontsize=9.0, weight="bold" if bold else "normal")
        width = drawn.get_window_extent(renderer).width / 720.0
        assert text_width(text, 9.0, bold) == pytest.approx(width, rel=0.03)
    lines = wrapped(f"{'word ' * 50}{'x' * 300}", SHEET[0] - 2.0 * LEFT, 9.0)
    assert "".join(lines).replace(" ", "") == "word" * 50 + "x" * 300
    assert max(text_width(line, 9.0) for line in lines) <= SHEET[0] - 2.0 * LEFT
