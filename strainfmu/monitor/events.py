"""The event list of a run: what changed from one datagram to the next, when, and why.

An event that comes again within a short time is counted, not listed again: a flapping input must not drive the
first cause out of the list.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from strainfmu.can.quality import HEALING, all_words

LISTED = 100
"""Maximum number of events kept; the oldest are dropped."""

REPEATED_WITHIN = 2.0
"""Time within which an equal event is counted with the one before [s]."""

NAMED_GAUGES = 3
"""Maximum number of gauges named in one event."""

_LOOK_BACK = 8
_WORDS = all_words()


@dataclass(kw_only=True, eq=False)
class Event:
    """One entry.

    Attributes
    ----------
    first, last : time of the first and of the last occurrence [s since 1970].
    kind : quality, cause, gauges, suspect, bus, recording or link.
    level : good, note or alarm.
    what, why : in words; ``why`` may be empty.
    count : number of occurrences.
    """

    first: float
    last: float
    kind: str
    level: str
    what: str
    why: str = ""
    count: int = 1


class EventLog:
    """Keeps the latest events; give it every datagram's result in order."""

    def __init__(self) -> None:
        self._events: deque[Event] = deque(maxlen=LISTED)
        self._before: dict[str, Any] | None = None
        self.changes = 0
        """Number of times that the list was changed."""

    def take(self, result: dict[str, Any]) -> None:
        """List what changed with ``result``, as :func:`strainfmu.monitor.message.parsed` returns it."""
        before, self._before = self._before, result
        time = result["timestamp"]
        if before is None or _is_new_bridge(before, result):
            self._add(time, "link", "note", "bridge connected", result["bus"]["name"] or "")
            before = None
        self._take_bus(time, before, result)
        self._take_recording(time, before, result)
        self._take_period(time, before, result)
        self._take_gauges(time, before, result)
        self._take_quality(time, before, result)
        missed = 0 if before is None else _missed(before, result)
        if missed:
            self._add(time, "link", "note", f"{missed} datagrams of the bridge lost on the way to this page")

    def lose(self, time: float) -> None:
        """List that the bridge has gone silent, last heard at ``time`` [s since 1970]."""
        self._add(time, "link", "alarm", "bridge gone", "no datagram since")
        self._before = None

    def listed(self) -> list[dict[str, Any]]:
        """Return all events, by their last occurrence, the newest last."""
        return [asdict(event) for event in self._events]

    def _add(self, time: float, kind: str, level: str, what: str, why: str = "") -> None:
        self.changes += 1
        for event in list(self._events)[-_LOOK_BACK:]:
            is_equal = (event.kind, event.what, event.why) == (kind, what, why)
            if is_equal and 0.0 <= time - event.last <= REPEATED_WITHIN:
                event.last, event.count = time, event.count + 1
                self._events.remove(event)
                self._events.append(event)
                return
        self._events.append(Event(first=time, last=time, kind=kind, level=level, what=what, why=why))

    def _take_quality(self, time: float, before: dict[str, Any] | None, result: dict[str, Any]) -> None:
        quality, causes = result["quality_name"], result["causes"]
        known = [] if before is None else before["causes"]
        if before is None or before["quality_name"] != quality:
            level = "good" if quality in ("VALID", "UNPROTECTED") else "alarm"
            self._add(time, "quality", level, f"quality {quality}", _why(result, causes))
            known = [*known, *causes]
        passed = [cause for cause in result["causes_since"] if cause not in known and cause not in causes]
        new = [cause for cause in causes if cause not in known]
        for cause in (*new, *passed):
            ended = " (passed)" if cause in passed else ""
            self._add(time, "cause", "note", f"{cause}{ended}", _word("cause", cause))

    def _take_gauges(self, time: float, before: dict[str, Any] | None, result: dict[str, Any]) -> None:
        was = {} if before is None else before["not_used"]
        now, total = result["not_used"], len(result["strain_um_per_m"])
        out: dict[str, list[str]] = {}
        for gauge, reason in now.items():
            if was.get(gauge) != reason and not (gauge in was and reason == HEALING):
                out.setdefault(reason, []).append(gauge)
        for reason, gauges in out.items():
            self._add(time, "gauges", "alarm", f"{_gauges(gauges, total)} not used", reason)
        back = [gauge for gauge in was if gauge not in now]
        if back:
            self._add(time, "gauges", "good", f"{_gauges(back, total)} used again")
        suspect = result["suspect_gauge"]
        if suspect != (None if before is None else before["suspect_gauge"]):
            number = result["suspects"] or 0
            remainder = f"; {number} that cannot be distinguished" if number > 1 else ""
            what = f"gauge {suspect} suspect" if suspect else "no gauge suspect any more"
            why = f"does not fit the others{remainder}" if suspect else ""
            self._add(time, "suspect", "alarm" if suspect else "good", what, why)

    def _take_bus(self, time: float, before: dict[str, Any] | None, result: dict[str, Any]) -> None:
        state, bus = result["bus_state"], result["bus"]
        was = "ERROR_ACTIVE" if before is None else before["bus_state"]
        if state != was:
            fault = bus["last_fault"] if state == "DISCONNECTED" else ""
            level = "good" if state == "ERROR_ACTIVE" else "alarm"
            self._add(time, "bus", level, f"bus {state}", fault or _word("bus", state))
        reopened = 0 if before is None else (bus["reconnects"] or 0) - (before["bus"]["reconnects"] or 0)
        if reopened > 0:
            self._add(time, "bus", "note", "bus reopened", bus["last_fault"] or "")

    def _take_period(self, time: float, before: dict[str, Any] | None, result: dict[str, Any]) -> None:
        text = result.get("period_text")
        if text and (before is None or before.get("period_text") != text):
            level = "alarm" if "PERIOD" in result["causes"] else "note"
            self._add(time, "link", level, "period of the sender", text)

    def _take_recording(self, time: float, before: dict[str, Any] | None, result: dict[str, Any]) -> None:
        now = result["recording"]
        if now is None:
            return
        was = before["recording"] if before is not None else None
        if was is None:
            self._add(time, "recording", "note", f"recording {now['file']}")
        if now["failure"] and (was is None or not was["failure"]):
            self._add(time, "recording", "alarm", "recording ended early", now["failure"])
        lost = (now["lost"] or 0) - ((was["lost"] or 0) if was else 0)
        if lost > 0:
            self._add(time, "recording", "alarm", f"recording lost {lost} frames")


def _why(result: dict[str, Any], causes: Sequence[str]) -> str:
    """Return the causes of a quality in words, what the estimator's health means among them."""
    texts = []
    for cause in causes:
        name = result["health_name"]
        if cause == "HEALTH" and name:
            texts.append(f"HEALTH: {name}, {result['health_text'] or _word('health', name)}")
        elif cause == "PERIOD" and result.get("period_text"):
            texts.append(f"{cause}: {result['period_text']}")
        else:
            texts.append(f"{cause}: {_word('cause', cause)}")
    return "; ".join(texts)


def _word(kind: str, name: str) -> str:
    return _WORDS[kind].get(name, name.replace("_", " ").lower())


def _gauges(names: Sequence[str], total: int) -> str:
    if len(names) == 1:
        return f"gauge {names[0]}"
    if len(names) == total:
        return f"all {total} gauges"
    named = ", ".join(names[:NAMED_GAUGES]) + (" ..." if len(names) > NAMED_GAUGES else "")
    return f"{len(names)} gauges ({named})"


def _is_new_bridge(before: dict[str, Any], result: dict[str, Any]) -> bool:
    if before["sequence"] is None or result["sequence"] is None:
        return False
    return bool(result["sequence"] <= before["sequence"])


def _missed(before: dict[str, Any], result: dict[str, Any]) -> int:
    if before["sequence"] is None or result["sequence"] is None:
        return 0
    return int(result["sequence"] - before["sequence"] - 1)
