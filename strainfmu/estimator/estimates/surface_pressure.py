"""The pressure on the surface that belongs to an estimate of the compiled core, in numpy, off the deadline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.estimates.pressure_field import FieldInputs, PressureField
from strainfmu.estimator.linear.estimator import Estimator as LinearEstimator
from strainfmu.estimator.manifold.field_estimate import pressure_of

if TYPE_CHECKING:
    from strainfmu.estimator.estimate import Estimate
    from strainfmu.estimator.estimator import Estimator


@dataclass(frozen=True, eq=False, kw_only=True)
class SolvedSample:
    """What the pressure of the nonlinear estimator follows from: arrays of one sample of an :class:`Estimate`."""

    field_inputs: FieldInputs | None
    valid: BoolArray
    state: FloatArray
    state_covariance: FloatArray
    navigation_used: BoolArray
    is_linear: bool


def surface_pressure(estimator: Estimator, estimate: Estimate, with_std: bool) -> PressureField:
    """Return pressure and standard deviation at every node of the map's surface, of one sample.

    Raises
    ------
    InputError
        The map holds no pressure field.
    """
    sample = estimate.sample
    layout = estimator.core.inputs
    strain, temperature = sample[: estimator.inverse_map.n_gauges], sample[layout["temperature"]]
    thrust = sample[layout["thrust"]]
    sensors = estimator.inverse_map.sensors
    if sensors is not None and len(thrust):
        strain = sensors.without_thrust(strain, thrust[0])
    known = temperature if np.isfinite(temperature).any() else None
    flow = {name: float(sample[layout[name].start]) for name in _FLOW}
    names, values = estimator.parameters.names, sample[layout["parameter"]].tolist()
    parameters = dict(zip(names, values, strict=True))
    field_estimator = estimator.field_estimator
    if isinstance(field_estimator, LinearEstimator):
        found = field_estimator.step(
            strain,
            flow["dynamic_pressure"],
            estimate.valid,
            flow["dynamic_pressure_std"],
            temperature=known,
        )
        return found.pressure(with_std)
    stds = sample[layout["parameter_std"]].tolist() if "parameter_std" in layout else []
    nonlinear = field_estimator
    inputs = nonlinear.checked_inputs(
        strain, estimate.valid, flow, parameters, dict(zip(names, stds, strict=False))
    )
    if known is not None:
        ((_, nonlinear, inputs),) = nonlinear.groups(inputs, known)
    field_inputs = nonlinear.field_inputs(inputs)
    return pressure_of(
        SolvedSample(
            field_inputs=None if field_inputs is None else field_inputs.of_sample(0),
            valid=estimate.valid,
            state=estimate.state,
            state_covariance=estimate.state_covariance,
            navigation_used=estimate.air_data_used,
            is_linear=estimate.is_linear,
        ),
        with_std,
    )


_FLOW = (
    "dynamic_pressure",
    "dynamic_pressure_std",
    "mach_number",
    "mach_number_std",
    "static_pressure",
    "static_pressure_std",
    "altitude",
)
