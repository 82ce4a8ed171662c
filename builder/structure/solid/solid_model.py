"""Three-dimensional model: from a case to Z_p, stage by stage.

mesh -> checks and report -> locking check -> gauges -> supports and solution -> mesh error. What the gauges do not
touch (checks, report, locking) is taken from a file made before on the same mesh.
"""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from builder.reporting import Progress, Reporter
from builder.structure.solid.case import SolidCase
from builder.structure.solid.checks import (
    NO_REFERENCE,
    LockingWarning,
    check_locking,
    check_solid_elements,
    largest_amplitude,
    reference_pressures,
)
from builder.structure.solid.gauge_rows import gauge_fields
from builder.structure.solid.linear_solvers import CYCLIC, named_back_end
from builder.structure.solid.mesh_checks import (
    check_mesh,
    exact_wall,
    mesh_misfits,
    mesh_report,
)
from builder.structure.solid.nodal_loads import loaded_surface
from builder.structure.solid.solid_mesh import INTERNAL, SolidMesh
from builder.structure.solid.strain_solution import layout_rows, solve_strain
from builder.structure.solid.swept_mesh import AnyMesh
from builder.structure.structure_file import MeshCheck, Structure, save_structure, structure_to_reuse
from builder.workspace import refuse_misfits
from strainfmu.arrays import FloatArray
from strainfmu.version import __version__

FOURIER_REFERENCE = "the Fourier model"
NEEDS_BOTH = "the vehicle file must state the body and the wall of the mesh"


def holds_structure(path: Path, case: SolidCase) -> bool:
    """Return whether ``path`` holds the structure of ``case``."""
    before = structure_to_reuse(path)
    return before is not None and before.settings["made_from"] == case.made_from()


def update_structure(path: Path, case: SolidCase, reporter: Reporter) -> tuple[Structure, bool]:
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
        contents = f"{before.model.replace('_', ' ')}, {before.statistics['degrees_of_freedom']} dofs"
        reporter.note(f"{path}: held {contents} of other entries or options; replaced")
    structure = solve_solid_structure(case, reporter, before)
    with reporter.stage("Write"):
        save_structure(structure, path)
    return structure, False


def solve_solid_structure(case: SolidCase, reporter: Reporter, before: Structure | None = None) -> Structure:
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
    with reporter.stage("Mesh"):
        mesh = case.mesh
        surface = loaded_surface(mesh)[0]
    made_from = case.made_from()
    if before is not None and before.settings["made_from"]["mesh"] == made_from["mesh"]:
        reporter.note("mesh: the same as before, its checks are not repeated")
        settings = {key: before.settings[key] for key in ("mesh_report", "locking")}
    else:
        settings = _examined(case, reporter)
    with reporter.stage("Gauges"):
        rows = layout_rows(mesh, case.layouts)
    with reporter.stage("Strain per pressure") as progress:
        solved = solve_strain(mesh, case.matter, case.support, rows, case.solver, progress)
    error, check, against = np.zeros(len(solved.strain_operator)), None, NO_REFERENCE
    if case.reference is not None or case.second is not None:
        with reporter.stage("Mesh error") as progress:
            strain = solved.strain_operator @ reference_pressures(surface.point, case.length)
            if case.reference is not None:
                error, against = largest_amplitude(strain - case.reference()), FOURIER_REFERENCE
            if case.second is not None:
                name, other_mesh = case.second
                check = on_other_mesh(case, other_mesh(case.mesh.full), progress, name)
                assert check.point is not None
                on_other = check.strain_operator @ reference_pressures(check.point, case.length)
                error, against = largest_amplitude(strain - on_other), check.against
    return Structure(
        vehicle=case.vehicle,
        model=case.model,
        settings={
            "strainfmu_version": __version__,
            **case.record,
            **settings,
            "mesh_error_against": against,
            "made_from": made_from,
        },
        statistics={
            "elements": len(case.mesh.full.element),
            "degrees_of_freedom": case.mesh.full.n_dof,
            **solved.statistics,
        },
        **gauge_fields(case.layouts),
        point=surface.point,
        triangle=surface.triangle,
        normal=surface.node_normal,
        strain_operator=solved.strain_operator,
        mesh_error=error,
        check=check,
    )


def on_other_mesh(
    case: SolidCase, mesh: AnyMesh, progress: Progress | None, name: str = "another mesh"
) -> MeshCheck:
    """Return Z_p of the gauges on another mesh; on one of free shape each is moved onto its surface."""
    is_free = case.body is None
    rows = layout_rows(mesh, case.layouts, near_surface=is_free)
    surface, solver = loaded_surface(mesh)[0], case.solver if is_free else None
    return MeshCheck(
        against=f"{name} of {mesh.full.n_dof} dofs",
        factor=1.0,
        strain_operator=solve_strain(mesh, case.matter, case.support, rows, solver, progress).strain_operator,
        point=surface.point,
        triangle=surface.triangle,
    )


def strain_per_force(case: SolidCase) -> tuple[SolidMesh, FloatArray]:
    """Return the whole mesh and the strain (n_d, n_p, 3) [1/N] of all layouts per force at its external nodes."""
    rows = layout_rows(case.mesh, case.layouts)
    solved = solve_strain(case.mesh, case.matter, case.support, rows, case.solver, of_forces=True)
    return case.mesh.full, solved.strain_operator.reshape(len(solved.strain_operator), -1, 3)


def _examined(case: SolidCase, reporter: Reporter) -> dict[str, Any]:
    """Check the mesh and describe it; return the settings ``mesh_report`` and ``locking`` that follow.

    ``locking`` is how much of the wall's bending is kept, by harmonic; a body without a cavity has no wall.
    """
    mesh = case.mesh.full
    exact = None if case.body is None else exact_wall(*case.of_revolution)
    with reporter.stage("Mesh checks and report"):
        check_mesh(mesh, case.length, hollow=case.body is not None)
        if case.file is not None:
            refuse_misfits(case.file, mesh_misfits(mesh, *case.of_revolution), NEEDS_BOTH)
        report = mesh_report(mesh, case.matter.known_densities(mesh.region_names), exact)
    ratios: Mapping[int, float] = {}
    with reporter.stage("Locking check"), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LockingWarning)
        if INTERNAL in mesh.surface:
            ratios = check_locking(case.wall_elements, case.allow_locking)
        else:
            check_solid_elements(mesh.element_type, case.allow_locking)
            reporter.note(
                "mesh: a body without a cavity (no surface 'internal'): it has no wall whose bending locks"
            )
    for warning in caught:
        reporter.note(f"warning: {warning.message}")
    return {
        "mesh_report": [list(row) for row in report],
        "locking": {str(harmonic): float(ratio) for harmonic, ratio in ratios.items()},
    }
