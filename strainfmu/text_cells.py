"""Cells of texts: numbers with decimal marks and thousands, dates and times, and texts that stand for no value."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import date
from typing import Literal

DateOrder = Literal["day", "month"]
"""What stands first in a date of figures."""

NUMBER = re.compile(r"(?:[+-] *)?([0-9]+[.,]?[0-9]*|[.,][0-9]+)([eE][+-]?[0-9]+)?|[+-]?nan", re.IGNORECASE)
"""A number in a cell: ASCII digits, a decimal point or comma, or NaN. float() accepts more, such as 1_0 for 10."""

_GROUPED = re.compile(
    r"(?:[+-] *)?[1-9][0-9]{0,2}(?P<between>[.,'’ \u00a0\u2009\u202f])[0-9]{3}"
    r"(?P<more>(?:(?P=between)[0-9]{3})*)(?:(?P<mark>(?!(?P=between))[.,])[0-9]+)?(?:[eE][+-]?[0-9]+)?"
)
"""A number with separators of thousands."""

OVERLOAD = (
    *("OVL", "OVLD", "OVR", "OVF", "OVFL", "OFL", "OL", "OVER", "OVERLOAD", "OVERFLOW", "OVRFLW", "OVERRANGE"),
    *("OVRNG", "OVERSCALE", "OFF SCALE", "OUT OF RANGE", "UNDER", "UNDERFLOW", "UNDERRANGE", "UNDERSCALE", "HHHH"),
    *("LLLL", "INF", "INFINITY", "1.#INF", "BURNOUT", "B.OUT", "OPEN", "OTC", "SATURATED", "SAT", "CLIPPED"),
)
"""Texts for a reading beyond the range of a recorder; letters alone count, of any size: ``-Over range``."""

NO_READING = (
    *("NaN", "NaN(ind)", "1.#IND", "1.#QNAN", "#N/A", "#NV", "#NUM!", "#VALUE!", "#DIV/0!", "NULL", "None"),
    *("MISSING", "INVALID", "BAD", "NO DATA", "ERR", "ERROR", "FAULT", "SKIP", "BROKEN", "I/O TIMEOUT"),
)
"""Texts for no reading, likewise; so are empty cells, and cells of one of :data:`NO_READING_MARKS` alone."""

NO_READING_MARKS = "+-*?#<>~∞"

NO_NUMBERS = (9.9e37, 9.91e37)
"""Numbers for overload and for no reading (IVI Foundation, Standard Commands for Programmable Instruments)."""

_BEYOND = re.compile(r"[<>] *[+-]?[0-9.,]+")
"""Limits of a range that a reading is beyond."""


def _letters(text: str) -> str:
    return "".join(filter(str.isalpha, text)).casefold()


_NO_VALUE = frozenset(map(_letters, (*OVERLOAD, *NO_READING)))


def has_no_value(text: str) -> bool:
    """Return whether a text stands for no value: an overload, no reading, or the same mark throughout."""
    if any(map(str.isdigit, text)):
        return _BEYOND.fullmatch(text) is not None or ("#" in text and _letters(text) in _NO_VALUE)
    return _letters(text) in _NO_VALUE or (text[:1] in NO_READING_MARKS and not text.strip(text[:1]))


def is_number(text: str) -> bool:
    """Return whether a text is a number or stands for one that is missing, and is not empty."""
    return bool(NUMBER.fullmatch(text) or _GROUPED.fullmatch(text) or (text and has_no_value(text)))


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
            plain, grouped = NUMBER.fullmatch(text), _GROUPED.fullmatch(text)
            mark = _mark_in(text) if plain else ""
            if grouped and not plain:
                mark = grouped["mark"] or {".": ",", ",": "."}.get(grouped["between"], "")
            is_clear = not (plain and grouped)
            if mark and (is_clear or not self.mark):
                self.mark, self.is_sure = mark, is_clear

    def number(self, text: str) -> float:
        """Return the number in a cell that is not empty, NaN where it stands for no value.

        Raises
        ------
        ValueError
            It is no number; says what was expected.
        """
        plain, grouped = NUMBER.fullmatch(text), _GROUPED.fullmatch(text)
        if plain is None and grouped is None:
            if has_no_value(text):
                return float("nan")
            raise ValueError("expected a number")
        if not self.mark:
            self.learn([text])
        if plain is not None and _mark_in(text) in ("", self.mark):
            return _value(text)
        if grouped is None or (plain is not None and not self.is_sure) or not self._agrees(grouped):
            what = "point" if self.delimiter == "," else f"'{self.mark}', as before"
            raise ValueError(f"expected a number with a decimal {what}")
        self.grouped = self.grouped or text
        return _value(text.replace(grouped["between"], ""))

    def _agrees(self, grouped: re.Match[str]) -> bool:
        """Return whether the decimal mark of a number with separators of thousands is the file's."""
        return grouped["between"] != self.mark and (grouped["mark"] or self.mark) == self.mark


def _mark_in(text: str) -> str:
    return "," if "," in text else "." if "." in text else ""


def _value(text: str) -> float:
    """Return the number that a text is, whose decimal mark is a point or a comma."""
    value = float(text.replace(" ", "").replace(",", "."))
    return float("nan") if abs(value) in NO_NUMBERS else value


_CLOCK = (
    r"(?P<hour>[0-9]{1,2}):(?P<minute>[0-9]{2})(?::(?P<second>[0-9]{2})(?:[.,:](?P<part>[0-9]{1,9})[0-9]*)?)?"
    r"(?:\s*(?P<half>[ap])\.?m\.?)?(?:\s*(?P<zone>Z|UTC|GMT|[+-][0-9]{2}(?::?[0-9]{2})?))?"
)
_DATED = re.compile(
    r"(?:(?P<first>[0-9]{1,4})(?P<between>[./-])(?P<middle>[0-9]{1,2})(?P=between)(?P<third>[0-9]{2,4})[T ,;]\s*"
    r"|(?P<day>[0-9]{1,2})[ .-]+(?P<name>[^\W\d_]{3,9})\.?[ .-]+(?P<year>[0-9]{4}|[0-9]{2})[T ,;]\s*"
    r"|(?:(?P<irig_year>[0-9]{4})[:/. -])?(?P<day_of_year>[0-9]{3})[:/. T-])?" + _CLOCK,
    re.IGNORECASE,
)
"""A date and a time of day, or one alone; the day of the year, as in 032:14:05:22.125, is of IRIG standard 200."""

_REWRITTEN = (
    (re.compile(r"\A([^\W\d_]{3,9})\.? ([0-9]{1,2}),? (?=[0-9])"), r"\2-\1-"),
    (re.compile(r"\A([0-9]{4})([0-9]{2})([0-9]{2})[T ]([0-9]{2}):?([0-9]{2}):?([0-9]{2})"), r"\1-\2-\3T\4:\5:\6"),
)
"""Dates with the name of the month ahead, and ISO 8601 without marks, in the forms above."""

_MINUTES = re.compile(r"(?P<minute>[0-9]{1,2}):(?P<second>[0-9]{2})[.,](?P<part>[0-9]+)")

_ENGLISH = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_MONTHS = {**{name: i for i, name in enumerate(_ENGLISH, 1)}, "mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12}
"""Months by the first three letters of their English and German names."""

LEAP_YEAR = 366
_DAY = 86400 * 10**9
"""[ns]."""

UNKNOWN_ORDER = "of an order of day and month that is not known"

_ORDERS: dict[DateOrder | None, str] = {
    "day": "with the day first",
    "month": "with the month first",
    None: UNKNOWN_ORDER,
}


@dataclass(frozen=True)
class _Moment:
    """A time [ns] since the year 1, or of day; its day of the year, and whether it has a date, a year, a zone."""

    time: int
    day_of_year: int
    form: tuple[bool, bool, bool]


@dataclass
class TimeForm:
    """How a column writes its times, in words, the order of its dates, and its first and last time."""

    words: str
    order: DateOrder | None
    first: _Moment
    _before: int = field(default=0, init=False)
    _last: int = field(default=0, init=False)
    _turn: int = field(default=0, init=False)

    def seconds(self, text: str) -> float:
        """Return the time since the first text [s]; times without a date, or a year, go on behind its end.

        Raises
        ------
        ValueError
            The text has another form; says what was expected.
        """
        moment = _moment(text, self.order)
        if moment is None or moment.form[:2] != self.first.form[:2]:
            raise ValueError(f"expected a time {self.words}, as at the start")
        if moment.form != self.first.form:
            raise ValueError("expected a time zone everywhere or nowhere, got both")
        time = moment.time - self.first.time
        has_date, has_year, _ = moment.form
        if not has_date:
            time += _DAY * max(0, round((self._last - time) / _DAY))
        elif not has_year:
            if self._last - time - self._turn > 0.5 * LEAP_YEAR * _DAY:
                self._turn += _DAY * max(LEAP_YEAR - 1, self._before)
            time += self._turn
        self._before, self._last = moment.day_of_year, time
        return time / 1e9


def time_form(text: str, stated: DateOrder | None) -> TimeForm | None:
    """Return the form of a date and time, None for any other text.

    A date of figures has the day first where the month would be above 12, or points stand between its figures, and
    the month first where the day would be above 12; else ``stated`` decides, and without it the order is unknown.
    """
    match = _dated(text)
    order: DateOrder | None = None
    words = "of day" if match is not None and match["half"] else "of ISO 8601"
    if match is not None and match["day_of_year"]:
        words = "with the day of the year"
    elif match is not None and match["name"]:
        words = "with the name of the month"
    elif match is not None and match["first"] and len(match["first"]) <= 2:
        order = stated
        if stated is None and (int(match["first"]) > 12 or match["between"] == "."):
            order = "day"
        elif stated is None and int(match["middle"]) > 12:
            order = "month"
        words = _ORDERS[order]
    first = _moment(text, order)
    return None if first is None else TimeForm(words, order, first)


def _dated(text: str) -> re.Match[str] | None:
    for form, usual in _REWRITTEN:
        text = form.sub(usual, text)
    return _DATED.fullmatch(text)


def _moment(text: str, order: DateOrder | None) -> _Moment | None:
    """Return the moment that a text states, None for a text of no date and time; without an order month first."""
    match = _dated(text)
    short = _MINUTES.fullmatch(text)
    if short is not None:
        parts, hour = short.groupdict(), 0
    elif match is not None:
        parts, hour = match.groupdict(), int(match["hour"])
    else:
        return None
    half = (parts.get("half") or "").lower()
    if half:
        hour = hour % 12 + (12 if half == "p" else 0) if 1 <= hour <= 12 else 24
    minute, second = int(parts["minute"]), int(parts["second"] or 0)
    if hour > 23 or minute > 59 or second > 60:
        return None
    try:
        day = _date(parts, order)
    except ValueError:
        return None
    time = 60 * (60 * hour + minute) + second - _zone(parts.get("zone") or "")
    nanoseconds = int(f"{parts['part'] or '':0<9}"[:9])
    has_date = day is not None
    has_year = has_date and (parts.get("day_of_year") is None or parts["irig_year"] is not None)
    form = has_date, has_year, bool(parts.get("zone"))
    number, of_year = (0, 0) if day is None else (day.toordinal(), day.timetuple().tm_yday)
    return _Moment(_DAY * number + 10**9 * time + nanoseconds, of_year, form)


def _zone(text: str) -> int:
    """Return the offset of a time zone [s]."""
    digits = text[1:].replace(":", "").ljust(4, "0")
    return 0 if text[:1] not in ("+", "-") else int(f"{text[0]}1") * 60 * (60 * int(digits[:2]) + int(digits[2:]))


def _date(parts: Mapping[str, str | None], order: DateOrder | None) -> date | None:
    """Return the date of a text, None without one; of a leap year where no year is stated.

    Raises
    ------
    ValueError
        There is no such day.
    """
    first, middle, third = parts.get("first"), parts.get("middle"), parts.get("third")
    if day_of_year := parts.get("day_of_year"):
        day = date(int(parts["irig_year"] or 1972), 1, 1)
        if not 1 <= int(day_of_year) <= LEAP_YEAR:
            raise ValueError
        return date.fromordinal(day.toordinal() + int(day_of_year) - 1)
    if name := parts.get("name"):
        return date(_year(parts["year"]), _MONTHS.get(name.casefold()[:3], 0), int(parts["day"] or 0))
    if not (first and middle and third):
        return None
    if len(first) > 2:
        return date(int(first), int(middle), int(third))
    day_number, month = (first, middle) if order == "day" else (middle, first)
    return date(_year(third), int(month), int(day_number))


def _year(text: str | None) -> int:
    return int(text or 0) + (2000 if text and len(text) == 2 else 0)
