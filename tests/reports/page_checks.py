"""What a reader's browser would find in a page: tags, names, tables, and whether it loads anything else."""

from dataclasses import dataclass, field
from html.parser import HTMLParser

VOID = {"meta", "img", "br", "hr", "link", "input"}
"""Elements of HTML 5 without an end tag."""

FETCHED = ("src", "srcset", "data", "poster", "background", "action", "formaction")
"""Attributes whose value a browser fetches by itself."""


@dataclass
class ReadPage:
    """Attributes
    ----------
    open : tags not closed yet.
    wrong : what is not balanced.
    fetched : what a browser would fetch.
    links, anchors : targets of links, names inside the page.
    tables : per id of a table its rows of texts, the headings first.
    text : everything that is shown.
    """

    open: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    anchors: list[str] = field(default_factory=list)
    tables: dict[str, list[list[str]]] = field(default_factory=dict)
    tags: list[str] = field(default_factory=list)
    alternatives: list[str] = field(default_factory=list)
    text: str = ""


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.page = ReadPage()
        self.table = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        page, values = self.page, dict(attrs)
        page.tags.append(tag)
        if tag not in VOID:
            page.open.append(tag)
        page.fetched += [values[name] or "" for name in FETCHED if name in values]
        if tag == "a":
            page.links.append(values.get("href") or "")
        elif "href" in values:
            page.fetched.append(values["href"] or "")
        if values.get("id"):
            page.anchors.append(values["id"] or "")
        if tag == "img":
            page.alternatives.append(values.get("alt") or "")
        if tag == "table":
            self.table = values.get("id") or ""
            page.tables[self.table] = []
        elif tag == "tr":
            page.tables[self.table].append([])
        elif tag in ("td", "th"):
            page.tables[self.table][-1].append("")

    def handle_endtag(self, tag: str) -> None:
        if not self.page.open or self.page.open.pop() != tag:
            self.page.wrong.append(f"</{tag}> at {self.getpos()}")

    def handle_data(self, data: str) -> None:
        if self.page.open and self.page.open[-1] in ("td", "th"):
            self.page.tables[self.table][-1][-1] += data
        if not {"style", "script"} & set(self.page.open):
            self.page.text += data


def read_page(html: str) -> ReadPage:
    """Parse a page."""
    reader = _Reader()
    reader.feed(html)
    reader.close()
    return reader.page


def assert_self_contained(html: str) -> ReadPage:
    """Assert that a page is balanced and fetches nothing, and that links inside it lead somewhere."""
    page = read_page(html)
    assert not page.wrong
    assert not page.open
    assert all(one.startswith("data:image/") for one in page.fetched)
    assert not {"link", "iframe", "object", "embed"} & set(page.tags)
    assert "default-src 'none'" in html
    assert "@import" not in html
    assert "url(" not in html
    assert len(set(page.anchors)) == len(page.anchors)
    for link in page.links:
        assert "://" not in link
        assert not link.startswith("#") or link[1:] in page.anchors
    assert all(page.alternatives)
    return page
