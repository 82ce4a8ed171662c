"""The pressure on the surface that belongs to an estimate of the compiled core, off the deadline.

The core's flight state and its covariance count, and so do the sensors and air data that it used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, STD, VIBRATION
from strainfmu.estimator.estimates.flight_pressure import pressure_of
from strainfmu.estimator.estimates.linear_field import linear_pressure
from strainfmu.estimator.estimates.pressure_field import FieldInputs, PressureField
from strainfmu.estimator.map.inverse_map import InverseMap, with_gauge_covariance
from strainfmu.estimator.map.sensors import readings_of_modes, vibration_ratio, with_vibration
from strainfmu.estimator.policies import LARGEST_USED_SCORE
from strainfmu.estimator.reference.air import air_inputs_of
from strainfmu.estimator.reference.readings import Zeros, amplitudes, row_noise, rows_of
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceSample:
    """One sample and what was estimated of it, as far as the pressure follows from them.

    Attributes
    ----------
    strain : (n_d,) readings.
    air : :data:`~strainfmu.estimator.air_inputs.AIR_INPUTS` by name, NaN where not known.
    temperature : (n_t,) of the temperature sensors [K], NaN where one gives none.
    inertial : :data:`~strainfmu.estimator.air_inputs.INERTIAL_INPUTS` by name; none of a map without masses.
    thrust : [N]; 0 of a map without sensors that respond to it.
    parameter, parameter_std, parameter_score : (n_p,) flow parameters, their standard deviations, NaN where not
        known, and the part of its range by which each leaves it.
    valid : (n_d,) sensors that were used.
    state, state_covariance : (4,), (4, 4) flight state; NaN of linear maps.
    navigation_used : (3,) air-data inputs that were used.
    is_linear : whether the loads come from the linear map.
    has_coefficients : whether q_inf gave coefficients.
    """

    strain: FloatArray
    air: Mapping[str, float]
    temperature: FloatArray
    inertial: Mapping[str, float]
    thrust: float
    parameter: FloatArray
    parameter_std: FloatArray
    parameter_score: FloatArray
    valid: BoolArray
    state: FloatArray
    state_covariance: FloatArray
    navigation_used: BoolArray
    is_linear: bool
    has_coefficients: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class _Solved:
    """What :func:`~strainfmu.estimator.estimates.flight_pressure.pressure_of` reads."""

    field_inputs: FieldInputs | None
    valid: BoolArray
    state: FloatArray
    state_covariance: FloatArray
    navigation_used: BoolArray
    is_linear: bool


def surface_pressure(
    inverse_map: InverseMap, zeros: GaugeZeros, sample: SurfaceSample, with_std: bool
) -> PressureField:
    """Return pressure and standard deviation at every node of the map's surface.

    ``with_std`` false leaves the standard deviation NaN.

    Raises
    ------
    InputError
        The map holds no pressure field.
    """
    held, strain = _at_temperature(inverse_map, zeros, sample)
    known = np.isfinite(sample.parameter) & (sample.parameter_score <= LARGEST_USED_SCORE)
    known &= np.isfinite(sample.parameter_std)
    if held.manifold is None:
        stated, q_std = sample.air[DYNAMIC_PRESSURE], sample.air[f"{DYNAMIC_PRESSURE}{STD}"]
        q_std = q_std if np.isfinite(q_std) else held.dynamic_pressure_error * stated
        q = stated if sample.has_coefficients else np.nan
        q_std, p, p_std = q_std if sample.has_coefficients else 0.0, np.nan, np.nan
    else:
        air = air_inputs_of(held, sample.air)
        (_, p, q), (_, p_std, q_std) = air.value, air.std
        q, q_std = air.of_loads if air.is_computed else (q, q_std)
    inputs = FieldInputs(
        inverse_map=held,
        strain=strain,
        dynamic_pressure=np.asarray(q),
        dynamic_pressure_std=np.asarray(q_std),
        static_pressure=np.asarray(p),
        static_pressure_std=np.asarray(p_std),
        parameter_value=np.where(known, sample.parameter, np.nan),
        parameter_std=np.where(known, sample.parameter_std, np.nan),
    )
    if held.manifold is None:
        return linear_pressure(inputs, sample.valid, with_std)
    return pressure_of(
        _Solved(
            field_inputs=inputs,
            valid=sample.valid,
            state=sample.state,
            state_covariance=sample.state_covariance,
            navigation_used=sample.navigation_used,
            is_linear=sample.is_linear,
        ),
        with_std,
    )


def _at_temperature(
    inverse_map: InverseMap, zeros: GaugeZeros, sample: SurfaceSample
) -> tuple[InverseMap, FloatArray]:
    """Return the map with the noise of the sample, and its rows (n_d,) without temperature and inertia [m/m]."""
    amplitude, left = None, None
    inertial = {name: np.array([value]) for name, value in sample.inertial.items()}
    theta, known = readings_of_modes(inverse_map.thermal, inverse_map.inertia, sample.temperature[None], inertial)
    ratio = vibration_ratio(inverse_map.inertia, inertial.get(VIBRATION, np.full(1, np.nan)))[0]
    if known.any() or np.isfinite(ratio):
        modes = with_vibration(inverse_map.thermal_and_inertia, inverse_map.inertia, float(ratio))
        of_sensors = amplitudes(modes, theta, known[0])
        amplitude, left = of_sensors.mean, of_sensors.covariance
    of_zeros = Zeros(value=zeros.value, std=zeros.std, common_std=zeros.common_std)
    rows = rows_of(inverse_map, sample.strain[None], np.array([sample.thrust]), of_zeros, amplitude)[0]
    flight, own = inverse_map.manifold, inverse_map.gauge_covariance
    about_tables = own if flight is None else flight.gauge_covariance
    noise, of_tables = (row_noise(inverse_map, one, of_zeros, left) for one in (own, about_tables))
    return with_gauge_covariance(inverse_map, noise, of_tables), rows
