"""Pages of HTML: balanced, escaped, self-contained; tables hold raw numbers and show them rounded."""

import csv
import io
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from page_checks import assert_self_contained

from builder.figures.drawing import blank_figure
from builder.reports.page.html import (
    Files,
    Items,
    Page,
    Paragraph,
    Preformatted,
    Section,
    page_html,
    picture,
    write_page,
)
from builder.reports.page.page_tables import (
    Column,
    Table,
    by_name,
    make_table,
    records_table,
    table_csv,
    table_json,
    write_csv,
)
from strainfmu.errors import StrainfmuError

pytestmark = pytest.mark.fast

NASTY = '<script>alert("a & b")</script>'


def example_table() -> Table:
    """A table with all that a cell can be."""
    columns = (Column("gauge"), Column("x", "m", ".3f"), Column("count"), Column("bias", "um/m"), Column("seen"))
    rows = [
        [NASTY, np.float64(1.23456789), np.int64(7), float("inf"), np.True_],
        ["b, c", -1e-9, 12, None, False],
        ['say "d"', 1e-9, 0, float("nan"), True],
    ]
    return make_table("example", "Gauges & more", columns, rows)


def example_page() -> Page:
    """A page with a block of each kind, and two sections of one title."""
    figures = []
    for kind in ("png", "svg"):
        figure = blank_figure(2.0, 1.0)
        figure.add_subplot().plot([0.0, 1.0], [0.0, 1.0])
        figures.append(picture(figure, f"A {kind} <line>", f'A "{kind}" line', kind))
    blocks = (
        Paragraph(NASTY),
        Items((NASTY, "two")),
        Preformatted("a  <b>\n c"),
        Files((("numbers & more.csv", "numbers"),)),
        example_table(),
        *figures,
        Section("Inside", (Paragraph("deep"),)),
    )
    return Page(f"Title {NASTY}", (Paragraph("opening"),), (Section("Same", blocks), Section("Same", ())))


def test_page_is_balanced_and_self_contained() -> None:
    html = page_html(example_page())
    page = assert_self_contained(html)
    assert "script" not in page.tags
    assert page.text.count(NASTY) == 5  # the two titles, paragraph, item, cell
    assert page.anchors == ["same", "table-example", "inside", "same-2"]
    assert [link for link in page.links if link.startswith("#")] == ["#same", "#inside", "#same-2"]
    assert len(page.fetched) == 2
    assert [one.split(";")[0] for one in page.fetched] == ["data:image/png", "data:image/svg+xml"]


def test_check_finds_what_is_wrong() -> None:
    html = page_html(example_page())
    for wrong in (
        html.replace("</section>", "", 1),
        html.replace("</body>", '<img src="http://a.example/b.png" alt="b"></body>'),
        html.replace('href="#inside"', 'href="#outside"'),
        html.replace("</head>", '<link rel="stylesheet" href="style.css"></head>'),
    ):
        with pytest.raises(AssertionError):
            assert_self_contained(wrong)


def test_table_shows_rounded_and_writes_in_full() -> None:
    table = example_table()
    page = assert_self_contained(page_html(Page("p", (), (Section("s", (table,)),))))
    rows = page.tables["table-example"]
    assert rows[0] == ["gauge", "x [m]", "count", "bias [um/m]", "seen"]
    assert rows[1] == [NASTY, "1.235", "7", "infinite", "yes"]
    assert rows[2] == ["b, c", "0.000", "12", "–", "no"]
    read = list(csv.reader(io.StringIO(table_csv(table))))
    assert read[0] == rows[0]
    assert read[1] == [NASTY, "1.23456789", "7", "infinite", "yes"]
    assert float(read[3][1]) == 1e-9
    assert read[3][3] == ""
    # allow_nan=False: what other programs read knows no NaN.
    raw = json.loads(json.dumps(table_json(table), allow_nan=False))
    assert raw["rows"][0] == [NASTY, 1.23456789, 7, "infinite", True]
    assert raw["rows"][2][3] is None
    assert raw["columns"][1] == {"heading": "x", "unit": "m"}


def test_numbers_stand_at_the_right_words_at_the_left() -> None:
    html = page_html(Page("p", (), (Section("s", (example_table(),)),)))
    assert '<th scope="col" class="number">x [m]</th>' in html
    assert '<th scope="col">gauge</th>' in html
    assert '<td class="number">1.235</td>' in html


def test_table_refuses_what_does_not_fit() -> None:
    with pytest.raises(ValueError, match="1 cells in row 1, 2 columns"):
        make_table("t", "c", (Column("a"), Column("b")), [[1]])
    with pytest.raises(ValueError, match="neither a number nor a word"):
        make_table("t", "c", (Column("a"),), [[[1, 2]]])


@dataclass(frozen=True)
class Gauge:
    name: str
    strain: float
    share: float | int
    used: bool
    count: int


def test_records_are_rows_in_the_columns_units(tmp_path: Path) -> None:
    """SI in the records, um/m and % in the table; what is no such number stays as it is."""
    records = [
        Gauge(name="A", strain=np.float64(2e-6), share=0.25, used=True, count=3),
        Gauge(name="B", strain=np.float32(0.5), share=1, used=False, count=0),
    ]
    columns = (
        ("name", Column("gauge")),
        ("strain", Column("strain", "um/m")),
        ("share", Column("share", "%")),
        (lambda one: one.used, Column("used", "%")),
        ("count", Column("count")),
    )
    table = records_table("gauges", "Two.", records, columns)
    assert table.rows == (("A", pytest.approx(2.0), 25.0, True, 3), ("B", 5e5, 100.0, False, 0))
    write_csv(by_name([table]), tmp_path)
    assert (tmp_path / "gauges.csv").read_bytes().decode() == table_csv(table)
    with pytest.raises(AttributeError):
        records_table("gauges", "Two.", records, [("nothing", Column("a"))])


def test_page_is_written_whole_or_not(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "page.html"
    write_page(example_page(), path)
    assert path.read_text(encoding="utf-8") == page_html(example_page())
    assert [one.name for one in path.parent.iterdir()] == ["page.html"]
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StrainfmuError, match="could not be written"):
        write_page(example_page(), tmp_path / "file" / "page.html")


def test_a_figure_is_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The layout is settled before, so that saving does not draw unseen for it."""
    figure = blank_figure(2.0, 2.0)
    figure.subplots().plot([0.0, 1.0])
    draws, draw = list[object](), type(figure).draw
    monkeypatch.setattr(type(figure), "draw", lambda self, *renderer: draws.append(draw(self, *renderer)))
    picture(figure, "A line.", "A line.")
    assert len(draws) == 1
