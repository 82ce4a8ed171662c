"""The pressure on the surface that belongs to an estimate of the compiled core, in numpy, off the deadline."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.estimates.pressure_field import FieldInputs, PressureField
from strainfmu.estimator.linear.estimator import Estimator as LinearEstimator
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.field_estimate import pressure_of

AIR_DATA = (
    "dynamic_pressure",
    "dynamic_pressure_std",
    "mach_number",
    "mach_number_std",
    "static_pressure",
    "static_pressure_std",
    "altitude",
)


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceSample:
    """One sample and what was estimated of it, as far as the pressure follows from them.

    Attributes
    ----------
    strain : (n_d,) readings.
    air : :data:`AIR_DATA` by name, NaN where not known.
    temperature : (n_t,) of the temperature sensors [K], NaN where one gives none.
    thrust : [N]; None of a map without sensors that respond to it.
    parameters, parameters_std : flow parameters and their standard deviations by name, NaN where not known.
    valid : (n_d,) sensors that were used.
    state, state_covariance : (4,), (4, 4) flight state; NaN of linear maps.
    navigation_used : (3,) air-data inputs that were used.
    is_linear : whether the loads come from the linear map.
    """

    strain: FloatArray
    air: Mapping[str, float]
    temperature: FloatArray
    thrust: float | None
    parameters: Mapping[str, float]
    parameters_std: Mapping[str, float]
    valid: BoolArray
    state: FloatArray
    state_covariance: FloatArray
    navigation_used: BoolArray
    is_linear: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class _Solved:
    """What :func:`~strainfmu.estimator.manifold.field_estimate.pressure_of` reads."""

    field_inputs: FieldInputs | None
    valid: BoolArray
    state: FloatArray
    state_covariance: FloatArray
    navigation_used: BoolArray
    is_linear: bool


def surface_pressure(
    estimator: LinearEstimator | ManifoldEstimator, sample: SurfaceSample, with_std: bool
) -> PressureField:
    """Return pressure and standard deviation at every node of the map's surface.

    ``with_std`` false leaves the standard deviation NaN.

    Raises
    ------
    InputError
        The map holds no pressure field.
    """
    strain, sensors = sample.strain, estimator.inverse_map.sensors
    if sensors is not None and sample.thrust is not None:
        strain = sensors.without_thrust(strain, sample.thrust)
    temperature = sample.temperature if np.isfinite(sample.temperature).any() else None
    if isinstance(estimator, LinearEstimator):
        pressure, std = sample.air["dynamic_pressure"], sample.air["dynamic_pressure_std"]
        return estimator.step(strain, pressure, sample.valid, std, temperature=temperature).pressure(with_std)
    inputs = estimator.checked_inputs(
        strain, sample.valid, sample.air, sample.parameters, sample.parameters_std or None
    )
    if temperature is not None:
        ((_, estimator, inputs),) = estimator.groups(inputs, temperature)
    field_inputs = estimator.field_inputs(inputs)
    return pressure_of(
        _Solved(
            field_inputs=None if field_inputs is None else field_inputs.of_sample(0),
            valid=sample.valid,
            state=sample.state,
            state_covariance=sample.state_covariance,
            navigation_used=sample.navigation_used,
            is_linear=sample.is_linear,
        ),
        with_std,
    )
