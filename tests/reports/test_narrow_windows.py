"""Pages in a browser: nothing is clipped at the widths of a laptop's and a tablet's window; long tables fold."""

import zipfile
from pathlib import Path

import pytest
from chromium import PROGRAM, Browser
from clipping import WIDTHS, clipped, show
from synthetic_vehicle import SyntheticFiles

from builder.reports.build_report.build_page import ROWS_ON_PAGE
from builder.reports.build_report.build_tables import first_rows
from builder.reports.page.html import Files, Items, Page, Paragraph, Preformatted, Section, page_html, write_page
from builder.reports.page.page_tables import Column, Table, make_table
from strainfmu.pages import ROWS_OPEN, table_html

LONG = "a_name_without_a_blank_" * 12
in_browser = pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")


def wide_table(n_rows: int, name: str = "wide") -> Table:
    """Sixteen columns with the headings of a table of gauges, long names and numbers."""
    columns = [Column("gauge"), *(Column(f"lost: sigma of C_{k} grows", "um/m per kPa") for k in range(14))]
    rows = [[LONG, *(1e3 * k + 0.123 for k in range(14)), "hoop_0_1, hoop_0_2"] for _ in range(n_rows)]
    return make_table(name, "Wide & long.", [*columns, Column("on")], rows)


def wide_page() -> Page:
    blocks = (
        Paragraph(LONG),
        Items((LONG,)),
        Files(((f"{LONG}.csv", "numbers"),)),
        Preformatted(f"command {'--option value ' * 40}{LONG}"),
        wide_table(ROWS_OPEN, "open"),
        wide_table(ROWS_OPEN + 1, "folded"),
    )
    return Page(LONG, (), (Section(LONG, blocks),))


@pytest.mark.fast
def test_tables_of_more_than_twelve_rows_fold() -> None:
    """The summary line holds caption and length; the ids and cells are those of an open table."""
    html = page_html(wide_page())
    assert html.count("<details") == 1
    folded = html[html.index("<details") : html.index("</details>")]
    assert "<summary>Wide &amp; long. <span>(13 rows)</span></summary>" in folded
    assert 'id="table-folded"' in folded
    assert 'id="table-open"' not in folded
    assert "<caption>Wide &amp; long.</caption>" in html[: html.index("<details")]


@pytest.mark.fast
def test_a_page_holds_the_first_rows_of_a_long_table() -> None:
    """The caption says so, and names the file that holds all."""
    cut = first_rows(wide_table(300), ROWS_ON_PAGE)
    assert len(cut.rows) == ROWS_ON_PAGE
    assert cut.caption == "Wide & long. The first 200 of 300; wide.csv holds all."
    assert first_rows(cut, ROWS_ON_PAGE) is cut


@pytest.mark.fast
def test_tables_in_fmus_fold_too() -> None:
    rows = [(str(k), "name") for k in range(ROWS_OPEN + 1)]
    assert "<details" in table_html(("No.", "Gauge"), rows, caption="Gauges")
    assert "<details" not in table_html(("No.", "Gauge"), rows[:-1], caption="Gauges")


@in_browser
@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_clipped_on_a_page_of_long_words(browser: Browser, tmp_path: Path, width: int) -> None:
    write_page(wide_page(), tmp_path / "page.html")
    show(browser, tmp_path / "page.html")
    assert clipped(browser, width) == []


@in_browser
def test_nothing_is_clipped_on_the_report(browser: Browser, html: str, tmp_path: Path) -> None:
    """Shown once, for the browser takes seconds to draw it."""
    (tmp_path / "report.html").write_text(html, encoding="utf-8")
    show(browser, tmp_path / "report.html")
    for width in WIDTHS:
        assert clipped(browser, width) == [], width


@in_browser
@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_clipped_on_the_page_of_an_fmu(
    browser: Browser, synthetic: SyntheticFiles, tmp_path: Path, width: int
) -> None:
    with zipfile.ZipFile(synthetic.estimator_1) as archive:
        (tmp_path / "index.html").write_bytes(archive.read("documentation/index.html"))
    show(browser, tmp_path / "index.html")
    assert clipped(browser, width) == []
    assert browser.value("document.querySelectorAll('details').length") >= 1


@in_browser
def test_clipped_content_is_found(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_text('<!DOCTYPE html><div style="overflow-x:auto"><p style="width:1500px">wide</p></div>')
    show(browser, path)
    assert any("1500 in" in one for one in clipped(browser, 1280, patience=0.0))
