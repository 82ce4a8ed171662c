"""Dates and times in cells: ISO 8601, day or month first, named months, 12 hours with AM and PM, times of day."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import Enum

from strainfmu.recorded.columns.column_names import DateOrder

_LOCAL = re.compile(
    r"(?:(?:(?P<first>[0-9]{1,4})(?P<between>[./-])(?P<second>[0-9]{1,2})(?P=between)(?P<third>[0-9]{2,4})"
    r"|(?P<day>[0-9]{1,2})[ .-]+(?P<name>[^\W\d_]{3,9})\.?[ .-]+(?P<year>[0-9]{4}))[T ,;]\s*)?"
    r"(?P<hour>[0-9]{1,2}):(?P<minute>[0-9]{2})(?::(?P<whole>[0-9]{2})(?:[.,:](?P<part>[0-9]{1,9}))?)?"
    r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
)

_ENGLISH = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_MONTHS = {**{name: i for i, name in enumerate(_ENGLISH, 1)}, "mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12}
"""Months by the first three letters of their English and German names."""

_NO_DAY = datetime(1970, 1, 1)


class Order(Enum):
    """What the first number of a date is; its value says it in messages."""

    ISO = "of ISO 8601"
    DAY = "with the day first"
    MONTH = "with the month first"
    PLAIN = "of day"
    UNKNOWN = "of an order of day and month that is not known"


@dataclass(frozen=True)
class TimeForm:
    """How a column writes its times: the order of a date, and whether there is one."""

    order: Order
    has_date: bool

    def moment(self, text: str) -> datetime | None:
        """Return the date and time, of a day in 1970 without a date; None for a text of another form."""
        if self.order is Order.ISO:
            found = iso_time(text)
            return None if found is None or _is_of_day(text) == self.has_date else found
        match = _LOCAL.fullmatch(text)
        if match is None or ((match["first"] or match["name"] or "") == "" and self.has_date):
            return None
        return _moment(match, self.order)


def time_form(text: str, stated: DateOrder | None) -> TimeForm | None:
    """Return the form of a date and time, None for any other text.

    A date of figures has the day first where the month would be above 12, or points stand between its figures, and
    the month first where the day would be above 12; else ``stated`` decides, and without it the order is UNKNOWN.
    """
    if iso_time(text) is not None:
        return TimeForm(Order.ISO, not _is_of_day(text))
    match = _LOCAL.fullmatch(text)
    if match is None:
        return None
    if match["first"] is None or len(match["first"]) > 2:
        form = TimeForm(Order.PLAIN, (match["first"] or match["name"]) is not None)
        return form if _moment(match, form.order) is not None else None
    first, second = int(match["first"]), int(match["second"])
    if stated is not None:
        order = Order.DAY if stated == "day" else Order.MONTH
    elif first > 12 or match["between"] == ".":
        order = Order.DAY
    else:
        order = Order.MONTH if second > 12 else Order.UNKNOWN
    return TimeForm(order, True)


def iso_time(text: str) -> datetime | None:
    """Return an ISO 8601 date and time, or a time of day, of a day in 1970; None for any other text."""
    text = text.strip()
    for candidate in (text, f"1970-01-01T{text}"):
        try:
            found = datetime.fromisoformat(candidate)
        except ValueError:
            continue
        # A compact date, such as 20260101, is a number here.
        return found if ":" in text or "-" in text[1:] else None
    return None


def _is_of_day(text: str) -> bool:
    """Return whether an ISO time has no date."""
    return text.strip()[2:3] == ":"


def _moment(match: re.Match[str], order: Order) -> datetime | None:
    """Return the moment of a match, None where there is no such day or time."""
    hour, half = int(match["hour"]), (match["half"] or "").lower()
    if half:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + (12 if half == "p" else 0)
    date = _date(match, order)
    if date is None or hour > 23:
        return None
    micro = int(((match["part"] or "") + "000000")[:6])
    minute, second = int(match["minute"]), int(match["whole"] or 0)
    if minute > 59 or second > 60:
        return None
    return date + timedelta(hours=hour, minutes=minute, seconds=second, microseconds=micro)


def _date(match: re.Match[str], order: Order) -> datetime | None:
    if match["name"] is not None:
        month = _MONTHS.get(match["name"].casefold()[:3], 0)
        parts = (int(match["year"]), month, int(match["day"]))
    elif match["first"] is None:
        return _NO_DAY
    elif len(match["first"]) > 2:
        parts = (int(match["first"]), int(match["second"]), int(match["third"]))
    else:
        first, second, year = int(match["first"]), int(match["second"]), int(match["third"])
        day, month = (first, second) if order is Order.DAY else (second, first)
        parts = (year + 2000 if len(match["third"]) == 2 else year, month, day)
    try:
        return datetime(*parts)
    except ValueError:
        return None
