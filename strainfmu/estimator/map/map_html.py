"""A table of a map as HTML, as notebooks show it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.map.validity import valid_ranges
from strainfmu.estimator.notebook import html_table
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.gain import load_covariance

if TYPE_CHECKING:
    from strainfmu.estimator.map.inverse_map import InverseMap

_METHODS = {1: "least squares on POD modes", 2: "low-rank Gaussian prior"}


def map_html(inverse_map: InverseMap) -> str:
    """Return what a map is for, and where it holds."""
    q, area, length = (
        inverse_map.nominal_dynamic_pressure,
        inverse_map.reference_area,
        inverse_map.reference_length,
    )
    scale = 1.0 / (q * area * np.array([1.0, 1.0, 1.0, length, length]))
    sigma = scale * np.sqrt(np.diag(load_covariance(inverse_map))[FIVE_LOADS])
    rows = [
        ("method", f"Case {inverse_map.case}, {_METHODS[inverse_map.case]}"),
        ("gauges", f"{inverse_map.n_gauges}"),
        ("pressure states", f"{inverse_map.n_states}"),
        *((one.quantity, one.text) for one in valid_ranges(inverse_map)),
        (
            f"sigma at {q:.4g} Pa",
            ", ".join(f"{name} {value:.2g}" for name, value in zip(COEFFICIENT_NAMES, sigma, strict=True)),
        ),
    ]
    return html_table(f"Inverse map: {inverse_map.vehicle}", ("", ""), rows)
