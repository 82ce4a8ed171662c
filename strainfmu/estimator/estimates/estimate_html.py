"""Tables of estimates as HTML, as notebooks show them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from strainfmu.estimator.estimates.estimate_text import health_counts
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, LOAD_NAMES, LOAD_UNITS
from strainfmu.estimator.notebook import html_table

if TYPE_CHECKING:
    from strainfmu.estimator.estimates.load_estimate import ShownEstimate


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
    limit = f"chi-square {estimate.chi_square:.4g}, limit {estimate.chi_square_limit:.4g}"
    used = f"{int(np.sum(estimate.valid))} of {len(estimate.valid)} gauges"
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
