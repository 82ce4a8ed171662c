"""The estimator as a carrier of streams: samples in, the fields that files keep out."""

from dataclasses import replace
from typing import Any

import numpy as np
from inputs import PART, Inputs, Results

from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros


def estimator_for(estimator: Estimator, inputs: Inputs) -> Estimator:
    """Return ``estimator`` with the zero offsets and settings of ``inputs``."""
    if inputs.zero.size:
        value, std = inputs.zero[:-1].reshape(2, -1)
        estimator = estimator.with_zeros(GaugeZeros(value=value, std=std, common_std=float(inputs.zero[-1])))
    return (
        estimator.with_settings(replace(estimator.settings, **inputs.settings)) if inputs.settings else estimator
    )


def arguments(estimator: Estimator, inputs: Inputs) -> dict[str, Any]:
    """Return the arguments of the estimator by name, but the readings."""
    names = estimator.parameters.names
    found: dict[str, Any] = {**inputs.flow, "valid": inputs.valid, "thrust": inputs.thrust}
    if inputs.temperature.shape[1]:
        found["temperature"] = inputs.temperature
    if inputs.parameter.shape[1]:
        found["parameters"] = dict(zip(names, inputs.parameter.T, strict=True))
    if inputs.parameter_std.shape[1]:
        found["parameters_std"] = dict(zip(names, inputs.parameter_std.T, strict=True))
    return found


def by_estimator(estimator: Estimator, inputs: Inputs, mode: str, seconds: float) -> Results:
    """Return what the handle on the compiled core gives."""
    if mode == "each":
        return results_of(estimator.estimate(inputs.strain, **arguments(estimator, inputs)))
    fresh = estimator.filter(seconds if mode == "filter" else 0.0)
    return results_of(fresh.track(inputs.strain, time=inputs.time, **arguments(estimator, inputs)))


def results_of(found: Estimate) -> Results:
    """Return the fields of k estimates that files keep."""
    suspects = [*map(tuple, found.suspects)]
    results = {
        "loads": found.loads,
        "loads_std": found.loads_std,
        "coefficients": found.coefficients,
        "coefficients_std": found.coefficients_std,
        "chi_square": found.chi_square,
        "chi_square_limit": found.chi_square_limit,
        "degrees_of_freedom": found.degrees_of_freedom,
        "health": found.health,
        "valid_gauges": found.valid.sum(axis=1),
        "suspect_gauge": np.array([1 + one[0] if one else 0 for one in suspects]),
        "suspects": np.array([len(one) for one in suspects]),
        "envelope_score": found.envelope_score,
        "standardised_residual": found.standardised_residual,
    }
    if found.parameter_score.shape[1]:
        results["parameter_score"] = found.parameter_score
    if found.section_station.size or np.any(found.other_loads_std > 0.0):
        results |= {
            "other_loads": found.other_loads,
            "other_loads_std": found.other_loads_std,
            "other_coefficients": found.other_coefficients,
            "other_coefficients_std": found.other_coefficients_std,
            "M_R": found.M_R,
            "M_R_std": found.sigma.M_R,
        }
    if not np.all(np.isnan(found.state)):
        with np.errstate(invalid="ignore"):
            state_std = np.sqrt(np.diagonal(found.state_covariance, axis1=1, axis2=2))
        results |= {
            "air_data": found.air_data.value,
            "air_data_std": found.air_data.std,
            "is_identified": found.air_data.is_identified,
            "air_data_used": found.air_data_used,
            "is_linear": found.is_linear,
            "fits": found.fits,
            "state": found.state,
            "state_std": state_std,
        }
    return in_part({name: as_kept(value) for name, value in results.items()})


def as_kept(value: np.ndarray) -> np.ndarray:
    """Return ``value`` as files have it: float64, or whole numbers of 16 bits."""
    return value.astype(np.float64) if value.dtype.kind == "f" else value.astype(np.int16)


def in_part(results: Results) -> Results:
    """Return ``results`` with some fields of the first samples alone."""
    return {name: value[: PART.get(name)] for name, value in results.items()}
