"""The state of the live view: last datagram, last minute and events; datagrams in, JSON for the page out."""

import json
import threading
from collections import deque
from typing import Any, NamedTuple

from strainfmu.can.quality import Quality, all_words
from strainfmu.estimator.air_inputs import AIR_INPUTS, DYNAMIC_PRESSURE
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY
from strainfmu.estimator.valid_ranges import VALIDITY_LABELS
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.interface.fmi_variables import COEFFICIENTS, unit_shown
from strainfmu.interface.input_names import FLOW_KEYS
from strainfmu.monitor.events import EventLog
from strainfmu.monitor.message import FIELD_UNITS, UNITS, parsed

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


def flow_tiles() -> list[dict[str, Any]]:
    """Return a tile of each quantity of the flow: key in a result, label, unit and factor to it, digits.

    ``range`` is its name among the ranges of a map; ``is_needed`` whether results without it are in question.
    """
    tiles = []
    for quantity in AIR_INPUTS:
        if quantity.name in FLOW_KEYS:
            unit, factor = unit_shown(quantity.unit, quantity.shown)
            tiles.append(
                {
                    "key": FLOW_KEYS[quantity.name],
                    "label": quantity.label,
                    "unit": "" if unit == "1" else unit,
                    "factor": factor,
                    "digits": 3 if unit == "1" else 2,
                    "range": VALIDITY_LABELS[quantity.name],
                    "is_needed": quantity.name == DYNAMIC_PRESSURE,
                }
            )
    return tiles


def histories() -> list[dict[str, Any]]:
    """Return a history of each coefficient and its load: names in a result, titles, factor to the load's unit."""
    groups = []
    for name, (load, signal) in zip(COEFFICIENTS, LOADS.items(), strict=True):
        unit, factor = unit_shown(signal.unit, f"k{signal.unit}")
        axis = signal.label.partition(" ")[0].lower()
        title = f"{signal.label} [{unit.replace('.', ' ')}]"
        groups.append(
            {
                "name": name,
                "title": f"{name} [1], {axis}",
                "load": load,
                "load_title": title,
                "load_factor": factor,
            }
        )
    return groups


_LISTED = 8
"""Largest number of publishers that are listed."""

HISTORY = 60.0
"""Length of the history that a new page gets [s]."""

HISTORY_PERIOD = 0.1
"""Time between two points of the history [s]."""

SILENT_AFTER = 1.5
"""Time without a datagram after which the page reports that the bridge is gone [s]."""

COLUMNS = (
    *("timestamp", "quality", "chi_square", "chi_square_limit"),
    *COEFFICIENT_NAMES,
    *(f"sigma.{name}" for name in COEFFICIENT_NAMES),
    *LOADS,
    *(f"sigma.{name}" for name in LOADS),
)
"""What a point of the history holds; the quality is the worst since the point before."""

_SEVERITY = tuple(
    getattr(Quality, name)
    for name in ("VALID", "UNPROTECTED", "DEGRADED", "UNCONFIRMED", "SUSPECT", "NO_DATA", "STALE", "INVALID")
)
"""Qualities, the best first."""

_NO_LAYOUT: dict[str, Any] = {
    "gauges": [],
    "vehicle": None,
    "coefficient_range": {},
    "load_tables": [],
    "validity": {},
}


class Seen(NamedTuple):
    """What a page has had: points of the history, changes of the event list, pressure fields."""

    points: int
    events: int
    fields: int = 0


class MonitorState:
    """The latest datagram replaces the one before: a slow page shows fewer of them, never old ones.

    ``token`` is what datagrams must state; None: anybody may publish.
    """

    def __init__(self, token: str | None = None) -> None:
        self._token = token
        self._publishers: dict[str, float] = {}
        self._changed = threading.Condition()
        self._latest: dict[str, Any] | None = None
        self._layout = _NO_LAYOUT
        self._field: dict[str, Any] | None = None
        self.fields = 0
        self._history: deque[list[Any]] = deque(maxlen=round(HISTORY / HISTORY_PERIOD))
        self._last_point = self._last_time = float("-inf")
        self._worst = -1
        self._is_lost = False
        self._events, self._answer = EventLog(), Answer()
        self.version = self.points = 0
        self.datagrams = self.refused = 0

    def take(self, datagram: bytes, now: float, publisher: str = "") -> None:
        """Take in a datagram that came at ``now`` [s, monotonic]; others than a bridge's are only counted.

        ``publisher`` is the address that it came from.
        """
        try:
            content = parsed(datagram, self._token)
        except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, RecursionError):
            with self._changed:
                self.refused += 1
            return
        with self._changed:
            if "layout" in content:
                self._layout = content["layout"]
            elif "field" in content:
                self._field = content["field"]
                self.fields += 1
            else:
                self._take_result(content, now)
            recent = {who: heard for who, heard in self._publishers.items() if now - heard <= SILENT_AFTER}
            if publisher and len(recent) < _LISTED:
                recent[publisher] = now
            self._publishers = recent
            self.datagrams += 1
            self.version += 1
            self._changed.notify_all()

    def _take_result(self, result: dict[str, Any], now: float) -> None:
        self._notice_silence(now)
        self._latest, self._last_time, self._is_lost = result, now, False
        self._events.take(result)
        self._answer.take(result)
        self._worst = max(self._worst, _severity(result["quality"]))
        if now - self._last_point >= HISTORY_PERIOD:
            kinds = (
                (COEFFICIENT_ARRAY, COEFFICIENT_NAMES),
                ("sigma", COEFFICIENT_NAMES),
                ("loads", LOADS),
                ("loads_sigma", LOADS),
            )
            values = [result[kind][name] for kind, names in kinds for name in names]
            head = [
                result["timestamp"],
                int(_SEVERITY[self._worst]),
                result["chi_square"],
                result["chi_square_limit"],
            ]
            self._history.append([*head, *values])
            self.points += 1
            self._last_point, self._worst = now, -1

    def _notice_silence(self, now: float) -> bool:
        """Return whether the bridge is silent at ``now`` [s, monotonic]; list it the first time."""
        is_silent = now - self._last_time > SILENT_AFTER
        if is_silent and self._latest is not None and not self._is_lost:
            self._is_lost = True
            self._events.lose(self._latest["timestamp"])
        return is_silent

    def wait(self, version: int, timeout: float) -> int:
        """Wait up to ``timeout`` [s] for a version other than ``version``; return the present one."""
        with self._changed:
            if self.version == version:
                self._changed.wait(timeout)
            return self.version

    def snapshot(self, now: float) -> str:
        """Return all of the page's contents at ``now`` [s, monotonic] as JSON on one line."""
        return self.news(now, None)[0]

    def news(self, now: float, sent: Seen | None) -> tuple[str, Seen]:
        """Return what a page has not seen yet as JSON on one line, and what it has seen with it.

        Parameters
        ----------
        now : time [s, monotonic].
        seen : returned by the call before for the same page; None for a page that has nothing yet.
        """
        with self._changed:
            silent = self._notice_silence(now)
            shown = Seen(self.points, self._events.changes, self.fields)
            new = len(self._history) if sent is None else min(shown.points - sent.points, len(self._history))
            content: dict[str, Any] = {
                "layout": self._layout,
                "latest": self._latest,
                "answer": self._answer.content(),
                "silent": silent,
                "silent_for_s": None if self._latest is None else round(now - self._last_time, 3),
                "publishers": sorted(
                    who for who, heard in self._publishers.items() if now - heard <= SILENT_AFTER
                ),
                "datagrams": self.datagrams,
                "refused": self.refused,
                "points": list(self._history)[len(self._history) - new :],
            }
            if sent is None or sent.fields != shown.fields:
                content["field"] = self._field
            if sent is None or sent.events != shown.events:
                content["events"] = self._events.listed()
        if sent is None:
            content |= {"columns": COLUMNS, "units": UNITS, "field_units": FIELD_UNITS}
            content |= {"words": all_words(), "history_s": HISTORY}
            content |= {"flow": flow_tiles(), "histories": histories()}
        return json.dumps(content, separators=(",", ":"), allow_nan=False), shown


def _severity(quality: float | None) -> int:
    """Return the rank of a quality's number; one that this version does not know is the worst."""
    known = [int(member) for member in _SEVERITY]
    return known.index(int(quality)) if quality in known and quality is not None else len(known) - 1
