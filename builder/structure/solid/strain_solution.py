"""Z_p = B A^-1 C_map, the linear map from the pressure at surface nodes to gauge strain, by adjoint solves.

A is symmetric, so row i of Z_p is C_map^T A^-1 b_i with b_i the gauge's row: one solution per gauge, however many
pressure nodes there are. Source: the paper's eq. Z_p = B A^-1 C_map.

The solution for Z_p: by sectors where the mesh is made of them, on the full mesh otherwise.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from builder.reporting import Progress
from builder.structure.solid.cyclic import (
    CyclicSolver,
    SectorRows,
    cyclic_problem,
    force_operator,
    pressure_operator,
    sector_rows,
)
from builder.structure.solid.gauge_rows import Gauges, gauge_rows, joined_gauges, refuse_twins
from builder.structure.solid.linear_solvers import CYCLIC, SparseSolver, choose_solver
from builder.structure.solid.matter import FreeFlight, Matter, determinate_support, free_flight
from builder.structure.solid.nodal_loads import loaded_surface, nodal_force_load, pressure_load
from builder.structure.solid.solid_mesh import EXTERNAL, SolidMesh
from builder.structure.solid.sparse_problem import SparseProblem
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.supports import Restraint, Support, restrain
from builder.structure.solid.swept_mesh import REGION, AnyMesh, SweptSector
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

GAUGES_AT_ONCE = 16


def held_problem(
    mesh: SolidMesh, materials: Mapping[str, Material], supports: Sequence[Support] | Restraint | None
) -> SparseProblem:
    """Assemble the stiffness of a mesh and hold it.

    Parameters
    ----------
    mesh : the mesh.
    materials : material by name of region.
    supports : what holds it, or the restraint they make; None in free flight, where three nodes hold the rigid
        motions and :class:`~builder.structure.solid.matter.FreeFlight` balances the load.
    """
    if supports is None:
        supports = determinate_support(mesh)
    restraint = supports if isinstance(supports, Restraint) else restrain(mesh, supports)
    return SparseProblem(restraint.held_stiffness(assemble_stiffness(mesh, materials)), restraint.free, mesh.node)


def strain_operator(
    rows: csr_array,
    solver: SparseSolver,
    load: csr_array,
    flight: FreeFlight | None = None,
    progress: Progress | None = None,
) -> FloatArray:
    """Return Z_p, the strain of every gauge per pressure at every surface node.

    Parameters
    ----------
    rows : (n_gauges, n_dof) strain per displacement [1/m].
    solver : of the held structure.
    load : (n_dof, n_p) nodal force per pressure [m2].
    flight : the body's inertia in free flight; None where supports carry the load.
    progress : called with (gauges done, gauges in all) after each block of 16.

    Returns
    -------
    (n_gauges, n_p) [1/Pa].
    """
    if rows.shape[1] != load.shape[0]:
        raise InputError(f"gauge rows are of {rows.shape[1]} dofs, the load of {load.shape[0]}")
    n = rows.shape[0]
    z = np.empty((n, load.shape[1]))
    for first in range(0, n, GAUGES_AT_ONCE):
        block = slice(first, min(first + GAUGES_AT_ONCE, n))
        adjoint = solver.solve(csr_array(rows[block].T))
        if flight is not None:
            adjoint = flight.balanced_rows(adjoint)
        z[block] = (load.T @ adjoint).T
        if progress is not None:
            progress(block.stop, n)
    return z


def displacement(
    solver: SparseSolver, load: csr_array, pressure: FloatArray, flight: FreeFlight | None = None
) -> FloatArray:
    """Return the displacement of every node under surface pressures.

    Parameters
    ----------
    solver, load, flight : as in :func:`strain_operator`.
    pressure : (n_p,) or (n_p, k) [Pa].

    Returns
    -------
    (n_nodes, 3) or (k, n_nodes, 3) [m], body axes. In free flight rigid motion is left out: the field is at right
    angles to all rigid motions, weighted with mass.
    """
    force = np.asarray(load @ pressure.reshape(len(pressure), -1))
    field = solver.solve(force if flight is None else flight.balanced(force))
    if flight is not None:
        field = field - flight.rigid @ np.linalg.solve(flight.inertia, flight.inertia_force.T @ field)
    shaped = field.T.reshape(-1, len(field) // 3, 3)
    return np.asarray(shaped[0] if pressure.ndim == 1 else shaped)


def layout_rows(
    mesh: AnyMesh, layouts: Mapping[str, Gauges], near_surface: bool = False
) -> csr_array | SectorRows:
    """Return B of all layouts on a mesh, one after another; within a layout no gauge may occur twice.

    ``near_surface``, of meshes that are not swept, and errors are as in
    :func:`~builder.structure.solid.gauge_rows.gauge_rows`.
    """
    for gauges in layouts.values():
        refuse_twins(gauges)
    every = joined_gauges([*layouts.values()])
    return sector_rows(mesh, every) if isinstance(mesh, SweptSector) else gauge_rows(mesh, every, near_surface)


FIELDS_AT_ONCE = 4
"""Pressures that are solved for together; the residual of their sum is checked, which grows with their number."""


class StrainSolution(NamedTuple):
    """Z_p (n_d, n_p) [1/Pa], and its solver, licence and residuals; nothing that changes from run to run.

    Columns are in the order of the full mesh's external nodes; of meshes that are not swept one per side of a
    sharp edge (:func:`~builder.structure.solid.nodal_loads.split_surface`).
    """

    strain_operator: FloatArray
    statistics: dict[str, Any]


def solve_strain(
    mesh: AnyMesh,
    matter: Matter,
    support: Support | None,
    rows: csr_array | SectorRows,
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
    rows : of n_d gauges, by sectors of a swept mesh.
    solver_name : name of a solver, or None for the best installed one.
    progress : called with (done, in all).
    of_forces : columns are forces along x, y, z at the external nodes, column = 3 * node + component [1/N].
    """
    if isinstance(mesh, SweptSector) and solver_name == CYCLIC and support is None:
        raise InputError(f"solver '{CYCLIC}': free flight is not the same in every sector, take another solver")
    if isinstance(mesh, SweptSector) and solver_name in (None, CYCLIC) and support is not None:
        cyclic = CyclicSolver(cyclic_problem(mesh, matter.materials((REGION,)), [support]))
        assert isinstance(rows, SectorRows)
        in_sectors = (force_operator if of_forces else pressure_operator)(mesh, EXTERNAL)
        operator = cyclic.strain_operator(rows, in_sectors, progress)
        return _solution(_along_body_axes(mesh, operator) if of_forces else operator, cyclic)
    solver, flight = _held(mesh, matter, support, solver_name)
    load = nodal_force_load(mesh.full, EXTERNAL) if of_forces else _pressure_load(mesh)
    full_rows = rows.along_body_axes() if isinstance(rows, SectorRows) else rows
    return _solution(strain_operator(full_rows, solver, load, flight, progress), solver)


def solve_fields(
    mesh: SolidMesh,
    matter: Matter,
    support: Support | None,
    rows: csr_array,
    fields: FloatArray,
    solver_name: str | None = None,
    progress: Progress | None = None,
) -> FloatArray:
    """Return the strain (n_d, k) of gauge rows under pressures ``fields`` (n_p, k): one solution per pressure.

    With many gauges and few pressures this is cheaper than :func:`solve_strain`, whose other parameters and errors
    it has.
    """
    solver, flight = _held(mesh, matter, support, solver_name)
    load, n = _pressure_load(mesh), fields.shape[1]
    strain = np.empty((rows.shape[0], n))
    for first in range(0, n, FIELDS_AT_ONCE):
        block = slice(first, min(first + FIELDS_AT_ONCE, n))
        moved = displacement(solver, load, fields[:, block], flight)
        strain[:, block] = rows @ moved.reshape(len(moved), -1).T
        if progress is not None:
            progress(block.stop, n)
    return strain


def _held(
    mesh: AnyMesh, matter: Matter, support: Support | None, solver_name: str | None
) -> tuple[SparseSolver, FreeFlight | None]:
    """Return the solver of the held structure on its full mesh, and the inertia that balances a free flight."""
    full = mesh.full
    regions = full.region_names
    flight = free_flight(full, matter) if support is None else None
    problem = held_problem(full, matter.materials(regions), None if support is None else [support])
    return choose_solver(problem, solver_name), flight


def _pressure_load(mesh: AnyMesh) -> csr_array:
    """Return the nodal force (n_dof, n_p) per pressure [m2] on the external surface."""
    return pressure_load(mesh.full, EXTERNAL, loaded_surface(mesh)[1])


def _along_body_axes(sector: SweptSector, operator: FloatArray) -> FloatArray:
    """Return strain per force (n_d, k) [1/N], given in sector frames, along body axes."""
    parts = operator.reshape(len(operator), sector.n_sectors, -1, 3)
    turns = np.stack([sector.rotation(s) for s in range(sector.n_sectors)])
    return np.asarray(np.einsum("sij,dsnj->dsni", turns, parts, optimize=True).reshape(len(operator), -1))


def _solution(operator: FloatArray, solver: SparseSolver | CyclicSolver) -> StrainSolution:
    statistics = {
        "solver": solver.name,
        "licence": solver.licence,
        "relative_residual": float(f"{solver.relative_residual:.0e}"),
        "probe_residual": float(f"{solver.probe_residual:.0e}"),
    }
    return StrainSolution(operator, statistics)
