"""Estimates as a few lines of text, as a console shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, LOAD_NAMES, LOAD_UNITS

if TYPE_CHECKING:
    from strainfmu.estimator.estimates.load_estimate import ShownEstimate


def estimate_text(estimate: ShownEstimate) -> str:
    """Return kind and health of an estimate, then each load with its coefficient, both with sigma."""
    used = f"{int(np.sum(estimate.valid))} of {len(estimate.valid)} gauges"
    limit = f"chi-square {estimate.chi_square:.4g}, limit {estimate.chi_square_limit:.4g}"
    first = f"{type(estimate).__name__}: health {estimate.health.name}, {limit}, {used}; value +- sigma:"
    loads, coefficients = (
        [_value(*one) for one in zip(values, std, units, strict=True)]
        for values, std, units in (
            (estimate.loads, estimate.loads_std, LOAD_UNITS),
            (estimate.coefficients, estimate.coefficients_std, [""] * len(COEFFICIENT_NAMES)),
        )
    )
    lines = [
        f"  {name} {load}, {symbol} {coefficient}"
        for name, load, symbol, coefficient in zip(LOAD_NAMES, loads, COEFFICIENT_NAMES, coefficients, strict=True)
    ]
    return "\n".join([first, *lines])


def estimates_text(estimates: ShownEstimate) -> str:
    """Return kind, number and health of estimates, then the range and the median sigma of each load."""
    count = len(estimates)
    samples = f"{count} sample{'' if count == 1 else 's'}"
    health = f": health {health_counts(estimates)}" if count else ""
    lines = [
        f"  {name} {_range(values, std, unit)}"
        for name, values, std, unit in zip(
            LOAD_NAMES, estimates.loads.T, estimates.loads_std.T, LOAD_UNITS, strict=True
        )
        if count
    ]
    return "\n".join([f"{type(estimates).__name__} of {samples}{health}", *lines])


def health_counts(estimates: ShownEstimate) -> str:
    """Return how many samples are of each state of health, as text."""
    counts = zip(*np.unique(estimates.health, return_counts=True), strict=True)
    return ", ".join(f"{count} {HealthState(int(state)).name}" for state, count in counts)


def _value(value: float, std: float, unit: str) -> str:
    return f"{value:.5g} +- {std:.2g} {unit}".rstrip() if np.isfinite(value) else "not known"


def _range(values: FloatArray, std: FloatArray, unit: str) -> str:
    known = np.isfinite(values)
    if not known.any():
        return "not known"
    low, high, sigma = values[known].min(), values[known].max(), np.median(std[known])
    return f"{low:.5g} to {high:.5g} {unit}, median sigma {sigma:.2g} {unit}"
