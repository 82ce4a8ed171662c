"""The same results by the numpy estimator, which recording compares the compiled core with.

Two differences are known, and not compared:

- Of a sample without any gauge the core states no flight state, and that nothing fits; numpy states those of the
  air data.
- Where flow parameters are known with a standard deviation, the core searches the tables of those parameters, as
  the first step of numpy's tracker does, which stands here. ``ManifoldEstimator.estimate`` searches the tables at
  the mean and goes on from there: far off the tables, or where two states fit, it may end elsewhere.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from estimator_carrier import as_kept, in_part
from inputs import Inputs, Results

from strainfmu.estimator.filter.switched import SwitchedFilter, TimedTrack
from strainfmu.estimator.filter.switched_linear import SwitchedLinearFilter, TimedLaw
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.settings import default_settings
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros

FLOW = (
    "mach_number",
    "static_pressure",
    "dynamic_pressure",
    "mach_number_std",
    "static_pressure_std",
    "dynamic_pressure_std",
    "altitude",
)


def by_numpy(inverse_map: InverseMap, inputs: Inputs, mode: str, seconds: float) -> Results:
    """Return what the numpy estimator gives."""
    settings = replace(default_settings(inverse_map), **inputs.settings)
    zeros = None
    if inputs.zero.size:
        value, std = inputs.zero[:-1].reshape(2, -1)
        zeros = GaugeZeros(value=value, std=std, common_std=float(inputs.zero[-1]))
    time_constant = seconds if mode == "filter" else 0.0
    if inverse_map.manifold is None:
        found = _linear(Estimator(inverse_map, settings, zeros), inputs, time_constant)
    else:
        estimator = ManifoldEstimator(inverse_map, settings, zeros)
        found = _of_tables(estimator, inputs, time_constant, with_memory=mode != "each")
    results = {name: np.array([one[name] for one in found]) for name in found[0]}
    return in_part({name: as_kept(value) for name, value in results.items()})


def _linear(estimator: Estimator, inputs: Inputs, time_constant: float) -> list[dict[str, Any]]:
    switched, last, found = None, TimedLaw(), []
    if time_constant > 0.0:
        switched = SwitchedLinearFilter(estimator, time_constant)
    strain = _without_thrust(estimator.inverse_map, inputs)
    for k, valid in enumerate(inputs.valid):
        of_one = _known(inputs, k, estimator.parameters.names)
        flow = {name: of_one["flow"][name] for name in ("dynamic_pressure_std", "mach_number", "altitude")}
        q, warm = of_one["flow"]["dynamic_pressure"], of_one["temperature"]
        given = {"temperature": warm, "parameters": of_one["parameters"]}
        estimate = estimator.step(strain[k], q, valid, **flow, **given)
        if switched is not None:
            estimate, last = switched.step(estimate, strain[k], q, last, float(inputs.time[k]), warm)
        found.append(_fields(estimate))
    return found


def _of_tables(
    estimator: ManifoldEstimator, inputs: Inputs, time_constant: float, *, with_memory: bool
) -> list[dict[str, Any]]:
    switched, last, found = SwitchedFilter(estimator, time_constant), TimedTrack(), []
    strain = _without_thrust(estimator.inverse_map, inputs)
    for k, valid in enumerate(inputs.valid):
        of_one = _known(inputs, k, estimator.parameters.names)
        warm = of_one["temperature"]
        checked = estimator.checked_inputs(
            strain[k], valid, of_one["flow"], of_one["parameters"], of_one["parameters_std"]
        )
        if with_memory:
            estimate, last = switched.step(checked, last, float(inputs.time[k]), warm)
        elif checked.knows_parameters and estimator.manifold.parameters is not None:
            estimate, _ = switched.step(checked, TimedTrack(), 0.0, warm)
        else:
            estimate = estimator._at_temperature(checked, warm)[0]
        found.append(_fields(estimate))
    return found


def _without_thrust(inverse_map: InverseMap, inputs: Inputs) -> np.ndarray:
    if inverse_map.sensors is None:
        return inputs.strain
    rows = zip(inputs.strain, inputs.thrust.tolist(), strict=True)
    return np.array([inverse_map.sensors.without_thrust(one, thrust) for one, thrust in rows])


def _known(inputs: Inputs, k: int, names: tuple[str, ...]) -> dict[str, Any]:
    """Return what is known of sample ``k``, as the estimators take it."""
    flow = dict.fromkeys(FLOW, np.nan) | {name: float(value[k]) for name, value in inputs.flow.items()}
    known: dict[str, Any] = {"flow": flow, "temperature": None, "parameters": None, "parameters_std": None}
    warm = inputs.temperature[k]
    if np.isfinite(warm).any():
        known["temperature"] = warm
    for name, values in (("parameters", inputs.parameter), ("parameters_std", inputs.parameter_std)):
        if values.shape[1]:
            known[name] = dict(zip(names, values[k].tolist(), strict=True))
    return known


def _fields(one: Any) -> dict[str, Any]:
    """Return the fields of an estimate."""
    found = {
        "loads": one.loads,
        "loads_std": one.loads_std,
        "coefficients": one.coefficients,
        "coefficients_std": one.coefficients_std,
        "chi_square": one.chi_square,
        "chi_square_limit": one.chi_square_limit,
        "degrees_of_freedom": one.degrees_of_freedom,
        "health": int(one.health),
        "valid_gauges": int(one.valid.sum()),
        "suspect_gauge": 1 + one.suspects[0] if one.suspects else 0,
        "suspects": len(one.suspects),
        "envelope_score": one.envelope_score,
        "standardised_residual": one.standardised_residual,
        "parameter_score": one.parameter_score,
        "further_loads": one.further_loads,
        "further_loads_std": one.further_loads_std,
        "further_coefficients": one.further_coefficients,
        "further_coefficients_std": one.further_coefficients_std,
        "M_R": one.further_coefficients[0],
        "M_R_std": one.further_coefficients_std[0],
    }
    if hasattr(one, "air_data"):
        with np.errstate(invalid="ignore"):
            state_std = np.sqrt(np.diag(one.state_covariance))
        found |= {
            "air_data": one.air_data.value,
            "air_data_std": one.air_data.std,
            "is_identified": one.air_data.is_identified,
            "air_data_used": one.navigation_used,
            "is_linear": one.is_linear,
            "fits": one.fits,
            "state": one.state,
            "state_std": state_std,
        }
    return found


def without_gauges(results: Results, found: Results) -> Results:
    """Return ``results`` with flight state and fit of ``found`` where no gauge was valid."""
    none = found["valid_gauges"] == 0
    changed = {}
    for name in {"fits", "state", "state_std"} & found.keys():
        of_none = none[: len(results[name])].reshape(-1, *(1,) * (results[name].ndim - 1))
        changed[name] = np.where(of_none, found[name], results[name])
    return results | changed
