"""Z_p = B A^-1 C_map, the linear map from the pressure at surface nodes to gauge strain, by adjoint solves.

A is symmetric, so row i of Z_p is C_map^T A^-1 b_i with b_i the gauge's row: one solution per gauge, however many
pressure nodes there are. Source: the paper's eq. Z_p = B A^-1 C_map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array

from builder.reporting import Progress
from builder.structure.solid.mesh.solid_mesh import SolidMesh
from builder.structure.solid.operators.free_flight import FreeFlight, determinate_support
from builder.structure.solid.operators.stiffness import assemble_stiffness
from builder.structure.solid.operators.supports import Restraint, Support, restrain
from builder.structure.solid.solvers.problem import SparseProblem
from builder.structure.solid.solvers.solver import Solver
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
        motions and :class:`~builder.structure.solid.operators.free_flight.FreeFlight` balances the load.

    Raises
    ------
    InputError
        A region has no material, an element is turned inside out, or the supports leave a rigid motion free.
    """
    if supports is None:
        supports = determinate_support(mesh)
    restraint = supports if isinstance(supports, Restraint) else restrain(mesh, supports)
    return SparseProblem(restraint.held_stiffness(assemble_stiffness(mesh, materials)), restraint.free, mesh.node)


def strain_operator(
    rows: csr_array,
    solver: Solver,
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

    Raises
    ------
    InputError
        Rows and load are of different meshes.
    SolverError
        A solution's residual is too large.
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
    solver: Solver, load: csr_array, pressure: FloatArray, flight: FreeFlight | None = None
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


def forward_error(
    z: FloatArray,
    rows: csr_array,
    solver: Solver,
    load: csr_array,
    pressure: FloatArray,
    flight: FreeFlight | None = None,
) -> float:
    """Return the largest difference of Z_p p from B u(p), over the largest strain.

    Parameters
    ----------
    z : (n_gauges, n_p) [1/Pa], from adjoint solutions.
    rows, solver, load, flight : as in :func:`strain_operator`.
    pressure : (n_p, k) [Pa], k forward solutions.
    """
    field = displacement(solver, load, pressure, flight).reshape(pressure.shape[1], -1)
    strain = rows @ field.T
    return float(np.abs(z @ pressure - strain).max() / np.abs(strain).max())
