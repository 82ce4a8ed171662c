"""Sweeps of which each run takes a few, and `pytest -m slow` the rest."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from _pytest.mark.structures import ParameterSet

SLOW = pytest.mark.slow


def sweep(values: Iterable[Any], quick: Iterable[Any]) -> list[ParameterSet]:
    """Return ``values`` as parameters of a test, a tuple as several; all but those in ``quick`` are slow."""
    in_each_run = list(quick)
    return [
        pytest.param(
            *(value if isinstance(value, tuple) else (value,)), marks=() if value in in_each_run else SLOW
        )
        for value in values
    ]
