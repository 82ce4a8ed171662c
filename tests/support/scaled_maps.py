"""Random maps in form "dynamic_pressure", small and consistent."""

from dataclasses import replace
from typing import Any

import numpy as np

from strainfmu.estimator.map.inverse_map import PAIRS, InverseMap

NOMINAL = 130e3


def scaled_map(
    case: int,
    seed: int,
    n: int = 18,
    n_states: int = 4,
    errors: dict[str, np.ndarray] | None = None,
    **changes: Any,
) -> InverseMap:
    """Return a map of ``n`` gauges whose errors and prior are some 100 times the gauges' own noise.

    ``errors`` are those of :func:`errors_at_strain`, whose mean is then part of the covariance.
    """
    rng = np.random.default_rng(seed)
    states = 6e-5 * rng.standard_normal((n, n_states))
    error, error_load = 3e-6 * rng.standard_normal((n, n + 5)), 8.0 * rng.standard_normal((5, n + 5))
    if errors is not None:
        error = np.hstack([error, _mean_errors(errors)])
        error_load = np.hstack([error_load, np.zeros((5, error.shape[1] - error_load.shape[1]))])
    covariance = (1e-6**2) * (np.diag(rng.uniform(0.5, 2.0, n)) + 0.1)
    load_per_state, mean = 400.0 * rng.standard_normal((5, n_states)), 1e-4 * rng.standard_normal(n)
    fields: dict[str, Any] = {
        "vehicle": "random",
        "case": case,
        "gauge_names": tuple(f"g{i}" for i in range(n)),
        "gauge_position": rng.standard_normal((n, 3)),
        "gauge_direction": np.tile([1.0, 0.0, 0.0], (n, 1)),
        "noise_std": np.sqrt(np.diag(covariance)),
        "state_operator": states,
        "gauge_covariance": covariance,
        "error_strain": error,
        "error_load": error_load,
        "regularisation": 0.0 if case == 1 else 1.0,
        "load_per_state": load_per_state,
        "load_of_mean": np.array([900.0, 2000.0, -1500.0, 700.0, 300.0]),
        "mean_strain": mean,
        "strain_range": 3.0 * np.abs(mean) + 1e-5,
        "coefficient_range": np.tile([-0.5, 0.5], (5, 1)),
        "reference_area": 0.12,
        "reference_length": 0.4,
        "nominal_dynamic_pressure": NOMINAL,
        "form": "dynamic_pressure",
    }
    return InverseMap(**(fields | (errors or {}) | changes))


def errors_at_strain(n: int, seed: int = 1, size: float = 4e-6, n_terms: int = 3) -> dict[str, np.ndarray]:
    """Return the fields of errors that follow the current strain: ``n_terms`` of each kind, ``size`` [m/m]."""
    rng = np.random.default_rng(seed)
    of_gauge = size * rng.standard_normal((n_terms, 6, n))
    c = np.hstack([np.ones((50, 1)), rng.uniform(-0.3, 0.3, (50, 5))])
    twice = [1.0 if a == b else 2.0 for a, b in PAIRS]
    products = [
        k * np.sum(of_gauge[:, a] * of_gauge[:, b], axis=0) for k, (a, b) in zip(twice, PAIRS, strict=True)
    ]
    return {
        "gauge_error_product": np.array(products),
        "common_error": size * rng.standard_normal((n_terms, 6, n)),
        "mean_product": np.array([np.mean(c[:, a] * c[:, b]) for a, b in PAIRS]),
    }


def _mean_errors(errors: dict[str, np.ndarray]) -> np.ndarray:
    """Return (n, k) error strain of independent terms, whose covariance is that of ``errors`` at the mean."""
    mean, product = errors["mean_product"], np.zeros((6, 6))
    for value, (a, b) in zip(mean, PAIRS, strict=True):
        product[a, b] = product[b, a] = value
    root = np.linalg.cholesky(product)
    common = np.einsum("tan,ak->ntk", errors["common_error"], root)
    return np.hstack([np.diag(np.sqrt(mean @ errors["gauge_error_product"])), common.reshape(len(common), -1)])


def with_envelope(seed: int = 1, n: int = 40, size: float = 0.3) -> dict[str, Any]:
    """Return the fields of an envelope: ``n`` half-spaces around coefficients of that size, and ranges."""
    direction = np.random.default_rng(seed).standard_normal((n, 5))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    return {
        "envelope_direction": direction,
        "envelope_limit": np.full(n, size),
        "dynamic_pressure_range": np.array([3e4, 6e5]),
        "mach_number_range": np.array([5.0, 7.0]),
        "altitude_range": np.array([12e3, 30e3]),
        "dynamic_pressure_error": 0.01,
        "chi_square_scale": 1.1,
        "outlier_scale": 1.2,
    }


def with_fixed(inverse_map: InverseMap, seed: int = 1) -> dict[str, Any]:
    """Return strain and load that do not follow the dynamic pressure."""
    rng = np.random.default_rng(seed)
    return {
        "fixed_strain": 2e-5 * rng.standard_normal(inverse_map.n_gauges),
        "fixed_load": 100.0 * rng.standard_normal(5),
    }


def whole_scaled_map(case: int, seed: int, n: int = 18, n_states: int = 4) -> InverseMap:
    """Return :func:`scaled_map` with errors at the current strain, an envelope, and fixed strain and load."""
    plain = scaled_map(case, seed, n=n, n_states=n_states, errors=errors_at_strain(n, seed))
    return replace(plain, **with_envelope(seed), **with_fixed(plain, seed))
