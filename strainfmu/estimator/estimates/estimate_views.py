"""Estimates as a few lines of text, as HTML of notebooks, and as a table of pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.notebook import html_table
from strainfmu.estimator.other_loads import names_of
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES, LOAD_NAMES, LOAD_UNITS

if TYPE_CHECKING:
    from pandas import DataFrame

    from strainfmu.estimator.estimates.load_estimate import ShownEstimate


def estimate_text(estimate: ShownEstimate) -> str:
    """Return kind and health of an estimate, then each load with its coefficient, both with sigma."""
    limit, used = _judgement(estimate)
    first = f"{type(estimate).__name__}: health {estimate.health.name}, {limit}, {used}; value +- sigma:"
    loads, coefficients = (
        [_value(*each) for each in zip(values, std, units, strict=True)]
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


def _judgement(estimate: ShownEstimate) -> tuple[str, str]:
    """Return chi-square with its limit, and the gauges in use."""
    limit = f"chi-square {estimate.chi_square:.4g}, limit {estimate.chi_square_limit:.4g}"
    return limit, f"{int(np.sum(estimate.valid))} of {len(estimate.valid)} gauges"


def estimate_html(estimate: ShownEstimate) -> str:
    """Return coefficients and loads with 3 sigma, and the health."""
    rows = [
        (name, f"{value:.5g}", f"{3.0 * std:.2g}", "1")
        for name, value, std in zip(
            COEFFICIENT_NAMES, estimate.coefficients, estimate.coefficients_std, strict=True
        )
    ]
    rows += [
        (name.replace("_", " "), f"{value:.5g}", f"{3.0 * std:.2g}", unit)
        for name, value, std, unit in zip(LOAD_NAMES, estimate.loads, estimate.loads_std, LOAD_UNITS, strict=True)
    ]
    limit, used = _judgement(estimate)
    return html_table(
        f"Load estimate: {estimate.health.name}; {limit}; {used}", ("", "value", "3 sigma", "unit"), rows
    )


def estimates_html(estimates: ShownEstimate) -> str:
    """Return range and median of 3 sigma of each coefficient over the samples, and how many are of each health."""
    rows = []
    for name, values, std in zip(
        COEFFICIENT_NAMES, estimates.coefficients.T, estimates.coefficients_std.T, strict=True
    ):
        known = np.isfinite(values)
        texts = (np.min(values[known]), np.max(values[known]), 3.0 * np.median(std[known])) if known.any() else ()
        rows.append((name, *(f"{text:.4g}" for text in texts)))
    return html_table(
        f"{len(estimates)} load estimates: {health_counts(estimates)}",
        ("", "minimum", "maximum", "median 3 sigma"),
        rows,
    )


def dataframe_of(estimate: ShownEstimate) -> DataFrame:
    """Return a row a sample. Needs pandas."""
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
    columns["health"] = [HealthState(int(state)).name for state in np.atleast_1d(estimate.health)]
    columns["usable"] = np.atleast_1d(estimate.usable)
    columns["valid_gauges"] = np.atleast_1d(np.sum(estimate.valid, axis=-1))
    return DataFrame(columns)
