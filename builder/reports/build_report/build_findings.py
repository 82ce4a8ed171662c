"""The report of a build as numbers: what a map and its gauges can and cannot do.

Errors that the stated uncertainties of one vehicle file do not include, in words.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh, grid_of, mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.inertia import inertia_in_words
from builder.inverse.noise.model import NoiseTerm
from builder.inverse.problem import AnyStructure, inverse_problem
from builder.inverse.solution import Problem, Solution, with_flow_models
from builder.reports.findings.coefficient_sources import GammaChoice, coefficient_sources, gamma_choice
from builder.reports.findings.envelope_states import FlightAccuracy, flight_accuracy
from builder.reports.findings.estimator_in_use import InUse, estimator_in_use, named_errors
from builder.reports.findings.gauge_value import GaugeValue, gauge_value
from builder.reports.findings.prior_observability import PriorObservability, prior_observability
from builder.reports.page.origin import InputFile, Origin, origin_of
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
from builder.vehicle.map_options import OWN_NOISE, Noise
from builder.vehicle.model_form import model_form_percent
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap

OPTIONAL_ERRORS = (
    ("apparent_strain_um_per_m", "apparent strain, such as from an uncompensated temperature"),
    ("gauge_gain_percent", "errors of gauge factor and amplifier gain"),
    ("common_gain_percent", "errors common to all gains, such as an error of Young's modulus"),
    ("gauge_position_mm", "errors of the gauges' positions"),
    ("gauge_orientation_deg", "errors of the gauges' directions"),
    ("layout_roll_deg", "an error of the whole layout's roll angle"),
    ("wall_thickness_percent", "an error of the wall's thickness"),
    ("internal_pressure_percent", "errors of the internal pressure"),
)
"""Entries of the section [noise], and the error that is left out where one is 0."""

OF_STRUCTURE = {
    "distribution of stiffness": ("region_modulus_percent",),
    "distribution of thickness": ("wall_harmonic_percent", "wall_second_harmonic_percent", "wall_taper_percent"),
    "joints": ("joint_softness_mm",),
    "support": ("clamp_compliance_mm",),
}
"""Errors of the structural model that are left out where none of their entries is stated."""


def exclusions(vehicle: Vehicle, engine: str) -> tuple[str, ...]:
    """Return what no sigma of the map includes, one sentence each; ``engine`` is the one of the snapshots."""
    model = "Fourier" if vehicle.structure.model == "fourier" else "three-dimensional"
    return (
        "Base pressure: C_A is the fore-body's.",
        "Flight conditions that differ from the snapshots', inside or outside the ranges of this page.",
        f"Errors of the flow solution ({engine}): modes and prior come from it.",
        *_absent_structure(vehicle.noise, model),
        *_absent_noise(vehicle.noise, vehicle.map.case == 1 or vehicle.map.prior_modes is not None),
        "Errors of the dynamic pressure: an estimate adds the standard deviation that it is given, or "
        f"{vehicle.noise.dynamic_pressure_percent:g} % (noise.dynamic_pressure_percent).",
        *([] if vehicle.mass is not None else [f"Inertia: {inertia_in_words(vehicle)}."]),
        "Vibration: strain counts as the static response to the current pressure.",
    )


def _absent_structure(noise: Noise, model: str) -> list[str]:
    absent = [
        what for what, entries in OF_STRUCTURE.items() if not any(getattr(noise, entry) > 0.0 for entry in entries)
    ]
    return [f"Errors of the structural model ({model}): {', '.join(absent)}."] if absent else []


def _absent_noise(noise: Noise, truncates: bool) -> list[str]:
    # Temperature may also be given as modes in the nuisance file.
    in_file = {"apparent_strain_um_per_m"} if noise.nuisance_file is not None else set()
    absent = [
        f"{what[0].upper()}{what[1:]}: noise.{entry} is 0."
        for entry, what in OPTIONAL_ERRORS
        if getattr(noise, entry) == 0.0 and entry not in in_file
    ]
    if truncates and not noise.with_truncated_modes:
        absent.append("Truncated pressure modes: the vehicle file leaves them out of the noise.")
    return absent


@dataclass(frozen=True, eq=False, kw_only=True)
class BuildReport:
    """The parts of a report.

    Attributes
    ----------
    vehicle, layout, engine, structural_model : names.
    inverse_map : the map of the report.
    snapshots : the flows that it was built from.
    surface : its pressure nodes.
    singular_values : of Z_p over smooth pressures [1/Pa], falling.
    smooth_degree, smooth_harmonics : of those pressures.
    symmetries : response of the gauges to each class of smooth pressures.
    observability : what they observe of the snapshots.
    in_use : the estimator that the map is used with: the nonlinear one of a map with tables.
    gauges : value of each to the estimator in use.
    gamma : choice of gamma, in Case 2.
    flight : uncertainty of the nonlinear estimator over the envelope; None for a map without tables.
    origin : version, date and files.
    excluded : errors that no number here includes.
    model_form_percent : entry of the vehicle file [%].
    noise_entry : entry of the section [noise] that states the gauges' own noise.
    """

    vehicle: str
    layout: str
    engine: str
    structural_model: str
    inverse_map: InverseMap
    snapshots: Snapshots
    surface: SurfaceMesh
    singular_values: FloatArray
    smooth_degree: int
    smooth_harmonics: int
    symmetries: tuple[SymmetryResponse, ...]
    observability: PriorObservability
    in_use: InUse
    gauges: GaugeValue
    gamma: GammaChoice | None
    flight: FlightAccuracy | None
    origin: Origin
    excluded: tuple[str, ...]
    model_form_percent: float
    noise_entry: str

    @property
    def blind_classes(self) -> tuple[int, ...]:
        """Indices in ``symmetries`` of the classes that the gauges do not respond to."""
        return tuple(i for i, symmetry in enumerate(self.symmetries) if symmetry.blind)


def build_report(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    inverse_map: InverseMap,
    nuisance: Sequence[NoiseTerm] = (),
    files: tuple[InputFile, ...] = (),
    problem: Problem | None = None,
) -> BuildReport:
    """Return the report of ``inverse_map``, which was built from the others; ``files`` are those they lie in.

    ``problem`` is what the map was solved from, where it is known.

    Raises
    ------
    InputError
        As :func:`builder.inverse.build.build_inverse_map`; the map was built from other inputs, or the surface has
        too few nodes to resolve its symmetries.
    """
    problem = problem or inverse_problem(vehicle, snapshots, structure, nuisance)
    if inverse_map.manifold is not None:
        problem = with_flow_models(problem)
    solution = problem.solution
    if not _same(solution, inverse_map):
        raise InputError(f"report: the map of {inverse_map.vehicle} was not built from these snapshots and gauges")
    surface, grid = mesh_of(structure.surface), grid_of(structure.surface)
    observed = prior_observability(problem, solution, structure.surface)
    sources = coefficient_sources(inverse_map, problem, solution)
    response = _response(problem.strain_operator, surface, None if grid is None else grid.n_roll)
    errors = None
    if inverse_map.manifold is not None:
        errors = named_errors(problem, structure.surface, nuisance)
    return BuildReport(
        vehicle=vehicle.name,
        layout=vehicle.gauges.layout,
        engine=snapshots.engine,
        structural_model=structure.description,
        inverse_map=inverse_map,
        snapshots=snapshots,
        surface=surface,
        singular_values=response.singular_values(),
        smooth_degree=int(response.degree.max()),
        smooth_harmonics=int(response.harmonic.max()),
        symmetries=tuple(symmetry_responses(response)),
        observability=observed,
        in_use=estimator_in_use(inverse_map, sources, observed, surface.node_area, errors),
        model_form_percent=model_form_percent(vehicle.map, vehicle.noise),
        noise_entry=next(name for name in OWN_NOISE if getattr(vehicle.noise, name) is not None),
        gauges=gauge_value(inverse_map),
        gamma=gamma_choice(inverse_map, problem, solution, structure.surface),
        flight=flight_accuracy(inverse_map),
        origin=origin_of(files),
        excluded=exclusions(vehicle, snapshots.engine),
    )


def _same(solution: Solution, inverse_map: InverseMap) -> bool:
    """Return whether the map is the map of the solution, up to round-off."""
    a, b, error = solution.solved.state_operator, inverse_map.state_operator, inverse_map.error_strain
    if len(a) != len(b):
        return False
    # What the map's noise_covariance leaves, by BLAS: of thousands of gauges in a tenth of the time.
    noise = solution.noise.covariance
    rest = noise - inverse_map.gauge_covariance
    rest -= error @ error.T
    rest[np.diag_indices(len(rest))] -= inverse_map.own_error_strain**2
    # A A' - B B' does not depend on the choice of states, nor on those that no gauge observes.
    aa, bb, ab = (np.linalg.norm(first.T @ second) for first, second in ((a, a), (b, b), (a, b)))
    is_same = aa**2 + bb**2 - 2.0 * ab**2 <= 1e-12 * bb**2
    return bool(is_same and np.linalg.norm(rest) <= 1e-6 * np.linalg.norm(noise))


def _response(strain_operator: FloatArray, surface: SurfaceMesh, n_roll: int | None) -> SmoothResponse:
    """Return the response to pressures as fine as the surface resolves: of lower degree on a coarse one."""
    limit = HIGHEST_HARMONIC if n_roll is None else min(HIGHEST_HARMONIC, (n_roll - 1) // 2)
    last = InputError("surface: no pressures tried")
    for degree, harmonics in ((HIGHEST_DEGREE, limit), (CLASS_DEGREE, limit), (CLASS_DEGREE, min(limit, 4))):
        try:
            return smooth_response(strain_operator, surface.point, surface.node_area, degree, harmonics)
        except InputError as error:
            last = error
    raise last
