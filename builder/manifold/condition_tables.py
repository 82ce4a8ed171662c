"""Tables of a vehicle of any shape over the flight state, from snapshots on a grid of conditions.

Cubic splines over Mach number, angle of attack and sideslip go through the snapshots. The estimator's tables are
polar, sums of cos m phi_T and sin m phi_T over Mach number and total incidence, for a body of revolution and any
other alike: the splines are read off on rings of total incidence all round. Beyond the snapshots, splines and
tables go on along their tangents.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.flows_between import BETWEEN, FlowsBetween
from builder.manifold.flow_amplitudes import with_middle_mach
from builder.manifold.parameter_slopes import (
    FLOW_PARAMETERS,
    ConditionSlopes,
    ParameterSlopes,
    condition_slopes,
)
from builder.manifold.snapshot_grid import SnapshotGrid, snapshot_grid
from builder.manifold.tables import interpolating, spline_coefficients
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, N_STATES, FlightTables, U, W, evaluate
from strainfmu.estimator.numerics import basis
from strainfmu.flight_condition import FlightCondition

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
    errors = {} if between is not None else {"interpolation": left_out_errors(grid, values)}
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


def left_out_errors(grid: SnapshotGrid, values: FloatArray) -> FloatArray:
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
