"""The inverse map from snapshots and strain per pressure.

The map of a solved problem: its operators, parts of the form "dynamic_pressure", field and provenance.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from builder.aero.load_groups import other_load_fields
from builder.aero.load_operator import coefficients_of
from builder.aero.surface.mesh import SurfaceMesh, mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.envelope import (
    coefficient_half_spaces,
    condition_ranges,
    flight_ranges,
    parameter_ranges,
    with_score_limit,
)
from builder.inverse.noise.hardware_errors import error_model
from builder.inverse.noise.inertia import NAME as INERTIA
from builder.inverse.noise.inertia import VIBRATION_MODES, inertia_in_words
from builder.inverse.noise.model import NoiseTerm, fixed_covariance, principal_columns
from builder.inverse.problem import AnyStructure, inverse_problem, on_structure
from builder.inverse.sensor_set import SensorSet
from builder.inverse.solution import Problem, Solution
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from strainfmu.arrays import FloatArray, lower_factor
from strainfmu.estimator.map.inverse_map import DENSE_GAUGES, InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.settings import GAUGE_RANGE
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.linear.state_map import whitened_spectrum
from strainfmu.version import __version__

LEAST_COLUMN, LEAST_OF_MANY = 1e-7, 1e-3
"""Size of a column of errors, over noise and loads, of which maps of few and of many gauges do without."""


def inverse_map_of(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, problem: Problem, solution: Solution
) -> InverseMap:
    """Return the map of a solved ``problem``; its first noise term is the gauges' own."""
    snapshots, reference = on_structure(snapshots, structure), vehicle.reference_quantities()
    loads, ensemble = problem.load_operator, problem.ensemble
    solved, load_per_state = solution.solved, loads @ solution.field_modes
    coefficients = ensemble.coefficients(loads[FIVE_LOADS])
    gauges = structure.layouts[vehicle.gauges.layout]
    envelope_direction, envelope_limit = coefficient_half_spaces(ensemble, coefficients)
    return InverseMap(
        vehicle=vehicle.name,
        case=problem.entry.case,
        **_rows(gauges, problem.sensors),
        noise_std=np.sqrt(problem.noise[0].variance),
        state_operator=solved.state_operator,
        regularisation=solved.regularisation,
        load_per_state=load_per_state,
        load_of_mean=loads @ (solution.mean - ensemble.fixed_pressure),
        mean_strain=solved.mean_strain,
        strain_range=np.abs(problem.strain).max(axis=0),
        coefficient_range=np.column_stack([coefficients.min(axis=0), coefficients.max(axis=0)]),
        reference_area=reference.area,
        reference_length=reference.length,
        nominal_dynamic_pressure=ensemble.nominal_dynamic_pressure,
        provenance=_provenance(vehicle, snapshots, structure, problem, solution),
        dynamic_pressure_error=0.01 * vehicle.noise.dynamic_pressure_percent,
        envelope_direction=envelope_direction,
        envelope_limit=envelope_limit,
        **flight_ranges(problem.entry, ensemble.conditions),
        form=problem.entry.form,
        **other_load_fields(problem.entry),
        **_errors(problem, solution),
        **(_parts_that_follow(problem, coefficients) if problem.entry.follows_pressure else {}),
        **(_field(problem, solution, mesh_of(structure.surface)) if problem.entry.keep_field else {}),
    )


def _rows(gauges: GaugeLayout, sensors: SensorSet | None) -> dict[str, Any]:
    """Return names, positions and directions of the map's rows, and what those that are no gauges measure."""
    direction = gauges.direction / np.linalg.norm(gauges.direction, axis=1, keepdims=True)
    if sensors is None:
        return {"gauge_names": gauges.names, "gauge_position": gauges.position, "gauge_direction": direction}
    return {
        "gauge_names": (*gauges.names, *(row.name for row in sensors.rows)),
        "gauge_position": np.vstack([gauges.position, *(row.position for row in sensors.rows)]),
        "gauge_direction": np.vstack([direction, *(row.direction for row in sensors.rows)]),
        "sensors": sensors.described(len(gauges.names)),
    }


def _errors(problem: Problem, solution: Solution) -> dict[str, Any]:
    """Return the fields of a map on its errors, temperature and inertia among them.

    In form "absolute" nothing follows the dynamic pressure; terms without a load then need no columns either.
    """
    terms, modes = solution.noise.terms, dict[str, Any]()
    if problem.thermal is not None:
        rest = fixed_covariance(terms, (TEMPERATURE,))
        modes["thermal"] = replace(problem.thermal, isothermal_covariance=rest)
    if problem.inertia is not None:
        rest = fixed_covariance(terms, (INERTIA, VIBRATION_MODES, TEMPERATURE))
        modes["inertia"] = replace(problem.inertia, rest_covariance=rest)
    squares = [term.strain**2 for term in terms if term.scales and term.is_own]
    common = [term for term in terms if term.scales and not term.is_own]
    n_gauges, n_loads = len(problem.strain_operator), len(problem.load_operator)
    columns = [np.zeros((n_gauges + n_loads, 0)), *(term.strain_and_load(n_loads) for term in common)]
    strain, load = np.split(fewest_columns(columns, problem.noise[0].variance), [n_gauges])
    return {
        "gauge_covariance": fixed_covariance(terms),
        "own_error_strain": np.sqrt(np.sum(squares, axis=0)) if squares else np.zeros(0),
        "error_strain": strain,
        "error_load": load,
        **modes,
    }


def fewest_columns(blocks: Sequence[FloatArray], variance: FloatArray) -> FloatArray:
    """Return (n_d + n_f, k) columns with the covariance of all ``blocks`` (n_d + n_f, m) of columns.

    What a column more would add is, of all gauges together, at most :data:`LEAST_COLUMN` of their noise of
    ``variance`` (n_d,), and of each load as much of its standard deviation; of more gauges than linear estimators
    take by full matrices :data:`LEAST_OF_MANY`, so that the number of columns does not grow with the gauges.
    """
    least = LEAST_COLUMN if len(variance) <= DENSE_GAUGES else LEAST_OF_MANY
    of_load = np.sqrt(sum(np.sum(block[len(variance) :] ** 2, axis=1) for block in blocks))
    size = np.concatenate([np.sqrt(variance), np.where(of_load > 0.0, of_load, 1.0)])[:, None]
    return size * principal_columns([block / size for block in blocks], least)


def _parts_that_follow(problem: Problem, coefficients: FloatArray) -> dict[str, Any]:
    """Return the fields of a map in form "dynamic_pressure" that one in form "absolute" does not have."""
    parts = dict[str, Any]()
    inside = problem.ensemble.fixed_pressure
    if inside != 0.0:
        parts["fixed_strain"] = -inside * problem.strain_operator.sum(axis=1)
        parts["fixed_load"] = -inside * problem.load_operator.sum(axis=1)
    return parts | error_model(list(problem.errors), problem.ensemble, coefficients)


def _provenance(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, problem: Problem, solution: Solution
) -> dict[str, Any]:
    conditions, ensemble, names = snapshots.conditions(), problem.ensemble, snapshots.parameter_names
    incidence = [degrees(condition.total_incidence) for condition in ensemble.conditions]
    gauges = structure.layouts[vehicle.gauges.layout]
    recorder = vehicle.recorder.model_dump(exclude_defaults=True)
    return {
        "strainfmu_version": __version__,
        "layout": vehicle.gauges.layout,
        **({} if vehicle.gauges.range_um_per_m is None else {GAUGE_RANGE: vehicle.gauges.range_um_per_m}),
        "snapshots": len(conditions),
        "flows_solved": int(snapshots.solved.sum()),
        **solution.facts,
        "form": problem.entry.form,
        "symmetry": "listed" if ensemble.grid is None else "full",
        "noise_terms": solution.noise.fractions(),
        "inertia": inertia_in_words(vehicle),
        **({"recorder": recorder} if recorder else {}),
        "internal_pressure_Pa": vehicle.structure.internal_pressure_Pa,
        **condition_ranges(conditions),
        **({"parameters": parameter_ranges(names, conditions)} if names else {}),
        "total_incidence_deg": [min(incidence), max(incidence)],
        "moment_station_m": vehicle.reference_quantities().moment_station,
        "resolution": vehicle.resolution.map.model_dump(),
        "structural_model": structure.description,
        **({} if problem.mesh is None else {"mesh_error": problem.mesh.record(gauges.names)}),
    }


def _field(problem: Problem, solution: Solution, mesh: SurfaceMesh) -> dict[str, Any]:
    """Return the fields of the map that give pressure on the surface, in single precision."""
    scaled, none = problem.entry.follows_pressure, np.zeros(len(solution.mean))
    variance = none if solution.unresolved is None else solution.unresolved
    return {
        "field_std": np.sqrt(variance).astype(np.float32),
        "field_is_net": scaled and problem.ensemble.fixed_pressure == 0.0,
        "field_mean": solution.mean.astype(np.float32),
        "field_modes": solution.field_modes.astype(np.float32),
        "point": mesh.point.astype(np.float32),
        "triangle": mesh.triangle.astype(np.int32),
    }


def on_observable_states(inverse_map: InverseMap) -> InverseMap:
    """Return ``inverse_map`` with n_d states, where it has more than its n_d gauges.

    With L^-1 A = U S V^T the new states are V_d^T q, amplitudes of the data-informed modes F v_k by falling
    eigenvalue (paper, eq. eigproblem). No gauge observes the other states, with any gauges lost: their
    estimate is the prior's mean, 0. So loads, fields and residuals do not change. What the other states add to the
    covariance of the loads is part of ``error_load``, and no gain changes it. With 243
    snapshots a field of 60,000 nodes takes 13 MB instead of 58.
    """
    n_gauges, n_states = inverse_map.state_operator.shape
    if n_states <= n_gauges:
        return inverse_map
    right = whitened_spectrum(inverse_map.state_operator, inverse_map.noise_covariance).right_vectors
    observable = right[:, :n_gauges]
    of_hidden = lower_factor(inverse_map.load_per_state @ right[:, n_gauges:])
    return replace(
        inverse_map,
        # States without strain, whose loads count, become columns of errors without strain.
        error_strain=np.hstack([inverse_map.error_strain, np.zeros((n_gauges, len(of_hidden.T)))]),
        error_load=np.hstack([inverse_map.error_load, of_hidden]),
        state_operator=inverse_map.state_operator @ observable,
        load_per_state=inverse_map.load_per_state @ observable,
        field_std=_with_hidden(inverse_map, observable),
        field_modes=inverse_map.field_modes @ observable.astype(np.float32),
    )


def _with_hidden(inverse_map: InverseMap, observable: FloatArray) -> NDArray[np.float32]:
    """Return (n_p,) standard deviation [Pa] of the field that no state holds, the states left out included.

    All states are standard normal: a node has the variance of all of them less the variance of the observable
    ones.
    """
    field, std = inverse_map.field_modes, inverse_map.field_std
    observed = field @ observable.astype(np.float32)
    hidden = np.einsum("pq,pq->p", field, field) - np.einsum("pq,pq->p", observed, observed)
    return np.sqrt(std**2 + np.maximum(hidden, 0.0)).astype(np.float32)


def build_inverse_map(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    nuisance: Sequence[NoiseTerm] = (),
    problem: Problem | None = None,
) -> InverseMap:
    """Build the map of the case in the vehicle file, for the layout in use.

    Parameters and errors are as in :func:`~builder.inverse.problem.inverse_problem`, whose result ``problem``
    is where it is known. The gauges may also fail to identify the requested modes.
    """
    snapshots = on_structure(snapshots, structure)
    problem = problem or inverse_problem(vehicle, snapshots, structure, nuisance)
    inverse_map = inverse_map_of(vehicle, snapshots, structure, problem, problem.solution)
    return with_score_limit(on_observable_states(inverse_map), problem, problem.solution.noise.terms)


def snapshot_coefficients(vehicle: Vehicle, snapshots: Snapshots, loads: FloatArray) -> FloatArray:
    """Return (N, 5) coefficients of the snapshots; ``loads`` is the load operator (5, n_p)."""
    conditions = snapshots.conditions()
    inside = vehicle.structure.internal_pressure(conditions)
    return coefficients_of(snapshots.pressure - inside[:, None], loads, conditions, vehicle.reference_quantities())
