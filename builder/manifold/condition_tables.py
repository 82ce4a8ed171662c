"""Tables of a vehicle of any shape over the flight state, from snapshots on a grid of conditions.

Cubic splines over Mach number, angle of attack and sideslip go through the snapshots. The estimator's tables are
polar, sums of cos m phi_T and sin m phi_T over Mach number and total incidence, for a body of revolution and any
other alike: the splines are read off on rings of total incidence all round. Beyond the snapshots, splines and
tables go on along their tangents.

Pressure on the surface over the flight state, and how far it may be off: what a map holds of the field.

Snapshots of any shape as a grid of Mach number, angle of attack, sideslip and flow parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.inverse.ensemble import rolled_modes
from builder.inverse.noise.error_list import INTERPOLATION, PROCESS, SPREAD, parts_of
from builder.inverse.noise.flow_models import LEVEL
from builder.inverse.noise.flows_between import BETWEEN, FlowsBetween
from builder.inverse.solution import Problem
from builder.manifold.discrepancy import gaussian_process_shapes, process_size
from builder.manifold.flow_amplitudes import flow_amplitudes, with_middle_mach
from builder.manifold.parameter_slopes import (
    FLOW_PARAMETERS,
    ConditionSlopes,
    ParameterSlopes,
    condition_slopes,
)
from builder.manifold.tables import interpolating, left_out_errors, ring_response, spline_coefficients, spline_rows
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, FlightTables, U, W, evaluate
from strainfmu.estimator.map.nonlinear_map import FlightField
from strainfmu.estimator.numerics import basis
from strainfmu.flight_condition import FlightCondition

MIN_VALUES = (2, 3, 3)
"""Least number of Mach numbers, angles of attack and sideslip angles of a spline."""

_DIGITS = 9


@dataclass(frozen=True, eq=False, kw_only=True)
class SnapshotGrid:
    """Snapshots at every combination of their conditions, one altitude of each.

    Attributes
    ----------
    mach, angle_of_attack, sideslip : (n_M,), (n_a,), (n_b,) increasing [1, rad, rad].
    row : (n_M, n_a, n_b, n_k) of the snapshots, n_k combinations of the flow parameters, 1 without.
    """

    mach: FloatArray
    angle_of_attack: FloatArray
    sideslip: FloatArray
    row: IntArray


def snapshot_grid(snapshots: Snapshots) -> SnapshotGrid:
    """Return the grid of ``snapshots``.

    Raises
    ------
    InputError
        There are too few values of a condition for a spline, or a combination is missing.
    """
    conditions = snapshots.conditions()
    keys = [
        (
            *np.round(
                (condition.mach_number, condition.angle_of_attack, condition.sideslip_angle), _DIGITS
            ).tolist(),
            condition.parameters,
        )
        for condition in conditions
    ]
    first: dict[tuple[object, ...], int] = {}
    for number, key in enumerate(keys):
        first.setdefault(key, number)
    values = [sorted({key[axis] for key in keys}) for axis in range(3)]
    parameters = sorted({key[3] for key in keys})
    _check_numbers([len(axis) for axis in values])
    row = np.empty([*(len(axis) for axis in values), len(parameters)], dtype=np.int64)
    for place, key in zip(np.ndindex(row.shape), product(*values, parameters), strict=True):
        if key not in first:
            mach, alpha, beta = key[:3]
            raise InputError(
                f"map.estimator: 'nonlinear' needs every combination of the conditions, got none of Mach number "
                f"{mach:g}, angle of attack {np.degrees(alpha):.4g} deg, sideslip {np.degrees(beta):.4g} deg"
                + (f", parameters {', '.join(f'{value:g}' for value in key[3])}" if key[3] else "")
            )
        row[place] = first[key]
    mach, alpha, beta = map(np.array, values)
    return SnapshotGrid(mach=mach, angle_of_attack=alpha, sideslip=beta, row=row)


def _check_numbers(counts: list[int]) -> None:
    if any(count < least for count, least in zip(counts, MIN_VALUES, strict=True)):
        needed, got = (
            "{} Mach numbers, {} angles of attack and {} sideslip angles".format(*numbers)
            for numbers in (MIN_VALUES, counts)
        )
        raise InputError(
            f"map.estimator: 'nonlinear' needs {needed} at least, got {got}; estimator 'linear' takes them"
        )


RINGS, ROLLS, MAX_HARMONIC = 12, 64, 24
"""Total incidences and roll angles at which the splines are read off, and highest harmonic of the tables."""

LEFT_OUT_FRACTION = 0.5
"""Part of the error at a condition left out that remains at the spacing of the snapshots.

Of a cubic spline at twice the spacing 1/16 would remain where it converges; few conditions do not show that.
"""

_NEGLIGIBLE = 3e-4
"""Size of a harmonic, relative to the largest of its row, below which it is left out."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ConditionTables:
    """Tables of n rows.

    Attributes
    ----------
    mach_knots, incidence_knots : (n_M,), (n_k,) [1, rad].
    coefficients : (n_M + 2, n_k + 2, n, n_m, 2) per p_inf.
    errors : by name, columns (n, k) per p_inf whose squares add up to the mean one.
    crossflow_range : (2, 2) smallest and largest u and w of the snapshots [rad].
    incidence_limit : total incidence in the farthest corner of these [rad].
    overpressure : (n_p,) p / p_inf - 1 at the smallest total incidence, the mean of these.
    slopes : by flow parameters; None where the snapshots have none that changes.
    """

    mach_knots: FloatArray
    incidence_knots: FloatArray
    coefficients: FloatArray
    errors: dict[str, FloatArray]
    crossflow_range: FloatArray
    incidence_limit: float
    overpressure: FloatArray
    slopes: ParameterSlopes | None


def condition_tables(
    snapshots: Snapshots, operator: FloatArray, is_vented: bool, between: FlowsBetween | None = None
) -> ConditionTables:
    """Return the tables of ``operator`` (n, n_p) times the pressure.

    Parameters
    ----------
    snapshots : on the nodes of ``operator``.
    is_vented : whether p - p_inf loads the body, and not p.
    between : flows between the snapshots, which show how far the tables are off there; where they are not known,
        conditions are left out in turn.

    Raises
    ------
    InputError
        The snapshots are on no grid of conditions, or too few.
    """
    grid, conditions = snapshot_grid(snapshots), snapshots.conditions()
    ambient = np.array([condition.ambient_pressure for condition in conditions])
    ratio = snapshots.pressure / ambient[:, None] - 1.0
    all_values = (ratio @ operator.T)[grid.row]
    values = all_values.mean(axis=3)
    errors = {} if between is not None else {"interpolation": errors_of_left_out(grid, values)}
    slope = None
    if grid.row.shape[3] > 1:
        off = all_values - values[:, :, :, None]
        slope = condition_slopes(off, [conditions[row].parameters for row in grid.row[0, 0, 0]])
        errors[FLOW_PARAMETERS] = np.hstack(slope.spread_error())
        errors["flow parameters, the rest"] = slope.rest_error()
    mach = grid.mach
    if len(mach) == 2:
        mach, values = with_middle_mach(mach, values)
    if not is_vented:
        values = values + operator.sum(axis=1)
    incidence = np.array([condition.total_incidence for condition in conditions])
    polar = _polar(grid, mach, values, float(incidence.max()))
    errors["tables"] = _off_the_splines(grid, polar, values)
    if between is not None:
        fixed = 0.0 if is_vented else operator.sum(axis=1)
        errors[BETWEEN] = errors_between(polar, between.middle_of_cells(), between.of_cells(operator) + fixed)
    alpha, beta = grid.angle_of_attack, grid.sideslip
    return ConditionTables(
        mach_knots=polar.mach_knots,
        incidence_knots=polar.incidence_knots,
        coefficients=polar.response,
        errors=errors,
        crossflow_range=np.array([[alpha[0], alpha[-1]], [-beta[-1], -beta[0]]]),
        incidence_limit=float(incidence.max()),
        overpressure=ratio[incidence <= incidence.min() + 1e-9].mean(axis=0),
        slopes=None if slope is None else _slope_tables(grid, slope, polar),
    )


def _slope_tables(grid: SnapshotGrid, slope: ConditionSlopes, tables: FlightTables) -> ParameterSlopes:
    """Return the tables of ``slope`` on the knots and with the harmonics of ``tables``."""
    n_m, slopes = tables.response.shape[3], []
    for values in np.moveaxis(slope.value, 3, 0):
        mach = grid.mach
        if len(mach) == 2:
            mach, values = with_middle_mach(mach, values)
        response = _polar(grid, mach, values, float(tables.incidence_knots[-1])).response
        slopes.append(with_harmonics(response, n_m))
    return ParameterSlopes(
        powers=slope.powers,
        slope=np.stack(slopes, axis=2),
        unit_error=slope.unit_error(),
        spread_error=slope.spread_error(),
    )


def with_harmonics(coefficients: FloatArray, n_m: int) -> FloatArray:
    """Return tables of ``n_m`` harmonics of the roll angle, their axis 3; what tables leave out is negligible."""
    leading = coefficients[:, :, :, :n_m]
    return np.pad(leading, [(0, 0)] * 3 + [(0, n_m - leading.shape[3]), (0, 0)])


def errors_of_left_out(grid: SnapshotGrid, values: FloatArray) -> FloatArray:
    """Return columns (n, k) of the errors at what is left out of ``values`` (n_M, n_a, n_b, n) in turn.

    That is every inner Mach number, angle of attack and sideslip angle. Of two Mach numbers none is: the
    difference of strain linear in M and per unit of dynamic pressure between them counts.
    """
    columns = []
    for axis, knots in enumerate((grid.mach, grid.angle_of_attack, grid.sideslip)):
        along, errors = np.moveaxis(values, axis, 0), []
        for omitted in range(1, len(knots) - 1):
            remaining = np.delete(np.arange(len(knots)), omitted)
            table = interpolating(knots[remaining], along[remaining])
            predicted = np.tensordot(basis(knots[remaining], knots[omitted : omitted + 1]).value[0], table, 1)
            errors.append(LEFT_OUT_FRACTION * (along[omitted] - predicted))
        if len(knots) == 2:
            between = with_middle_mach(knots, along)[1][1]
            errors.append(LEFT_OUT_FRACTION * (between - along.mean(axis=0)))
        rows = np.array(errors).reshape(-1, values.shape[-1])
        columns.append(rows / np.sqrt(len(rows)))
    return np.concatenate(columns).T


def errors_between(tables: FlightTables, conditions: Sequence[FlightCondition], values: FloatArray) -> FloatArray:
    """Return columns (n, k) of the differences of ``tables`` from ``values`` (k, n) per p_inf at k conditions."""
    state = np.zeros((len(conditions), N_STATES))
    for row, condition in zip(state, conditions, strict=True):
        row[MACH], row[U] = condition.mach_number, condition.total_incidence * np.cos(condition.leeward_roll_angle)
        row[W] = condition.total_incidence * np.sin(condition.leeward_roll_angle)
    errors = evaluate(tables, state).value - values
    return np.asarray(errors.T / np.sqrt(len(errors)))


def _polar(grid: SnapshotGrid, mach: FloatArray, values: FloatArray, limit: float) -> FlightTables:
    """Return polar tables of ``values`` (n_M, n_a, n_b, n), no part of them fixed."""
    incidence = limit * np.arange(1, RINGS + 1) / RINGS
    roll = 2.0 * np.pi * np.arange(ROLLS) / ROLLS
    u, w = (np.outer(incidence, wave).ravel() for wave in (np.cos(roll), np.sin(roll)))
    splines = _splines(grid, values)
    rings = _at(grid, splines, u, w).reshape(len(mach), RINGS, ROLLS, -1)
    spectrum = np.moveaxis(np.fft.rfft(rings, axis=2), 2, -1)[..., : MAX_HARMONIC + 1] / ROLLS
    spectrum[..., 1:] *= 2.0
    largest = np.abs(spectrum).max(axis=(0, 1))
    significant = largest > _NEGLIGIBLE * np.maximum(largest.max(axis=1, keepdims=True), 1e-300)
    n_m = max(int(np.flatnonzero(significant.any(axis=0))[-1]) + 1, 2)
    amplitude = np.stack([spectrum.real, -spectrum.imag], axis=-1)[..., :n_m, :]
    zero = np.zeros((len(mach), values.shape[-1], n_m, 2))
    zero[..., 0, 0] = _at(grid, splines, np.zeros(1), np.zeros(1))[:, 0]
    knots, response = spline_coefficients(mach, incidence, amplitude, np.arange(RINGS), zero)
    return FlightTables(
        mach_knots=mach, incidence_knots=knots, response=response, fixed_response=np.zeros(response.shape[2])
    )


def _splines(grid: SnapshotGrid, values: FloatArray) -> FloatArray:
    """Return (n_M, n_a + 2, n_b + 2, n) coefficients of splines over the two angles."""
    along = interpolating(grid.angle_of_attack, np.moveaxis(values, 1, 0))
    both = interpolating(grid.sideslip, np.moveaxis(along, 2, 0))
    return np.ascontiguousarray(np.moveaxis(both, [0, 1], [2, 1]))


def _at(grid: SnapshotGrid, splines: FloatArray, u: FloatArray, w: FloatArray) -> FloatArray:
    """Return (n_M, k, n) the splines at ``u`` and ``w`` (k,) [rad]."""
    incidence = np.hypot(u, w)
    across = np.sinc(incidence / np.pi)
    alpha, beta = np.arctan2(across * u, np.cos(incidence)), -np.arcsin(across * w)
    first, second = basis(grid.angle_of_attack, alpha).value, basis(grid.sideslip, beta).value
    return np.asarray(np.einsum("ka,kb,mabn->mkn", first, second, splines, optimize=True))


def _off_the_splines(grid: SnapshotGrid, tables: FlightTables, values: FloatArray) -> FloatArray:
    """Return columns (n, k) of the differences of ``tables`` from the splines through ``values``, at the snapshots
    and between."""
    alpha, beta = (
        np.sort(np.concatenate([angles, 0.5 * (angles[1:] + angles[:-1])]))
        for angles in (grid.angle_of_attack, grid.sideslip)
    )
    a, b = (angle.ravel() for angle in np.meshgrid(alpha, beta))
    y, z, along = -np.sin(b), np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)
    scale = 1.0 / np.sinc(np.arctan2(np.hypot(y, z), along) / np.pi)
    true = _at(grid, _splines(grid, values), scale * z, scale * y)
    errors = []
    for mach, exact in zip(tables.mach_knots, true, strict=True):
        state = np.zeros((len(a), N_STATES))
        state[:, MACH], state[:, U], state[:, W], state[:, LOG_PRESSURE] = mach, scale * z, scale * y, 0.0
        errors.append(evaluate(tables, state).value - exact)
    rows = np.concatenate(errors)
    return np.asarray(rows.T / np.sqrt(len(rows)))


MAX_FIELD_HARMONIC = 32
"""Highest harmonic of the field: the leeward shock needs more than the gauges see."""

MAX_ERROR_HARMONIC = 16
"""Highest harmonic that the residual of strain corrects."""


def flight_field(
    snapshots: Snapshots, problem: Problem, grid: SurfaceGrid, of_grid: FloatArray | None = None
) -> FlightField:
    """Return the field of the tables made from ``snapshots`` on the nodes of ``grid``.

    ``of_grid`` (q, n_x, n_m) are errors of the flow's grid, see
    :func:`~builder.manifold.state_tables.grid_errors`; None where they are not known.
    """
    flows = flow_amplitudes(snapshots, MAX_FIELD_HARMONIC)
    inclined = np.flatnonzero(flows.incidence > 1e-9)
    zero = flows.amplitude[:, 0, ..., None] if len(inclined) < len(flows.incidence) else None
    incidence = flows.incidence[inclined]
    _, coefficients = spline_coefficients(
        flows.mach, incidence, flows.amplitude[:, inclined, ..., None], spline_rows(incidence), zero
    )
    error = left_out_errors(flows.mach, flows.incidence, flows.amplitude[..., None], flows.of_two)[..., 0]
    n_h = min(MAX_ERROR_HARMONIC, flows.amplitude.shape[-1] - 1) + 1
    response = ring_response(problem.strain_operator, grid, n_h)
    process, process_std = _of_process(problem, grid, response)
    prior, prior_std = _of_prior(problem, grid, n_h)
    n_m = flows.amplitude.shape[-1]
    numerics = [error] if of_grid is None else [error, of_grid[..., :n_m]]
    level = problem.model_form.of_overpressure * flows.overpressure()
    of_level = np.zeros_like(process)
    of_level[:, 0, 0] = np.outer(level, response[:, :, 0, 0] @ level)
    covariances = {PROCESS: process, SPREAD: prior, LEVEL: of_level}
    measured = problem.sensors is not None
    if measured:  # strain alone does not show the pattern
        covariances[INTERPOLATION] = _of_numerics(error[..., :n_h], response)
    covariance = sum(
        (parts_of(name, measured)[0] ** 2 * covariance for name, covariance in covariances.items()),
        start=0.0 * process,
    )
    return FlightField(
        station=grid.x,
        radius=grid.radius,
        roll_angle=grid.roll_angle,
        amplitude=coefficients[..., 0].astype(np.float32),
        strain_covariance=covariance.astype(np.float32),
        error_std=np.hypot(np.hypot(process_std, prior_std), level),
        table_error_std=_table_error(snapshots, numerics, grid).astype(np.float32),
    )


def _of_numerics(error: FloatArray, response: FloatArray) -> FloatArray:
    """Return (n_x, n_h, 2, n_d) covariance with strain of ``error`` (q, n_x, n_h), averaged over the roll angle.

    ``response`` (n_d, n_x, n_h, 2) comes from :func:`~builder.manifold.tables.ring_response`.
    """
    if not len(error):
        return np.zeros((response.shape[1], response.shape[2], 2, len(response)))
    strain = np.einsum("qxm,nxms->qnms", error, response, optimize=True)
    mean = np.where(np.arange(error.shape[2]) == 0, 1.0, 0.5) / len(error)
    return np.einsum("m,qxm,qnms->xmsn", mean, error, strain, optimize=True)


def _of_process(problem: Problem, grid: SurfaceGrid, response: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the covariance with strain, and sigma (n_x,), of the Gaussian process."""
    size = process_size(problem)
    along, around = gaussian_process_shapes(grid, problem.entry)
    ring = around @ around[0]
    n_h = response.shape[2]
    of_harmonic = np.fft.rfft(ring).real[:n_h] / len(ring) * np.where(np.arange(n_h) == 0, 1.0, 2.0)
    covariance = np.einsum("xa,ya,m,nyms->xmsn", along, along, size * size * of_harmonic, response, optimize=True)
    return covariance, size * np.sqrt(np.sum(along**2, axis=1) * ring[0])


def _of_prior(problem: Problem, grid: SurfaceGrid, n_h: int) -> tuple[FloatArray, FloatArray]:
    """Return the same of the fraction of the snapshots' spread."""
    ensemble, n_roll = problem.ensemble, grid.n_roll
    modes = rolled_modes(ensemble, None)
    pressure = float(np.average(ensemble.ambient_pressure, weights=ensemble.weight))
    spread = problem.model_form.of_prior / pressure * modes.modes * modes.coefficient_std
    nodes = (spread @ (problem.strain_operator @ spread).T).reshape(len(grid.x), n_roll, -1)
    angle = np.outer(np.arange(n_h), grid.roll_angle)
    waves = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    weight = np.where(np.arange(n_h) == 0, 1.0, 2.0)[:, None, None] / n_roll
    covariance = np.einsum("msr,xrn->xmsn", weight * waves, nodes, optimize=True)
    variance = np.sum(spread**2, axis=1).reshape(len(grid.x), n_roll).mean(axis=1)
    return covariance, np.sqrt(variance)


def _table_error(snapshots: Snapshots, numerics: list[FloatArray], grid: SurfaceGrid) -> FloatArray:
    """Return (n_x, n_roll) root mean square of all ``numerics`` (q, n_x, n_m), and of the harmonics that the
    field has not."""
    n_m, square = numerics[0].shape[2], np.zeros((len(grid.x), grid.n_roll))
    waves = np.cos(np.outer(np.arange(n_m), grid.roll_angle))
    for error_rows in numerics:
        if len(error_rows):
            square += np.mean((error_rows @ waves) ** 2, axis=0)
    spectrum = np.fft.rfft(snapshots.pressure.reshape(len(snapshots.pressure), len(grid.x), -1), axis=2)
    spectrum[:, :, :n_m] = 0.0
    rest = np.fft.irfft(spectrum, n=grid.n_roll, axis=2)
    conditions = snapshots.conditions()
    turned = np.array(
        [
            np.roll(difference, -round(c.leeward_roll_angle * grid.n_roll / (2.0 * np.pi)), axis=1)
            / c.ambient_pressure
            for difference, c in zip(rest, conditions, strict=True)
        ]
    )
    return np.sqrt(square + np.mean(turned**2, axis=0))
