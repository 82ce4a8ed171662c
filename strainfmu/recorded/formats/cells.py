"""Cells of texts as numbers: decimal marks, separators of thousands, and the texts that stand for no value."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

NUMBER = re.compile(r"[+-]?([0-9]+[.,]?[0-9]*|[.,][0-9]+)([eE][+-]?[0-9]+)?|[+-]?nan", re.IGNORECASE)
"""A number in a cell: ASCII digits, a decimal point or comma, or NaN. float() accepts more, such as 1_0 for 10."""

_GROUPED = re.compile(
    r"[+-]?[1-9][0-9]{0,2}(?P<between>[.,'’ \u00a0\u2009\u202f])[0-9]{3}(?P<more>(?:(?P=between)[0-9]{3})*)"
    r"(?:(?P<mark>(?!(?P=between))[.,])[0-9]+)?(?:[eE][+-]?[0-9]+)?"
)
"""A number with separators of thousands."""

OVERLOAD = (
    *(
        "OVL",
        "OVLD",
        "OVR",
        "OVF",
        "OVFL",
        "OL",
        "O.L.",
        "OVER",
        "OVERLOAD",
        "OVERFLOW",
        "OVERRANGE",
        "OVER RANGE",
    ),
    *("UNDER", "UNDERFLOW", "UNDERRANGE", "UNDER RANGE", "INF", "INFINITY", "∞", "1.#INF"),
)
"""Texts for a reading beyond the range of a recorder, in letters of any size; a sign may stand ahead."""

NO_READING = (
    *("NaN", "NaN(ind)", "1.#IND", "1.#QNAN", "#N/A", "#NV", "#NUM!", "#VALUE!", "#DIV/0!", "N/A", "NA", "n.a."),
    *("NULL", "None", "invalid"),
)
"""Texts for no reading, likewise; so are cells of hyphens, asterisks or question marks alone, and empty ones."""

_NO_VALUE = frozenset(text.casefold() for text in (*OVERLOAD, *NO_READING))


def has_no_value(text: str) -> bool:
    """Return whether a text stands for no value: empty, an overload, or no reading."""
    return text.lstrip("+-").casefold() in _NO_VALUE or (text[:1] in "-*?" and not text.strip(text[:1]))


def is_number(text: str) -> bool:
    """Return whether a text is a number or stands for one that is missing, and is not empty."""
    return bool(text) and (_is_numeral(text) or has_no_value(text))


def _is_numeral(text: str) -> bool:
    return NUMBER.fullmatch(text) is not None or _GROUPED.fullmatch(text) is not None


def _could_be_grouped(text: str) -> bool:
    """Return whether the one mark of a number may as well separate thousands, as in 1.234."""
    return _GROUPED.fullmatch(text) is not None


@dataclass
class Numerals:
    """How a file writes numbers, as far as its cells have shown.

    Attributes
    ----------
    delimiter : between the cells.
    mark : decimal mark, "" until a cell shows one.
    is_sure : whether a cell has shown it that cannot be read otherwise; then the other mark separates thousands.
    grouped : the first number with separators of thousands, "" before one.
    """

    delimiter: str
    mark: str = ""
    is_sure: bool = False
    grouped: str = field(default="", init=False)

    def __post_init__(self) -> None:
        if self.delimiter == ",":
            self.mark, self.is_sure = ".", True

    def learn(self, cells: Iterable[str]) -> None:
        """Take the decimal mark from cells, the first of which that is clear decides."""
        for text in cells:
            if self.is_sure:
                return
            if _is_numeral(text) and (mark := _shown_mark(text)):
                is_clear = not _could_be_grouped(text) or NUMBER.fullmatch(text) is None
                if is_clear or not self.mark:
                    self.mark, self.is_sure = mark, is_clear

    def number(self, text: str) -> float:
        """Return the number in a cell that is not empty, NaN where it stands for no value.

        Raises
        ------
        ValueError
            It is no number; says what was expected.
        """
        if NUMBER.fullmatch(text) is not None:
            mark = "," if "," in text else "." if "." in text else ""
            if not mark or mark == self.mark:
                return float(text.replace(",", "."))
            if self.is_sure and _could_be_grouped(text):
                return self._without_groups(text, mark)
            if not self.mark:
                self.learn([text])
                return float(text.replace(",", "."))
            raise ValueError(self._expected())
        if has_no_value(text):
            return float("nan")
        match = _GROUPED.fullmatch(text)
        if match is None:
            raise ValueError("expected a number")
        if not self.mark:
            self.learn([text])
        if match["between"] == self.mark or (match["mark"] or self.mark) != self.mark:
            raise ValueError(self._expected())
        return self._without_groups(text, match["between"])

    def _without_groups(self, text: str, between: str) -> float:
        self.grouped = self.grouped or text
        return float(text.replace(between, "").replace(",", "."))

    def _expected(self) -> str:
        if self.delimiter == ",":
            return "expected a number with a decimal point"
        return f"expected a number with a decimal '{self.mark}', as before"


def _shown_mark(text: str) -> str:
    """Return the decimal mark that a numeral shows, "" without one."""
    match = _GROUPED.fullmatch(text)
    if match is None or (NUMBER.fullmatch(text) is not None):
        return "," if "," in text else "." if "." in text else ""
    return match["mark"] or {".": ",", ",": "."}.get(match["between"], "")
