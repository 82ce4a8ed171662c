"""What is made of an estimate off the deadline: the pressure on the surface, and loads that the core lacks.

These are the loads behind the five of a linear map of form "absolute". The pressure follows from the flight state
of the core and its covariance, and from the sensors and air data that it used.

**Linear.** At the pressure ratio s = q_inf / q_nominal the states follow from (d - d_0) / s + d_0 - m = A q + e
with cov e = Gamma_g / s^2 + N N' and what errors in proportion to strain add at the strain. The pressure is
s (p_mean + V q), and the field that no state holds adds its standard deviation.

**Nonlinear.** With C the covariance with strain of pressure off the tables that the gain may correct:
p = p(x) + C S^-1 r, as the loads. The variance of a node with the derivative J_p by the state is

    (J_p - C S^-1 J) E_x (..)' + sigma_p^2 - C S^-1 C'.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import (
    AIR_INPUT_NAMES,
    DYNAMIC_PRESSURE,
    INERTIAL_NAMES,
    MEASURED_MOTION,
    NOT_KNOWN,
    STD,
    VIBRATION,
)
from strainfmu.estimator.core import Layout
from strainfmu.estimator.estimate import Estimate, PressureField
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, MIN_INCIDENCE, Response, U, W, evaluate
from strainfmu.estimator.map.inverse_map import InverseMap, with_gauge_covariance
from strainfmu.estimator.map.nonlinear_map import FlightField, ManifoldMap, ShapeField, with_known
from strainfmu.estimator.map.sensors import InertiaMap, ThermalMap
from strainfmu.estimator.numerics import local_basis
from strainfmu.estimator.other_loads import FIVE_LOADS, OTHER_LOADS
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.reference.air import air_inputs_of, lognormal_std
from strainfmu.estimator.reference.linear import estimate as linear_estimate
from strainfmu.estimator.reference.linear import excess_covariance
from strainfmu.estimator.reference.nonlinear import strain_covariance
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
        tables = manifold
        if isinstance(field, ShapeField) and field.parameters is not None:
            tables = with_known(manifold, *_known_parameters(estimate, sample))
        return flight_pressure(
            manifold,
            tables,
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
    known = np.isfinite(value) & np.isfinite(std) & (estimate.parameter_score <= POLICIES.largest_used_score)
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
    noise, of_tables = (row_noise(inverse_map, gamma, zeros, remaining) for gamma in (of_map, about_tables))
    return with_gauge_covariance(inverse_map, noise, of_tables), rows


LEAST_VIBRATION, MOST_VIBRATION, NO_VIBRATION = 0.0625, 1024.0, 1e-6
"""Vibration over its standard deviation in the map: what counts as none, and the largest; what stands for none."""


def channels_of(values: Mapping[str, FloatArray]) -> FloatArray:
    """Return the channels (m, k) of m samples of the inertial inputs by name, NaN where not known."""
    known = [
        np.where(values[name] == NOT_KNOWN, np.nan, values[name])
        for name in (item.name for item in MEASURED_MOTION)
    ]
    force, (x, y, z), turn = known[:3], known[3:6], known[6:]
    products = (-(y * y + z * z), -(x * x + z * z), -(x * x + y * y), x * y, x * z, y * z)
    return np.stack([*force, *turn, *products], axis=1)


def readings_of_modes(
    thermal: ThermalMap,
    inertia: InertiaMap | None,
    temperature: FloatArray,
    inertial: Mapping[str, FloatArray],
) -> tuple[FloatArray, BoolArray]:
    """Return readings (m, n_t + k) of :func:`with_inertia` of m samples, and which of them are known.

    ``temperature`` is (m, n_t) [K], ``inertial`` holds (m,) of each inertial input.
    """
    rise = temperature - thermal.reference_temperature
    known = (temperature > 0.0) & (np.abs(rise) <= POLICIES.largest_rise)
    if inertia is None:
        return temperature, known
    channels = channels_of(inertial)
    read = np.hstack([temperature, thermal.reference_temperature + channels])
    return read, np.hstack([known, np.abs(channels) <= POLICIES.largest_channel])


def vibration_ratio(inertia: InertiaMap | None, vibration: FloatArray) -> FloatArray:
    """Return (m,) the ``vibration`` (m,) [m/m] over the vibration of the map, as the covariance takes it.

    NaN where it is not known. It is the next larger power of the root of 2: matrices stay while the vibration
    changes little.
    """
    if inertia is None:
        return np.full(len(vibration), np.nan)
    known = np.isfinite(vibration) & (vibration >= 0.0)
    ratio = np.where(known, vibration, 0.0) / inertia.vibration_std
    step = np.ceil(2.0 * np.log2(np.clip(ratio, LEAST_VIBRATION, MOST_VIBRATION)) - 1e-12)
    return np.where(known, np.where(ratio <= LEAST_VIBRATION, NO_VIBRATION, 2.0 ** (0.5 * step)), np.nan)


def with_vibration(modes: ThermalMap, inertia: InertiaMap | None, ratio: float) -> ThermalMap:
    """Return the ``modes`` of :func:`with_inertia` whose vibration is ``ratio`` of the map's; NaN: as it is."""
    if inertia is None or np.isnan(ratio):
        return modes
    first = modes.n_modes - inertia.vibration_strain.shape[1]
    scale = np.where(np.arange(modes.n_modes) < first, 1.0, ratio)
    return replace(modes, prior_std=modes.prior_std * scale)


def _std(covariance: FloatArray) -> FloatArray:
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def absolute_loads(
    inverse_map: InverseMap, zeros: GaugeZeros, settings: EstimatorSettings, estimate: Estimate, places: Layout
) -> FloatArray:
    """Return (4, k, n_f - 5) loads behind the five of k samples by the field of an estimate, and their standard
    deviations, then coefficients and theirs.

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
    masks, which = np.unique(valid, axis=0, return_inverse=True)
    loads = np.full((4, len(rows), inverse_map.n_loads), np.nan)
    for number, used in enumerate(masks):
        of_mask = np.flatnonzero(which.reshape(-1) == number)
        if used.any():
            read = np.where(used, rows[of_mask], 0.0)
            fit = linear_estimate(inverse_map, read, used, q[of_mask], std[of_mask], noise)
            loads[0, of_mask], loads[1, of_mask] = fit.loads, _std(fit.covariance)
            loads[2, of_mask], loads[3, of_mask] = fit.coefficients, _std(fit.coefficient_covariance)
    lengths = np.where(inverse_map.is_moment, settings.reference_length, 1.0)
    loads[2:] *= inverse_map.references / (settings.reference_area * lengths)
    loads[2:, ~known] = np.nan
    return loads[:, :, OTHER_LOADS]


MIN_OF_EXCESS = 0.25
"""Least variance of a node relative to that at the mean strain: the linear model of the errors could give less."""

MIN_LEFT = 0.05
"""Least part of the variance of pressure off the tables that strain leaves: C holds its low harmonics alone."""


def unknown_field(n_nodes: int, is_net: bool) -> PressureField:
    """Return the pressure of a sample without an estimate: NaN at all ``n_nodes``."""
    return PressureField(pressure=np.full(n_nodes, np.nan), std=np.full(n_nodes, np.nan), is_net=is_net)


def no_field() -> InputError:
    """Return the error of a map without a pressure field."""
    return InputError("inverse map: holds no pressure field, expected one built with keep_field = true in [map]")


def linear_pressure(
    inverse_map: InverseMap,
    strain: FloatArray,
    valid: BoolArray,
    dynamic_pressure: float,
    dynamic_pressure_std: float,
    with_std: bool = True,
) -> PressureField:
    """Return the pressure of one sample of ``strain`` (n_d,) [m/m] by the linear map from the ``valid`` gauges.

    q_inf and its standard deviation [Pa] are NaN where not known. ``with_std`` false leaves the standard deviation
    of the pressure NaN.
    """
    if not inverse_map.has_field:
        raise no_field()
    scaled, is_net = inverse_map.follows_pressure, inverse_map.field_is_net
    ratio = dynamic_pressure / inverse_map.nominal_dynamic_pressure if scaled else 1.0
    few = inverse_map.case == 1 and np.count_nonzero(valid) < inverse_map.n_states
    if not ratio > 0.0 or few or not valid.any():
        return unknown_field(len(inverse_map.field_mean), is_net)
    fixed = inverse_map.fixed_strain
    data = (strain - fixed) / ratio + fixed - inverse_map.mean_strain
    of_all = inverse_map.gauge_covariance / ratio**2 + inverse_map.scaled_covariance
    noise, operator = of_all[np.ix_(valid, valid)], inverse_map.state_operator[valid]
    weighted = np.linalg.solve(noise, operator).T
    precision = weighted @ operator + inverse_map.regularisation * np.eye(operator.shape[1])
    gain = np.linalg.solve(precision, weighted)
    state = gain @ data[valid]
    mean, modes = inverse_map.field_mean.astype(float), inverse_map.field_modes.astype(float)
    pressure = ratio * (mean + modes @ state)
    if not with_std:
        return replace(unknown_field(len(mean), is_net), pressure=pressure)
    covariance = gain @ noise @ gain.T
    if inverse_map.case == 2:  # the prior
        unresolved = np.eye(len(gain)) - gain @ operator
        covariance = covariance + unresolved @ unresolved.T
    variance = np.einsum("pq,qr,pr->p", modes, covariance, modes, optimize=True)
    excess = gain @ _excess(inverse_map, state, valid) @ gain.T
    variance = np.maximum(
        variance + np.einsum("pq,qr,pr->p", modes, excess, modes, optimize=True), MIN_OF_EXCESS * variance
    )
    # The strain of the field that no state holds is in Case 1 part of the states' error: the sum bounds both.
    std, rest = np.sqrt(variance), inverse_map.field_std.astype(float)
    std = ratio * (std + rest if inverse_map.case == 1 else np.hypot(std, rest))
    if scaled:
        by_ratio = mean + modes @ (gain @ (inverse_map.fixed_strain - inverse_map.mean_strain)[valid])
        std = np.hypot(std, by_ratio * dynamic_pressure_std / inverse_map.nominal_dynamic_pressure)
    return PressureField(pressure=pressure, std=std, is_net=is_net)


def _excess(inverse_map: InverseMap, state: FloatArray, valid: BoolArray) -> FloatArray:
    """Return what errors in proportion to strain add to the covariance of the ``valid`` gauges at ``state``."""
    mean = inverse_map.load_of_mean - inverse_map.fixed_load
    loads = mean[FIVE_LOADS] + inverse_map.load_per_state[FIVE_LOADS] @ state
    coefficients = loads / (inverse_map.nominal_dynamic_pressure * inverse_map.references[FIVE_LOADS])
    return excess_covariance(inverse_map, coefficients[None])[0][np.ix_(valid, valid)]


def table_pressure(manifold: ManifoldMap, field: FlightField | ShapeField, state: FloatArray) -> Response:
    """Return the pressure (n_p,) [Pa] of the tables at ``state`` (4,), and its derivatives (n_p, 4)."""
    return (
        _of_shape(manifold, field, state) if isinstance(field, ShapeField) else _of_rings(manifold, field, state)
    )


def _of_shape(manifold: ManifoldMap, field: ShapeField, state: FloatArray) -> Response:
    fixed = np.zeros(field.modes.shape[1])
    tables = replace(manifold.tables, response=field.amplitude, fixed_response=fixed)
    value, jacobian = (field.modes @ part[0] for part in evaluate(tables, state[None]))
    pressure = float(np.exp(state[LOG_PRESSURE]))
    jacobian[:, LOG_PRESSURE] += pressure
    return Response(value + pressure, jacobian)


def _of_rings(manifold: ManifoldMap, field: FlightField, state: FloatArray) -> Response:
    u, w = float(state[U]), float(state[W])
    incidence = float(np.sqrt(u * u + w * w + MIN_INCIDENCE**2))
    at_mach = local_basis(manifold.mach_knots, state[MACH : MACH + 1])
    at_incidence = local_basis(manifold.incidence_knots, np.array([incidence]))
    (i,), (of_mach,), (by_mach_knots,) = at_mach
    (j,), (of_incidence,), (by_incidence_knots,) = at_incidence
    local = field.amplitude[i : i + 4, j : j + 4].astype(float)
    pairs = ((of_mach, of_incidence), (by_mach_knots, of_incidence), (of_mach, by_incidence_knots))
    amplitude, by_mach, by_incidence = (np.einsum("a,b,abxm->xm", a, b, local, optimize=True) for a, b in pairs)
    m = np.arange(local.shape[3])
    angle = np.outer(m, field.roll_angle - np.arctan2(w, u))
    cosine, sine = np.cos(angle), np.sin(angle)
    value = (amplitude @ cosine).ravel()
    along = (by_incidence @ cosine).ravel()
    turned = ((m * amplitude) @ sine).ravel() / incidence  # by phi_T, times its derivative 1/a_T
    jacobian = np.stack(
        [
            (by_mach @ cosine).ravel(),
            (u * along - w * turned) / incidence,
            (w * along + u * turned) / incidence,
            value,
        ],
        axis=1,
    )
    pressure = float(np.exp(state[LOG_PRESSURE]))
    return Response(pressure * value, pressure * jacobian)


def flight_pressure(
    manifold: ManifoldMap,
    tables: ManifoldMap,
    *,
    state: FloatArray,
    state_covariance: FloatArray,
    strain: FloatArray,
    used: BoolArray,
    with_std: bool = True,
) -> PressureField:
    """Return the pressure at an estimated flight state.

    Parameters
    ----------
    manifold, tables : the map's, with the noise of the sample; the second with what is known of parameters.
    state, state_covariance : (4,), (4, 4) of the estimate.
    strain, used : (n_d,) strain [m/m], and the gauges that the state follows from.
    with_std : false leaves the standard deviation NaN.
    """
    field, n_d = tables.surface_field, len(strain)
    assert field is not None
    table = table_pressure(manifold, field, state)
    value, by_state_of_rows = (part[0] for part in evaluate(tables.tables, state[None]))
    covariance = strain_covariance(tables, manifold.gauge_covariance, state[None], considered=False)[0]
    factor = np.linalg.cholesky(np.where(used[:, None] & used, covariance, np.eye(n_d)))
    residual = np.where(used, strain - value[:n_d], 0.0)
    jacobian = np.where(used[:, None], by_state_of_rows[:n_d], 0.0)
    whitened = np.linalg.solve(factor, np.column_stack([residual, jacobian]))
    pressure = float(np.exp(state[LOG_PRESSURE]))
    if not with_std:
        weights = np.asarray(np.linalg.solve(factor.T, whitened[:, 0]), dtype=float)
        correction = pressure * pressure * _corrected(field, used, weights)
        return replace(unknown_field(field.n_nodes, is_net=False), pressure=table.value + correction)
    gain = pressure * pressure * _turned(field, factor, used)
    by_state = table.jacobian - gain @ whitened[:, 1:]
    prior = pressure * pressure * _relative_variance(field, state)
    remaining = np.maximum(prior - np.einsum("pn,pn->p", gain, gain), MIN_LEFT * prior)
    # Errors of ln p_inf are normal; p_inf has a longer tail.
    of_log = float(np.sqrt(state_covariance[LOG_PRESSURE, LOG_PRESSURE]))
    wider = (float(lognormal_std(np.array(of_log))) / of_log) ** 2
    variance = wider * np.einsum("px,xy,py->p", by_state, state_covariance, by_state) + remaining
    return PressureField(pressure=table.value + gain @ whitened[:, 0], std=np.sqrt(variance), is_net=False)


def _corrected(field: FlightField | ShapeField, used: BoolArray, weights: FloatArray) -> FloatArray:
    """Return (n_p,) C times ``weights`` (n_d,)."""
    if isinstance(field, ShapeField):
        return np.asarray(field.strain_covariance[:, used].astype(float) @ weights[used])
    return np.asarray((_around(field) @ _of_stations(field, used, weights)).T.ravel())


def _relative_variance(field: FlightField | ShapeField, state: FloatArray) -> FloatArray:
    """Return (n_p,) variance of the pressure off the tables, per p_inf^2."""
    if isinstance(field, ShapeField):
        return field.error_std**2
    return np.asarray((field.error_std[:, None] ** 2 + _at_wind(field, state).astype(float) ** 2).ravel())


def _turned(field: FlightField | ShapeField, factor: FloatArray, used: BoolArray) -> FloatArray:
    """Return (n_p, n_d) C L'^-1 per p_inf^2, L (n_d, n_d) the Cholesky factor of S."""
    if isinstance(field, ShapeField):
        return np.asarray(np.linalg.solve(factor, np.where(used, field.strain_covariance, 0.0).T).T)
    n_x, n_h, _, n_d = field.strain_covariance.shape
    known = np.where(used, field.strain_covariance, 0.0).reshape(-1, n_d)
    whitened = np.linalg.solve(factor, known.T).T.reshape(n_x, 2 * n_h, n_d)
    return np.asarray((_around(field) @ whitened).reshape(-1, n_d))


def _of_stations(field: FlightField, used: BoolArray, weights: FloatArray) -> FloatArray:
    """Return (2 n_h, n_x) amplitudes of C times ``weights`` (n_d,)."""
    known = field.strain_covariance[..., used].astype(float) @ weights[used]
    return np.asarray(known.reshape(len(known), -1).T)


def _around(field: FlightField) -> FloatArray:
    """Return (n_roll, 2 n_h) cosines and sines round the body."""
    angle = np.outer(field.roll_angle, np.arange(field.strain_covariance.shape[1]))
    return np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(len(angle), -1)


def _at_wind(field: FlightField, state: FloatArray) -> FloatArray:
    """Return (n_x, n_roll) the error of the tables at the nodes, with the leeward meridian where ``state`` has
    it."""
    n_roll = len(field.roll_angle)
    place = ((field.roll_angle - np.arctan2(state[W], state[U])) * n_roll / (2.0 * np.pi)) % n_roll
    below = np.floor(place).astype(np.int64) % n_roll
    above = (below + 1) % n_roll
    return np.maximum(field.table_error_std[:, below], field.table_error_std[:, above])
