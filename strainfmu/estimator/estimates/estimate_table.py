"""Estimates as a table of pandas: coefficients, loads, their standard deviations and health."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, LOAD_NAMES
from strainfmu.estimator.other_loads import names_of

if TYPE_CHECKING:
    from pandas import DataFrame

    from strainfmu.estimator.estimates.load_estimate import ShownEstimate


def dataframe_of(estimate: ShownEstimate, health: Any) -> DataFrame:
    """Return a row a sample; ``health`` names its state. Needs pandas."""
    from pandas import DataFrame

    columns: dict[str, Any] = {}
    groups = estimate.load_groups
    stated = [group for group in groups if group.load.coefficient]
    of_stated = np.concatenate([np.arange(group.first, group.first + group.size) for group in stated])
    coefficients = tuple(name for group in stated for name in group.numbered(group.load.coefficient))
    rows: tuple[tuple[tuple[str, ...], FloatArray, FloatArray], ...] = (
        (COEFFICIENT_NAMES, estimate.coefficients, estimate.coefficients_std),
        (LOAD_NAMES, estimate.loads, estimate.loads_std),
        (
            coefficients,
            estimate.other_coefficients[..., of_stated],
            estimate.other_coefficients_std[..., of_stated],
        ),
        (names_of(groups), estimate.other_loads, estimate.other_loads_std),
    )
    for names, values, std in rows:
        columns |= dict(zip(names, np.atleast_2d(values).T, strict=True))
        columns |= {f"sigma.{name}": row for name, row in zip(names, np.atleast_2d(std).T, strict=True)}
    columns["chi_square"] = np.atleast_1d(estimate.chi_square)
    columns["health"] = health
    columns["usable"] = np.atleast_1d(estimate.usable)
    columns["valid_gauges"] = np.atleast_1d(np.sum(estimate.valid, axis=-1))
    return DataFrame(columns)
