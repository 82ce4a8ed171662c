"""Three-dimensional model of a vehicle of any shape, on a mesh of its own: from its case to Z_p."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csr_array, vstack

from builder.reporting import Progress, Reporter
from builder.structure.mesh_check import MeshCheck
from builder.structure.solid.checks.examination import examination
from builder.structure.solid.checks.locking import WallElements, check_locking, check_solid_elements
from builder.structure.solid.checks.reference_loads import NO_REFERENCE, largest_amplitude, reference_pressures
from builder.structure.solid.free_case import FreeCase
from builder.structure.solid.gauges.gauge_rows import gauge_fields, gauge_rows
from builder.structure.solid.mesh.mesh_checks import check_mesh
from builder.structure.solid.mesh.mesh_report import facet_size_round_axis, mesh_report
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, INTERNAL, SolidMesh
from builder.structure.solid.mesh.swept_mesh import SweptMesh
from builder.structure.solid.operators.surface_triangles import split_surface
from builder.structure.solid.solution import StrainSolution, solve_strain
from builder.structure.structure_file import Structure
from strainfmu.arrays import FloatArray
from strainfmu.version import __version__


def solve_free_structure(
    case: FreeCase, support: dict[str, Any], reporter: Reporter, before: Structure | None = None
) -> Structure:
    """Compute Z_p of all layouts of a free shape.

    Parameters
    ----------
    case : what is computed.
    support : what a file states of the support.
    reporter : receives the stages.
    before : an earlier result, from which checks are taken if it is of the same mesh.

    Raises
    ------
    InputError
        The mesh fails a check or locks, a gauge is not on its surface, or the supports leave a rigid motion free.
    StrainfmuError
        The solver fails.
    """
    made_from = case.made_from()
    if before is not None and before.settings["made_from"]["mesh"] == made_from["mesh"]:
        reporter.note("mesh: the same as before, its checks are not repeated")
        found = {key: before.settings[key] for key in ("mesh_report", "locking")}
    else:
        found = _examined(case, reporter)
    surface = split_surface(case.mesh, EXTERNAL)[0]
    with reporter.stage("Strain per pressure") as progress:
        solved = _solved(case, case.mesh, False, progress)
    error, check = np.zeros(len(solved.strain_operator)), None
    if case.other is not None:
        with reporter.stage("Mesh error") as progress:
            check = on_other_mesh(case, case.other, progress)
        error = _mesh_error(surface.point, solved.strain_operator, check, case.length)
    return Structure(
        vehicle=case.vehicle,
        model=case.model,
        settings={
            "strainfmu_version": __version__,
            "mesh": {"model": case.model, **case.source},
            "wall": {"thickness_m": case.thickness},
            "material": {
                "youngs_modulus_Pa": case.matter.material.youngs_modulus,
                "poisson_ratio": case.matter.material.poisson_ratio,
                "density_kg_per_m3": case.matter.density,
            },
            **({"regions_and_masses": placed} if (placed := case.matter.regions_and_masses()) else {}),
            "support": support,
            **found,
            "mesh_error_against": NO_REFERENCE if check is None else check.against,
            "made_from": made_from,
        },
        statistics={
            "elements": len(case.mesh.element),
            "degrees_of_freedom": case.mesh.n_dof,
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


def _examined(case: FreeCase, reporter: Reporter) -> dict[str, Any]:
    """Check the mesh and describe it; the wall's bending is judged at the gauges."""
    mesh = case.mesh
    with reporter.stage("Mesh checks and report"):
        check_mesh(mesh, case.length, hollow=False)
        report = mesh_report(mesh, case.matter.known_densities(mesh.region_names))

    def locking() -> Mapping[int, float]:
        if INTERNAL not in mesh.surface:
            check_solid_elements(mesh.element_type, case.allow_locking)
            reporter.note(
                "mesh: a body without a cavity (no surface 'internal'): it has no wall whose bending locks"
            )
            return {}
        radius = case.gauge_radius
        size = facet_size_round_axis(mesh, INTERNAL, radius)
        layers = max(1, round(case.thickness / size))
        quadrature = mesh.quadrature if isinstance(mesh, SweptMesh) else "full"
        elements = WallElements(element_type=mesh.element_type, size=size, layers=layers, quadrature=quadrature)
        return check_locking(elements, radius, case.thickness, case.matter.material, case.allow_locking)

    return examination(report, locking, reporter)


def _solved(case: FreeCase, mesh: SolidMesh, near_surface: bool, progress: Progress) -> StrainSolution:
    rows = [gauge_rows(mesh, gauges, near_surface) for gauges in case.layouts.values()]
    return solve_strain(
        mesh=mesh,
        matter=case.matter,
        support=case.support,
        rows=csr_array(vstack(rows)),
        solver_name=case.solver,
        progress=progress,
    )


def on_other_mesh(case: FreeCase, other: SolidMesh, progress: Progress) -> MeshCheck:
    """Return Z_p of the gauges on the other mesh, each moved onto its surface."""
    surface = split_surface(other, EXTERNAL)[0]
    return MeshCheck(
        against=f"another mesh of {other.n_dof} dofs",
        factor=1.0,
        strain_operator=_solved(case, other, True, progress).strain_operator,
        point=surface.point,
        triangle=surface.triangle,
    )


def _mesh_error(point: FloatArray, operator: FloatArray, check: MeshCheck, length: float) -> FloatArray:
    """Return the difference (n_d,) [1/Pa] of both meshes under the reference loads."""
    assert check.point is not None
    there = check.strain_operator @ reference_pressures(check.point, length)
    return largest_amplitude(operator @ reference_pressures(point, length) - there)
