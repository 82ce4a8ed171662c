"""The inverse map from snapshots and strain per pressure."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from typing import Any

import numpy as np

from builder.aero.loads.operator import coefficients_of, load_operator
from builder.aero.loads.sections import further_load_operator
from builder.aero.surface.mesh import SurfaceMesh, mesh_load_operator, mesh_of_grid
from builder.campaign.snapshot_transfer import snapshots_on
from builder.campaign.snapshots import Snapshots
from builder.inverse.cases.observable_states import on_observable_states
from builder.inverse.envelope.bounds import coefficient_half_spaces, flight_ranges
from builder.inverse.envelope.score_limit import with_score_limit
from builder.inverse.loads.covariance import load_covariance_by_terms
from builder.inverse.loads.further import further_loads
from builder.inverse.modes.ensemble import Ensemble, ensemble_of
from builder.inverse.noise.flows_between import BETWEEN, flows_between
from builder.inverse.noise.gauges import gauge_covariance, nuisance_terms
from builder.inverse.noise.hardware_errors import HardwareError, error_model, hardware_errors, hardware_terms
from builder.inverse.noise.leeward import LEEWARD_PRESSURE, leeward_fields
from builder.inverse.noise.mesh_error import MeshError, mesh_error
from builder.inverse.noise.model import NoiseTerm, gauge_noise, pressure_errors
from builder.inverse.noise.thermal import (
    modulus_std,
    thermal_map,
    thermal_terms,
    with_further_rows,
    with_isothermal,
)
from builder.inverse.sensors.sensor_set import SensorSet, joined_errors, joined_terms, sensor_set
from builder.inverse.solution import Problem, Solution, solve
from builder.structure.fourier.model import StructuralModel, structural_model_on
from builder.structure.mapped_structure import MappedStructure
from builder.structure.solid.case import structure_case
from builder.structure.solid.checks.reference_loads import ELEMENT_FRACTION
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.validity import condition_ranges, parameter_ranges
from strainfmu.version import __version__

AnyStructure = StructuralModel | MappedStructure


def gauge_noise_covariance(vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure) -> FloatArray:
    """Return the covariance (n_d, n_d) of the noise of the gauges in use [(m/m)^2].

    Relative noise is a fraction of the median |strain| over the snapshots, at their own pressure level and as they
    are listed, and the gauges of ``noise.of_layout``.

    Raises
    ------
    InputError
        The section [noise] does not fit the gauges.
    """
    entry = vehicle.noise
    layout, median = vehicle.gauges.layout, 0.0
    if entry.percent_of_median_strain is not None:
        inside = np.array([vehicle.internal_pressure(condition) for condition in snapshots.conditions()])
        net = snapshots.pressure - inside[:, None]
        median = float(np.median(np.abs(net @ structure.strain_operator(entry.of_layout or layout).T)))
    return gauge_covariance(entry, len(structure.layouts[layout].names), median, vehicle.beside(""))


def check_noise(vehicle: Vehicle) -> None:
    """Refuse entries and files of the section [noise] that do not fit the gauges in use.

    Called before the long work.

    Raises
    ------
    InputError
        As :func:`gauge_noise_covariance` and :func:`builder.inverse.noise.gauges.nuisance_terms`.
    """
    entry, layout = vehicle.noise, vehicle.gauges.layout
    names = structure_case(vehicle, [layout]).layouts[layout].name
    gauge_covariance(entry, len(names), 1.0, vehicle.beside(""))
    if entry.nuisance_file is not None:
        nuisance_terms(vehicle.beside(entry.nuisance_file), names)


def noise_terms(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    ensemble: Ensemble,
    errors: list[HardwareError],
) -> list[NoiseTerm]:
    """Return the noise terms of the section [noise], without the truncated modes.

    ``errors`` are those in proportion to strain.

    Raises
    ------
    InputError
        The section does not fit the gauges, or the structural model cannot do what it requests.
    """
    layout, file = vehicle.gauges.layout, vehicle.noise.nuisance_file
    nuisance = [] if file is None else nuisance_terms(vehicle.beside(file), structure.layouts[layout].names)
    own = gauge_noise(gauge_noise_covariance(vehicle, snapshots, structure))
    z_p = structure.strain_operator(layout)
    return [own, *nuisance, *hardware_terms(vehicle, errors, ensemble, z_p)]


def build_inverse_map(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    nuisance: Sequence[NoiseTerm] = (),
    problem: Problem | None = None,
) -> InverseMap:
    """Build the map of the case in the vehicle file, for the layout in use.

    Parameters and errors are those of :func:`inverse_problem`, whose result ``problem`` is where it is known. The
    gauges may also fail to identify the requested modes.
    """
    snapshots = on_structure(snapshots, structure)
    problem = problem or inverse_problem(vehicle, snapshots, structure, nuisance)
    solution = solve(problem)
    found = on_observable_states(inverse_map_of(vehicle, snapshots, structure, problem, solution))
    return with_score_limit(found, problem, solution)


def inverse_problem(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    nuisance: Sequence[NoiseTerm] = (),
    left: Sequence[HardwareError] = (),
) -> Problem:
    """Return what the map of the layout in use is solved from.

    Parameters
    ----------
    vehicle : the vehicle file.
    snapshots : surface pressure at the flight conditions.
    structure : strain per pressure.
    nuisance : further noise terms, such as thermal strain.
    left : further errors in proportion to strain, such as what a ground test left.

    Raises
    ------
    InputError
        The snapshots' surface is not the structure's, or the section [noise] does not fit the gauges.
    """
    snapshots = on_structure(snapshots, structure)
    z_p = structure.strain_operator(vehicle.gauges.layout)
    ensemble = ensemble_of(vehicle, snapshots)
    mesh = _mesh_error(vehicle, snapshots, structure, ensemble)
    thermal = thermal_map(vehicle)
    errors = hardware_errors(vehicle, structure, z_p, ensemble, modulus_std=modulus_std(thermal))
    errors += left
    if mesh is not None and vehicle.noise.model == "default":
        errors += mesh.terms()
    terms = [
        *noise_terms(vehicle, snapshots, structure, ensemble, errors),
        *thermal_terms(vehicle, thermal),
        *nuisance,
    ]
    own = gauge_noise_covariance(vehicle, snapshots, structure)
    sensors = sensor_set(vehicle, structure, ensemble, own)
    if sensors is not None:
        terms = joined_terms(terms, errors, sensors, ensemble)
        errors = joined_errors(errors, sensors, len(z_p), ensemble)
        z_p = np.vstack([z_p, sensors.operator])
    loads = _load_operator(structure.surface, vehicle.reference_quantities().moment_station)
    further = further_load_operator(
        structure.surface, vehicle.map.section_stations_m, vehicle.reference_quantities().moment_station
    )
    between, off, leeward = flows_between(vehicle, snapshots), None, None
    if ensemble.grid is None and vehicle.noise.model == "default":
        leeward = leeward_fields(vehicle, snapshots, ensemble)
        if between is not None:
            off = between.off_the_snapshots(ensemble, vehicle.map.form == "dynamic_pressure")
    for name, fields in ((BETWEEN, off), (LEEWARD_PRESSURE, leeward)):
        if fields is not None:
            terms.append(pressure_errors(name, fields, z_p, loads, further))
    return Problem(
        ensemble=ensemble,
        strain_operator=z_p,
        load_operator=loads,
        node_area=_mesh(structure.surface).node_area,
        noise=tuple(terms),
        errors=tuple(errors),
        with_truncated_modes=vehicle.noise.with_truncated_modes,
        entry=vehicle.map,
        mesh=mesh,
        sensors=sensors,
        further_operator=further,
        thermal=thermal if sensors is None else with_further_rows(thermal, len(sensors.rows)),
        between=between,
        off_the_snapshots=off,
        leeward=leeward,
    )


def _mesh_error(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, ensemble: Ensemble
) -> MeshError | None:
    """Return the error by the structure's mesh, None where nothing is known of it."""
    layout, against = vehicle.gauges.layout, structure.checked_against
    operator = structure.error_operator(layout)
    if operator is None and isinstance(structure, MappedStructure) and not structure.is_external:
        operator, against = _difference_of_fourier_model(vehicle, structure), "the Fourier model"
    if operator is None:
        return None
    std = np.sqrt(np.diag(gauge_noise_covariance(vehicle, snapshots, structure)))
    return mesh_error(operator, against, ensemble, std)


def _difference_of_fourier_model(vehicle: Vehicle, structure: MappedStructure) -> FloatArray | None:
    """Return what the Fourier model's Z_p (n_d, n_p) [1/Pa] adds to ``structure``; None where it cannot do it."""
    layout, surface = vehicle.gauges.layout, structure.surface
    if not isinstance(surface, SurfaceGrid) or layout not in vehicle.gauges.layouts:
        return None
    own = vehicle.resolution.map
    length = min(own.element_length_mm, 1e3 * ELEMENT_FRACTION * vehicle.body().length)
    fine = own.model_copy(update={"element_length_mm": length, "wall_layers": max(2, own.wall_layers)})
    try:
        other = structural_model_on(vehicle, surface, fine, [layout])
    except InputError:
        return None
    return other.strain_operator(layout) - structure.strain_operator(layout)


def inverse_map_of(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, problem: Problem, solution: Solution
) -> InverseMap:
    """Return the map of a solved ``problem``; its first noise term is the gauges' own."""
    snapshots, reference = on_structure(snapshots, structure), vehicle.reference_quantities()
    z_p, loads, ensemble = problem.strain_operator, problem.load_operator, problem.ensemble
    solved, load_per_state = solution.solved, loads @ solution.field_modes
    coefficients = ensemble.coefficients(loads)
    gauges = structure.layouts[vehicle.gauges.layout]
    ranges, half_spaces = flight_ranges(vehicle, ensemble), coefficient_half_spaces(ensemble, coefficients)
    return InverseMap(
        vehicle=vehicle.name,
        case=problem.entry.case,
        **_rows(gauges, problem.sensors),
        noise_std=np.linalg.norm(problem.noise[0].strain, axis=1),
        state_operator=solved.state_operator,
        noise_covariance=solved.noise_covariance,
        regularisation=solved.regularisation,
        strain_gain=solved.strain_gain,
        state_offset=solved.state_offset,
        load_per_state=load_per_state,
        load_of_mean=loads @ (solution.mean - ensemble.fixed_pressure),
        load_covariance=load_covariance_by_terms(
            solved, load_per_state, solution.noise, solution.noise.strain_load_covariance
        ),
        mean_strain=solved.mean_strain,
        residual_whitening=solved.residual_whitening,
        residual_degrees_of_freedom=solved.residual_degrees_of_freedom,
        strain_range=np.abs(ensemble.responses(z_p) + problem.offset).max(axis=0),
        coefficient_range=np.column_stack([coefficients.min(axis=0), coefficients.max(axis=0)]),
        reference_area=reference.area,
        reference_length=reference.length,
        nominal_dynamic_pressure=ensemble.nominal_dynamic_pressure,
        strain_load_covariance=solution.noise.strain_load_covariance,
        provenance=_provenance(vehicle, snapshots, structure, problem, solution),
        dynamic_pressure_error=0.01 * vehicle.noise.dynamic_pressure_percent,
        envelope_direction=half_spaces.direction,
        envelope_limit=half_spaces.limit,
        dynamic_pressure_range=ranges.dynamic_pressure,
        mach_number_range=ranges.mach_number,
        altitude_range=ranges.altitude,
        thermal=with_isothermal(problem.thermal, solution.noise.terms),
        **(
            _scaled_parts(problem, solution, coefficients)
            if problem.entry.form == "dynamic_pressure"
            else {"further": further_loads(problem, solution, None)}
        ),
        **(_field(problem, solution, _mesh(structure.surface)) if problem.entry.keep_field else {}),
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


def _scaled_parts(problem: Problem, solution: Solution, coefficients: FloatArray) -> dict[str, Any]:
    """Return the fields of a map in form "dynamic_pressure" that one in form "absolute" does not have."""
    scaling = [term for term in solution.noise.terms if term.scales]
    fixed = [term.strain @ term.strain.T for term in solution.noise.terms if not term.scales]
    m = 0 if problem.further_operator is None else len(problem.further_operator)
    strain, load = _compressed(scaling, len(problem.strain_operator), m)
    parts: dict[str, Any] = {
        "form": "dynamic_pressure",
        "gauge_covariance": np.sum(fixed, axis=0),
        "error_strain": strain,
        "error_load": load[:5],
        "further": further_loads(problem, solution, load[5:]),
    }
    inside = problem.ensemble.fixed_pressure
    if inside != 0.0:
        parts["fixed_strain"] = -inside * problem.strain_operator.sum(axis=1)
        parts["fixed_load"] = -inside * problem.load_operator.sum(axis=1)
    errors = error_model(list(problem.errors), problem.ensemble, coefficients)
    if errors is not None:
        parts["gauge_error_product"] = errors.of_gauge
        parts["common_error"] = errors.common
        parts["mean_product"] = errors.mean_product
    return parts


def _compressed(terms: list[NoiseTerm], n_gauges: int, n_further: int) -> tuple[FloatArray, FloatArray]:
    """Return strain (n_d, k) and load (5 + m, k) columns with the covariance of all ``terms``.

    k is at most n_d + 5 + m with m = ``n_further`` further loads.
    """
    if not terms:
        return np.zeros((n_gauges, 0)), np.zeros((5 + n_further, 0))
    joint = np.hstack([np.vstack([term.strain, _loads_of(term, n_further)]) for term in terms])
    # Rows of one size: strain and newtons differ by many orders of magnitude.
    size = np.linalg.norm(joint, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    upper: FloatArray = np.asarray(np.linalg.qr((joint / size).T, mode="r"))
    triangle = size * upper.T
    return triangle[:n_gauges], triangle[n_gauges:]


def _loads_of(term: NoiseTerm, n_further: int) -> FloatArray:
    """Return (5 + m, k) loads of the columns of ``term``, zero where it has none."""
    parts = ((term.load, 5), (term.further, n_further))
    k = term.strain.shape[1]
    return np.vstack([np.zeros((rows, k)) if part is None else part for part, rows in parts])


def on_structure(snapshots: Snapshots, structure: AnyStructure) -> Snapshots:
    """Return the snapshots at the structure's nodes, unchanged where they are there already."""
    return snapshots_on(snapshots, structure.surface) if isinstance(structure.surface, SurfaceGrid) else snapshots


def _provenance(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, problem: Problem, solution: Solution
) -> dict[str, Any]:
    conditions, ensemble, names = snapshots.conditions(), problem.ensemble, snapshots.parameter_names
    return {
        "strainfmu_version": __version__,
        "layout": vehicle.gauges.layout,
        "snapshots": len(conditions),
        "flows_solved": int(snapshots.solved.sum()),
        **solution.facts,
        "form": problem.entry.form,
        "symmetry": "listed" if ensemble.grid is None else "full",
        "noise_terms": [
            {"name": one.name, "share": one.fraction, "rms_strain": one.rms_strain}
            for one in solution.noise.fractions()
        ],
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
    scaled, none = problem.entry.form == "dynamic_pressure", np.zeros(len(solution.mean))
    variance = none if solution.unresolved is None else solution.unresolved
    return {
        "field_std": np.sqrt(variance).astype(np.float32),
        "field_is_net": scaled and problem.ensemble.fixed_pressure == 0.0,
        "field_mean": solution.mean.astype(np.float32),
        "field_modes": solution.field_modes.astype(np.float32),
        "point": mesh.point.astype(np.float32),
        "triangle": mesh.triangle.astype(np.int32),
    }


def _mesh(surface: SurfaceGrid | SurfaceMesh) -> SurfaceMesh:
    return mesh_of_grid(surface) if isinstance(surface, SurfaceGrid) else surface


def _load_operator(surface: SurfaceGrid | SurfaceMesh, moment_station: float) -> FloatArray:
    """Return (5, n_p) loads per nodal pressure about ``moment_station`` [m]."""
    if isinstance(surface, SurfaceGrid):
        return load_operator(surface, moment_station)
    return mesh_load_operator(surface, moment_station)


def snapshot_coefficients(vehicle: Vehicle, snapshots: Snapshots, loads: FloatArray) -> FloatArray:
    """Return (N, 5) coefficients of the snapshots; ``loads`` is the load operator (5, n_p)."""
    conditions = snapshots.conditions()
    inside = np.array([vehicle.internal_pressure(condition) for condition in conditions])
    return coefficients_of(snapshots.pressure - inside[:, None], loads, conditions, vehicle.reference_quantities())
