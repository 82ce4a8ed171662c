"""What the bridge said last, and the last minute of it: datagrams in, JSON for the page out."""

from __future__ import annotations

import json
import threading
from collections import deque
from typing import Any

from strainfmu.inverse_map import COEFFICIENT_NAMES

HISTORY = 60.0
"""Seconds of history that a new page gets."""

HISTORY_PERIOD = 0.1
"""Time between two points of the history [s]."""

SILENT_AFTER = 1.5
"""Seconds without a datagram after which the page says that the bridge is silent."""

_LARGEST = 1 << 16


class MonitorState:
    """The newest datagram replaces the one before: a slow page sees fewer of them, never old ones."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._latest: dict[str, Any] | None = None
        self._gauges: list[dict[str, Any]] = []
        self._history: deque[list[Any]] = deque(maxlen=round(HISTORY / HISTORY_PERIOD))
        self._last_point = self._last_time = float("-inf")
        self.version = 0
        self.datagrams = self.refused = 0

    def take(self, datagram: bytes, now: float) -> None:
        """Take a datagram that came at ``now`` [s, monotonic]; what is no result of a bridge is counted only."""
        try:
            content = json.loads(datagram[:_LARGEST])
            self._take(content, now)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            with self._changed:
                self.refused += 1

    def _take(self, content: dict[str, Any], now: float) -> None:
        layout = content.get("layout")
        with self._changed:
            if layout is not None:
                self._gauges = [
                    {"name": str(g["name"]), "x": _number(g["x"]), "roll_angle": _number(g["roll_angle"])}
                    for g in layout["gauges"]
                ]
            else:
                point = _point(content)
                self._latest, self._last_time = content, now
                if now - self._last_point >= HISTORY_PERIOD:
                    self._history.append(point)
                    self._last_point = now
            self.datagrams += 1
            self.version += 1
            self._changed.notify_all()

    def wait(self, version: int, timeout: float) -> int:
        """Wait up to ``timeout`` [s] for something newer than ``version``; return the version there is."""
        with self._changed:
            if self.version == version:
                self._changed.wait(timeout)
            return self.version

    def snapshot(self, now: float, with_history: bool) -> str:
        """Return what the page shows, as JSON on one line."""
        with self._changed:
            content: dict[str, Any] = {
                "gauges": self._gauges,
                "latest": self._latest,
                "silent": now - self._last_time > SILENT_AFTER,
                "datagrams": self.datagrams,
                "refused": self.refused,
            }
            if with_history:
                content["history"] = list(self._history)
        return json.dumps(content, separators=(",", ":"))


def _number(value: Any) -> float | None:
    """Return a number or None; refuse anything else."""
    return None if value is None else float(value)


def _point(content: dict[str, Any]) -> list[Any]:
    """Return time, coefficients and sigmas of a result; raise if it is none."""
    values = [_number(content[kind][name]) for kind in ("coefficients", "sigma") for name in COEFFICIENT_NAMES]
    for value in content["strain_um_per_m"].values():
        _number(value)
    return [float(content["timestamp"]), *values]
