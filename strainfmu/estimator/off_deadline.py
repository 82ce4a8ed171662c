"""What is made of an estimate off the deadline: the pressure on the surface, and loads that the core lacks.

These are the loads behind the five of a linear map of form "absolute". The pressure follows from the flight state
of the core and its covariance, and from the sensors and air data that it used.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import AIR_INPUT_NAMES, DYNAMIC_PRESSURE, INERTIAL_NAMES, STD, VIBRATION
from strainfmu.estimator.core import Layout
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimates.pressure import (
    PressureField,
    flight_pressure,
    linear_pressure,
    no_field,
    unknown_field,
)
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE
from strainfmu.estimator.map.inverse_map import InverseMap, with_gauge_covariance
from strainfmu.estimator.map.nonlinear_map import ManifoldMap, ShapeField, field_with_known, with_known
from strainfmu.estimator.map.sensors import readings_of_modes, vibration_ratio, with_vibration
from strainfmu.estimator.other_loads import OTHER_LOADS
from strainfmu.estimator.policies import LARGEST_USED_SCORE
from strainfmu.estimator.reference.air import air_inputs_of
from strainfmu.estimator.reference.linear import estimate as linear_estimate
from strainfmu.estimator.reference.readings import amplitudes, row_noise, rows_of
from strainfmu.estimator.settings import EstimatorSettings
from strainfmu.estimator.signal_names import TEMPERATURE, THRUST

Sample = Mapping[str, FloatArray]
"""Values of one sample by the names of a record."""


def surface_pressure(
    inverse_map: InverseMap, zeros: GaugeZeros, estimate: Estimate, places: Layout, with_std: bool
) -> PressureField:
    """Return pressure and standard deviation at every node of the map's surface, of one sample.

    ``places`` is the layout of the sample of ``estimate``; ``with_std`` false leaves the standard deviation NaN.

    Raises
    ------
    InputError
        The map holds no pressure field.
    """
    sample = {name: estimate.sample[place] for name, place in places.items()}
    strain_map, strain = _without_motion(inverse_map, zeros, estimate.sample[: inverse_map.n_gauges], sample)
    if strain_map.manifold is not None:
        return _of_tables(strain_map, strain_map.manifold, strain, estimate, sample, with_std)
    q, q_std = (float(sample[name][0]) for name in (DYNAMIC_PRESSURE, DYNAMIC_PRESSURE + STD))
    q_std = q_std if np.isfinite(q_std) else inverse_map.dynamic_pressure_error * q
    if not np.isfinite(estimate.coefficients).all():
        q, q_std = np.nan, 0.0
    return linear_pressure(strain_map, strain, estimate.valid, q, q_std, with_std)


def _of_tables(
    inverse_map: InverseMap,
    manifold: ManifoldMap,
    strain: FloatArray,
    estimate: Estimate,
    sample: Sample,
    with_std: bool,
) -> PressureField:
    """Return the absolute pressure of an estimate of a map with tables."""
    field, used = manifold.surface_field, estimate.valid
    if field is None:
        raise no_field()
    if not used.any():
        return unknown_field(field.n_nodes, is_net=False)
    state, covariance = estimate.state, estimate.state_covariance
    if not estimate.is_linear:
        tables, value, std = manifold, *_known_parameters(estimate, sample)
        if manifold.parameters is not None and isinstance(field, ShapeField) and np.isfinite(std).any():
            powers = manifold.parameters.powers
            if field.parameters is not None:
                tables = with_known(manifold, value, std)
                field = field_with_known(field, powers, value, std)
        return flight_pressure(
            manifold,
            tables,
            field,
            state=state,
            state_covariance=covariance,
            strain=strain,
            used=used,
            with_std=with_std,
        )
    inputs = air_inputs_of(inverse_map, {name: float(sample[name][0]) for name in AIR_INPUT_NAMES})
    (_, p, q), (_, p_std, q_std) = inputs.value, inputs.std
    q, q_std = inputs.of_loads if inputs.is_computed else (q, q_std)
    pressure = linear_pressure(inverse_map, strain, used, float(q), float(q_std), with_std)
    if not pressure.is_net:
        return pressure
    ambient, ambient_std = float(p), float(p_std)
    if not (estimate.air_data_used[1] and np.isfinite(ambient)):
        ambient = float(np.exp(state[LOG_PRESSURE]))
        ambient_std = ambient * float(np.sqrt(covariance[LOG_PRESSURE, LOG_PRESSURE]))
    return PressureField(
        pressure=pressure.pressure + ambient, std=np.hypot(pressure.std, ambient_std), is_net=False
    )


def _known_parameters(estimate: Estimate, sample: Sample) -> tuple[FloatArray, FloatArray]:
    """Return (n_p,) values and standard deviations of flow parameters, NaN where not known or far out of range."""
    value = sample["parameter"]
    std = sample.get("parameter_std", np.full(len(value), np.nan))
    known = np.isfinite(value) & np.isfinite(std) & (estimate.parameter_score <= LARGEST_USED_SCORE)
    return np.where(known, value, np.nan), np.where(known, std, np.nan)


def _without_motion(
    inverse_map: InverseMap, zeros: GaugeZeros, readings: FloatArray, sample: Sample
) -> tuple[InverseMap, FloatArray]:
    """Return the map with the noise of the sample, and its rows (n_d,) without temperature and inertia [m/m]."""
    amplitude, remaining = None, None
    inertial = {name: sample[name] for name in INERTIAL_NAMES if inverse_map.has_masses}
    theta, known = readings_of_modes(inverse_map.thermal, inverse_map.inertia, sample[TEMPERATURE][None], inertial)
    ratio = vibration_ratio(inverse_map.inertia, inertial.get(VIBRATION, np.full(1, np.nan)))[0]
    if known.any() or np.isfinite(ratio):
        modes = with_vibration(inverse_map.thermal_and_inertia, inverse_map.inertia, float(ratio))
        of_sensors = amplitudes(modes, theta, known[0])
        amplitude, remaining = of_sensors.mean, of_sensors.covariance[0]
    thrust = sample[THRUST] if sample[THRUST].size else np.zeros(1)
    rows = rows_of(inverse_map, readings[None], thrust, zeros, amplitude)[0]
    tables, of_map = inverse_map.manifold, inverse_map.gauge_covariance
    about_tables = of_map if tables is None else tables.gauge_covariance
    noise, of_tables = (row_noise(inverse_map, each, zeros, remaining) for each in (of_map, about_tables))
    return with_gauge_covariance(inverse_map, noise, of_tables), rows


_NAMES = ("other_loads", "other_loads_std", "other_coefficients", "other_coefficients_std")


def _std(covariance: FloatArray) -> FloatArray:
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def absolute_loads(
    inverse_map: InverseMap, zeros: GaugeZeros, settings: EstimatorSettings, estimate: Estimate, places: Layout
) -> dict[str, FloatArray]:
    """Return the loads behind the five of k samples by the field of an estimate, (k, n_f - 5).

    ``places`` is the layout of the samples of ``estimate``. All is NaN without valid sensors, coefficients also
    without q_inf.
    """
    record = np.atleast_2d(estimate.sample)
    thrust = record[:, places[THRUST]].sum(axis=1)  # of no column: 0
    known, solved = (
        np.asarray(np.isfinite(np.atleast_2d(values)).all(axis=1))
        for values in (estimate.coefficients, estimate.loads)
    )
    stated, pressure_std = (record[:, places[name].start] for name in (DYNAMIC_PRESSURE, DYNAMIC_PRESSURE + STD))
    valid = np.atleast_2d(estimate.valid) & solved[:, None]
    rows = rows_of(inverse_map, record[:, : inverse_map.n_gauges], thrust, zeros)
    noise = row_noise(inverse_map, inverse_map.gauge_covariance, zeros)
    known &= np.isfinite(stated)
    q = np.where(known, stated, 1.0)
    std = np.where(np.isnan(pressure_std), inverse_map.dynamic_pressure_error * q, pressure_std)
    lengths = np.where(inverse_map.is_moment[OTHER_LOADS], settings.reference_length, 1.0)
    scale = inverse_map.references[OTHER_LOADS] / (settings.reference_area * lengths)
    loads = {name: np.full((len(rows), len(scale)), np.nan) for name in _NAMES}
    masks, which = np.unique(valid, axis=0, return_inverse=True)
    for number, used in enumerate(masks):
        of_mask = np.flatnonzero(which.reshape(-1) == number)
        if not used.any():
            continue
        read = np.where(used, rows[of_mask], 0.0)
        fit = linear_estimate(inverse_map, read, used, q[of_mask], std[of_mask], noise)
        for name, value, turn in (
            ("other_loads", fit.loads, np.ones(1)),
            ("other_loads_std", _std(fit.covariance), np.ones(1)),
            (
                "other_coefficients",
                fit.coefficients,
                scale * np.where(known[of_mask], 1.0, np.nan)[:, None],
            ),
            ("other_coefficients_std", _std(fit.coefficient_covariance), scale),
        ):
            loads[name][of_mask] = turn * value[:, OTHER_LOADS]
    loads["other_coefficients_std"][~known] = np.nan
    return loads
