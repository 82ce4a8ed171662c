"""Pages as PDF: whole, repeatable, nothing beyond the margins, read by PDFium."""

import io
from collections.abc import Iterator

import numpy as np
import pypdfium2
import pytest

from builder.reports.page.html import Cards, Items, Page, Paragraph, Picture, Preformatted, Section
from builder.reports.page.page_tables import Column, make_table
from builder.reports.page.pdf import A4, MARGIN, WIDTH, page_pdf

pytestmark = pytest.mark.fast

REMARK = "a remark that is longer than the column it stands in, " * 3


def page(rows: int = 3) -> Page:
    table = make_table(
        "many",
        "A table that is longer than a sheet.",
        (Column("gauge"), Column("a heading of several words", "um/m"), Column("remark")),
        [[f"gauge_{k}", 0.1 * k, REMARK] for k in range(rows)],
    )
    blocks = (Paragraph("Words & <words>, σ = 1 µm. " * 40), Items(("one", "two $x$ 100 %")), table)
    shown = (*blocks, Preformatted("a = 1\n  b = 2"))
    cards = Cards((("Good", "green", ("a", "b")), ("Bad", "red", ())))
    return Page("A title", (cards,), (Section("First", shown), Section("Second", (Section("Inner", blocks),))))


def read(made: bytes) -> pypdfium2.PdfDocument:
    return pypdfium2.PdfDocument(made)


def text_of(made: bytes) -> str:
    return "\n".join(sheet.get_textpage().get_text_bounded() for sheet in read(made))


def boxes(made: bytes) -> Iterator[tuple[float, float, float, float]]:
    """Yield left, bottom, right and top [pt] of each run of text, without the feet."""
    for sheet in read(made):
        text = sheet.get_textpage()
        for k in range(text.count_rects()):
            box = text.get_rect(k)
            if box[3] > MARGIN:
                yield box


def png(columns: int = 60, rows: int = 40) -> bytes:
    from matplotlib.image import imsave

    stream = io.BytesIO()
    imsave(stream, np.random.default_rng(0).random((rows, columns, 3)), format="png")
    return stream.getvalue()


def test_the_same_page_gives_the_same_file() -> None:
    made = page_pdf(page())
    assert made.startswith(b"%PDF-1")
    assert made == page_pdf(page())


def test_all_is_on_the_sheets_and_characters_of_markup_too() -> None:
    text = " ".join(text_of(page_pdf(page())).split())
    for part in (
        "A title",
        "Words & <words>, σ = 1 µm.",
        "two $x$ 100 %",
        "gauge_2",
        "0.2",
        "Good",
        "Nothing.",
        "b = 2",
    ):
        assert part in text, part


def test_long_tables_go_on_with_their_headings_and_every_sheet_has_its_number() -> None:
    short, made = page_pdf(page(3)), page_pdf(page(60))
    sheets = [sheet.get_textpage().get_text_bounded() for sheet in read(made)]
    assert len(sheets) > len(read(short)) + 2
    for number, text in enumerate(sheets, start=1):
        assert f"A title {number} of {len(sheets)}" in " ".join(text.split())
        assert "gauge_" not in text or "remark" in text.split("gauge_")[0]


def test_headings_are_the_outline() -> None:
    found = [(entry.level, entry.get_title()) for entry in read(page_pdf(page())).get_toc()]
    assert found == [(0, "A title"), (1, "First"), (1, "Second"), (2, "Inner")]


def test_nothing_is_beyond_the_margins_and_words_that_fit_no_line_are_broken() -> None:
    wide = make_table(
        "wide", "Wide.", [Column(f"heading {k}", "um/m") for k in range(14)], [[1e-6 / 3.0] * 14] * 3
    )
    long = make_table("long", "Long.", (Column("a"), Column("b")), [["x" * 200, "y" * 300]])
    made = page_pdf(
        Page("T" * 200, (Paragraph("x" * 300), Preformatted("z" * 300), wide, long), page(40).sections)
    )
    found = np.array(list(boxes(made)))
    assert found[:, 0].min() >= MARGIN - 1.0
    assert found[:, 2].max() <= MARGIN + WIDTH + 1.0
    assert found[:, 3].max() <= A4[1] - MARGIN + 1.0
    letters = text_of(made)
    assert letters.count("x") >= 500
    assert letters.count("y") >= 300
    assert letters.count("z") >= 300


@pytest.mark.parametrize("count", [1, 40, 100])
def test_tables_of_any_number_of_columns_keep_within_the_margins(count: int) -> None:
    columns = [Column(f"heading {k}" if k else "") for k in range(count)]
    made = page_pdf(Page("t", (make_table("many", "", columns, [["word"] * count]),), ()))
    found = np.array(list(boxes(made)))
    assert found[:, 0].min() >= MARGIN - 1.0
    assert found[:, 2].max() <= MARGIN + WIDTH + 1.0


def test_a_cell_longer_than_a_sheet_goes_on_with_the_next_one() -> None:
    long = make_table("long", "Long.", (Column("a"), Column("b")), [["one", "word " * 4000], ["two", "end"]])
    made = page_pdf(Page("t", (long,), ()))
    assert len(read(made)) > 1
    assert text_of(made).count("word") == 4000


@pytest.mark.parametrize("shape", [(60, 40), (40, 400)])
def test_pictures_are_set_within_the_margins_and_others_left_out(shape: tuple[int, int]) -> None:
    picture = Picture(content=png(*shape), kind="png", caption="Noise.", alternative="noise")
    none = Picture(content=b"<svg/>", kind="svg", caption="None.", alternative="none")
    made = page_pdf(Page("t", (), (Section("Pictures", (picture, none)),)))
    last = list(read(made))[-1]
    (image,) = last.get_objects(filter=[pypdfium2.raw.FPDF_PAGEOBJ_IMAGE])
    left, bottom, right, top = image.get_bounds()
    assert min(left, bottom) >= MARGIN - 0.1
    assert right <= MARGIN + WIDTH + 0.1
    assert (right - left) / (top - bottom) == pytest.approx(shape[0] / shape[1], rel=1e-3)
    text = last.get_textpage().get_text_bounded()
    assert "Pictures" in text
    assert "Noise." in text
    assert "None." not in text
