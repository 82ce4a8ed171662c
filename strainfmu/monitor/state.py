"""The state of the live view: last datagram and last minute of the bridge; datagrams in, JSON for the page out."""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Iterable
from math import isfinite
from typing import Any, NoReturn

from strainfmu.estimator.inverse_map import COEFFICIENT_NAMES

HISTORY = 60.0
"""Length of the history that a new page gets [s]."""

HISTORY_PERIOD = 0.1
"""Time between two points of the history [s]."""

SILENT_AFTER = 1.5
"""Time without a datagram after which the page reports that the bridge is silent [s]."""

_LARGEST = 1 << 16
_NUMBERS = ("quality", "dynamic_pressure_Pa", "age_ms", "health", "chi_square")
_FURTHER_NUMBERS = ("mach_number", "altitude_m", "envelope_score", "envelope_score_limit", "age_uncertainty_ms")
_FURTHER_TEXTS = ("health_text",)
"""Keys that a bridge of an earlier version does not send."""
_TEXTS = ("quality_name", "health_name", "bus_state")


class MonitorState:
    """The latest datagram replaces the one before: a slow page shows fewer of them, never old ones."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._latest: dict[str, Any] | None = None
        self._gauges: list[dict[str, Any]] = []
        self._history: deque[list[Any]] = deque(maxlen=round(HISTORY / HISTORY_PERIOD))
        self._last_point = self._last_time = float("-inf")
        self.version = 0
        self.datagrams = self.refused = 0

    def take(self, datagram: bytes, now: float) -> None:
        """Take in a datagram that came at ``now`` [s, monotonic]; others than a bridge's are only counted."""
        try:
            content = json.loads(datagram[:_LARGEST], parse_constant=_refused)
            if "layout" in content:
                self._take_layout([_gauge(gauge) for gauge in content["layout"]["gauges"]])
            else:
                self._take_result(_result(content), now)
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
            with self._changed:
                self.refused += 1

    def _take_layout(self, gauges: list[dict[str, Any]]) -> None:
        with self._changed:
            self._gauges = gauges
            self._count()

    def _take_result(self, result: dict[str, Any], now: float) -> None:
        with self._changed:
            self._latest, self._last_time = result, now
            if now - self._last_point >= HISTORY_PERIOD:
                values = [result[kind][name] for kind in ("coefficients", "sigma") for name in COEFFICIENT_NAMES]
                self._history.append([result["timestamp"], *values])
                self._last_point = now
            self._count()

    def _count(self) -> None:
        """Count a datagram and wake the waiting threads; the lock must be held."""
        self.datagrams += 1
        self.version += 1
        self._changed.notify_all()

    def wait(self, version: int, timeout: float) -> int:
        """Wait up to ``timeout`` [s] for a version other than ``version``; return the present one."""
        with self._changed:
            if self.version == version:
                self._changed.wait(timeout)
            return self.version

    def snapshot(self, now: float, with_history: bool) -> str:
        """Return the contents of the page as JSON on one line."""
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
        return json.dumps(content, separators=(",", ":"), allow_nan=False)


def _result(content: dict[str, Any]) -> dict[str, Any]:
    """Return the contents of a result for the page, flat and of known types; raise if it is no result.

    A page must not receive what it cannot parse: a number that JSON does not have, or a structure without end.
    """
    timestamp = _number(content["timestamp"])
    if timestamp is None:
        raise ValueError("a result without a time")
    return {
        "timestamp": timestamp,
        **{name: _number(content[name]) for name in _NUMBERS},
        **{name: _text(content[name]) for name in _TEXTS},
        **{name: _number(content.get(name)) for name in _FURTHER_NUMBERS},
        **{name: _text(content.get(name)) for name in _FURTHER_TEXTS},
        "causes": [_text(cause) for cause in content["causes"]],
        "coefficients": _numbers(content["coefficients"], COEFFICIENT_NAMES),
        "sigma": _numbers(content["sigma"], COEFFICIENT_NAMES),
        "strain_um_per_m": _numbers(content["strain_um_per_m"], content["strain_um_per_m"]),
        "account": _numbers(content["account"], content["account"]),
    }


def _gauge(content: dict[str, Any]) -> dict[str, Any]:
    """Return name and position of a gauge; raise if it is none."""
    return {
        "name": str(content["name"]),
        "x": _number(content["x"]),
        "roll_angle": _number(content["roll_angle"]),
    }


def _numbers(content: dict[str, Any], names: Iterable[str]) -> dict[str, float | None]:
    return {name: _number(content[name]) for name in names}


def _number(value: Any) -> float | None:
    """Return a finite number or None; refuse anything else."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"expected a finite number, got {type(value).__name__}")
    return value


def _text(value: Any) -> str | None:
    if value is not None and not isinstance(value, str):
        raise TypeError(f"expected a text, got {type(value).__name__}")
    return value


def _refused(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no JSON")
