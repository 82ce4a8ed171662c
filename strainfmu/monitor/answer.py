"""Whether the loads of a result may be used, since when, and why: the first thing on the page."""

from __future__ import annotations

from typing import Any

from strainfmu.can.cycle.states.quality import Quality
from strainfmu.can.cycle.states.words import all_words

_WORDS = all_words()

_WITH_BANDS = frozenset(
    quality.name for quality in (Quality.VALID, Quality.UNPROTECTED, Quality.DEGRADED, Quality.SUSPECT)
)
"""Qualities whose loads may be used with their bands, if the estimator says so."""


def is_usable(result: dict[str, Any]) -> bool:
    """Return whether loads of a result may be used with their standard deviations.

    A result that says nothing about it, as of an earlier version, is usable where its quality is VALID.
    """
    stated = result.get("usable")
    if stated is None:
        return bool(result["quality_name"] == Quality.VALID.name)
    return bool(stated == 1 and result["quality_name"] in _WITH_BANDS)


def reason(result: dict[str, Any]) -> str:
    """Return in words why loads may be used, or may not."""
    name, causes = result["quality_name"], result["causes"]
    words = [_WORDS["cause"].get(cause, "unknown cause") for cause in causes if cause != "HEALTH"]
    if result["health_name"] not in (None, "OK"):
        words.insert(0, result["health_text"] or _WORDS["health"].get(result["health_name"], "unknown health"))
    return "; ".join(words) or _WORDS["quality"].get(name, "unknown quality")


class Answer:
    """Follows the answer from result to result."""

    def __init__(self) -> None:
        self._usable: bool | None = None
        self._since = 0.0
        self._why = ""

    def take(self, result: dict[str, Any]) -> None:
        """Take in a result of the bridge."""
        usable = is_usable(result)
        if usable is not self._usable:
            self._usable, self._since = usable, result["timestamp"]
        self._why = reason(result)

    def content(self) -> dict[str, Any] | None:
        """Return the answer for the page: usable, since when [s since 1970], why; None before the first result."""
        if self._usable is None:
            return None
        return {"usable": self._usable, "since": self._since, "why": self._why}
