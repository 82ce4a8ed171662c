"""Blocks of 20-node hexahedra mapped from the unit cube: meshes of benchmark bodies."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from builder.structure.solid.elements import boundary_facets, reference_nodes, shape_functions
from builder.structure.solid.solid_mesh import SolidMesh
from builder.structure.solid.sparse_problem import factor_symmetric
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.supports import free_motions
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray, IntArray

Mapping3 = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
Side = Callable[[FloatArray], NDArray[np.bool_]]

HEXAHEDRON = "hexahedron20"
CLOSE = 1e-6  # nodes of neighbouring blocks nearer than this are one [m]


def mapped_mesh(blocks: list[tuple[Mapping3, tuple[int, int, int]]], sides: Mapping[str, Side]) -> SolidMesh:
    """Mesh blocks, each a right-handed map of (u, v, w) in the unit cube to (n, 3) [m] with counts of elements.

    ``sides`` picks the outer facets of each named surface by the places (f, 8, 3) of their nodes.
    """
    places = [_block_places(mapping, counts) for mapping, counts in blocks]
    place = np.concatenate(places)
    _, first, number = np.unique(
        np.rint(place.reshape(-1, 3) / CLOSE), axis=0, return_index=True, return_inverse=True
    )
    node = place.reshape(-1, 3)[first]
    element = number.reshape(-1, 20).astype(np.int64)
    facet, _ = boundary_facets(HEXAHEDRON, element)
    surface = {name: facet[here(node[facet])] for name, here in sides.items()}
    return SolidMesh(
        element_type=HEXAHEDRON,
        node=node,
        element=element,
        region=np.zeros(len(element), dtype=np.int64),
        region_names=("body",),
        surface=surface,
    )


def _block_places(mapping: Mapping3, counts: tuple[int, int, int]) -> FloatArray:
    """Return (m, 20, 3) the places of the nodes of each element."""
    cell = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    u, v, w = np.moveaxis((cell + reference_nodes(HEXAHEDRON)) / np.array(counts), -1, 0)
    return mapping(u.ravel(), v.ravel(), w.ravel()).reshape(*u.shape, 3)


def plane(axis: int, value: float) -> Side:
    """Return the side in the plane where a coordinate has a value [m]."""
    return lambda place: (np.abs(place[..., axis] - value) < CLOSE).all(axis=-1)


def solve_held(
    mesh: SolidMesh, material: Material, load: FloatArray, held: Sequence[tuple[IntArray, int | FloatArray]]
) -> FloatArray:
    """Return displacements (n, 3) [m] under forces (n_dof,) [N]; ``held`` are nodes with an axis or direction."""
    node = np.concatenate([nodes for nodes, _ in held])
    along = [np.eye(3)[axis] if isinstance(axis, int) else axis for _, axis in held]
    direction = np.concatenate(
        [np.tile(one, (len(nodes), 1)) for one, (nodes, _) in zip(along, held, strict=True)]
    )
    free = free_motions(mesh.n_nodes, node, direction)
    stiffness = csr_array(free.T @ assemble_stiffness(mesh, {"body": material}) @ free)
    return np.asarray(free @ factor_symmetric(stiffness).solve(free.T @ load)).reshape(-1, 3)


def stress_at(mesh: SolidMesh, material: Material, displacement: FloatArray, node: int) -> FloatArray:
    """Return the stress (3, 3) [Pa] at a node, the mean over its elements."""
    lame, shear = material.lame_parameters
    total = []
    for owner, local in zip(*np.nonzero(mesh.element == node), strict=True):
        _, gradient = shape_functions(mesh.element_type, reference_nodes(mesh.element_type)[[local]])
        nodes = mesh.element[owner]
        jacobian = mesh.node[nodes].T @ gradient[0]
        slope = displacement[nodes].T @ gradient[0] @ np.linalg.inv(jacobian)
        strain = 0.5 * (slope + slope.T)
        total.append(lame * np.trace(strain) * np.eye(3) + 2.0 * shear * strain)
    return np.mean(total, axis=0)


def node_at(mesh: SolidMesh, place: tuple[float, float, float]) -> int:
    """Return the node at a point [m]."""
    distance = np.linalg.norm(mesh.node - np.array(place), axis=1)
    found = int(distance.argmin())
    assert distance[found] < CLOSE
    return found
