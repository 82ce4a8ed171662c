"""Random maps in form "dynamic_pressure", small and consistent."""

from __future__ import annotations

from typing import Any

import numpy as np

from strainfmu.estimator.innovation import estimate_gain, innovation_whitening, inverse_cholesky
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.load_errors import LoadErrorModel, load_error_covariance, load_gain

NOMINAL = 130e3


def scaled_map(case: int, seed: int, n: int = 18, n_states: int = 4, **changes: Any) -> InverseMap:
    """Return a map of ``n`` gauges whose errors and prior are some 100 times the gauges' own noise."""
    rng = np.random.default_rng(seed)
    states = 6e-5 * rng.standard_normal((n, n_states))
    error, error_load = 3e-6 * rng.standard_normal((n, n + 5)), 8.0 * rng.standard_normal((5, n + 5))
    own = (1e-6**2) * (np.diag(rng.uniform(0.5, 2.0, n)) + 0.1)
    load_per_state, mean = 400.0 * rng.standard_normal((5, n_states)), 1e-4 * rng.standard_normal(n)
    gamma, cross = own + error @ error.T, error @ error_load.T
    regularisation = 0.0 if case == 1 else 1.0
    gain = estimate_gain(states, gamma, regularisation)
    of_strain = load_gain(
        load_per_state=load_per_state,
        strain_gain=gain,
        state_operator=states,
        noise_whitening=inverse_cholesky(gamma),
        strain_load_covariance=cross,
    )
    root = np.linalg.cholesky(gamma)
    regression = np.linalg.solve(root, cross).T
    model = LoadErrorModel(
        noise_root=root,
        regression=regression,
        remainder=error_load @ error_load.T - regression @ regression.T,
        state_operator=states,
        load_per_state=load_per_state,
        known_prior=case == 2,
    )
    fields: dict[str, Any] = {
        "vehicle": "random",
        "case": case,
        "gauge_names": tuple(f"g{i}" for i in range(n)),
        "gauge_position": rng.standard_normal((n, 3)),
        "gauge_direction": np.tile([1.0, 0.0, 0.0], (n, 1)),
        "noise_std": np.sqrt(np.diag(own)),
        "state_operator": states,
        "noise_covariance": gamma,
        "regularisation": regularisation,
        "strain_gain": gain,
        "state_offset": -gain @ mean,
        "load_per_state": load_per_state,
        "load_of_mean": np.array([900.0, 2000.0, -1500.0, 700.0, 300.0]),
        "load_covariance": load_error_covariance(model, of_strain),
        "mean_strain": mean,
        "residual_whitening": innovation_whitening(states, gamma, regularisation),
        "residual_degrees_of_freedom": n - n_states if case == 1 else n,
        "strain_range": 3.0 * np.abs(mean) + 1e-5,
        "coefficient_range": np.tile([-0.5, 0.5], (5, 1)),
        "reference_area": 0.12,
        "reference_length": 0.4,
        "nominal_dynamic_pressure": NOMINAL,
        "strain_load_covariance": cross,
        "form": "dynamic_pressure",
        "gauge_covariance": own,
        "error_strain": error,
        "error_load": error_load,
    }
    return InverseMap(**(fields | changes))
