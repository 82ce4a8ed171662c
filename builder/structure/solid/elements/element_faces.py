"""Faces and edges of elements, and the boundary of a mesh.

Local node numbers are VTK's: corners, then the middles of edges in the order of :data:`EDGES`. Faces turn
anticlockwise seen from outside, corners first, then middles, so their normal points outward (VTK User's Guide,
figures of cell types; vtkQuadraticTetra, vtkQuadraticHexahedron).
"""

from __future__ import annotations

import numpy as np

from strainfmu.arrays import IntArray

_TETRAHEDRON_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_HEXAHEDRON_EDGES = (
    *((0, 1), (1, 2), (2, 3), (3, 0)),
    *((4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
_TETRAHEDRON_FACES = ((0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1))
_HEXAHEDRON_FACES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))

CORNERS = {"hexahedron20": 8, "tetrahedron10": 4, "hexahedron8": 8, "tetrahedron4": 4}
FACE_CORNERS = {"hexahedron20": 4, "tetrahedron10": 3, "hexahedron8": 4, "tetrahedron4": 3}


def element_edges(element_type: str) -> IntArray:
    """Return (n_edges, 2) local corners of each edge, in the order of the middle nodes."""
    return np.array(_TETRAHEDRON_EDGES if CORNERS[element_type] == 4 else _HEXAHEDRON_EDGES, dtype=np.int64)


def element_faces(element_type: str) -> IntArray:
    """Return (n_faces, n_f) local nodes of each face, outward."""
    corners = _TETRAHEDRON_FACES if CORNERS[element_type] == 4 else _HEXAHEDRON_FACES
    if element_type in ("tetrahedron4", "hexahedron8"):
        return np.array(corners, dtype=np.int64)
    first_middle = CORNERS[element_type]
    middle = {frozenset(edge): first_middle + i for i, edge in enumerate(element_edges(element_type).tolist())}
    faces = [
        [*face, *(middle[frozenset((a, b))] for a, b in zip(face, (*face[1:], face[0]), strict=True))]
        for face in corners
    ]
    return np.array(faces, dtype=np.int64)


def all_faces(element_type: str, element: IntArray) -> IntArray:
    """Return (m * n_faces, n_f) the faces of elements (m, n_e), element by element."""
    local = element_faces(element_type)
    return element[:, local].reshape(-1, local.shape[1])


def face_keys(element_type: str, facet: IntArray) -> IntArray:
    """Return (f, n_corners) sorted corners of facets: equal for one face seen from both of its elements."""
    return np.sort(facet[:, : FACE_CORNERS[element_type]], axis=1)


def boundary_facets(element_type: str, element: IntArray) -> tuple[IntArray, IntArray]:
    """Return the faces that belong to one element alone.

    Parameters
    ----------
    element_type : kind of the elements.
    element : (m, n_e) node numbers.

    Returns
    -------
    facet : (f, n_f) node numbers, outward.
    owner : (f,) the element of each.
    """
    faces = all_faces(element_type, element)
    _, first, count = np.unique(face_keys(element_type, faces), axis=0, return_index=True, return_counts=True)
    alone = np.sort(first[count == 1])
    return faces[alone], alone // len(element_faces(element_type))
