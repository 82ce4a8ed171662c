"""The tables and errors of the nonlinear estimator, from the problem of an inverse map.

Hardware errors follow the flight state. The estimator holds the variance of the error of each gauge as c' Q c, c =
[1, C_A, C_N, C_Y, M_P, M_Y], see :class:`~strainfmu.estimator.map.nonlinear_map.ManifoldMap`. The strain of an
error is regressed on c. What is left, above all of hoop gauges shifted round the body next to the leeward
meridian, grows with the square of the incidence and depends on where the wind comes from: its square is fitted by
squares of combinations of c.

Of auxiliary sensors the surface pressure's part is a row of the tables as strain is. Base pressure adds to an
axial force in proportion to p_inf, friction in proportion to q_inf = gamma M^2 p_inf / 2: both are exact in the
splines.

Tables whose gauges read two winds alike are refused. Gauges in one plane through the axis read the same of a wind
and of its mirror image: strain has two solutions, and the covariance of one knows nothing of the other.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import nnls

from builder.aero.load_groups import Surface
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.ensemble import Ensemble, rolled_modes
from builder.inverse.noise.error_list import PROCESS, SPREAD, by_role, error_named, record_of
from builder.inverse.noise.flow_models import FLOW_MODELS, LEEWARD_PRESSURE, LEVEL
from builder.inverse.noise.hardware_errors import HardwareError
from builder.inverse.noise.model import NoiseTerm, fixed_covariance
from builder.inverse.problem import AnyStructure, inverse_problem
from builder.inverse.sensor_set import base_area
from builder.inverse.solution import Problem, with_flow_models
from builder.manifold.discrepancy import process_size, tested_shapes
from builder.manifold.parameter_slopes import FLOW_PARAMETERS, ParameterSlopes, compressed
from builder.manifold.state_tables import StateTables, state_tables
from builder.structure.as_built_kinds import Role
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, pressure_and_temperature
from strainfmu.errors import InputError
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, U, W, evaluate
from strainfmu.estimator.map.inverse_map import PAIRS, InverseMap
from strainfmu.estimator.map.nonlinear_map import FlightField, ManifoldMap, ParameterTables, ShapeField
from strainfmu.estimator.numerics import DEGREE, padded_knots
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.nonlinear import strain_covariance


def with_base_and_friction(problem: Problem, mach_knots: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Return ``coefficients`` (n_M + 2, n_a + 2, n, n_m, 2), base pressure and friction in the sensors' rows."""
    sensors, entry = problem.sensors, problem.stated_sensors
    if sensors is None or entry is None:
        return coefficients
    padded = padded_knots(mach_knots)
    first, second, third = (padded[i : len(mach_knots) + 2 + i] for i in range(1, DEGREE + 1))
    square = (first * second + second * third + first * third) / 3.0  # coefficients of M^2, by its polar form
    area = problem.reference.area
    of_base = base_area(entry, problem.reference) * (1.0 - entry.base_pressure_ratio)
    force = of_base + 0.5 * HEAT_CAPACITY_RATIO * square * area * entry.friction_C_A
    rows, n_d = sensors.per_axial_force, len(problem.strain_operator)
    out = coefficients.copy()
    # B-splines add up to 1: the same coefficient at every incidence is a constant.
    out[:, :, n_d - len(rows) : n_d, 0, 0] += np.outer(force, rows)[:, None]
    return out


def base_pressure_error(problem: Problem, n: int) -> dict[str, FloatArray]:
    """Return the column (n, 1) per p_inf of the base pressure's error by name, none where it moves no reading.

    The pressure level is part of the flight state: of the linear map's term, its spread is left out.
    """
    sensors, entry = problem.sensors, problem.stated_sensors
    if sensors is None or entry is None:
        return {}
    column = np.zeros((n, 1))
    n_d, area = len(problem.strain_operator), base_area(entry, problem.reference)
    column[n_d - len(sensors.rows) : n_d, 0] = 0.01 * entry.base_pressure_percent * area * sensors.per_axial_force
    return {"base pressure": column} if column.any() else {}


def friction_error(problem: Problem) -> list[HardwareError]:
    """Return the error of friction, which grows with q_inf, over the members of the ensemble; none where it moves
    no reading."""
    sensors, entry, ensemble = problem.sensors, problem.stated_sensors, problem.ensemble
    if sensors is None or entry is None:
        return []
    n_d = len(problem.strain_operator)
    reading = np.zeros(n_d)
    area = problem.reference.area
    size = entry.friction_C_A_std * ensemble.nominal_dynamic_pressure * area
    reading[n_d - len(sensors.rows) :] = size * sensors.per_axial_force
    if not reading.any():
        return []
    of_member = np.tile(reading, (len(ensemble.member_weight), 1))
    return [HardwareError(name="friction", strain=of_member, common=True, with_rest=True)]


def gains_of_sensors(problem: Problem) -> dict[str, Any]:
    """Return a map's fields that hold errors of the sensors' gains: their own, and that shared with gauges."""
    if problem.sensors is None:
        return {}
    rows = problem.sensors.rows
    shared = np.array(["common gain" in row.shared for row in rows])
    return {
        "sensor_gain_std": np.array([row.gain for row in rows]),
        "sensor_common_gain_std": np.where(shared, 0.01 * problem.tolerances.common_gain_percent, 0.0),
    }


ROLLS = 24
"""Roll angles of the wind that are compared."""

APART = np.radians(45.0)
"""Smallest difference of two roll angles that counts."""

DISTINGUISHED, LINEAR_EXCESS = 9.0, 25.0
"""Square of the distance in strain, in standard deviations, from which two winds are distinguished, and by how
much more the linearised problem, from which the sigmas of the estimate follow, may have between them."""


def check_told_apart(manifold: ManifoldMap) -> None:
    """Refuse tables with winds that gauges read alike, far apart though they are by the estimate's own sigmas.

    Raises
    ------
    InputError
        Names two such winds, in the middle of the ranges.
    """
    angles = winds_read_alike(manifold)
    if angles is not None:
        first, second = (round(float(np.degrees(angle))) for angle in angles)
        raise InputError(
            f"gauges: expected some off one plane through the axis for the nonlinear estimator, got wind at roll "
            f"angle {first} deg and at {second} deg that strain all of them alike; or map.estimator = 'linear'"
        )


def winds_read_alike(manifold: ManifoldMap) -> tuple[float, float] | None:
    """Return the roll angles [rad] of two winds that gauges do not distinguish, where the linearised problem does.

    They are those that it has farthest apart, None where there are none.
    """
    n_d = manifold.n_gauges
    roll = 2.0 * np.pi * np.arange(ROLLS) / ROLLS
    middle, half = manifold.crossflow
    state = np.zeros((ROLLS, N_STATES))
    state[:, MACH], state[:, LOG_PRESSURE] = manifold.mach_range.mean(), np.log(manifold.pressure_range).mean()
    state[:, U], state[:, W] = (
        centre + 0.5 * size * wave
        for centre, size, wave in zip(middle, half, (np.cos(roll), np.sin(roll)), strict=True)
    )
    response = evaluate(manifold.tables, state)
    factors = np.linalg.cholesky(strain_covariance(manifold, manifold.gauge_covariance, state))
    far = np.abs(np.angle(np.exp(1j * (roll[:, None] - roll)))) >= APART
    worst, pair = 0.0, None
    for i, factor in enumerate(factors):
        strain = np.linalg.solve(factor, (response.value[:, :n_d] - response.value[i, :n_d]).T)
        slope = np.linalg.solve(factor, response.jacobian[i, :n_d])
        distance, linear = np.sum(strain**2, axis=0), np.sum((slope @ (state - state[i]).T) ** 2, axis=0)
        alike = far[i] & (distance < DISTINGUISHED) & (linear - distance > LINEAR_EXCESS)
        j = int(np.argmax(np.where(alike, linear - distance, 0.0)))
        if alike[j] and linear[j] - distance[j] > worst:
            worst, pair = float(linear[j] - distance[j]), (float(roll[min(i, j)]), float(roll[max(i, j)]))
    return pair


GAINS = ("gauge gain", "common gain", "sensor gain")
"""Errors in proportion to the reading itself."""

DIRECTIONS = 12
"""Roll angles of the combinations that look into one direction."""

_FIRST, _SECOND = np.array(PAIRS).T
_TWICE = np.where(_FIRST == _SECOND, 1.0, 2.0)


class FollowedError(NamedTuple):
    """An error that follows strain: its slopes (6, n_d) over 1 and the loads, and its rest (n, n_d), per p_inf."""

    error: HardwareError
    slope: FloatArray
    rest: FloatArray


def errors_over_loads(problem: Problem) -> tuple[FloatArray, list[FollowedError]]:
    """Return 1 and the five loads over p_inf S (L) of the members (n, 6), and each error over them.

    That is by least squares. Gains, which have fields of their own in a map, are left out.
    """
    reference, ensemble = problem.reference, problem.ensemble
    scale = reference.area * np.array([1.0, 1.0, 1.0, reference.length, reference.length])
    pressure = np.tile(ensemble.ambient_pressure, ensemble.rolls)[:, None]
    loads = ensemble.responses(problem.load_operator[FIVE_LOADS]) / pressure / scale
    c = np.hstack([np.ones((len(loads), 1)), loads])
    root, followed = np.sqrt(ensemble.member_weight)[:, None], []
    for error in [*problem.errors, *friction_error(problem)]:
        if error.name in GAINS:
            continue
        strain = error.strain / pressure
        slope = np.linalg.lstsq(root * c, root * strain, rcond=1e-10)[0]
        followed.append(FollowedError(error, slope, strain - c @ slope))
    return c, followed


def followed_errors(problem: Problem) -> dict[str, Any]:
    """Return a map's fields of errors that follow strain, but for gains: of each gauge (21, n_d), and common ones
    (n_t, 6, n_d) that are estimated and considered."""
    n_d, (c, followed) = len(problem.strain_operator), errors_over_loads(problem)
    products, square = np.zeros((len(PAIRS), n_d)), np.zeros((len(c), n_d))
    common: dict[Role, list[FloatArray]] = {"estimated": [], "considered": []}
    for error, slope, rest in followed:
        if not error.common or error.with_rest:
            square += rest**2
        if error.common:
            common[error_named(error.name).role].append(slope)
            continue
        products += _TWICE[:, None] * slope[_FIRST] * slope[_SECOND]
    estimated, considered = (np.array(slopes).reshape(-1, 6, n_d) for slopes in common.values())
    return {
        "gauge_error_product": products + squares_fitted(c, square, problem.ensemble.member_weight),
        "common_error": estimated,
        "considered_common": considered,
    }


def squares_fitted(c: FloatArray, square: FloatArray, weight: FloatArray) -> FloatArray:
    """Return (21, n_d) products whose quadratic form in ``c`` (n, 6) fits ``square`` (n, n_d), and is nowhere
    negative.

    The form is a sum of squares of combinations of c, with factors by non-negative least squares of ``weight``
    (n,).
    """
    combinations = _combinations(c)
    root = np.sqrt(weight)[:, None]
    size = np.maximum(square.max(axis=0), 1e-300)
    of_combination = (c @ combinations.T) ** 2
    # The triangular factor stands for all members: the same least squares, at a fraction of the size.
    basis, triangle = np.linalg.qr(root * of_combination)
    target = basis.T @ (root * square / size)
    factor = np.array([nnls(triangle, column)[0] for column in target.T]).T * size
    return np.asarray((_TWICE[:, None] * (combinations[:, _FIRST] * combinations[:, _SECOND]).T) @ factor)


def _combinations(c: FloatArray) -> FloatArray:
    """Return (k, 6) combinations of ``c`` (n, 6): the mean, what C_A rises by, forces and moments across into all
    directions, and sums of these with the rise of C_A."""
    rise = np.zeros(len(PAIRS[:6]))
    low, high = c[:, 1].min(), c[:, 1].max()
    rise[:2] = np.array([-low, 1.0]) / (high - low) if high > low else 0.0
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    directions = [np.eye(6)[0], rise]
    for first in (2, 4):
        largest = np.hypot(c[:, first], c[:, first + 1]).max()
        across = np.zeros((DIRECTIONS, 6))
        if largest > 0.0:
            across[:, first], across[:, first + 1] = np.cos(angle) / largest, np.sin(angle) / largest
        directions += [*across[: DIRECTIONS // 2], *(across + rise)]
    return np.array(directions)


def with_manifold(
    inverse_map: InverseMap | None,
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    nuisance: Sequence[NoiseTerm] = (),
    problem: Problem | None = None,
) -> InverseMap:
    """Return ``inverse_map`` with the tables of the nonlinear estimator, made from the same inputs.

    ``nuisance`` holds the other noise terms of the map, ``problem`` what it was solved from where it is known.
    The linear map stands in where strain does not fit the tables: it expects the difference of flow models, too.
    It is built here where flow models differ, or where ``inverse_map`` is None.

    Raises
    ------
    InputError
        The flows do not suffice for tables, or the gauges do not distinguish the sides of the wind.
    """
    problem = problem or inverse_problem(vehicle, snapshots, structure, nuisance)
    if problem.flow_models or inverse_map is None:
        inverse_map = build_inverse_map(vehicle, snapshots, structure, nuisance, with_flow_models(problem))
    manifold, terms = manifold_map(problem, structure.surface, nuisance)
    provenance = {**inverse_map.provenance, "table_error_terms": terms}
    return replace(inverse_map, manifold=manifold, provenance=provenance)


def manifold_map(
    problem: Problem, surface: Surface, nuisance: Sequence[NoiseTerm] = ()
) -> tuple[ManifoldMap, list[dict[str, Any]]]:
    """Return the tables and errors of ``problem``, and what pressure off the tables strains, term by term.

    ``surface`` is its structure's, ``nuisance`` holds the other noise terms of the map.

    Raises
    ------
    InputError
        As :func:`with_manifold`.
    """
    operator = _operator(problem)
    inside = problem.inside
    fixed = np.zeros(len(operator)) if inside == "ambient" else -float(inside) * operator.sum(axis=1)
    tables, terms = tables_and_errors(problem, surface, nuisance)
    n_d = len(problem.strain_operator)
    coefficients = with_base_and_friction(problem, tables.mach_knots, tables.coefficients)
    estimated, considered = map(compressed, by_role(terms, problem.sensors is not None))
    reference, noise = problem.reference, problem.tolerances
    low, high = (1e3 * height for height in problem.entry.valid_altitude_km)
    made = ManifoldMap(
        mach_knots=tables.mach_knots,
        incidence_knots=tables.incidence_knots,
        response=coefficients,
        fixed_response=fixed,
        gauge_covariance=fixed_covariance(problem.noise),
        error_strain=estimated[:n_d],
        error_load=estimated[n_d:],
        considered_strain=considered[:n_d],
        considered_load=considered[n_d:],
        gauge_gain_std=0.01 * noise.gauge_gain_percent,
        common_gain_std=0.01 * noise.common_gain_percent,
        **gains_of_sensors(problem),
        **followed_errors(problem),
        reference_area=reference.area,
        reference_length=reference.length,
        mach_range=tables.mach_knots[[0, -1]],
        pressure_range=np.array([pressure_and_temperature(high)[0], pressure_and_temperature(low)[0]]),
        incidence_limit=tables.incidence_limit,
        crossflow_range=tables.crossflow_range,
        considered_response=tables.considered,
        mach_number_error=noise.navigation_mach_number,
        static_pressure_error=0.01 * noise.navigation_static_pressure_percent,
        dynamic_pressure_error=0.01 * noise.dynamic_pressure_percent,
        altitude_error=0.01 * noise.standard_atmosphere_percent,
        pressure_field=tables.field if isinstance(tables.field, FlightField) else None,
        shape_field=tables.field if isinstance(tables.field, ShapeField) else None,
        parameters=_parameters(tables.slopes, terms, problem.sensors is not None),
    )
    check_told_apart(made)
    made = replace(made, discrepancy_shapes=tested_shapes(made))
    n_g = n_d if problem.sensors is None else n_d - len(problem.sensors.rows)
    pressure = problem.ensemble.mean_ambient_pressure
    for term in problem.flow_models:
        if term.name == FLOW_MODELS:
            terms[term.name] = term.strain_and_load(len(problem.load_operator)) / pressure
    return made, _terms_of(problem, terms, n_g)


def tables_and_errors(
    problem: Problem, surface: Surface, nuisance: Sequence[NoiseTerm] = ()
) -> tuple[StateTables, dict[str, FloatArray]]:
    """Return the tables of strains and loads of ``problem``, and columns (n_d + n_f, k) per p_inf of their errors.

    Errors are by name, their squares add up to the mean one; arguments as of :func:`manifold_map`.

    Raises
    ------
    InputError
        The flows do not suffice for tables.
    """
    operator = _operator(problem)
    tables = state_tables(problem, surface, operator)
    terms = tables.errors | _scaled_errors(problem, tables.process, operator)
    terms |= _scaled_nuisance(nuisance, problem) | base_pressure_error(problem, len(operator))
    if problem.leeward is not None:
        terms[LEEWARD_PRESSURE] = operator @ problem.leeward.T / problem.ensemble.mean_ambient_pressure
    level = problem.model_form.of_overpressure
    if level > 0.0:
        terms[LEVEL] = level * (operator @ tables.overpressure)[:, None]
    return tables, terms


def _operator(problem: Problem) -> FloatArray:
    """Return (n_d + n_f, n_p) strains [1/Pa] and loads [m2, m3] per pressure."""
    return np.vstack([problem.strain_operator, problem.load_operator])


def _parameters(
    slopes: ParameterSlopes | None, terms: dict[str, FloatArray], is_measured: bool
) -> ParameterTables | None:
    """Return ``slopes`` with the errors that are left where all parameters are known."""
    if slopes is None:
        return None
    error_columns = by_role(
        {name: columns for name, columns in terms.items() if name != FLOW_PARAMETERS}, is_measured
    )[0]
    unit, spread = slopes.compressed_errors()
    return ParameterTables(
        powers=slopes.powers,
        slope=slopes.slope,
        unit_error=unit,
        spread_error=spread,
        error=compressed(error_columns),
    )


def _terms_of(problem: Problem, terms: dict[str, FloatArray], n_gauges: int) -> list[dict[str, Any]]:
    """Return name and rms strain over the gauges [m/m] of each of ``terms``, at the mean p_inf of the flows."""
    pressure, is_measured = problem.ensemble.mean_ambient_pressure, problem.stated_sensors is not None
    sections = {"map": problem.entry, "noise": problem.tolerances}
    return [
        {
            **record_of(name, sections, problem.model_form, is_measured),
            "rms_strain": pressure * float(np.sqrt(np.sum(columns[:n_gauges] ** 2) / n_gauges)),
        }
        for name, columns in terms.items()
    ]


def _scaled_errors(problem: Problem, process: FloatArray, operator: FloatArray) -> dict[str, FloatArray]:
    """Return columns (n_d + n_f, k) per p_inf: pressure off the tables and the internal pressure, by name.

    ``process`` (n_d + n_f, k) is the response to the Gaussian process at unit variance.
    """
    noise, columns_of = problem.tolerances, {}
    of_prior = problem.model_form.of_prior
    size = process_size(problem)
    if size > 0.0:
        columns_of[PROCESS] = size * process
    if of_prior > 0.0:
        spread = _spread_of_flows(problem.ensemble, operator)
        columns_of[SPREAD] = of_prior * spread
    if noise.internal_pressure_percent > 0.0:
        column = 0.01 * noise.internal_pressure_percent * operator.sum(axis=1)
        n_d = len(problem.strain_operator)
        column[n_d:] = 0.0  # loads are those of the stated internal pressure
        if problem.sensors is not None:
            follows = np.array([row.follows_inside for row in problem.sensors.rows])
            column[n_d - len(follows) : n_d] *= follows
        columns_of["internal pressure"] = column[:, None]
    return columns_of


def _spread_of_flows(ensemble: Ensemble, operator: FloatArray) -> FloatArray:
    """Return columns (n, k) of the responses' difference from their mean over the flows, per p_inf."""
    pressure = ensemble.mean_ambient_pressure
    if ensemble.grid is None:
        response, weight = ensemble.responses(operator), ensemble.member_weight
        return np.asarray((np.sqrt(weight)[:, None] * (response - weight @ response)).T / pressure)
    modes = rolled_modes(ensemble, None)
    return np.asarray(operator @ (modes.modes * modes.coefficient_std) / pressure)


def _scaled_nuisance(nuisance: Sequence[NoiseTerm], problem: Problem) -> dict[str, FloatArray]:
    """Return columns (n_d + n_f, k) per p_inf of the other terms that scale, by name."""
    ensemble = problem.ensemble
    pressure = ensemble.mean_ambient_pressure
    columns_of = {}
    for term in nuisance:
        if term.scales:
            # Terms are those of the gauges: they have no part in auxiliary sensors.
            of_rows = term.padded(0, len(problem.strain_operator) - len(term.strain))
            columns_of[term.name] = of_rows.strain_and_load(len(problem.load_operator)) / pressure
    return columns_of
