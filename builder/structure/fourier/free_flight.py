"""Free flight of a body of revolution: its inertia balances the load, harmonic by harmonic.

Only harmonics 0 and 1 move a rigid body: along the axis, and across it with a turn about the middle. As in
:mod:`builder.structure.solid.matter`, strain then does not depend on the nodes that hold the
motions.
"""

import numpy as np
from scipy.sparse import csc_array, csr_array

from builder.structure.fourier.factors import factored
from builder.structure.fourier.fourier_elasticity import (
    FourierStiffness,
    HarmonicSolver,
    factor_harmonic,
    free_motions,
    reference_points_of_mass,
    rigid_motions,
)
from builder.structure.fourier.meridian_mesh import MeridianMesh, line_nodes, locate_on_edge, quadratic_shape
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError


class FlyingSolver:
    """Solver of harmonic 0 or 1 of a body that nothing holds.

    Inertia balances the load, so that what holds the motions takes no force. Where it is the whole aft ring, that
    keeps its shape: a stiff base.

    Parameters
    ----------
    mesh : with masses.
    stiffness : of the mesh.
    harmonic : 0 or 1.
    """

    def __init__(self, mesh: MeridianMesh, stiffness: FourierStiffness, harmonic: int) -> None:
        if len(mesh.clamped_node):
            self._held = factor_harmonic(mesh, stiffness, harmonic)
        else:
            self._held = held_at_points(mesh, stiffness.matrix(harmonic), harmonic)
        self._rigid = rigid_motions(mesh, harmonic)
        self._inertia_force = inertia_matrix(mesh, harmonic) @ self._rigid
        self._inertia = self._rigid.T @ self._inertia_force

    def solve(self, load: FloatArray) -> FloatArray:
        """Return displacement amplitudes (n_dof, k) [m] that act on a load as for the balanced load.

        For the rows of gauges: the answer times a load is the strain under load and inertia.
        """
        adjoint = self._held.solve(load)
        return np.asarray(adjoint - self._rigid @ np.linalg.solve(self._inertia, self._inertia_force.T @ adjoint))

    def moved_by(self, load: FloatArray) -> FloatArray:
        """Return displacement amplitudes (n_dof, k) [m] under nodal forces (n_dof, k) that inertia balances: the
        transpose of :meth:`solve`."""
        inertia = self._inertia_force @ np.linalg.solve(self._inertia.T, self._rigid.T @ load)
        return self._held.solve(load - inertia)


def inertia_matrix(mesh: MeridianMesh, harmonic: int) -> csr_array:
    """Return the mass matrix (n_dof, n_dof) [kg] of a harmonic, per :func:`roll_integral` as the stiffness is.

    A mass on the axis moves along it in harmonic 0, across it in harmonic 1; it has no moment of inertia.

    Raises
    ------
    InputError
        The mesh has no masses, or one lies outside the body.
    """
    if mesh.masses is None:
        raise InputError("free flight: the masses are missing")
    masses = mesh.masses
    density = np.full(len(mesh.element), masses.density[0])
    if mesh.material_of is not None:
        density = np.array(masses.density)[mesh.material_of]
    shape, volume = reference_points_of_mass(mesh)
    block = np.einsum("e,eq,qa,qb->eab", density, volume, shape, shape, optimize=True)
    parts = [_spread(mesh.element, block, len(mesh.node), np.ones(3))]
    for start, end, per_area in masses.covers:
        parts.append(_cover(mesh, start, end, per_area))
    along_axis = np.array([1.0, 0.0, 0.0]) if harmonic == 0 else np.array([0.0, 1.0, 1.0])
    for station, mass in masses.points:
        front, aft = mesh.node[mesh.outer_edge[[0, -1], [0, 2]], 0]
        if not front < station <= aft:
            raise InputError(
                f"point mass at {station:.4g} m: expected a station of the body, up to {aft:.4g} m, got it outside"
            )
        edge, xi = locate_on_edge(mesh, mesh.outer_edge, np.array([station]))
        at = quadratic_shape(xi)[0]
        ring = mass / (2.0 * np.pi) * np.einsum("ea,eb->eab", at, at)
        parts.append(_spread(mesh.outer_edge[edge], ring, len(mesh.node), along_axis))
    return csr_array(sum(parts[1:], parts[0]))


def held_at_points(mesh: MeridianMesh, stiffness: csc_array, harmonic: int) -> HarmonicSolver:
    """Hold the two rigid motions of harmonic 0 or 1 at nodes of the outer surface and nothing else."""
    line = line_nodes(mesh.outer_edge)
    front, aft = line[len(line) // 2], line[-1]
    dof = [3 * aft, 3 * aft + 2] if harmonic == 0 else [3 * front + 2, 3 * aft + 2]
    free = free_motions(mesh, harmonic, twist=True)
    loose = np.setdiff1d(np.arange(free.shape[1]), free.tocsr()[dof].indices)
    free = csc_array(free[:, loose])
    free_stiffness = csc_array(free.T @ stiffness @ free)
    return HarmonicSolver(free, factored(free_stiffness))


def _cover(mesh: MeridianMesh, start: float, end: float, per_area: float) -> csr_array:
    """Return the mass matrix of a mass per outer area between two stations."""
    xi, weight = np.polynomial.legendre.leggauss(8)
    shape, slope = quadratic_shape(xi)
    place = np.einsum("qa,eac->eqc", shape, mesh.node[mesh.outer_edge])
    length = np.linalg.norm(np.einsum("qa,eac->eqc", slope, mesh.node[mesh.outer_edge]), axis=2)
    inside = (place[..., 0] >= start) & (place[..., 0] <= end)
    ring = per_area * inside * place[..., 1] * length * weight
    block = np.einsum("eq,qa,qb->eab", ring, shape, shape, optimize=True)
    return _spread(mesh.outer_edge, block, len(mesh.node), np.ones(3))


def _spread(nodes: IntArray, block: FloatArray, n_nodes: int, component: FloatArray) -> csr_array:
    """Return (3 n, 3 n) of blocks (e, a, a) between nodes (e, a), times ``component`` (3,) along x, r, phi."""
    row = 3 * np.broadcast_to(nodes[:, :, None], block.shape)[..., None] + np.arange(3)
    column = 3 * np.broadcast_to(nodes[:, None, :], block.shape)[..., None] + np.arange(3)
    entry = block[..., None] * component
    return csr_array((entry.ravel(), (row.ravel(), column.ravel())), shape=(3 * n_nodes, 3 * n_nodes))
