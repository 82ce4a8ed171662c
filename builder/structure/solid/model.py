"""Three-dimensional model: from a body, its wall and its gauges to Z_p, stage by stage.

mesh -> checks and report -> locking check -> gauges -> supports and solution -> mesh error. What the gauges do not
touch (checks, report, locking) is taken from a file made before on the same mesh.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array, vstack

from builder.aero.surface.mesh import SurfaceMesh
from builder.reporting import Progress, Reporter
from builder.structure.mesh_check import MeshCheck
from builder.structure.solid.checks.examination import examination
from builder.structure.solid.checks.locking import check_locking
from builder.structure.solid.checks.reference_loads import (
    fourier_can,
    fourier_reference_strain,
    largest_amplitude,
    reference_pressures,
)
from builder.structure.solid.free_case import FreeCase
from builder.structure.solid.free_model import solve_free_structure
from builder.structure.solid.gauges.cyclic_gauges import cyclic_gauge_rows
from builder.structure.solid.gauges.gauge_rows import Gauges, gauge_fields, gauge_rows
from builder.structure.solid.mesh.mesh_checks import check_mesh
from builder.structure.solid.mesh.mesh_of_vehicle import mesh_misfits
from builder.structure.solid.mesh.mesh_report import exact_wall, mesh_report
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, SolidMesh
from builder.structure.solid.mesh.swept_mesh import SweptSector
from builder.structure.solid.mesh_choice import (
    MeshChoice,
    check_other,
    coarser_sector,
    make_mesh,
    wall_elements,
    whole_mesh,
)
from builder.structure.solid.operators.matter import Matter
from builder.structure.solid.operators.supports import Clamped, Support
from builder.structure.solid.operators.surface_triangles import split_surface, triangulated_surface
from builder.structure.solid.solution import solve_strain
from builder.structure.solid.solvers.solver import CYCLIC, named_back_end
from builder.structure.structure_file import SCHEMA_VERSION, Structure, save_structure, structure_to_reuse
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import BodyOfRevolution
from builder.vehicle.shape.profile_record import profile_record
from builder.workspace import refuse_misfits
from strainfmu.arrays import FloatArray
from strainfmu.files import fingerprint
from strainfmu.version import __version__

FOURIER_REFERENCE = "the Fourier model"
NEEDS_BOTH = "the vehicle file must state the body and the wall of the mesh"


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidCase:
    """All that Z_p depends on.

    Attributes
    ----------
    vehicle : name.
    body, wall : outer shape; thickness, solid tip, material.
    density : of the material [kg/m3], or None where nothing needs it.
    support : what holds the body; None in free flight.
    mesh : which mesh.
    layouts : gauges by name of layout.
    solver : name of the solver, or None for the best installed one.
    allow_locking : go on with elements that lose more than a tenth of the wall's bending.
    checked_by : a second mesh, whose difference is the error of the first; None for one of ours, or the Fourier
        model.
    """

    vehicle: str
    body: BodyOfRevolution
    wall: Wall
    density: float | None
    support: Support | None
    mesh: MeshChoice
    layouts: Mapping[str, Gauges]
    solver: str | None = None
    allow_locking: bool = False
    checked_by: MeshChoice | None = None

    @property
    def matter(self) -> Matter:
        """One material, of wall and tip."""
        return Matter(material=self.wall.material, density=self.density)

    def made_from(self) -> dict[str, str]:
        """Return fingerprints of what the mesh and its solution depend on, and of the gauges.

        Raises
        ------
        InputError
            A mesh file is missing.
        """
        mesh = {
            "strainfmu_version": __version__,
            "schema_version": SCHEMA_VERSION,
            "vehicle": self.vehicle,
            "body": asdict(self.body),
            "wall": asdict(self.wall),
            "density": self.density,
            "support": support_entries(self.support),
            "mesh": self.mesh.inputs(),
            "solver": self.solver,
            "allow_locking": self.allow_locking,
            **({} if self.checked_by is None else {"checked_by": self.checked_by.inputs()}),
        }
        gauges = {name: asdict(gauges) for name, gauges in self.layouts.items()}
        return {"mesh": fingerprint(mesh), "gauges": fingerprint(gauges)}


AnyCase = SolidCase | FreeCase
"""Of a body of revolution, or of any other shape."""


def update_structure(path: Path, case: AnyCase, reporter: Reporter) -> tuple[Structure, bool]:
    """Make ``structure.h5`` unless it is up to date; return it, and whether it was.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`solve_solid_structure`; or ``path`` holds an artefact of another kind or cannot be written.
    """
    before, made_from = structure_to_reuse(path), case.made_from()
    if before is not None and before.settings["made_from"] == made_from:
        return before, True
    if case.solver not in (None, CYCLIC):
        named_back_end(case.solver)  # refused before the long work, not after it
    if before is not None and before.settings["made_from"]["mesh"] != made_from["mesh"]:
        held = f"{before.model.replace('_', ' ')}, {before.statistics['degrees_of_freedom']} dofs"
        reporter.note(f"{path}: held {held} of other entries or options; replaced")
    structure = solve_solid_structure(case, reporter, before)
    with reporter.stage("Write"):
        save_structure(structure, path)
    return structure, False


def solve_solid_structure(case: AnyCase, reporter: Reporter, before: Structure | None = None) -> Structure:
    """Compute Z_p of all layouts.

    Parameters
    ----------
    case : what is computed.
    reporter : receives the stages.
    before : an earlier result, from which checks, report and locking ratios are taken if it is of the same mesh.

    Raises
    ------
    InputError
        The wall does not fit the body, the mesh fails a check or locks, a gauge is not on its surface, the solver
        is not known or not installed, or the supports leave a rigid motion free.
    StrainfmuError
        Gmsh or meshio is needed and missing, or the solver fails.
    """
    if isinstance(case, FreeCase):
        return solve_free_structure(case, support_entries(case.support), reporter, before)
    with reporter.stage("Mesh"):
        mesh = make_mesh(case.body, case.wall, case.mesh)
        whole = whole_mesh(mesh)
        surface = _loaded_surface(mesh, whole)
    made_from = case.made_from()
    if before is not None and before.settings["made_from"]["mesh"] == made_from["mesh"]:
        reporter.note("mesh: the same as before, its checks are not repeated")
        found = {key: before.settings[key] for key in ("mesh_report", "locking")}
    else:
        found = _examined(case, mesh, whole, reporter)
    with reporter.stage("Gauges"):
        rows = _rows_of_layouts(mesh, case.layouts)
    with reporter.stage("Strain per pressure") as progress:
        solved = solve_strain(
            mesh=mesh,
            matter=case.matter,
            support=case.support,
            rows=rows,
            solver_name=case.solver,
            progress=progress,
        )
    with reporter.stage("Mesh error") as progress:
        error, check = _mesh_error(case, whole, surface.point, solved.strain_operator, progress)
    return Structure(
        vehicle=case.vehicle,
        model=case.mesh.model,
        settings={**_settings(case), **found, "mesh_error_against": check[0], "made_from": made_from},
        statistics={"elements": len(whole.element), "degrees_of_freedom": whole.n_dof, **solved.statistics},
        **gauge_fields(case.layouts),
        point=surface.point,
        triangle=surface.triangle,
        normal=surface.node_normal,
        strain_operator=solved.strain_operator,
        mesh_error=error,
        check=check[1],
    )


def strain_per_force(case: SolidCase, progress: Progress | None = None) -> tuple[SolidMesh, FloatArray]:
    """Return the whole mesh and the strain (n_d, n_p, 3) [1/N] of all layouts per force at its external nodes.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`solve_solid_structure`; checks and the locking of the mesh are that function's.
    """
    mesh = make_mesh(case.body, case.wall, case.mesh)
    solved = solve_strain(
        mesh=mesh,
        matter=case.matter,
        support=case.support,
        rows=_rows_of_layouts(mesh, case.layouts),
        solver_name=case.solver,
        progress=progress,
        of_forces=True,
    )
    return whole_mesh(mesh), solved.strain_operator.reshape(len(solved.strain_operator), -1, 3)


def check_gauges_on_mesh(body: BodyOfRevolution, wall: Wall, layouts: Mapping[str, Gauges]) -> None:
    """Refuse gauges that are not on their surface, on the coarsest swept mesh.

    Raises
    ------
    InputError
        The wall does not fit the body or a gauge is not on its surface.
    """
    _rows_of_layouts(make_mesh(body, wall, MeshChoice(resolution="coarse")), layouts)


def _examined(
    case: SolidCase, mesh: SweptSector | SolidMesh, whole: SolidMesh, reporter: Reporter
) -> dict[str, Any]:
    """Check the mesh and describe it; return the settings that follow."""
    with reporter.stage("Mesh checks and report"):
        check_mesh(whole, case.body.length)
        if case.mesh.file is not None:
            refuse_misfits(case.mesh.file, mesh_misfits(whole, case.body, case.wall), NEEDS_BOTH)
        report = mesh_report(
            whole, case.matter.known_densities(whole.region_names), exact_wall(case.body, case.wall)
        )

    def locking() -> Mapping[int, float]:
        elements = wall_elements(case.body, case.wall, mesh, case.mesh)
        radius, wall = case.body.base_radius, case.wall
        return check_locking(elements, radius, wall.thickness, wall.material, case.allow_locking)

    return examination(report, locking, reporter)


def _rows_of_layouts(mesh: SweptSector | SolidMesh, layouts: Mapping[str, Gauges]) -> csr_array:
    """Return B of all layouts, one after another; within a layout no gauge may occur twice."""
    rows = [
        cyclic_gauge_rows(mesh, gauges) if isinstance(mesh, SweptSector) else gauge_rows(mesh, gauges)
        for gauges in layouts.values()
    ]
    return csr_array(vstack(rows))


def _mesh_error(
    case: SolidCase, first: SolidMesh, point: FloatArray, operator: FloatArray, progress: Progress
) -> tuple[FloatArray, tuple[str, MeshCheck | None]]:
    """Return the error (n_d,) [1/Pa] under the reference loads; what it was measured against, and its Z_p.

    ``first`` is the mesh of ``operator``, ``point`` (n, 3) its loaded nodes [m]. The Fourier model's Z_p is not
    kept: a map solves it at the nodes of its own pressures.
    """
    length = case.body.length
    strain = operator @ reference_pressures(point, length)
    if (
        case.checked_by is None
        and isinstance(case.support, Clamped)
        and all(map(fourier_can, case.layouts.values()))
    ):
        parts = [fourier_reference_strain(case.body, case.wall, gauges) for gauges in case.layouts.values()]
        return largest_amplitude(strain - np.concatenate(parts)), (FOURIER_REFERENCE, None)
    if case.checked_by is None:
        mesh: SweptSector | SolidMesh = coarser_sector(case.body, case.wall, case.mesh)
        whole, name = whole_mesh(mesh), "swept hexahedra"
    else:
        mesh = make_mesh(case.body, case.wall, case.checked_by)
        whole, name = whole_mesh(mesh), case.checked_by.source if case.checked_by.file is None else ""
        name = name or f"the mesh {case.checked_by.source.rpartition('/')[2]}"
        if case.checked_by.file is not None:
            check_other(first, whole, case.checked_by.file)
        check_mesh(whole, case.body.length)
    rows = _rows_of_layouts(mesh, case.layouts)
    other = solve_strain(
        mesh=mesh,
        matter=case.matter,
        support=case.support,
        rows=rows,
        solver_name=None,
        progress=progress,
    )
    surface = _loaded_surface(mesh, whole)
    against = f"{name} of {whole.n_dof} dofs"
    check = MeshCheck(
        against=against,
        factor=1.0,
        strain_operator=other.strain_operator,
        point=surface.point,
        triangle=surface.triangle,
    )
    pressure = reference_pressures(surface.point, length)
    return largest_amplitude(strain - other.strain_operator @ pressure), (against, check)


def _loaded_surface(mesh: SweptSector | SolidMesh, whole: SolidMesh) -> SurfaceMesh:
    """Return the external surface as triangles, in the order of the columns of Z_p."""
    swept = isinstance(mesh, SweptSector)
    return triangulated_surface(whole, EXTERNAL) if swept else split_surface(whole, EXTERNAL)[0]


def _settings(case: SolidCase) -> dict[str, Any]:
    material = case.wall.material
    file = case.mesh.file
    return {
        "strainfmu_version": __version__,
        "mesh": {**case.mesh.inputs(), **({} if file is None else {"file_name": file.name})},
        "profile": profile_record(case.body),
        "wall": {
            "thickness_m": case.wall.thickness,
            "solid_tip_length_m": case.wall.solid_tip_length,
            **({"profile": [list(one) for one in case.wall.profile]} if case.wall.profile else {}),
        },
        "material": {
            "youngs_modulus_Pa": material.youngs_modulus,
            "poisson_ratio": material.poisson_ratio,
            "density_kg_per_m3": case.density,
        },
        "support": support_entries(case.support),
    }


def support_entries(support: Support | None) -> dict[str, Any]:
    """Return what a file states of the support."""
    if support is None:
        return {"kind": "free flight"}
    return {"kind": type(support).__name__.lower(), **asdict(support)}
