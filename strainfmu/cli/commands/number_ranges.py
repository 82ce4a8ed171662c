"""Ranges of the numbers that options take: outside, one is refused in one line before anything is opened."""

from __future__ import annotations

from collections.abc import Callable
from math import isnan, pi
from typing import Any

import typer

from strainfmu.errors import InputError

PRESSURE_PA = (1.0, 1e8)
"""Of q_inf, from a breath of wind to Mach 30 at sea level."""
DURATION_S = (1e-3, 1e8)


SI = {"mm": 1e-3, "km": 1e3, "deg": pi / 180.0, "um/m": 1e-6, "kPa": 1e3, "%": 0.01, "min": 60.0}
"""Factors to SI units."""


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


def number(low: float, high: float, unit: str, help_text: str) -> Any:
    """Return the option of a number from ``low`` to ``high`` in ``unit``, which the command gets in SI units."""
    callback = within(low, high, unit, factor=SI.get(unit))
    return typer.Option(metavar=unit.upper(), callback=callback, help=help_text)
