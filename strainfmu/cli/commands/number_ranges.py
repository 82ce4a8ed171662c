"""Ranges of the numbers that options take: outside, one is refused in one line before anything is opened."""

from __future__ import annotations

from collections.abc import Callable
from math import isnan
from typing import Any

import typer

from strainfmu.errors import InputError

PRESSURE_PA = (1.0, 1e8)
"""Of q_inf, from a breath of wind to Mach 30 at sea level."""
DURATION_S = (1e-3, 1e8)


def within(
    low: float, high: float, unit: str = "", *, takes_nan: bool = False
) -> Callable[[typer.CallbackParam, float | None], float | None]:
    """Return the callback of an option that takes a number from ``low`` to ``high``, and NaN if ``takes_nan``.

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
        return value

    return checked


def number(low: float, high: float, unit: str, help_text: str) -> Any:
    """Return the option of a number from ``low`` to ``high``, shown with its unit; errors as :func:`within`."""
    return typer.Option(metavar=unit.upper(), callback=within(low, high, unit), help=help_text)
