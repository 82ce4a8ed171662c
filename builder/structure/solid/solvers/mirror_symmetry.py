"""Planes of symmetry: a problem that a reflection leaves as it is falls apart into smaller ones.

Reflections about y = 0 and z = 0 commute with each other and, on a symmetric structure, with the matrix. In a
basis of motions that are even or odd about each plane the matrix is block diagonal, so up to four problems of a
quarter of the unknowns take the place of one (Bossavit, Comput. Methods Appl. Mech. Eng. 56, 1986, 167-215).
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.spatial import KDTree

from builder.structure.solid.solvers.problem import SparseProblem
from strainfmu.arrays import FloatArray, IntArray

SAME_PLACE = 1e-9  # of the size of the body: two nodes at one point
SYMMETRY_BOUND = 1e-10  # largest |A R - R A| over the largest |A|, on a vector of numbers up to 1

PLANES = {"y = 0": np.array([1.0, -1.0, 1.0]), "z = 0": np.array([1.0, 1.0, -1.0])}


def symmetric_parts(problem: SparseProblem) -> list[csr_array]:
    """Return bases of motions that do not work on one another.

    Returns
    -------
    One to four matrices (n_free, k) with orthonormal columns, which together span all free motions; the identity
    alone if the nodes, supports or stiffness have no plane of symmetry.
    """
    reflections = [one for one in (_reflection(problem, sign) for sign in PLANES.values()) if one is not None]
    n = problem.matrix.shape[0]
    if not reflections:
        return [csr_array(eye_array(n))]
    return [_basis(n, reflections, parity) for parity in product((1.0, -1.0), repeat=len(reflections))]


def _reflection(problem: SparseProblem, sign: FloatArray) -> csr_array | None:
    """Return the reflection as (n_free, n_free) signed permutation of free motions; None if it is no symmetry."""
    if problem.node is None:
        return None
    partner = _partners(problem.node, sign)
    if partner is None:
        return None
    dof = np.arange(problem.n_dof)
    target = 3 * partner[dof // 3] + dof % 3
    of_dofs = csr_array((sign[dof % 3], (target, dof)), shape=(problem.n_dof,) * 2)
    mirror = csr_array(problem.free.T @ of_dofs @ problem.free)
    mirror.eliminate_zeros()
    one_each = (np.diff(mirror.indptr) == 1).all() and np.allclose(np.abs(mirror.data), 1.0, rtol=0.0, atol=1e-12)
    if not one_each:  # the supports are not symmetric, or hold directions that a reflection mixes
        return None
    vector = np.random.default_rng(0).uniform(-1.0, 1.0, len(mirror.indptr) - 1)
    coupling = problem.matrix @ (mirror @ vector) - mirror @ (problem.matrix @ vector)
    symmetric = np.abs(coupling).max() <= SYMMETRY_BOUND * np.abs(problem.matrix.data).max()
    return mirror if symmetric else None


def _partners(node: FloatArray, sign: FloatArray) -> IntArray | None:
    """Return the node (n,) at the mirror image of each node (n, 3) [m]; None if one has none."""
    size = float(np.ptp(node, axis=0).max())
    distance, partner = KDTree(node).query(node * sign, distance_upper_bound=SAME_PLACE * size)
    return np.asarray(partner, dtype=np.int64) if np.isfinite(distance).all() else None


def _basis(n: int, reflections: list[csr_array], parity: tuple[float, ...]) -> csr_array:
    """Return the orthonormal basis (n, k) of motions x with R x = parity x for each reflection R.

    The projection of a unit vector is, but for the sign, the projection of its mirror images: one of them
    represents all.
    """
    projection, first = csr_array(eye_array(n)), np.arange(n)
    for mirror, sign in zip(reflections, parity, strict=True):
        projection = csr_array(0.5 * (projection + sign * (mirror @ projection)))
    whole = coo_array(projection)
    np.minimum.at(first, whole.col, whole.row)
    columns = csr_array(projection[:, np.flatnonzero(first == np.arange(n))])
    norm = np.sqrt(np.asarray(columns.multiply(columns).sum(axis=0)).ravel())
    kept = np.flatnonzero(norm > 0.25)  # 1/2 to 1 by the number of images; 0 where they cancel
    scaled = csr_array(columns[:, kept])
    scaled.data /= norm[kept][scaled.indices]
    return scaled
