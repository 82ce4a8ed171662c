"""The solution for Z_p: by sectors where the mesh is made of them, on the full mesh otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from builder.reporting import Progress
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, SolidMesh
from builder.structure.solid.mesh.swept_mesh import REGION, SweptSector, full_mesh
from builder.structure.solid.operators.cyclic_operator import cyclic_problem
from builder.structure.solid.operators.free_flight import free_flight
from builder.structure.solid.operators.matter import Matter
from builder.structure.solid.operators.supports import Support
from builder.structure.solid.operators.surface_load import nodal_force_load, pressure_load
from builder.structure.solid.operators.surface_triangles import split_surface
from builder.structure.solid.solvers.cyclic import CyclicSolver, force_operator, pressure_operator
from builder.structure.solid.solvers.solver import CYCLIC, Solver, choose_solver
from builder.structure.solid.strain_operator import held_problem, strain_operator
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False)
class StrainSolution:
    """Z_p and how it was found.

    Attributes
    ----------
    strain_operator : (n_d, n_p) [1/Pa], columns in the order of the full mesh's external nodes; of meshes that are
        not swept one per side of a sharp edge
        (:func:`~builder.structure.solid.operators.surface_triangles.split_surface`).
    statistics : solver, licence and residuals; nothing that changes from run to run.
    """

    strain_operator: FloatArray
    statistics: dict[str, Any]


def solve_strain(
    mesh: SweptSector | SolidMesh,
    matter: Matter,
    support: Support | None,
    rows: csr_array,
    solver_name: str | None,
    progress: Progress | None = None,
    of_forces: bool = False,
) -> StrainSolution:
    """Return Z_p of gauge rows, or their strain per force.

    A swept mesh that is held is solved sector by sector and its full matrix never built, unless another solver is
    named. Free flight holds three nodes, which are not the same in every sector.

    Parameters
    ----------
    mesh : the mesh, a swept one as its sector.
    matter : its materials and masses; a swept mesh has one material.
    support : what holds the body; None in free flight.
    rows : (n_d, n_dof) gauge rows of the full mesh [1/m].
    solver_name : name of a solver, or None for the best installed one.
    progress : called with (done, in all).
    of_forces : columns are forces along x, y, z at the external nodes, column = 3 * node + component [1/N].

    Raises
    ------
    InputError
        The solver is unknown, not installed or does not fit, a density is missing, or a rigid motion is left free.
    SolverError
        The stiffness is singular, or a residual is too large.
    """
    if (
        isinstance(mesh, SweptSector)
        and solver_name in (None, CYCLIC)
        and (support is not None or solver_name == CYCLIC)
    ):
        if support is None:
            raise InputError(
                f"solver '{CYCLIC}': free flight is not the same in every sector, take another solver"
            )
        problem = cyclic_problem(mesh, matter.materials((REGION,)), [support])
        cyclic = CyclicSolver(problem)
        if of_forces:
            found = cyclic.strain_operator(rows, force_operator(problem, EXTERNAL), progress)
            return _solution(_along_body_axes(mesh, found), cyclic)
        return _solution(cyclic.strain_operator(rows, pressure_operator(problem, EXTERNAL), progress), cyclic)
    whole = full_mesh(mesh) if isinstance(mesh, SweptSector) else mesh
    regions = whole.region_names
    flight = free_flight(whole, matter.densities(regions), matter) if support is None else None
    held = held_problem(whole, matter.materials(regions), None if support is None else [support])
    solver = choose_solver(held, solver_name)
    if of_forces:
        load = nodal_force_load(whole, EXTERNAL)
    else:
        load = pressure_load(
            whole, EXTERNAL, None if isinstance(mesh, SweptSector) else split_surface(mesh, EXTERNAL)[1]
        )
    operator = strain_operator(rows, solver, load, flight, progress)
    return _solution(operator, solver)


def _along_body_axes(sector: SweptSector, operator: FloatArray) -> FloatArray:
    """Return strain per force (n_d, k) [1/N], given in sector frames, along body axes."""
    parts = operator.reshape(len(operator), sector.n_sectors, -1, 3)
    turns = np.stack([sector.rotation(s) for s in range(sector.n_sectors)])
    return np.asarray(np.einsum("sij,dsnj->dsni", turns, parts, optimize=True).reshape(len(operator), -1))


def _solution(operator: FloatArray, solver: Solver) -> StrainSolution:
    used = solver.statistics
    statistics = {
        "solver": solver.name,
        "licence": solver.licence,
        "relative_residual": float(f"{used.relative_residual:.0e}"),
        "probe_residual": float(f"{used.probe_residual:.0e}"),
    }
    return StrainSolution(operator, statistics)
