"""What a map and its gauges can and cannot do, as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.aero.surface_mesh import SurfaceMesh, mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import AnyStructure, inverse_problem
from builder.inverse.noise_model import NoiseFraction, NoiseTerm
from builder.inverse.solution import Solution, solve
from builder.reports.coefficient_sources import CoefficientSources, coefficient_sources
from builder.reports.exclusions import exclusions
from builder.reports.gamma_choice import GammaChoice, gamma_choice
from builder.reports.gauge_value import GaugeValue, gauge_value
from builder.reports.prior_observability import PriorSight, prior_sight
from builder.structure.observability import (
    CLASS_DEGREE,
    HIGHEST_DEGREE,
    HIGHEST_HARMONIC,
    SmoothResponse,
    SymmetryResponse,
    smooth_response,
    symmetry_responses,
)
from builder.vehicle.file import Vehicle
from builder.vehicle.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.inverse_map import InverseMap


@dataclass(frozen=True)
class BuildReport:
    """The answers of a report.

    Attributes
    ----------
    vehicle, layout, engine, structural_model : names.
    inverse_map : the map that is spoken of.
    surface : its pressure nodes.
    singular_values : of Z_p over smooth pressures [1/Pa], greatest first.
    smooth_degree, smooth_harmonics : of those pressures.
    symmetries : what the gauges see of each class of smooth pressures.
    sight : what they see of the snapshots.
    coefficients : how sure each is, and why.
    gauges : what each is worth.
    noise : share of each noise term.
    gamma : choice of gamma, in Case 2.
    excluded : what no number here holds.
    """

    vehicle: str
    layout: str
    engine: str
    structural_model: str
    inverse_map: InverseMap
    surface: SurfaceMesh
    singular_values: FloatArray
    smooth_degree: int
    smooth_harmonics: int
    symmetries: tuple[SymmetryResponse, ...]
    sight: PriorSight
    coefficients: CoefficientSources
    gauges: GaugeValue
    noise: tuple[NoiseFraction, ...]
    gamma: GammaChoice | None
    excluded: tuple[str, ...]

    @property
    def blind_classes(self) -> tuple[int, ...]:
        """Classes that the gauges do not see, by their place in ``symmetries``."""
        return tuple(i for i, one in enumerate(self.symmetries) if one.blind)


def build_report(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    inverse_map: InverseMap,
    nuisance: Sequence[NoiseTerm] = (),
) -> BuildReport:
    """Return the report of ``inverse_map``, which was built from the others.

    Raises
    ------
    InputError
        As :func:`builder.inverse.build.build_inverse_map`; the map was built from something else, or the surface
        has too few nodes to tell its symmetries apart.
    """
    problem = inverse_problem(vehicle, snapshots, structure, nuisance)
    solution = solve(problem)
    if not _same(solution, inverse_map):
        raise InputError(f"report: the map of {inverse_map.vehicle} was not built from these snapshots and gauges")
    grid = structure.surface
    surface = mesh_of_grid(grid) if isinstance(grid, SurfaceGrid) else grid
    response = _response(problem.strain_operator, surface, grid.n_roll if isinstance(grid, SurfaceGrid) else None)
    return BuildReport(
        vehicle=vehicle.name,
        layout=vehicle.gauges.layout,
        engine=snapshots.engine,
        structural_model=structure.description,
        inverse_map=inverse_map,
        surface=surface,
        singular_values=response.singular_values(),
        smooth_degree=int(response.degree.max()),
        smooth_harmonics=int(response.harmonic.max()),
        symmetries=tuple(symmetry_responses(response)),
        sight=prior_sight(problem, solution, grid),
        coefficients=coefficient_sources(inverse_map, problem, solution),
        gauges=gauge_value(inverse_map),
        noise=tuple(solution.noise.fractions()),
        gamma=gamma_choice(inverse_map, problem, solution, grid),
        excluded=exclusions(vehicle, snapshots.engine),
    )


def _same(solution: Solution, inverse_map: InverseMap) -> bool:
    """Return whether the map is that of the solution, but for round-off."""
    a, b = solution.solved.state_operator, inverse_map.state_operator
    # A A' does not depend on the states chosen, nor on those that no gauge sees.
    pairs = ((solution.noise.covariance, inverse_map.noise_covariance), (a @ a.T, b @ b.T))
    return all(
        one.shape == other.shape and np.linalg.norm(one - other) <= 1e-6 * np.linalg.norm(other)
        for one, other in pairs
    )


def _response(strain_operator: FloatArray, surface: SurfaceMesh, n_roll: int | None) -> SmoothResponse:
    """Return the response to pressures as fine as the surface carries: of lower degree on a coarse one."""
    most = HIGHEST_HARMONIC if n_roll is None else min(HIGHEST_HARMONIC, (n_roll - 1) // 2)
    last = InputError("surface: no pressures tried")
    for degree, harmonics in ((HIGHEST_DEGREE, most), (CLASS_DEGREE, most), (CLASS_DEGREE, min(most, 4))):
        try:
            return smooth_response(strain_operator, surface.point, surface.node_area, degree, harmonics)
        except InputError as error:
            last = error
    raise last
