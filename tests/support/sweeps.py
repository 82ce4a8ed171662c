"""Sweeps of which each run takes a few, and `pytest -m slow` the rest."""

from collections.abc import Iterable
from itertools import product
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


def crossed(*levels: Iterable[Any]) -> list[ParameterSet]:
    """Return all combinations of ``levels`` as parameters of a test.

    All are slow but as many as the longest list has: they take every level, shorter lists from their begin again.
    """
    lists = [list(values) for values in levels]
    most = max(map(len, lists))
    return sweep(product(*lists), [tuple(values[k % len(values)] for values in lists) for k in range(most)])
