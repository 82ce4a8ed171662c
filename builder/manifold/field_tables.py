"""Pressure on the surface over the flight state, and how far it may be off: what a map holds of the field."""

from __future__ import annotations

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.inverse.modes.ensemble import rolled_modes
from builder.inverse.noise.error_list import INTERPOLATION, PROCESS, SPREAD, parts_of
from builder.inverse.noise.flow_models import LEVEL
from builder.inverse.solution import Problem
from builder.manifold.discrepancy import gaussian_process_shapes, process_size
from builder.manifold.flow_amplitudes import flow_amplitudes
from builder.manifold.interpolation import left_out_errors
from builder.manifold.tables import ring_response, spline_coefficients, spline_rows
from builder.vehicle.file import Vehicle
from builder.vehicle.map.model_form import model_form
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.nonlinear_map import FlightField

MAX_FIELD_HARMONIC = 32
"""Highest harmonic of the field: the leeward shock needs more than the gauges see."""

MAX_ERROR_HARMONIC = 16
"""Highest harmonic that the residual of strain corrects."""


def flight_field(
    vehicle: Vehicle, snapshots: Snapshots, problem: Problem, grid: SurfaceGrid, of_grid: FloatArray | None = None
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
    process, process_std = _of_process(vehicle, grid, response, process_size(vehicle, problem))
    prior, prior_std = _of_prior(vehicle, problem, grid, n_h)
    n_m = flows.amplitude.shape[-1]
    numerics = [error] if of_grid is None else [error, of_grid[..., :n_m]]
    level = model_form(vehicle.map, vehicle.noise).of_overpressure * flows.overpressure()
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


def _of_process(
    vehicle: Vehicle, grid: SurfaceGrid, response: FloatArray, size: float
) -> tuple[FloatArray, FloatArray]:
    """Return the covariance with strain, and sigma (n_x,), of the Gaussian process of ``size``."""
    entry = vehicle.map
    along, around = gaussian_process_shapes(grid, entry)
    ring = around @ around[0]
    n_h = response.shape[2]
    of_harmonic = np.fft.rfft(ring).real[:n_h] / len(ring) * np.where(np.arange(n_h) == 0, 1.0, 2.0)
    covariance = np.einsum("xa,ya,m,nyms->xmsn", along, along, size * size * of_harmonic, response, optimize=True)
    return covariance, size * np.sqrt(np.sum(along**2, axis=1) * ring[0])


def _of_prior(vehicle: Vehicle, problem: Problem, grid: SurfaceGrid, n_h: int) -> tuple[FloatArray, FloatArray]:
    """Return the same of the fraction of the snapshots' spread."""
    ensemble, n_roll = problem.ensemble, grid.n_roll
    modes = rolled_modes(ensemble, None)
    pressure = float(np.average(ensemble.ambient_pressure, weights=ensemble.weight))
    spread = model_form(vehicle.map, vehicle.noise).of_prior / pressure * modes.modes * modes.coefficient_std
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
