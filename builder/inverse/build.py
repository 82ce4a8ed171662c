"""The inverse map from snapshots and strain per pressure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from builder.aero.loads import coefficients_of, load_operator
from builder.aero.surface_mesh import SurfaceMesh, mesh_load_operator, mesh_of_grid
from builder.campaign.snapshot_transfer import snapshots_on
from builder.campaign.snapshots import Snapshots
from builder.inverse.coefficients import load_covariance_by_terms
from builder.inverse.gauge_derivatives import gauge_derivatives
from builder.inverse.gauge_noise import gauge_covariance, gauge_error_terms, nuisance_terms
from builder.inverse.noise_model import NoiseTerm, gauge_noise
from builder.inverse.observable_states import on_observable_states
from builder.inverse.solution import Problem, Solution, solve
from builder.structure.fourier.model import StructuralModel
from builder.structure.mapped_structure import MappedStructure
from builder.structure.solid.case import solid_case
from builder.vehicle.file import Vehicle
from builder.vehicle.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.inverse_map import InverseMap
from strainfmu.estimator.validity import condition_ranges
from strainfmu.version import __version__

AnyStructure = StructuralModel | MappedStructure


def gauge_noise_covariance(vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure) -> FloatArray:
    """Return the covariance (n_d, n_d) of the noise of the gauges in use [(m/m)^2].

    Relative noise is a fraction of the median |strain| over the snapshots and the gauges of ``noise.of_layout``.

    Raises
    ------
    InputError
        The section [noise] does not fit the gauges.
    """
    entry = vehicle.noise
    layout, median = vehicle.gauges.layout, 0.0
    if entry.percent_of_median_strain is not None:
        net = snapshots.pressure - internal_pressure(vehicle, snapshots)
        median = float(np.median(np.abs(net @ structure.strain_operator(entry.of_layout or layout).T)))
    return gauge_covariance(entry, len(structure.layouts[layout].names), median, vehicle.beside(""))


def check_noise(vehicle: Vehicle) -> None:
    """Refuse entries and files of the section [noise] that do not fit the gauges in use.

    Called before the long work.

    Raises
    ------
    InputError
        As :func:`gauge_noise_covariance` and :func:`builder.inverse.gauge_noise.nuisance_terms`.
    """
    entry, layout = vehicle.noise, vehicle.gauges.layout
    names = solid_case(vehicle, [layout]).layouts[layout].name
    gauge_covariance(entry, len(names), 1.0, vehicle.beside(""))
    if entry.nuisance_file is not None:
        nuisance_terms(vehicle.beside(entry.nuisance_file), names)


def noise_terms(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, strain_operator: FloatArray
) -> list[NoiseTerm]:
    """Return the noise terms of the section [noise], without the truncated modes.

    Raises
    ------
    InputError
        The section does not fit the gauges, or the structural model cannot do what it requests.
    """
    entry = vehicle.noise
    layout, file = vehicle.gauges.layout, entry.nuisance_file
    nuisance = [] if file is None else nuisance_terms(vehicle.beside(file), structure.layouts[layout].names)
    derivatives = gauge_derivatives(vehicle, structure, layout) if entry.moves_gauges else None
    net = snapshots.pressure - internal_pressure(vehicle, snapshots)
    own = gauge_noise(gauge_noise_covariance(vehicle, snapshots, structure))
    return [own, *nuisance, *gauge_error_terms(entry, net, strain_operator, derivatives)]


def internal_pressure(vehicle: Vehicle, snapshots: Snapshots) -> float:
    """Return p_internal [Pa] of all snapshots.

    Raises
    ------
    InputError
        The snapshots' altitudes differ and so does the pressure inside.
    """
    inside = [vehicle.internal_pressure(condition) for condition in snapshots.conditions()]
    if min(inside) != max(inside):
        raise InputError(
            f"snapshots: internal pressures {min(inside):.6g} to {max(inside):.6g} Pa found, one is needed: give "
            "one altitude, or structure.internal_pressure_Pa as a number"
        )
    return inside[0]


def build_inverse_map(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, nuisance: Sequence[NoiseTerm] = ()
) -> InverseMap:
    """Build the map of the case in the vehicle file, for the layout in use.

    Parameters and errors are those of :func:`inverse_problem`. The gauges may also fail to identify the requested
    modes.
    """
    snapshots = _on_structure(snapshots, structure)
    problem = inverse_problem(vehicle, snapshots, structure, nuisance)
    return on_observable_states(inverse_map_of(vehicle, snapshots, structure, problem, solve(problem)))


def inverse_problem(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, nuisance: Sequence[NoiseTerm] = ()
) -> Problem:
    """Return what the map of the layout in use is solved from.

    Parameters
    ----------
    vehicle : the vehicle file.
    snapshots : surface pressure at the flight conditions.
    structure : strain per pressure.
    nuisance : further noise terms, such as thermal strain.

    Raises
    ------
    InputError
        The snapshots' surface is not the structure's, or the section [noise] does not fit the gauges.
    """
    snapshots = _on_structure(snapshots, structure)
    z_p = structure.strain_operator(vehicle.gauges.layout)
    return Problem(
        pressure=snapshots.pressure,
        internal_pressure=internal_pressure(vehicle, snapshots),
        strain_operator=z_p,
        load_operator=_load_operator(structure.surface, vehicle.reference_quantities().moment_station),
        node_area=_mesh(structure.surface).node_area,
        noise=(*noise_terms(vehicle, snapshots, structure, z_p), *nuisance),
        with_truncated_modes=vehicle.noise.with_truncated_modes,
        entry=vehicle.map,
    )


def inverse_map_of(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, problem: Problem, solution: Solution
) -> InverseMap:
    """Return the map of a solved ``problem``; its first noise term is the gauges' own."""
    snapshots, reference = _on_structure(snapshots, structure), vehicle.reference_quantities()
    z_p, loads, inside = problem.strain_operator, problem.load_operator, problem.internal_pressure
    solved, load_per_state = solution.solved, loads @ solution.field_modes
    coefficients = snapshot_coefficients(vehicle, snapshots, loads)
    gauges = structure.layouts[vehicle.gauges.layout]
    return InverseMap(
        vehicle=vehicle.name,
        case=problem.entry.case,
        gauge_names=gauges.names,
        gauge_position=gauges.position,
        gauge_direction=gauges.direction / np.linalg.norm(gauges.direction, axis=1, keepdims=True),
        noise_std=np.linalg.norm(problem.noise[0].strain, axis=1),
        state_operator=solved.state_operator,
        noise_covariance=solved.noise_covariance,
        regularisation=solved.regularisation,
        strain_gain=solved.strain_gain,
        state_offset=solved.state_offset,
        load_per_state=load_per_state,
        load_of_mean=loads @ (solution.mean - inside),
        load_covariance=load_covariance_by_terms(
            solved, load_per_state, solution.noise, solution.noise.strain_load_covariance
        ),
        mean_strain=solved.mean_strain,
        residual_whitening=solved.residual_whitening,
        residual_degrees_of_freedom=solved.residual_degrees_of_freedom,
        strain_range=np.abs((snapshots.pressure - inside) @ z_p.T).max(axis=0),
        coefficient_range=np.column_stack([coefficients.min(axis=0), coefficients.max(axis=0)]),
        reference_area=reference.area,
        reference_length=reference.length,
        nominal_dynamic_pressure=float(np.mean([c.dynamic_pressure for c in snapshots.conditions()])),
        strain_load_covariance=solution.noise.strain_load_covariance,
        provenance=_provenance(vehicle, snapshots, structure, solution, inside),
        **(_field(solution, _mesh(structure.surface)) if problem.entry.keep_field else {}),
    )


def _on_structure(snapshots: Snapshots, structure: AnyStructure) -> Snapshots:
    """Return the snapshots at the structure's nodes, unchanged where they are there already."""
    return snapshots_on(snapshots, structure.surface) if isinstance(structure.surface, SurfaceGrid) else snapshots


def _provenance(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, solution: Solution, inside: float
) -> dict[str, Any]:
    conditions = snapshots.conditions()
    return {
        "strainfmu_version": __version__,
        "layout": vehicle.gauges.layout,
        "snapshots": len(conditions),
        "flows_solved": int(snapshots.solved.sum()),
        **solution.facts,
        "noise_terms": [
            {"name": one.name, "share": one.fraction, "rms_strain": one.rms_strain}
            for one in solution.noise.fractions()
        ],
        "internal_pressure_Pa": inside,
        **condition_ranges(conditions),
        "moment_station_m": vehicle.reference_quantities().moment_station,
        "resolution": vehicle.resolution.map.model_dump(),
        "structural_model": structure.description,
    }


def _field(solution: Solution, mesh: SurfaceMesh) -> dict[str, Any]:
    """Return the fields of the map that give pressure on the surface, in single precision."""
    return {
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
    net = snapshots.pressure - internal_pressure(vehicle, snapshots)
    return coefficients_of(net, loads, snapshots.conditions(), vehicle.reference_quantities())
