"""Candidate gauges at flight states: what each reads of the unknowns there, and the coefficients as goals.

The models are as in the estimators, about flight states that are taken for known. Nonlinear: unknowns are
the flight state within air data and ranges, and pressure off the tables. Linear: the states of the map and
truncated modes, errors averaged over the flows. Errors of the vehicle and its gauges are the errors of the section
[noise]: what each gauge has on its own is noise of its row, what gauges have in common is an unknown.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from builder.aero.load_operator import coefficient_scale, load_operator_on
from builder.aero.surface.mesh import mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.ensemble import Ensemble, rolled_modes
from builder.inverse.noise.flow_models import leeward_fields
from builder.inverse.noise.flows_between import SolvedFlows
from builder.inverse.noise.hardware_errors import rms_ambient_pressure
from builder.inverse.problem import AnyStructure, errors_of_flows, gauge_noise_covariance, inverse_problem
from builder.inverse.solution import Problem, mode_choice
from builder.manifold.nonlinear_build import tables_and_errors
from builder.placement.candidate_strain import CandidateStrain
from builder.placement.gaussian_model import GaussianModel
from builder.placement.pressure_basis import CountedSensors, PressureBasis
from builder.structure.as_built_kinds import KINDS
from builder.vehicle.file import Vehicle
from builder.vehicle.model_form import model_form
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, pressure_and_temperature
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, FlightTables, U, W, evaluate
from strainfmu.linear.pressure_modes import PressureModes, proper_orthogonal_decomposition

Kind = Literal["linear", "nonlinear"]

STATES = 24
"""Flight states that the criterion is averaged over."""

GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
"""Angle by which the aerodynamic roll angle of one state is ahead of the last [rad]."""

FAINT = 0.02
"""Strain of an unknown in a typical gauge, over its noise, below which it counts as noise of its own."""

FREE = 1e3
"""Standard deviation of a state of Case 1, which has no prior, over the one that it has in the flows."""

FIELD_GOALS = 40
"""Combinations of the pressure that stand for the field as a goal."""

PROBES = 400
"""Candidates that stand for all where unknowns are ordered by what gauges see of them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightParts:
    """What models of candidates are made from.

    Attributes
    ----------
    vehicle, flows, ensemble : the vehicle, its flows, and these as the map uses them.
    structure : whose nodes the snapshots are on.
    basis : of pressure.
    noise_std : of a gauge [m/m].
    sensors : auxiliary sensors that count, None without any.
    """

    vehicle: Vehicle
    flows: SolvedFlows
    ensemble: Ensemble
    structure: AnyStructure
    basis: PressureBasis
    noise_std: float
    sensors: CountedSensors | None = None

    @property
    def loads(self) -> FloatArray:
        """(5, n_p) load operator [m2, m3]."""
        station = self.vehicle.reference_quantities().moment_station
        return load_operator_on(self.structure.surface, station)


@dataclass(frozen=True, eq=False, kw_only=True)
class _State:
    """One flight state: what its rows are made of.

    Attributes
    ----------
    unknowns : (K, m) of the basis per unknown at one standard deviation [Pa].
    inside : (K, 1) of the basis for the pressure inside the body at one standard deviation [Pa].
    goals : (n_g, m) coefficients per unknown.
    fixed : (n_g,) variance of the coefficients that no gauge lowers.
    pressure_root : (K, k) pressure that errors in proportion to strain follow: a root of its second moment [Pa].
    rest : (K, K) covariance of unknowns that count as noise [Pa^2].
    state : (4, 4) flight state per its own unknowns, the first ones; (0, 0) of the linear estimator.
    """

    unknowns: FloatArray
    inside: FloatArray
    goals: FloatArray
    fixed: FloatArray
    pressure_root: FloatArray
    rest: FloatArray
    state: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


def flight_model(parts: FlightParts, strain: CandidateStrain, sites: IntArray, kind: Kind) -> GaussianModel:
    """Return the model of candidates at ``sites`` (n_a, b) for the estimator ``kind``; goals are the coefficients.

    Raises
    ------
    InputError
        The flows do not suffice for tables.
    """
    states = _states(parts, strain, kind)
    rows = [_rows(parts, strain, state) for state in states]
    known = [_sensor_rows(parts, strain, state) for state in states]
    m = rows[0].shape[1]
    goals = [np.pad(state.goals, ((0, 0), (0, m - state.goals.shape[1]))) for state in states]
    fixed = [state.fixed for state in states]
    if kind == "linear":
        visible = _seen(rows[0], known[0])
        rows[0], known[0] = _without_faint(rows[0], visible), _without_faint(known[0], visible)
        of_goals = goals[0] @ visible
        fixed[0] = fixed[0] + np.maximum(_square(goals[0]) - _square(of_goals), 0.0)
        goals[0], m = of_goals, visible.shape[1]
    return GaussianModel(
        rows=_at_sites(np.stack(rows), sites),
        precision=np.stack([np.eye(m) + rows_known.T @ rows_known for rows_known in known]),
        goals=np.stack(goals),
        fixed=np.stack(fixed),
        weight=np.full(len(states), 1.0 / len(states)),
    )


def _states(parts: FlightParts, strain: CandidateStrain, kind: Kind) -> list[_State]:
    """Return the flight states of the estimator ``kind``, their unknowns ordered by what sensors see of them."""
    probe = strain.strain[:: max(1, len(strain.strain) // PROBES)]
    readings = [probe / np.sqrt(len(probe))]
    if parts.sensors is not None:
        readings.append(parts.noise_std * parts.sensors.reading)
    triangle = np.asarray(np.linalg.qr(np.vstack(readings), mode="r"))
    return _linear(parts, triangle) if kind == "linear" else _nonlinear(parts, triangle)


def _without_faint(rows: FloatArray, visible: FloatArray) -> FloatArray:
    """Return rows (n, k) of the combinations ``visible`` (m, k) of unknowns.

    What ``rows`` (n, m) see of others is noise.
    """
    short = rows @ visible
    faint = np.maximum(_square(rows) - _square(short), 0.0)
    return np.asarray(short / np.sqrt(1.0 + faint)[:, None])


def _seen(rows: FloatArray, known: FloatArray) -> FloatArray:
    """Return orthonormal columns (m, k): combinations of unknowns that candidates or auxiliary sensors see."""
    probe = rows[:: max(1, len(rows) // PROBES)]
    _, size, right = np.linalg.svd(np.vstack([probe / np.sqrt(len(probe)), known]), full_matrices=False)
    return np.asarray(right[size > FAINT].T)


def _at_sites(rows: FloatArray, sites: IntArray) -> FloatArray:
    """Return (n_s, n_a, b, m) rows of the gauges of each site, zero where it has none."""
    at_sites = rows[:, np.maximum(sites, 0)]
    at_sites[:, sites < 0] = 0.0
    return at_sites


def _rows(parts: FlightParts, strain: CandidateStrain, state: _State) -> FloatArray:
    """Return (n, m) rows of all candidates over the noise of each: unknowns of the flow, then common errors."""
    entry, root = parts.vehicle.noise, state.pressure_root
    reading = strain.strain @ root
    variance = parts.noise_std**2 + _square(KINDS["gauge_gain"].std(entry) * reading)
    for name, operator in (
        ("axial_shift", strain.axial),
        ("circumferential_shift", strain.circumferential),
        ("orientation", strain.orientation),
    ):
        variance += _square(KINDS[name].std(entry) * (operator @ root))
    variance += np.einsum("nk,kl,nl->n", strain.strain, state.rest, strain.strain, optimize=True)
    common = [
        KINDS["common_gain"].std(entry) * reading,
        KINDS["layout_roll"].std(entry) * (strain.layout_roll @ root),
        KINDS["wall_thickness"].std(entry) * (strain.wall_thickness @ root),
        np.full((len(reading), 1), KINDS["apparent_strain"].std(entry)),
        strain.thermal,
    ]
    of_sensors = np.zeros((len(reading), _n_sensor_errors(parts, root)))
    columns = np.hstack([strain.strain @ state.unknowns, strain.strain @ state.inside, *common, of_sensors])
    return np.asarray(columns / np.sqrt(variance)[:, None])


def _n_sensor_errors(parts: FlightParts, root: FloatArray) -> int:
    """Return the number of unknowns that only auxiliary sensors have in common."""
    sensors = parts.sensors
    return 0 if sensors is None else len(sensors.common) * root.shape[1] + sensors.drift.shape[1]


def _sensor_rows(parts: FlightParts, strain: CandidateStrain, state: _State) -> FloatArray:
    """Return (n, m) rows of the auxiliary sensors over the noise of each, of the unknowns of :func:`_rows`."""
    sensors, root = parts.sensors, state.pressure_root
    of_gauges = 3 * root.shape[1] + 1 + strain.thermal.shape[1]
    if sensors is None:
        return np.zeros((0, state.unknowns.shape[1] + 1 + of_gauges))
    variance = 1.0 + _square(sensors.gain[:, None] * (sensors.reading @ root))
    variance += np.einsum("nk,kl,nl->n", sensors.reading, state.rest, sensors.reading, optimize=True)
    inside = sensors.against_inside[:, None] * (sensors.reading @ state.inside)
    columns = np.hstack(
        [
            sensors.reading @ state.unknowns,
            inside,
            np.zeros((len(inside), of_gauges)),
            *(operator @ root for operator in sensors.common),
            sensors.drift,
        ]
    )
    return np.asarray(columns / np.sqrt(variance)[:, None])


def _square(columns: FloatArray) -> FloatArray:
    return np.asarray(np.sum(columns * columns, axis=1))


def _parted(
    columns: FloatArray, goals: FloatArray, triangle: FloatArray, noise_std: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return unknowns that gauges see (K, m), their goals (n_g, m), and of the others fixed (n_g,), rest (K, K).

    ``columns`` (K, k) are turned to combinations ordered by their strain; faint ones count as noise and, in the
    goals, as variance that no gauge lowers.
    """
    if columns.shape[1] > len(columns) + len(goals):
        upper = np.asarray(np.linalg.qr(np.vstack([columns, goals]).T, mode="r")).T
        columns, goals = upper[: len(columns)], upper[len(columns) :]
    _, size, right = np.linalg.svd(triangle @ columns / noise_std, full_matrices=True)
    is_visible = np.zeros(len(right), dtype=bool)
    is_visible[: len(size)] = size > FAINT
    visible, unseen = right[is_visible].T, right[~is_visible].T
    faint = columns @ unseen
    return columns @ visible, goals @ visible, np.sum((goals @ unseen) ** 2, axis=1), faint @ faint.T


def flight_states(parts: FlightParts) -> FloatArray:
    """Return (n_s, 4) flight states of the flows, even in incidence and Mach number; all round where these are."""
    ensemble = parts.ensemble
    conditions = sorted(ensemble.conditions, key=lambda flow: (round(flow.total_incidence, 9), flow.mach_number))
    count = min(STATES, len(conditions)) if ensemble.grid is None else STATES
    chosen = np.round(np.linspace(0, len(conditions) - 1, count)).astype(int)
    states = np.empty((count, N_STATES))
    for number, row in enumerate(chosen.tolist()):
        flow = conditions[row]
        roll = flow.leeward_roll_angle if ensemble.grid is None else number * GOLDEN
        states[number, MACH], states[number, LOG_PRESSURE] = flow.mach_number, np.log(flow.ambient_pressure)
        states[number, U], states[number, W] = (
            flow.total_incidence * np.cos(roll),
            flow.total_incidence * np.sin(roll),
        )
    return states


def _nonlinear(parts: FlightParts, triangle: FloatArray) -> list[_State]:
    vehicle, basis, n_k = parts.vehicle, parts.basis.fields.T, parts.basis.fields.shape[1]
    ensemble, sizes = parts.ensemble, model_form(vehicle.map, vehicle.noise)
    problem = Problem(
        ensemble=ensemble,
        strain_operator=basis,
        load_operator=parts.loads,
        node_area=mesh_of(parts.structure.surface).node_area,
        noise=(),
        errors=(),
        entry=vehicle.map.model_copy(update={"keep_field": False}),
        tolerances=vehicle.noise,
        stated_sensors=vehicle.sensors,
        reference=vehicle.reference_quantities(),
        inside=vehicle.structure.internal_pressure_Pa,
        flows=parts.flows,
        leeward=None if ensemble.grid is not None else leeward_fields(parts.flows, sizes, ensemble),
    )
    fitted, terms = tables_and_errors(problem, parts.structure.surface)
    nothing = np.zeros((n_k + len(parts.loads), 1))
    of_inside = terms.get("internal pressure", nothing)
    inside = vehicle.structure.internal_pressure_Pa
    operator = np.vstack([basis, parts.loads])
    fixed = np.zeros(len(operator)) if inside == "ambient" else -float(inside) * operator.sum(axis=1)
    tables = FlightTables(
        mach_knots=fitted.mach_knots,
        incidence_knots=fitted.incidence_knots,
        response=fitted.coefficients,
        fixed_response=fixed,
    )
    terms_off = [columns for name, columns in terms.items() if name != "internal pressure"]
    error, states = np.hstack([*terms_off, nothing]), flight_states(parts)
    table_rows = evaluate(tables, states)
    differing = np.zeros((len(states), len(operator), 0))  # of another flow model, which the gain considers
    if fitted.considered is not None:
        other_flow = replace(tables, response=fitted.considered, fixed_response=np.zeros_like(fixed))
        differing = evaluate(other_flow, states).value[:, :, None]
    typical = float(np.exp(states[:, LOG_PRESSURE].mean()))
    off, off_loads, off_fixed, off_rest = _parted(error[:n_k], error[n_k:], triangle, parts.noise_std / typical)
    models = []
    for state, value, slope, apart in zip(states, table_rows.value, table_rows.jacobian, differing, strict=True):
        pressure = float(np.exp(state[LOG_PRESSURE]))
        dynamic = 0.5 * HEAT_CAPACITY_RATIO * state[MACH] ** 2 * pressure
        scale = coefficient_scale(dynamic, vehicle.reference_quantities())
        prior = _state_root(parts, fitted.incidence_limit, fitted.crossflow_range, fitted.mach_knots, state)
        of_dynamic = np.zeros(N_STATES)
        of_dynamic[MACH], of_dynamic[LOG_PRESSURE] = 2.0 / state[MACH], 1.0
        # Coefficients are loads over q_inf, whose error goes with that of the state.
        by_state = scale[:, None] * (slope[n_k:] - value[n_k:, None] * of_dynamic)
        models.append(
            _State(
                pressure_root=value[:n_k, None],
                unknowns=np.hstack([slope[:n_k] @ prior, pressure * off, apart[:n_k]]),
                inside=pressure * of_inside[:n_k],
                goals=np.hstack(
                    [by_state @ prior, pressure * scale[:, None] * off_loads, scale[:, None] * apart[n_k:]]
                ),
                fixed=(pressure * scale) ** 2 * off_fixed,
                rest=pressure**2 * off_rest,
                state=prior,
            )
        )
    return models


def _state_root(
    parts: FlightParts, limit: float, crossflow: FloatArray | None, mach: FloatArray, state: FloatArray
) -> FloatArray:
    """Return (4, 4) a root of the flight state's covariance by air data and the ranges of the map."""
    noise, (low, high) = parts.vehicle.noise, parts.vehicle.map.valid_altitude_km
    half = np.full(2, limit) if crossflow is None else 0.5 * np.ptp(crossflow, axis=1)
    pressure = [pressure_and_temperature(1e3 * altitude)[0] for altitude in (high, low)]
    std = np.empty(N_STATES)
    std[MACH], std[U : W + 1] = max(0.5 * float(np.ptp(mach[[0, -1]])), 0.1), half
    std[LOG_PRESSURE] = 0.5 * np.log(pressure[1] / pressure[0])
    air = np.zeros((3, N_STATES))
    air[0, MACH], air[1, LOG_PRESSURE] = 1.0, 1.0
    air[2, MACH], air[2, LOG_PRESSURE] = 2.0 / state[MACH], 1.0
    of_air = np.array(
        [
            noise.navigation_mach_number,
            0.01 * noise.navigation_static_pressure_percent,
            max(0.01 * noise.dynamic_pressure_percent, 1e-3),
        ]
    )
    precision = np.diag(std**-2) + (air / of_air[:, None] ** 2).T @ air
    return np.asarray(np.linalg.inv(np.linalg.cholesky(precision)).T)


def _linear(parts: FlightParts, triangle: FloatArray) -> list[_State]:
    vehicle, ensemble, basis = parts.vehicle, parts.ensemble, parts.basis.fields.T
    loads, free = parts.loads, np.zeros(0, dtype=np.int64)
    if vehicle.map.case == 1:
        # Modes that the layout in use observes too weakly for states keep their prior, as in its map.
        problem = inverse_problem(vehicle, parts.flows.snapshots, parts.structure)
        modes, free = problem.modes, np.array(mode_choice(problem)[0])
    else:
        modes = _modes(ensemble)
    size = modes.coefficient_std
    size[free] *= FREE
    fields = modes.modes * size
    if len(free) and not vehicle.noise.with_truncated_modes:
        fields = fields[:, free]
    all_fields = [fields]
    all_fields += [error.T for error in errors_of_flows(vehicle, parts.flows, ensemble).values()]
    columns = np.hstack(all_fields)
    scale = coefficient_scale(ensemble.nominal_dynamic_pressure, vehicle.reference_quantities())
    goals = scale[:, None] * (loads @ columns)
    unknowns, of_loads, fixed, rest = _parted(basis @ columns, goals, triangle, parts.noise_std)
    inside = 0.01 * vehicle.noise.internal_pressure_percent * rms_ambient_pressure(ensemble)
    uniform = inside * basis.sum(axis=1)[:, None]
    weight = np.sqrt(ensemble.member_weight)
    flown = ensemble.responses(basis)
    return [
        _State(
            pressure_root=_short((weight[:, None] * flown).T),
            unknowns=unknowns,
            inside=uniform,
            goals=of_loads,
            fixed=fixed,
            rest=rest,
        )
    ]


def _short(columns: FloatArray) -> FloatArray:
    """Return fewer columns (K, k) with the covariance of ``columns``, to 1e-4 of the largest."""
    vectors, size, _ = np.linalg.svd(columns, full_matrices=False)
    counts = size > 1e-4 * size[0]
    return np.asarray(vectors[:, counts] * size[counts])


def _modes(ensemble: Ensemble) -> PressureModes:
    if ensemble.grid is not None:
        return rolled_modes(ensemble, None)
    return proper_orthogonal_decomposition(ensemble.pressure, None)


def pressure_of_unknowns(parts: FlightParts, strain: CandidateStrain, kind: Kind) -> FloatArray:
    """Return (n_s, K, m) pressure of the basis per unknown of :func:`flight_model` [Pa]; 0 of common errors."""
    states = _states(parts, strain, kind)
    rows, known = _rows(parts, strain, states[0]), _sensor_rows(parts, strain, states[0])
    fields = [np.hstack([state.unknowns, state.inside]) for state in states]
    unknowns = np.stack(
        [np.pad(pressure, ((0, 0), (0, rows.shape[1] - pressure.shape[1]))) for pressure in fields]
    )
    return unknowns @ _seen(rows, known) if kind == "linear" else unknowns


def field_goals(parts: FlightParts, strain: CandidateStrain, kind: Kind) -> FloatArray:
    """Return (n_s, n_g, m) the pressure on the surface as goals: its combinations of most variance, area-weighted.

    Their variances add up to the variance of the mean pressure on the surface, over the same without gauges.
    """
    area = mesh_of(parts.structure.surface).node_area
    weighted = np.sqrt(area / area.sum())[:, None] * parts.basis.fields
    root = np.asarray(np.linalg.qr(weighted, mode="r"))
    goals = []
    for unknowns in pressure_of_unknowns(parts, strain, kind):
        _, size, right = np.linalg.svd(root @ unknowns, full_matrices=False)
        largest = slice(0, min(FIELD_GOALS, len(size)))
        goals.append(size[largest, None] * right[largest] / np.linalg.norm(size))
    return np.stack(goals)


def air_data_goals(parts: FlightParts, strain: CandidateStrain) -> FloatArray:
    """Return (n_s, 4, m) the flight state of the nonlinear estimator as goals.

    These are Mach number, both incidences and ln p_inf.
    """
    states = _states(parts, strain, "nonlinear")
    m = _rows(parts, strain, states[0]).shape[1]
    return np.stack([np.pad(state.state, ((0, 0), (0, m - N_STATES))) for state in states])


def noise_std_of(vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure) -> float:
    """Return the noise of a candidate: the median over the gauges of the layout in use [m/m]."""
    return float(np.sqrt(np.median(np.diag(gauge_noise_covariance(vehicle, snapshots, structure)))))
