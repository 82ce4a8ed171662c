"""Supports of the body: surfaces that do not move or rest on springs; or none, in free flight.

Constraints are kept exactly: the displacement is u = free q with q the free motions, so a solver gets
free^T A free alone. At each held node the free motions are unit vectors, turned where the held directions are.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from builder.structure.solid.elements import reference_facet
from builder.structure.solid.nodal_loads import surface_nodes, vector_area
from builder.structure.solid.solid_mesh import SUPPORT, SolidMesh
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

DISTINCT_DIRECTIONS = 0.05
"""Part of a node's held directions from which on a further one is held, as for two lines 26 deg apart."""

SMALLEST_HOLD = 1e-12
"""Smallest eigenvalue of the supports' hold on rigid motions, over the largest."""

_AXES = ("x", "y", "z")
MOTIONS = (*(f"translation along {axis}" for axis in _AXES), *(f"rotation about {axis}" for axis in _AXES))


@dataclass(frozen=True)
class Clamped:
    """No node of the surface moves."""

    surface: str


@dataclass(frozen=True)
class Foundation:
    """Springs on the surface.

    Attributes
    ----------
    surface : name of the surface.
    normal, tangential : stiffness per area along and across the surface's normal [N/m3].
    """

    surface: str
    normal: float
    tangential: float = 0.0

    def __post_init__(self) -> None:
        stiffness = np.array([self.normal, self.tangential])
        if not np.isfinite(stiffness).all() or stiffness.min() < 0.0 or not stiffness.any():
            raise InputError(
                f"foundation on surface '{self.surface}': normal {self.normal:g} and tangential "
                f"{self.tangential:g} N/m3 must be at least 0, one of them greater"
            )


Support = Clamped | Foundation


def support_of(vehicle: Vehicle) -> Support | None:
    """Return what holds the vehicle, None in free flight."""
    entry = vehicle.structure
    if entry.support == "free_flight":
        return None
    if entry.support == "clamped_aft":
        return Clamped(SUPPORT)
    assert entry.foundation_normal_N_per_m3 is not None
    assert entry.foundation_tangential_N_per_m3 is not None
    return Foundation(SUPPORT, entry.foundation_normal_N_per_m3, entry.foundation_tangential_N_per_m3)


def support_entries(support: Support | None) -> dict[str, Any]:
    """Return what a file states of the support."""
    if support is None:
        return {"kind": "free flight"}
    return {"kind": type(support).__name__.lower(), **asdict(support)}


@dataclass(frozen=True, eq=False)
class Restraint:
    """What the supports leave free, and the stiffness they add.

    Attributes
    ----------
    free : (n_dof, n_free) free motions, orthonormal columns [-].
    added : (n_dof, n_dof) stiffness of foundations [N/m].
    """

    free: csr_array
    added: csr_array

    def held_stiffness(self, stiffness: csr_array) -> csr_array:
        """Return free^T (stiffness + added) free, (n_free, n_free) [N/m], positive definite."""
        total = csr_array(stiffness + self.added) if self.added.nnz else stiffness
        n_free = self.free.shape[1]
        if np.array_equal(self.free.indices, np.arange(n_free)) and (self.free.data == 1.0).all():
            # Unit vectors in the order of dofs: rows and columns of the matrix, ten times faster to pick.
            rows = np.flatnonzero(np.diff(self.free.indptr))
            return csr_array(total[rows][:, rows])
        return csr_array(self.free.T @ total @ self.free)


def restrain(mesh: SolidMesh, supports: Sequence[Support]) -> Restraint:
    """Return what supports leave free: any number of them, on surfaces of ``mesh``."""
    clamped = [surface_nodes(mesh, support.surface) for support in supports if isinstance(support, Clamped)]
    node = np.repeat(np.concatenate([np.zeros(0, dtype=np.int64), *clamped]), 3)
    direction = np.tile(np.eye(3), (len(node) // 3, 1))
    added = csr_array((mesh.n_dof, mesh.n_dof))
    for support in supports:
        if isinstance(support, Foundation):
            added = csr_array(added + foundation_stiffness(mesh, support))
    _refuse_rigid_motion(mesh, node, direction, added)
    return Restraint(free_motions(mesh.n_nodes, node, direction), added)


def free_motions(n_nodes: int, node: IntArray, direction: FloatArray) -> csr_array:
    """Return the motions that remain when nodes are held along directions.

    Parameters
    ----------
    n_nodes : nodes of the mesh.
    node : (k,) held nodes, each as often as it has held directions.
    direction : (k, 3) unit vectors, of one node not necessarily at right angles.

    Returns
    -------
    (3 n_nodes, n_free) orthonormal columns.
    """
    held_node, index = np.unique(node, return_inverse=True)
    gram = np.zeros((len(held_node), 3, 3))
    np.add.at(gram, index, direction[:, :, None] * direction[:, None, :])
    strength, vector = np.linalg.eigh(gram)
    which, column = np.nonzero(strength < DISTINCT_DIRECTIONS)
    largest = np.take_along_axis(vector, np.abs(vector).argmax(axis=1, keepdims=True), axis=1)
    vector *= np.sign(largest)  # one of two signs, so that unit vectors are positive
    loose = np.setdiff1d(np.arange(n_nodes), held_node)
    n_loose = 3 * len(loose)
    row = np.concatenate(
        [(3 * loose[:, None] + np.arange(3)).ravel(), (3 * held_node[which][:, None] + np.arange(3)).ravel()]
    )
    position = np.concatenate([np.arange(n_loose), np.repeat(n_loose + np.arange(len(which)), 3)])
    entry = np.concatenate([np.ones(n_loose), vector[which, :, column].ravel()])
    # Columns in the order of nodes: a factorisation's ordering starts from it.
    rank = np.empty(n_loose + len(which), dtype=np.int64)
    first = np.concatenate([row[:n_loose], 3 * held_node[which] + column])
    rank[np.argsort(first, kind="stable")] = np.arange(len(rank))
    free = csr_array((entry, (row, rank[position])), shape=(3 * n_nodes, len(rank)))
    free.eliminate_zeros()
    return free


def foundation_stiffness(mesh: SolidMesh, support: Foundation) -> csr_array:
    """Return (n_dof, n_dof) integral of N_a (k_n n n^T + k_t (I - n n^T)) N_b dS [N/m]."""
    facet = mesh.named_surface(support.surface)
    shape = reference_facet(mesh.element_type).shape
    vector = vector_area(mesh.element_type, mesh.node[facet])
    area = np.linalg.norm(vector, axis=-1)
    normal = vector / area[..., None]
    spring = support.tangential * np.eye(3) + (support.normal - support.tangential) * (
        normal[..., :, None] * normal[..., None, :]
    )
    value = np.einsum("fq,fqij,qa,qb->faibj", area, spring, shape, shape, optimize=True)
    dof = 3 * facet[:, :, None] + np.arange(3)
    row = np.broadcast_to(dof[:, :, :, None, None], value.shape)
    column = np.broadcast_to(dof[:, None, None], value.shape)
    return csr_array(coo_array((value.ravel(), (row.ravel(), column.ravel())), shape=(mesh.n_dof, mesh.n_dof)))


def rigid_motions(point: FloatArray, origin: FloatArray | None = None) -> FloatArray:
    """Return three translations [-] and three rotations about ``origin`` [m] of points (n, 3): (3 n, 6)."""
    arm = point - (np.zeros(3) if origin is None else origin)
    motion = np.zeros((len(point), 3, 6))
    motion[:, :, :3] = np.eye(3)
    for axis in range(3):
        motion[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arm)
    return motion.reshape(-1, 6)


def _refuse_rigid_motion(mesh: SolidMesh, node: IntArray, direction: FloatArray, added: csr_array) -> None:
    # The factorisation would not notice: rounding makes the vanishing pivot a small number.
    used = np.unique(mesh.element)
    centre = mesh.node[used].mean(axis=0)
    size = np.abs(mesh.node[used] - centre).max()
    rigid = rigid_motions(mesh.node, centre) / np.array([1.0, 1.0, 1.0, size, size, size])
    held_motion = np.einsum("kc,kcm->km", direction, rigid.reshape(-1, 3, 6)[node])
    hold = held_motion.T @ held_motion
    if added.nnz:
        springs = rigid.T @ (added @ rigid)
        hold += springs / np.trace(springs)
    strength, vector = np.linalg.eigh(hold)
    if strength[0] <= SMALLEST_HOLD * max(strength[-1], 1e-300):
        motion = MOTIONS[int(np.abs(vector[:, 0]).argmax())]
        raise InputError(f"supports: a rigid motion is left free ({motion}); add a support or use free flight")
