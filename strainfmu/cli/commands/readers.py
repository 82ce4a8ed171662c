"""Values of options that are read from text or lie in a range: a wrong one is refused before anything is opened.

A reader gets the name of the option and its text, and raises :class:`InputError` with one line for a wrong text.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, isnan, radians
from typing import Any

import typer

from strainfmu.errors import InputError

Reader = Callable[[str, str], Any]


def within(
    low: float, high: float, unit: str = "", *, takes_nan: bool = False, factor: float | None = None
) -> Callable[[typer.CallbackParam, float | None], float | None]:
    """Return the callback of an option that takes a number from ``low`` to ``high``, and NaN if ``takes_nan``.

    The command gets the number times ``factor``; None leaves it as it is.

    Raises
    ------
    InputError
        By the callback, where the number is outside; the message names the option.
    """

    def checked(param: typer.CallbackParam, value: float | None) -> float | None:
        if value is not None and not low <= value <= high and not (takes_nan and isnan(value)):
            name = max(param.opts, key=len)
            shown = f"{low:.6g} .. {high:.10g} {unit}".rstrip() + (", or nan" if takes_nan else "")
            raise InputError(f"{name}: expected {shown}, got {value:.6g}")
        return value if value is None or factor is None else factor * value

    return checked


def listed(_: str, text: str) -> list[str] | str:
    """Return the names of a list with commas; "all" as it is."""
    return text if text == "all" else [name.strip() for name in text.split(",") if name.strip()]


def numbers(option: str, text: str) -> list[float]:
    """Return finite numbers that commas separate."""
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError as error:
        raise InputError(f"{option}: expected numbers with commas, got '{text}'") from error
    if not all(map(isfinite, values)):
        raise InputError(f"{option}: expected finite numbers, got '{text}'")
    return values


def series(option: str, text: str) -> list[float]:
    """Return numbers with commas, or first:last:step."""
    if ":" not in text:
        return numbers(option, text)
    parts = numbers(option, text.replace(":", ","))
    if len(parts) != 3 or parts[2] <= 0.0 or parts[1] < parts[0] or (parts[1] - parts[0]) / parts[2] > 1e5:
        raise InputError(f"{option}: expected first:last:step with a positive step, got '{text}'")
    first, last, step = parts
    return [round(first + step * k, 9) for k in range(int((last - first) / step + 1e-9) + 1)]


def in_radians(reader: Callable[[str, str], list[float]]) -> Reader:
    """Return the reader of angles in degrees."""
    return lambda option, text: [*map(radians, reader(option, text))]


def named_numbers(option: str, text: str) -> dict[str, float]:
    """Return name=number with commas."""
    values = {}
    for part in filter(None, (entry.strip() for entry in text.split(","))):
        name, equals, value = part.partition("=")
        if not equals:
            raise InputError(f"{option}: expected name=number with commas, got '{part}'")
        values[name.strip()] = numbers(option, value)[0]
    return values


def cable(option: str, text: str) -> tuple[float, float]:
    """Return cost of a metre of cable and the station that it runs to [m]."""
    parts = numbers(option, text.replace("@", ","))
    if len(parts) != 2 or parts[0] < 0.0 or text.count("@") != 1:
        raise InputError(f"{option}: expected COST@X with a cost from 0 per metre, got '{text}'")
    return parts[0], parts[1]


def zone(option: str, text: str) -> tuple[float, ...]:
    """Return first and last station of a zone [m] and, if stated, its roll angles [rad]."""
    along, _, around = text.partition("@")
    parts = numbers(option, along.replace(":", ","))
    angles = numbers(option, around.replace(":", ",")) if around else []
    if len(parts) != 2 or len(angles) not in (0, 2) or parts[0] > parts[1]:
        raise InputError(f"{option}: expected x1:x2 in m or x1:x2@roll1:roll2 in deg, got '{text}'")
    return (*parts, *map(radians, angles))


def window(option: str, text: str) -> tuple[float, float]:
    """Return FROM:TO [s]."""
    begin, colon, end = text.partition(":")
    try:
        times = float(begin), float(end)
    except ValueError:
        times = float("nan"), float("nan")
    if not colon or not all(map(isfinite, times)):
        raise InputError(f"{option}: expected FROM:TO in seconds, as 0:10, got '{text}'")
    return times
