"""Whether the loads of a result may be used, since when, and why: the first thing on the page."""

from __future__ import annotations

from typing import Any

from strainfmu.can.quality import all_words

_WORDS = all_words()


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
        usable = result["usable"] == 1
        if usable is not self._usable:
            self._usable, self._since = usable, result["timestamp"]
        self._why = reason(result)

    def content(self) -> dict[str, Any] | None:
        """Return the answer for the page: usable, since when [s since 1970], why; None before the first result."""
        if self._usable is None:
            return None
        return {"usable": self._usable, "since": self._since, "why": self._why}
