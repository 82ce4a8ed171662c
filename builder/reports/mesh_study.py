"""Mesh study: the effect of a mesh on gauge strains and on the map built on it.

The Fourier model, which shares no mesh with the others, plays the vehicle. The difference of a mesh's strains from
the Fourier model's, under the pressure of the snapshots, is stated in units of the gauges' noise. A map is then
built on each mesh and fed with the Fourier model's strains and noise, as a vehicle would feed it.
"""

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from io import StringIO
from pathlib import Path

import numpy as np

from builder.aero.load_operator import load_operator
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.inverse.build import build_inverse_map, snapshot_coefficients
from builder.reporting import Progress, Reporter, Silent
from builder.structure.fourier.fourier_model import StructuralModel, place_layouts
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import harmonic_response
from builder.structure.mapped_structure import MappedStructure, mapped_operator
from builder.structure.solid.case import SolidCase, structure_case
from builder.structure.solid.checks import ELEMENT_FRACTION
from builder.structure.solid.gmsh_mesh import graded_wall_mesh, load_gmsh
from builder.structure.solid.linear_solvers import CYCLIC, named_back_end
from builder.structure.solid.mesh_choice import TETRAHEDRON_LENGTH
from builder.structure.solid.nodal_loads import triangulated_surface
from builder.structure.solid.solid_mesh import EXTERNAL, SolidMesh
from builder.structure.solid.strain_solution import layout_rows, solve_strain
from builder.structure.solid.swept_mesh import SweptSector, swept_wall
from builder.structure.wall import Wall, wall_of
from builder.trial.estimators import Estimates
from builder.trial.readings import Readings
from builder.trial.score import rows_of
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.map_needs import used_layouts
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.files import write_bytes_atomically

FOURIER = "Fourier model"
LAYERS = 2  # of the Fourier model's wall
FINE_LINEAR = 0.3  # sqrt(r t), length of linear tetrahedra: even these lose strain
NOISE_DRAWS, SEED = 10, 20200  # noise is drawn this many times for each snapshot


@dataclass(frozen=True)
class StudyMesh:
    """A mesh of the study.

    Attributes
    ----------
    name : for the table.
    make : returns it for a body and a wall.
    needs_gmsh : whether Gmsh makes it.
    """

    name: str
    make: Callable[[BodyOfRevolution, Wall], SweptSector | SolidMesh]
    needs_gmsh: bool = False


def linear_tetrahedra(mesh: SolidMesh) -> SolidMesh:
    """Return linear tetrahedra on the corners of quadratic ones, to show what is lost without middle nodes."""
    if mesh.element_type != "tetrahedron10":
        raise InputError(f"mesh: element type '{mesh.element_type}' found, must be tetrahedron10")
    used, element = np.unique(mesh.element[:, :4], return_inverse=True)
    number = np.full(mesh.n_nodes, -1)
    number[used] = np.arange(len(used))
    surface = {name: number[facet[:, :3]] for name, facet in mesh.surface.items()}
    return replace(
        mesh, element_type="tetrahedron4", node=mesh.node[used], element=element.reshape(-1, 4), surface=surface
    )


def _linear(body: BodyOfRevolution, wall: Wall, relative_length: float) -> SolidMesh:
    return linear_tetrahedra(graded_wall_mesh(body, wall, relative_length))


STUDY_MESHES = (
    *(
        StudyMesh(f"swept hexahedra, {name}", partial(swept_wall, resolution=name))
        for name in ("coarse", "medium", "paper")
    ),
    *(
        StudyMesh(f"Gmsh, quadratic, {size:g} sqrt(r t)", partial(graded_wall_mesh, relative_length=size), True)
        for size in (TETRAHEDRON_LENGTH["medium"], TETRAHEDRON_LENGTH["paper"])
    ),
    *(
        StudyMesh(f"Gmsh, linear, {size:g} sqrt(r t)", partial(_linear, relative_length=size), True)
        for size in (TETRAHEDRON_LENGTH["paper"], FINE_LINEAR)
    ),
)


def study_meshes(note: Callable[[str], None]) -> list[StudyMesh]:
    """Return :data:`STUDY_MESHES`, without the meshes of Gmsh where it is missing; ``note`` gets the reason."""
    try:
        load_gmsh()
    except StrainfmuError as error:
        note(f"swept meshes only: {error}")
        return [mesh for mesh in STUDY_MESHES if not mesh.needs_gmsh]
    return list(STUDY_MESHES)


@dataclass(frozen=True, eq=False, kw_only=True)
class StrainTruth:
    """Strains that the maps are fed with, and the true coefficients, at N snapshots.

    Attributes
    ----------
    strain : (N, n_d) of the Fourier model.
    sigma : (n_d,) noise of the gauges, one standard deviation.
    coefficients : (N, 5) C_A, C_N, C_Y, M_P, M_Y [1].
    dynamic_pressure : (N,) [Pa].
    """

    strain: FloatArray
    sigma: FloatArray
    coefficients: FloatArray
    dynamic_pressure: FloatArray


@dataclass(frozen=True, kw_only=True)
class StudyRow:
    """The effect of one mesh.

    Attributes
    ----------
    mesh : its name.
    n_dof : displacement components; 0 for the Fourier model.
    strain_rms, strain_largest : difference of gauge strain from the Fourier model over the gauge's noise [1], over
        gauges in use and snapshots.
    error_of_range : (5,) rms error of C_A, C_N, C_Y, M_P, M_Y from the map on this mesh over their range [1].
    coverage : (5,) fraction of samples with the truth within 3 sigma [1].
    alarms : fraction of samples with chi-square above its limit [1].
    """

    mesh: str
    n_dof: int
    strain_rms: float
    strain_largest: float
    error_of_range: tuple[float, ...]
    coverage: tuple[float, ...]
    alarms: float


def mesh_study(
    vehicle: Vehicle,
    snapshots: Snapshots,
    reporter: Reporter,
    meshes: Sequence[StudyMesh] = STUDY_MESHES,
    solver: str | None = None,
) -> Iterator[StudyRow]:
    """Yield a row of the Fourier model itself, then one per mesh.

    Parameters
    ----------
    vehicle, snapshots : the vehicle file and surface pressure at its conditions, on stations times roll angles.
    reporter : receives each mesh as a stage.
    meshes : those compared.
    solver : of free meshes; None for the best one installed.

    Raises
    ------
    InputError
        The snapshots are on a free surface or of another vehicle, the vehicle file requests what the Fourier
        model cannot do, or the solver is not installed.
    StrainfmuError
        Gmsh is needed and not installed, or a solver fails.
    """
    layout, case = vehicle.gauges.layout, structure_case(vehicle, used_layouts(vehicle))
    with reporter.stage(FOURIER) as progress:
        fourier = fourier_on_snapshots(vehicle, snapshots, progress)
        net = snapshots.pressure - snapshots.internal_pressure[:, None]
        own_map = build_inverse_map(vehicle, snapshots, fourier)
        loads = load_operator(fourier.surface, own_map.provenance["moment_station_m"])
        truth = StrainTruth(
            strain=net @ fourier.strain_operator(layout).T,
            sigma=own_map.noise_std,
            coefficients=snapshot_coefficients(vehicle, snapshots, loads),
            dynamic_pressure=np.array([condition.dynamic_pressure for condition in snapshots.conditions()]),
        )
    yield _row(FOURIER, 0, 0.0 * truth.strain, own_map, truth)
    for mesh in meshes:
        with reporter.stage(mesh.name) as progress:
            structure, n_dof = _on_mesh(case, mesh, snapshots, solver, progress)
            difference = (net @ structure.strain_operator(layout).T - truth.strain) / truth.sigma
            row = _row(mesh.name, n_dof, difference, build_inverse_map(vehicle, snapshots, structure), truth)
        yield row


def fourier_on_snapshots(
    vehicle: Vehicle, snapshots: Snapshots, progress: Progress | None = None
) -> StructuralModel:
    """Return the Fourier model with the nodes of snapshots as pressure nodes.

    Raises
    ------
    InputError
        The snapshots are on a free surface or of another body, or the model cannot do what the file requests.
    """
    grid, body = snapshots.grid, vehicle.body()
    if grid is None:
        raise InputError("snapshots: on a free surface, stations times roll angles are needed for the mesh study")
    off = (
        float(np.abs(grid.radius - body.radius(grid.x)).max())
        if grid.x[-1] <= body.length * (1 + 1e-9)
        else np.inf
    )
    if off > 1e-6 * body.length:
        raise InputError(f"snapshots: of '{snapshots.vehicle}', not on the body of '{vehicle.name}'")
    mesh = shell_mesh(body, wall_of(vehicle), ELEMENT_FRACTION * body.length, LAYERS)
    layouts, placed = place_layouts(vehicle, mesh, used_layouts(vehicle))
    stations = np.concatenate([gauges.x for gauges in placed.values()])
    harmonics = (grid.n_roll - 1) // 2
    response = harmonic_response(mesh, wall_of(vehicle).material, stations, grid.x, harmonics, progress)
    return StructuralModel(surface=grid, response=response, layouts=layouts, placed=placed)


def _on_mesh(
    case: SolidCase, chosen: StudyMesh, snapshots: Snapshots, solver: str | None, progress: Progress
) -> tuple[MappedStructure, int]:
    """Return the structure on a mesh, with pressure at the nodes of snapshots, and its number of dofs."""
    mesh = chosen.make(*case.of_revolution)
    full_mesh = mesh.full
    # Linear elements make free meshes faceted: gauges are moved onto the surface.
    rows = layout_rows(mesh, case.layouts, near_surface=True)
    solution = solve_strain(
        mesh,
        matter=case.matter,
        support=case.support,
        rows=rows,
        solver_name=None if isinstance(mesh, SweptSector) else solver,
        progress=progress,
    )
    surface, operator = mapped_operator(
        solution.strain_operator, triangulated_surface(full_mesh, EXTERNAL), snapshots
    )
    ends = np.cumsum([len(gauges.name) for gauges in case.layouts.values()])
    operators = dict(zip(case.layouts, np.split(operator, ends[:-1]), strict=True))
    # No error by the mesh in the noise: what it does is what is studied.
    structure = MappedStructure(
        surface=surface,
        description=f"{chosen.name}, {full_mesh.n_dof} dofs",
        layouts={
            name: GaugeLayout(layout.name, layout.position, layout.direction)
            for name, layout in case.layouts.items()
        },
        operators=operators,
        error_operators={name: np.zeros_like(operator) for name, operator in operators.items()},
    )
    return structure, full_mesh.n_dof


def _row(
    name: str,
    n_dof: int,
    difference: FloatArray,
    inverse_map: InverseMap,
    truth: StrainTruth,
) -> StudyRow:
    """Return the row of a map fed with the true strains and noise; ``difference`` (N, n_d) in units of noise."""
    noise = np.random.default_rng(SEED).standard_normal((NOISE_DRAWS, *truth.strain.shape)) * truth.sigma
    estimator = Estimator(inverse_map)
    estimates = [estimator.estimate(truth.strain + noise_strain, truth.dynamic_pressure) for noise_strain in noise]
    made = Estimates(
        value=np.concatenate([draw.coefficients for draw in estimates]),
        std=np.concatenate([draw.coefficients_std for draw in estimates]),
    )
    count = len(made.value)
    read = Readings(
        strain=np.empty((count, 0)),
        known={},
        truth=np.tile(truth.coefficients, (NOISE_DRAWS, 1)),
        vehicle=np.zeros(count, dtype=np.int64),
        flight=np.arange(count) % len(truth.coefficients),
    )
    _, *loads = rows_of(COEFFICIENT_NAMES, made, read)
    return StudyRow(
        mesh=name,
        n_dof=n_dof,
        strain_rms=float(np.sqrt(np.mean(difference**2))),
        strain_largest=float(np.abs(difference).max()),
        error_of_range=tuple(float(row["rms_of_range"]) for row in loads),
        coverage=tuple(0.01 * row["covered_percent"] for row in loads),
        alarms=float(np.mean([draw.chi_square > draw.chi_square_limit for draw in estimates])),
    )


def study_table(rows: Sequence[StudyRow]) -> str:
    """Return the rows as text: strain in units of noise, errors and alarms in per cent."""
    width = max(len(row.mesh) for row in rows) + 1
    pairs = "".join(f"{name:>8}" for name in COEFFICIENT_NAMES)
    lines = [
        f"{'':<{width}}{'':>10}{'strain / sigma':>18}{'rms error, % of range':>40}{'within':>9}{'chi2':>8}",
        f"{'mesh':<{width}}{'dofs':>10}{'rms':>9}{'largest':>9}{pairs}{'3 sig %':>9}{'alarm %':>8}",
    ]
    for row in rows:
        errors = "".join(f"{100.0 * value:>8.2f}" for value in row.error_of_range)
        lines.append(
            f"{row.mesh:<{width}}{row.n_dof:>10}{row.strain_rms:>9.3g}{row.strain_largest:>9.3g}{errors}"
            f"{100.0 * min(row.coverage):>9.1f}{100.0 * row.alarms:>8.1f}"
        )
    return "\n".join(lines)


def study_csv(rows: Sequence[StudyRow]) -> str:
    """Return the rows as CSV, one column per number; coverage and alarms as fractions."""
    errors = [f"rms_error_of_range.{name}" for name in COEFFICIENT_NAMES]
    coverage = [f"within_3_sigma.{name}" for name in COEFFICIENT_NAMES]
    head = ["mesh", "n_dof", "strain_rms_over_sigma", "strain_largest_over_sigma", *errors, *coverage]
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*head, "chi_square_alarms"])
    for row in rows:
        numbers = (row.strain_rms, row.strain_largest, *row.error_of_range, *row.coverage, row.alarms)
        writer.writerow([row.mesh, row.n_dof, *(f"{value:.6g}" for value in numbers)])
    return text.getvalue()


def bench_meshes(
    mesh: str | Path,
    snapshots: str | Path,
    output: str | Path = "mesh_study.csv",
    *,
    solver: str | None = None,
    reporter: Reporter | None = None,
) -> list[StudyRow]:
    """Compare the meshes of a vehicle's structure: errors in gauge strains, and in a map built on each.

    Parameters
    ----------
    mesh : vehicle file whose meshes are compared. Not with ``structure``, ``gauges``, ``worst``, ``peers``.
    snapshots : with ``mesh`` or ``gauges``, required: snapshots.h5 of ``strainfmu build``.
    output : with ``mesh``: table to write (CSV).
    solver : solver. Default: the fitting one of each mesh.

    Raises
    ------
    InputError, StrainfmuError
        A file is missing or wrong, or the solver is not installed.
    """
    vehicle, pressure, report = load_vehicle(mesh), load_snapshots(snapshots), reporter or Silent()
    if solver not in (None, CYCLIC) and not (back_end := named_back_end(solver)).installed():
        raise back_end.missing()
    rows = list(mesh_study(vehicle, pressure, report, study_meshes(report.note), solver))
    write_bytes_atomically(Path(output), study_csv(rows).encode())
    return rows
