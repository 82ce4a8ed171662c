"""HTML that all pages of the project share: long tables fold, and nothing is clipped in a narrow window."""

from collections.abc import Sequence
from html import escape

ROWS_OPEN = 12
"""Rows of a table that stands open; longer ones fold."""

COLUMNS_STACKED = 7
"""Columns from which a narrow window shows each row as a list of headings and cells."""

LONGEST_WORD = 32
"""Characters of a word in a cell above which it may break."""

STYLE = """\
body { overflow-wrap: anywhere; }
pre, code { white-space: pre-wrap; overflow-wrap: anywhere; }
img, svg { max-width: 100%; height: auto; }
table { max-width: 100%; border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption, td, th { text-align: left; } td, th { overflow-wrap: break-word; } td.long { overflow-wrap: anywhere; }
.number { text-align: right; } td.number { white-space: nowrap; }
table.many { font-size: 0.78rem; } table.many th, table.many td { padding: 0.16rem 0.35rem; }
details.fold { margin: 1rem 0; border: 1px solid #ccc; padding: 0.35rem 0.7rem; }
details.fold > summary { cursor: pointer; font-weight: 600; } details.fold > summary > span { font-weight: 400; }
@media screen and (max-width: 1100px) {
  table.many, table.many tbody, table.many tr, table.many td { display: block; }
  table.many caption { display: block; }
  table.many thead { display: none; }
  table.many tr { padding: 0.3rem 0; }
  table.many td, table.many td.number { display: flex; justify-content: space-between; gap: 1rem;
    text-align: right; white-space: normal; padding: 0.05rem 0.4rem; }
  table.many td::before { content: attr(data-heading); text-align: left; color: #444; }
}
@media print { details.fold:not([open])::details-content { display: block; content-visibility: visible; } }
"""
"""Style of tables, folds, figures and preformatted text."""


def table_html(
    headings: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    caption: str = "",
    name: str = "",
    number_columns: Sequence[bool] = (),
) -> str:
    """Return a table; with more than :data:`ROWS_OPEN` rows folded, its caption and length in the summary line.

    Parameters
    ----------
    headings, rows : plain texts, escaped here; as many cells in a row as there are headings.
    caption : one sentence; a folded table needs one.
    name : id of the table, "" for none.
    number_columns : whether each column is aligned as numbers; none by default.
    """
    numbers = list(number_columns) or [False] * len(headings)
    many = len(headings) >= COLUMNS_STACKED
    head = "".join(
        f'<th scope="col"{_class(number=number)}>{escape(text)}</th>'
        for number, text in zip(numbers, headings, strict=True)
    )
    # A row of a stacked table names its cells.
    labels = [f' data-heading="{escape(heading)}"' if many else "" for heading in headings]
    body = "\n".join(
        "<tr>"
        + "".join(
            f"<td{_class(number=number, long=_is_long(cell))}{label}>{escape(cell)}</td>"
            for number, label, cell in zip(numbers, labels, row, strict=True)
        )
        + "</tr>"
        for row in rows
    )
    folds = len(rows) > ROWS_OPEN
    title = f"<caption>{escape(caption)}</caption>\n" if caption and not folds else ""
    attributes = (f' id="{escape(name)}"' if name else "") + _class(many=many)
    table = f"<table{attributes}>\n{title}<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table>"
    return fold(table, caption, f"{len(rows)} rows") if folds else table


def _class(**classes: bool) -> str:
    names = " ".join(name for name, holds in classes.items() if holds)
    return f' class="{names}"' if names else ""


def _is_long(cell: str) -> bool:
    return max(map(len, cell.split()), default=0) > LONGEST_WORD


def fold(content: str, caption: str, extent: str) -> str:
    """Return ``content``, HTML, behind a summary line of two plain texts; closed until the reader opens it."""
    summary = f"{escape(caption)} <span>({escape(extent)})</span>"
    return f'<details class="fold"><summary>{summary}</summary>\n{content}\n</details>'
