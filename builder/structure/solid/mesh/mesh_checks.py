"""Checks of a mesh before anything is computed on it; each fault is one line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from builder.structure.solid.elements.element_faces import (
    FACE_CORNERS,
    all_faces,
    boundary_facets,
    face_keys,
)
from builder.structure.solid.elements.element_quality import determinant_ratio
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

FOLDED_BELOW = -1e-9  # minimum determinant over the mean: rounding at an element collapsed to a point
SAME_PLACE = 1e-8  # of the mesh's size
LENGTH_TOLERANCE = 0.02
KNOWN_UNITS = {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254, "foot": 0.3048}


def check_mesh(mesh: SolidMesh, length: float | None = None, hollow: bool = True) -> None:
    """Refuse a mesh that would give wrong numbers, or none.

    Parameters
    ----------
    mesh : the mesh.
    length : length of the vehicle along x [m], if known: finds a wrong unit.
    hollow : there must be a surface ``internal``. Otherwise a body without a cavity, such as a wing, passes too.

    Raises
    ------
    InputError
        The first fault found: wrong scale, missing surface, node in no element, doubled nodes, separate parts,
        inverted element, facet that is not an outer face of an element, turned inward or listed twice.
    """
    if length is not None:
        refuse_wrong_scale(mesh, length)
    for name in (EXTERNAL, SUPPORT):
        mesh.named_surface(name)
    if not len(mesh.surface.get(INTERNAL, ())):
        refuse_unnamed_cavity(mesh, hollow)
    refuse_unused_nodes(mesh)
    refuse_doubled_nodes(mesh)
    refuse_separate_parts(mesh)
    refuse_inverted_elements(mesh)
    refuse_foreign_facets(mesh)


def refuse_wrong_scale(mesh: SolidMesh, length: float) -> None:
    """Refuse a mesh whose length along x is not the length of the vehicle [m], to 2 %."""
    x = mesh.node[:, 0]
    found = float(np.ptp(x))
    ratio = found / length
    if abs(ratio - 1.0) <= LENGTH_TOLERANCE:
        return
    guess = [unit for unit, metre in KNOWN_UNITS.items() if abs(ratio * metre - 1.0) < 5.0 * LENGTH_TOLERANCE]
    hint = f"; read it with the unit {guess[0]} ({KNOWN_UNITS[guess[0]]:g} m)" if guess else ""
    raise InputError(f"mesh: {found:.6g} m long in x, the vehicle {length:.6g} m{hint}")


def refuse_unnamed_cavity(mesh: SolidMesh, hollow: bool) -> None:
    """Refuse a mesh without a surface ``internal`` that needs it (``hollow``), or has faces without a name."""
    found = ", ".join(sorted(mesh.surface))
    if hollow:
        raise InputError(
            f"mesh: no surface '{INTERNAL}', found {found}: a profile has a wall round a cavity; a body without "
            "one is given by shape.surface and structure.mesh"
        )
    face, _ = boundary_facets(mesh.element_type, mesh.element)
    named = np.concatenate([match_facets(mesh.element_type, face, facet) for facet in mesh.surface.values()])
    bare = np.delete(np.arange(len(face)), named[named >= 0])
    if len(bare):
        raise InputError(
            f"mesh: no surface '{INTERNAL}', and {len(bare)} outer faces of elements are on none of {found}, the "
            f"first at {_at(mesh.node[face[bare[0]]].mean(axis=0))}: name the cavity's '{INTERNAL}'; of a "
            "body without one every face is on a surface"
        )


def refuse_unused_nodes(mesh: SolidMesh) -> None:
    """Refuse nodes that no element has: they would make the stiffness singular."""
    used = np.zeros(mesh.n_nodes, dtype=bool)
    used[mesh.element] = True
    lost = np.flatnonzero(~used)
    if len(lost):
        raise InputError(
            f"mesh: {len(lost)} nodes are in no element, the first is node {lost[0]} at {_at(mesh.node[lost[0]])}"
        )


def refuse_doubled_nodes(mesh: SolidMesh) -> None:
    """Refuse two nodes at one point: the body would be cut there."""
    size = float(np.linalg.norm(np.ptp(mesh.node, axis=0)))
    pairs = cKDTree(mesh.node).query_pairs(SAME_PLACE * size, output_type="ndarray")
    if len(pairs):
        a, b = pairs[np.lexsort(pairs.T[::-1])][0]
        raise InputError(
            f"mesh: {len(pairs)} pairs of nodes at one point, the first are nodes {a} and {b} at "
            f"{_at(mesh.node[a])}; merge coincident nodes in the mesher"
        )


def refuse_separate_parts(mesh: SolidMesh) -> None:
    """Refuse a mesh of parts that share no node: only one of them would be held."""
    n, n_elements = mesh.n_nodes, len(mesh.element)
    # A graph of nodes and elements, each element joined to its nodes.
    joined = n + np.repeat(np.arange(n_elements), mesh.element.shape[1])
    graph = csr_array((np.ones(joined.size), (mesh.element.ravel(), joined)), shape=(n + n_elements,) * 2)
    count, label = connected_components(graph, directed=False)
    part = label[:n]
    if count == 1:
        return
    sizes = np.bincount(part, minlength=count)
    smallest = int(sizes.argmin())
    inside = mesh.node[part == smallest]
    box = ", ".join(
        f"{axis} {low:.4g} to {high:.4g}"
        for axis, low, high in zip("xyz", inside.min(0), inside.max(0), strict=True)
    )
    raise InputError(
        f"mesh: {count} parts that share no node; the smallest has {sizes[smallest]} of {mesh.n_nodes} nodes, in "
        f"the box {box} m"
    )


def refuse_inverted_elements(mesh: SolidMesh) -> None:
    """Refuse elements turned inside out or folded."""
    ratio = determinant_ratio(mesh.element_type, mesh.node, mesh.element)
    folded = np.flatnonzero(ratio < FOLDED_BELOW)
    if len(folded):
        first = folded[0]
        raise InputError(
            f"mesh: {len(folded)} of {len(mesh.element)} elements are inverted or folded, the first is element "
            f"{first} at {_at(mesh.node[mesh.element[first]].mean(axis=0))}"
        )


def refuse_foreign_facets(mesh: SolidMesh) -> None:
    """Refuse facets that are not outer faces of elements, point inward, or are listed twice."""
    faces = all_faces(mesh.element_type, mesh.element)
    _, number, count = np.unique(
        face_keys(mesh.element_type, faces), axis=0, return_inverse=True, return_counts=True
    )
    outer = faces[count[number.ravel()] == 1]
    for name, facet in mesh.surface.items():
        match = match_facets(mesh.element_type, outer, facet)
        _refuse(mesh, name, facet, match < 0, "are not outer faces of elements")
        turned = ~_same_turn(outer[match], facet, FACE_CORNERS[mesh.element_type])
        _refuse(mesh, name, facet, turned, "point inward or have their nodes in another order than their element")
        first = np.unique(match, return_index=True)[1]
        again = np.ones(len(facet), dtype=bool)
        again[first] = False
        _refuse(mesh, name, facet, again, "are listed twice")


def match_facets(element_type: str, face: IntArray, facet: IntArray) -> IntArray:
    """Return (f,) the face (k, n_f) with the same corners as each facet (f, n_f), -1 where there is none."""
    keys = np.concatenate([face_keys(element_type, face), face_keys(element_type, facet)])
    label = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    index = np.full(label.max() + 1, -1, dtype=np.int64)
    index[label[: len(face)]] = np.arange(len(face))
    return index[label[len(face) :]]


def _same_turn(face: IntArray, facet: IntArray, n_corners: int) -> NDArray[np.bool_]:
    """Whether each facet is its face, begun at any corner: same turn, same middles."""
    same = np.zeros(len(facet), dtype=bool)
    for shift in range(n_corners):
        rolled = np.concatenate(
            [np.roll(face[:, k : k + n_corners], -shift, axis=1) for k in range(0, face.shape[1], n_corners)],
            axis=1,
        )
        same |= (rolled == facet).all(axis=1)
    return same


def _refuse(mesh: SolidMesh, name: str, facet: IntArray, fault: NDArray[np.bool_], what: str) -> None:
    wrong = np.flatnonzero(fault)
    if len(wrong):
        where = _at(mesh.node[facet[wrong[0]]].mean(axis=0))
        raise InputError(
            f"mesh: surface '{name}': {len(wrong)} of {len(facet)} facets {what}, the first is facet {wrong[0]} "
            f"at {where}"
        )


def _at(point: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in point) + ") m"
