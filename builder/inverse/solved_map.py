"""The map of a solved problem: its operators, parts of the form "dynamic_pressure", field and provenance."""

from __future__ import annotations

from math import degrees
from typing import Any

import numpy as np

from builder.aero.loads.groups import other_load_fields
from builder.aero.surface.mesh import SurfaceMesh, mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.envelope.bounds import coefficient_half_spaces, flight_ranges
from builder.inverse.modes.ensemble import Ensemble
from builder.inverse.noise.hardware_errors import error_model
from builder.inverse.noise.inertia import inertia_in_words, with_rest
from builder.inverse.noise.model import NoiseTerm
from builder.inverse.noise.thermal import NAME as TEMPERATURE_MODES
from builder.inverse.noise.thermal import with_isothermal
from builder.inverse.problem import AnyStructure, on_structure
from builder.inverse.sensors.sensor_set import SensorSet
from builder.inverse.solution import Problem, Solution
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.validity import condition_ranges, parameter_ranges
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.settings import GAUGE_RANGE
from strainfmu.version import __version__


def inverse_map_of(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, problem: Problem, solution: Solution
) -> InverseMap:
    """Return the map of a solved ``problem``; its first noise term is the gauges' own."""
    snapshots, reference = on_structure(snapshots, structure), vehicle.reference_quantities()
    z_p, loads, ensemble = problem.strain_operator, problem.load_operator, problem.ensemble
    solved, load_per_state = solution.solved, loads @ solution.field_modes
    coefficients = ensemble.coefficients(loads[FIVE_LOADS])
    gauges = structure.layouts[vehicle.gauges.layout]
    envelope_direction, envelope_limit = coefficient_half_spaces(ensemble, coefficients)
    return InverseMap(
        vehicle=vehicle.name,
        case=problem.entry.case,
        **_rows(gauges, problem.sensors),
        noise_std=np.linalg.norm(problem.noise[0].strain, axis=1),
        state_operator=solved.state_operator,
        regularisation=solved.regularisation,
        load_per_state=load_per_state,
        load_of_mean=loads @ (solution.mean - ensemble.fixed_pressure),
        mean_strain=solved.mean_strain,
        strain_range=np.abs(ensemble.responses(z_p) + problem.offset).max(axis=0),
        coefficient_range=np.column_stack([coefficients.min(axis=0), coefficients.max(axis=0)]),
        reference_area=reference.area,
        reference_length=reference.length,
        nominal_dynamic_pressure=ensemble.nominal_dynamic_pressure,
        provenance=_provenance(vehicle, snapshots, structure, problem, solution),
        dynamic_pressure_error=0.01 * vehicle.noise.dynamic_pressure_percent,
        envelope_direction=envelope_direction,
        envelope_limit=envelope_limit,
        **flight_ranges(vehicle, ensemble.conditions),
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
    scaling = [term for term in solution.noise.terms if term.scales]
    fixed = [term.strain @ term.strain.T for term in solution.noise.terms if not term.scales]
    thermal = with_isothermal(problem.thermal, solution.noise.terms)
    strain, load = _compressed(scaling, len(problem.strain_operator), len(problem.load_operator))
    return {
        "gauge_covariance": np.sum(fixed, axis=0),
        "error_strain": strain,
        "error_load": load,
        **({} if thermal is None else {"thermal": thermal}),
        "inertia": with_rest(problem.inertia, solution.noise.terms, (TEMPERATURE_MODES,)),
    }


def _parts_that_follow(problem: Problem, coefficients: FloatArray) -> dict[str, Any]:
    """Return the fields of a map in form "dynamic_pressure" that one in form "absolute" does not have."""
    parts = dict[str, Any]()
    inside = problem.ensemble.fixed_pressure
    if inside != 0.0:
        parts["fixed_strain"] = -inside * problem.strain_operator.sum(axis=1)
        parts["fixed_load"] = -inside * problem.load_operator.sum(axis=1)
    return parts | error_model(list(problem.errors), problem.ensemble, coefficients)


def _compressed(terms: list[NoiseTerm], n_gauges: int, n_loads: int) -> tuple[FloatArray, FloatArray]:
    """Return strain (n_d, k) and load (n_f, k) columns, k <= n_d + n_f, with the covariance of all ``terms``."""
    if not terms:
        return np.zeros((n_gauges, 0)), np.zeros((n_loads, 0))
    none = (np.zeros((n_loads, term.strain.shape[1])) for term in terms)
    loads = (zero if term.load is None else term.load for term, zero in zip(terms, none, strict=True))
    joint = np.hstack([np.vstack([term.strain, load]) for term, load in zip(terms, loads, strict=True)])
    # Rows of one size: strain and newtons differ by many orders of magnitude.
    size = np.linalg.norm(joint, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    upper: FloatArray = np.asarray(np.linalg.qr((joint / size).T, mode="r"))
    triangle = size * upper.T
    return triangle[:n_gauges], triangle[n_gauges:]


def _provenance(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, problem: Problem, solution: Solution
) -> dict[str, Any]:
    conditions, ensemble, names = snapshots.conditions(), problem.ensemble, snapshots.parameter_names
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
        "noise_terms": [
            {"name": one.name, "share": one.fraction, "rms_strain": one.rms_strain}
            for one in solution.noise.fractions()
        ],
        "inertia": inertia_in_words(vehicle),
        **({"recorder": recorder} if recorder else {}),
        "internal_pressure_Pa": vehicle.structure.internal_pressure_Pa,
        **condition_ranges(conditions),
        **({"parameters": parameter_ranges(names, conditions)} if names else {}),
        "total_incidence_deg": _incidence_range(ensemble),
        "moment_station_m": vehicle.reference_quantities().moment_station,
        "resolution": vehicle.resolution.map.model_dump(),
        "structural_model": structure.description,
        **({} if problem.mesh is None else {"mesh_error": problem.mesh.record(_gauge_names(vehicle, structure))}),
    }


def _gauge_names(vehicle: Vehicle, structure: AnyStructure) -> tuple[str, ...]:
    return structure.layouts[vehicle.gauges.layout].names


def _incidence_range(ensemble: Ensemble) -> list[float]:
    incidence = [degrees(condition.total_incidence) for condition in ensemble.conditions]
    return [min(incidence), max(incidence)]


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
