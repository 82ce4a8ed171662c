"""The pressure field of an estimate, and how far it is from the true one.

The field error is |p_estimate - p| / |p| over the pressure nodes of the map, p absolute, in the Euclidean norm:
that of the reproduction of the source (:mod:`builder.reproduce.case_1`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import AnyStructure, on_structure
from builder.inverse.ensemble import rolled_modes
from builder.inverse.solution import Problem
from builder.manifold.discrepancy import gaussian_process_shapes, response_of_shapes
from builder.manifold.flow_amplitudes import flow_amplitudes
from builder.manifold.tables import spline_coefficients, spline_rows
from builder.truth.flow_table import FlowTable, harmonics_at
from builder.vehicle.file import Vehicle
from builder.vehicle.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.manifold.error_covariance import strain_covariance
from strainfmu.estimator.manifold.flight_tables import LOG_PRESSURE, MACH, U, W, evaluate
from strainfmu.estimator.manifold.manifold_map import ManifoldMap
from strainfmu.estimator.manifold.spline import basis
from strainfmu.flight_condition import FlightCondition


def true_field(
    table: FlowTable, of_table: SurfaceGrid, grid: SurfaceGrid, conditions: tuple[FlightCondition, ...]
) -> FloatArray:
    """Return (k, n_x, n_roll) [Pa] the pressure of the independent model at the nodes of ``grid``.

    ``of_table`` holds the stations of ``table``; both grids are on the same body.
    """
    mach = np.array([one.mach_number for one in conditions])
    incidence = np.array([one.total_incidence for one in conditions])
    harmonic = station_weights(of_table.x, grid.x) @ harmonics_at(table, mach, incidence)
    roll = np.array([one.leeward_roll_angle for one in conditions])
    ratio = harmonic @ _cosines(harmonic.shape[2], grid, roll)
    return np.asarray(np.array([one.ambient_pressure for one in conditions])[:, None, None] * ratio)


def station_weights(source: FloatArray, target: FloatArray) -> FloatArray:
    """Return (n_target, n_source) weights of linear interpolation along the body.

    Stations are doubled at slope breaks, where the pressure jumps: each piece is interpolated on its own.
    """
    out = np.zeros((len(target), len(source)))
    for rows, columns in zip(_pieces(target), _pieces(source), strict=True):
        unit = np.eye(columns.stop - columns.start)
        out[rows, columns] = np.stack([np.interp(target[rows], source[columns], one) for one in unit], axis=1)
    return out


def _pieces(x: FloatArray) -> list[slice]:
    ends = [0, *(np.flatnonzero(np.diff(x) <= 0.0) + 1).tolist(), len(x)]
    return [slice(first, last) for first, last in pairwise(ends)]


def _cosines(n_m: int, grid: SurfaceGrid, roll: FloatArray) -> FloatArray:
    """Return (k, n_m, n_roll) of cos m(phi - phi_T) at the nodes."""
    angle = grid.roll_angle - roll[:, None]
    return np.asarray(np.cos(np.arange(n_m)[:, None] * angle[:, None, :]))


def field_errors(estimate: FloatArray, true: FloatArray) -> FloatArray:
    """Return (k,) field errors [1] of ``estimate`` and ``true`` (k, ..) [Pa]."""
    k = len(true)
    difference = (estimate.reshape(k, -1) - true.reshape(k, -1), true.reshape(k, -1))
    off, size = (np.sqrt(np.sum(one * one, axis=1)) for one in difference)
    return np.asarray(off / size)


def linear_field(
    inverse_map: InverseMap, strain: FloatArray, dynamic_pressure: FloatArray, static_pressure: FloatArray
) -> FloatArray:
    """Return (k, n_p) [Pa] the field of a linear map with ``keep_field``, weights those of its nominal q_inf.

    In a vented body strain says nothing of p_inf: there it is ``static_pressure`` (k,) [Pa] that is added.
    """
    assert inverse_map.field_mean is not None
    assert inverse_map.field_modes is not None
    ratio = (dynamic_pressure / inverse_map.nominal_dynamic_pressure)[:, None]
    fixed = 0.0 if inverse_map.fixed_strain is None else inverse_map.fixed_strain
    at_nominal = fixed + (strain - fixed) / ratio
    state = at_nominal @ inverse_map.strain_gain.T + inverse_map.state_offset
    net = ratio * (inverse_map.field_mean + state @ inverse_map.field_modes.T.astype(np.float64))
    return np.asarray(net + static_pressure[:, None] if is_vented(inverse_map) else net)


def is_vented(inverse_map: InverseMap) -> bool:
    """Return whether the pressure inside the body is p_inf."""
    return bool(inverse_map.provenance["internal_pressure_Pa"] == "ambient")


@dataclass(frozen=True, eq=False, kw_only=True)
class TableField:
    """The pressure of the flight state, corrected by what the residual says of pressure off the tables.

    Attributes
    ----------
    mach_knots, incidence_knots : of the splines.
    coefficients : (n_M + 2, n_a + 2, n_x, n_m) of the amplitudes of cos m(phi - phi_T) in p / p_inf [1].
    field_strain_covariance : (n_p, n_d) of pressure off the tables with its strain, per p_inf^2 [1/Pa].
    grid : the nodes.
    """

    mach_knots: FloatArray
    incidence_knots: FloatArray
    coefficients: FloatArray
    field_strain_covariance: FloatArray
    grid: SurfaceGrid

    def pressure(self, manifold: ManifoldMap, state: FloatArray, strain: FloatArray) -> FloatArray:
        """Return (k, n_p) [Pa] of the flight ``state`` (k, 4) and the ``strain`` (k, n_d) it was found from."""
        incidence, roll = np.hypot(state[:, U], state[:, W]), np.arctan2(state[:, W], state[:, U])
        of_mach, of_incidence = (
            basis(self.mach_knots, state[:, MACH]).value,
            basis(self.incidence_knots, incidence).value,
        )
        weight = (of_mach[:, :, None] * of_incidence[:, None, :]).reshape(len(state), -1)
        n_x, n_m = self.coefficients.shape[2:]
        amplitude = (weight @ self.coefficients.reshape(-1, n_x * n_m)).reshape(-1, n_x, n_m)
        ratio = (amplitude @ _cosines(n_m, self.grid, roll)).reshape(len(state), -1)
        pressure = np.exp(state[:, LOG_PRESSURE])
        response, n_d = evaluate(manifold.tables, state).value, strain.shape[1]
        covariance = strain_covariance(
            manifold=manifold, pressure=pressure, strain=response[:, :n_d], loads=response[:, n_d:]
        )
        weighted = np.linalg.solve(covariance, (strain - response[:, :n_d])[:, :, None])[:, :, 0]
        correction = pressure[:, None] ** 2 * (weighted @ self.field_strain_covariance.T)
        return np.asarray(pressure[:, None] * ratio + correction)


def table_field(vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, problem: Problem) -> TableField:
    """Return the field of the nonlinear estimator from the parts of its map."""
    grid = structure.surface
    assert isinstance(grid, SurfaceGrid)
    flows = flow_amplitudes(on_structure(snapshots, structure))
    inclined = np.flatnonzero(flows.incidence > 1e-9)
    values = flows.amplitude[..., None]
    zero = values[:, 0] if len(inclined) < len(flows.incidence) else None
    incidence = flows.incidence[inclined]
    knots, coefficients = spline_coefficients(
        mach=flows.mach,
        incidence=incidence,
        values=values[:, inclined],
        rows=spline_rows(incidence),
        at_zero=zero,
    )
    return TableField(
        mach_knots=flows.mach,
        incidence_knots=knots,
        coefficients=coefficients[..., 0],
        field_strain_covariance=_field_strain_covariance(vehicle, problem, grid),
        grid=grid,
    )


def _field_strain_covariance(vehicle: Vehicle, problem: Problem, grid: SurfaceGrid) -> FloatArray:
    """Return (n_p, n_d) of the pressures off the tables that the section [map] states, with their strain."""
    entry, z_p = vehicle.map, problem.strain_operator
    along, around = gaussian_process_shapes(
        grid=grid,
        length=float(grid.x[-1]),
        axial_length=entry.discrepancy_length,
        roll_angle=float(np.deg2rad(entry.discrepancy_roll_deg)),
    )
    strain = response_of_shapes(z_p, along, around).reshape(len(z_p), along.shape[1], around.shape[1])
    process = np.einsum("xa,rb,nab->xrn", along, around, strain, optimize=True).reshape(-1, len(z_p))
    modes, ensemble = rolled_modes(problem.ensemble, None), problem.ensemble
    pressure = float(np.average(ensemble.ambient_pressure, weights=ensemble.weight))
    spread = 0.01 * entry.discrepancy_of_prior_percent / pressure * (modes.modes * modes.coefficient_std())
    return np.asarray((0.01 * entry.discrepancy_percent) ** 2 * process + spread @ (z_p @ spread).T)
