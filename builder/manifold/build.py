"""The tables and errors of the nonlinear estimator from the inputs of an inverse map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import AnyStructure, inverse_problem, on_structure
from builder.inverse.ensemble import Ensemble, rolled_modes
from builder.inverse.noise_model import NoiseTerm
from builder.inverse.solution import Problem
from builder.manifold.discrepancy import gaussian_process_shapes, response_of_shapes, tested_shapes
from builder.manifold.field_tables import flight_field
from builder.manifold.flow_amplitudes import FlowAmplitudes, flow_amplitudes
from builder.manifold.followed_errors import followed_errors
from builder.manifold.interpolation import interpolation_errors
from builder.manifold.tables import response_values, ring_response, spline_coefficients, spline_rows
from builder.vehicle.file import Vehicle
from builder.vehicle.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import pressure_and_temperature
from strainfmu.errors import InputError
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.manifold.further_tables import FurtherTables
from strainfmu.estimator.manifold.manifold_map import ManifoldMap

MIN_FLOWS = (2, 4)
"""Least number of Mach numbers, and of incidences but zero, of a spline."""


def with_manifold(
    inverse_map: InverseMap,
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    nuisance: Sequence[NoiseTerm] = (),
    problem: Problem | None = None,
) -> InverseMap:
    """Return ``inverse_map`` with the tables of the nonlinear estimator, made from the same inputs.

    ``nuisance`` holds the further noise terms of the map, ``problem`` what it was solved from where it is known.

    Raises
    ------
    InputError
        The body is no body of revolution, or the flows do not suffice for tables.
    """
    problem = problem or inverse_problem(vehicle, snapshots, structure, nuisance)
    manifold, terms = manifold_map(vehicle, snapshots, structure, problem, nuisance)
    provenance = {**inverse_map.provenance, "table_error_terms": terms}
    return replace(inverse_map, manifold=manifold, provenance=provenance)


def manifold_map(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    problem: Problem,
    nuisance: Sequence[NoiseTerm] = (),
) -> tuple[ManifoldMap, list[dict[str, Any]]]:
    """Return the tables and errors of ``problem``, and what pressure off the tables strains, term by term.

    Raises
    ------
    InputError
        As :func:`with_manifold`.
    """
    grid = structure.surface
    if not isinstance(grid, SurfaceGrid) or problem.ensemble.grid is None:
        raise InputError(
            "map.estimator: 'manifold' needs a body of revolution with rings of nodes, got a free surface; "
            "estimator 'linear' takes it"
        )
    snapshots = on_structure(snapshots, structure)
    flows = flow_amplitudes(snapshots)
    _check_flows(flows)
    overpressure = np.repeat(flows.overpressure(), grid.n_roll)
    operator = _operator(problem)
    fixed = np.zeros(len(operator))
    inside = vehicle.structure.internal_pressure_Pa
    if inside == "ambient":
        flows = flows.less_ambient()
    else:
        fixed = -float(inside) * operator.sum(axis=1)
    response = ring_response(operator, grid, flows.amplitude.shape[-1])
    knots, coefficients = _tables(flows, response)
    terms, n_d = _scaled_errors(vehicle, problem, flows, grid, response), len(problem.strain_operator)
    n = n_d + 5
    terms |= _scaled_nuisance(nuisance, problem)
    if vehicle.map.discrepancy_of_overpressure_percent > 0.0:
        level = 0.01 * vehicle.map.discrepancy_of_overpressure_percent * (operator @ overpressure)
        terms["fraction of the overpressure"] = level[:, None]
    errors = np.hstack(list(terms.values()))
    error = _compressed(errors[:n])
    reference, noise = vehicle.reference_quantities(), vehicle.noise
    products, common = followed_errors(vehicle, problem)
    low, high = (1e3 * height for height in vehicle.map.valid_altitude_km)
    found = ManifoldMap(
        mach_knots=flows.mach,
        incidence_knots=knots,
        response=coefficients[:, :, :n],
        fixed_response=fixed[:n],
        gauge_covariance=_fixed_covariance(problem),
        error_strain=error[:n_d],
        error_load=error[n_d:n],
        gauge_gain_std=0.01 * noise.gauge_gain_percent,
        common_gain_std=0.01 * noise.common_gain_percent,
        gauge_error_product=products,
        common_error=common,
        reference_area=reference.area,
        reference_length=reference.length,
        mach_range=flows.mach[[0, -1]],
        pressure_range=np.array([pressure_and_temperature(high)[0], pressure_and_temperature(low)[0]]),
        incidence_limit=float(flows.incidence[-1]),
        mach_number_error=noise.navigation_mach_number,
        static_pressure_error=0.01 * noise.navigation_static_pressure_percent,
        dynamic_pressure_error=0.01 * noise.dynamic_pressure_percent,
        further=_further(coefficients[:, :, n:], fixed[n:], errors[n:], errors[:n_d]),
        pressure_field=flight_field(vehicle, snapshots, problem, grid) if vehicle.map.keep_field else None,
    )
    found = replace(found, discrepancy_shapes=tested_shapes(found))
    return found, _terms_of(terms, problem.ensemble, n_d)


def _operator(problem: Problem) -> FloatArray:
    """Return (n_d + 5 + m, n_p) strains [1/Pa], loads and further loads [m2, m3] per pressure."""
    further = problem.further_operator
    parts = [problem.strain_operator, problem.load_operator, *([] if further is None else [further])]
    return np.vstack(parts)


def _further(
    coefficients: FloatArray, fixed: FloatArray, of_load: FloatArray, of_strain: FloatArray
) -> FurtherTables | None:
    """Return the tables of m further loads, None for m = 0; errors are (m, k) and (n_d, k) per p_inf."""
    if not len(fixed):
        return None
    return FurtherTables(
        response=coefficients,
        fixed_response=fixed,
        strain_covariance=of_load @ of_strain.T,
        variance=np.sum(of_load**2, axis=1),
    )


def _terms_of(terms: dict[str, FloatArray], ensemble: Ensemble, n_gauges: int) -> list[dict[str, Any]]:
    """Return name and rms strain over the gauges [m/m] of each of ``terms``, at the mean p_inf of the flows."""
    pressure = float(np.average(ensemble.ambient_pressure, weights=ensemble.weight))
    return [
        {"name": name, "rms_strain": pressure * float(np.sqrt(np.sum(columns[:n_gauges] ** 2) / n_gauges))}
        for name, columns in terms.items()
    ]


def _check_flows(flows: FlowAmplitudes) -> None:
    found = len(flows.mach), int(np.sum(flows.incidence > 1e-9))
    if found[0] < MIN_FLOWS[0] or found[1] < MIN_FLOWS[1]:
        raise InputError(
            f"map.estimator: 'manifold' needs {MIN_FLOWS[0]} Mach numbers and {MIN_FLOWS[1]} total incidences "
            f"above 0 at least, got {found[0]} and {found[1]}"
        )


def _tables(flows: FlowAmplitudes, response: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return knots of the incidence and spline coefficients of every channel of ``response``."""
    values = response_values(flows, response)
    inclined = np.flatnonzero(flows.incidence > 1e-9)
    zero = values[:, 0] if len(inclined) < len(flows.incidence) else None
    incidence = flows.incidence[inclined]
    return spline_coefficients(flows.mach, incidence, values[:, inclined], spline_rows(incidence), zero)


def _fixed_covariance(problem: Problem) -> FloatArray:
    """Return (n_d, n_d) of the noise that does not follow the pressure level [(m/m)^2]."""
    return np.asarray(np.sum([term.strain @ term.strain.T for term in problem.noise if not term.scales], axis=0))


def _scaled_errors(
    vehicle: Vehicle, problem: Problem, flows: FlowAmplitudes, grid: SurfaceGrid, response: FloatArray
) -> dict[str, FloatArray]:
    """Return columns (n_d + 5 + m, k) per p_inf: pressure off the tables and the internal pressure, by name."""
    entry, noise = vehicle.map, vehicle.noise
    operator = _operator(problem)
    found = {"interpolation": interpolation_errors(flows, response).T}
    if entry.discrepancy_percent > 0.0:
        along, around = gaussian_process_shapes(
            grid, float(grid.x[-1]), entry.discrepancy_length, float(np.deg2rad(entry.discrepancy_roll_deg))
        )
        columns = response_of_shapes(operator, along, around)
        found["pressure off the tables"] = 0.01 * entry.discrepancy_percent * columns
    if entry.discrepancy_of_prior_percent > 0.0:
        modes, ensemble = rolled_modes(problem.ensemble, None), problem.ensemble
        pressure = float(np.average(ensemble.ambient_pressure, weights=ensemble.weight))
        spread = operator @ (modes.modes * modes.coefficient_std())
        found["fraction of the snapshots"] = 0.01 * entry.discrepancy_of_prior_percent / pressure * spread
    if noise.internal_pressure_percent > 0.0:
        column = 0.01 * noise.internal_pressure_percent * operator.sum(axis=1)
        column[len(problem.strain_operator) :] = 0.0  # loads are those of the stated internal pressure
        found["internal pressure"] = column[:, None]
    return found


def _compressed(columns: FloatArray) -> FloatArray:
    """Return at most as many columns as rows with the same covariance."""
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    upper = np.asarray(np.linalg.qr((columns / size).T, mode="r"))
    return np.asarray(size * upper.T)


def _scaled_nuisance(nuisance: Sequence[NoiseTerm], problem: Problem) -> dict[str, FloatArray]:
    """Return columns (n_d + 5 + m, k) per p_inf of the further terms that scale, by name."""
    ensemble = problem.ensemble
    pressure = float(np.average(ensemble.ambient_pressure, weights=ensemble.weight))
    found = {}
    for term in nuisance:
        if term.scales:
            columns, further = term.strain.shape[1], problem.further_operator
            load = np.zeros((5, columns)) if term.load is None else term.load
            none = np.zeros((0 if further is None else len(further), columns))
            found[term.name] = np.vstack([term.strain, load, none if term.further is None else term.further])
            found[term.name] /= pressure
    return found
