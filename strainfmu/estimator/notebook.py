"""Tables of maps and estimates as HTML, as notebooks show them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.inverse_map import COEFFICIENT_NAMES, LOAD_NAMES
from strainfmu.estimator.validity import valid_ranges

if TYPE_CHECKING:
    from strainfmu.estimator.inverse_map import InverseMap
    from strainfmu.estimator.load_estimate import LoadEstimate, LoadEstimates

LOAD_UNITS = ("N", "N", "N", "N m", "N m")

_METHODS = {1: "least squares on POD modes", 2: "low-rank Gaussian prior"}


def map_html(inverse_map: InverseMap) -> str:
    """Return what a map is for, and where it holds."""
    q, area, length = (
        inverse_map.nominal_dynamic_pressure,
        inverse_map.reference_area,
        inverse_map.reference_length,
    )
    scale = 1.0 / (q * area * np.array([1.0, 1.0, 1.0, length, length]))
    sigma = scale * np.sqrt(np.diag(inverse_map.load_covariance))
    rows = [
        ("method", f"Case {inverse_map.case}, {_METHODS[inverse_map.case]}"),
        ("gauges", f"{inverse_map.n_gauges}"),
        ("pressure states", f"{len(inverse_map.state_offset)}"),
        *((one.quantity, one.text) for one in valid_ranges(inverse_map)),
        (
            f"sigma at {q:.4g} Pa",
            ", ".join(f"{name} {value:.2g}" for name, value in zip(COEFFICIENT_NAMES, sigma, strict=True)),
        ),
    ]
    return _table(f"Inverse map: {inverse_map.vehicle}", ("", ""), rows)


def estimate_html(estimate: LoadEstimate) -> str:
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
    return _table(
        f"Load estimate: {estimate.health.name}; {limit}; {used}", ("", "value", "3 sigma", "unit"), rows
    )


def estimates_html(estimates: LoadEstimates) -> str:
    """Return range and median of 3 sigma of each coefficient over the samples, and how many are of each health."""
    rows = []
    for name, values, std in zip(
        COEFFICIENT_NAMES, estimates.coefficients.T, estimates.coefficients_std.T, strict=True
    ):
        known = np.isfinite(values)
        texts = (np.min(values[known]), np.max(values[known]), 3.0 * np.median(std[known])) if known.any() else ()
        rows.append((name, *(f"{text:.4g}" for text in texts)))
    counts = zip(*np.unique(estimates.health, return_counts=True), strict=True)
    states = ", ".join(f"{count} {HealthState(int(state)).name}" for state, count in counts)
    return _table(f"{len(estimates)} load estimates: {states}", ("", "minimum", "maximum", "median 3 sigma"), rows)


def _table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return an HTML table; every text is escaped."""
    lines = [f"<table><caption>{escape(title)}</caption>"]
    if any(headings):
        lines.append(f"<tr>{''.join(f'<th>{escape(text)}</th>' for text in headings)}</tr>")
    lines += [
        f"<tr><th>{escape(first)}</th>{''.join(f'<td>{escape(text)}</td>' for text in rest)}</tr>"
        for first, *rest in rows
    ]
    return "\n".join([*lines, "</table>"])
