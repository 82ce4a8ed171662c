"""Elasticity of a body of revolution, harmonic by harmonic in roll angle (semi-analytic finite elements).

Displacements are u_x, u_r ~ cos(m phi) and u_phi ~ sin(m phi); harmonics do not couple. Matrices and
loads leave out the common factor of the integral over roll, 2 pi for m = 0 and pi otherwise
(:func:`roll_integral`). For m = 0, u_phi is a displacement that is constant in roll.

Source: Zienkiewicz and Taylor, The Finite Element Method, vol. 2 (5th ed.), section 9.5.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from builder.structure.fourier.factors import Factors, factored
from builder.structure.fourier.meridian_mesh import MeridianMesh, quadratic_shape
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

# Two points along the wall, three through it. Three along would lock: on elements longer than sqrt(R t) the
# membrane strain of a bent element is quadratic in xi and only vanishes at the two Gauss points. Three
# through the wall leave no motion without strain, which two by two would.
POINTS_ALONG, POINTS_THROUGH = 2, 3


def roll_integral(harmonic: int) -> float:
    """Return the integral of cos(m phi)^2 over roll, which loads and stiffness leave out."""
    return 2.0 * np.pi if harmonic == 0 else np.pi


@dataclass(frozen=True, eq=False)
class FourierStiffness:
    """Stiffness of every harmonic: K_m = K_0 + m K_1 + m^2 K_2, without the roll integral.

    Attributes
    ----------
    indices, indptr : pattern of the compressed columns, common to all harmonics.
    term : (3, n_nonzero) entries of K_0, K_1, K_2 [N/m per radian].
    place : (n_e 27 27,) where the entries of the elements are among the ``n_nonzero``; None where zeros are left
        out.
    """

    indices: NDArray[np.intp]
    indptr: NDArray[np.intp]
    term: FloatArray
    place: NDArray[np.intp] | None = None

    def matrix(self, harmonic: int) -> csc_array:
        """Return K_m, (n_dof, n_dof), symmetric; no motion is held."""
        n_dof = len(self.indptr) - 1
        data = self.term[0] + harmonic * (self.term[1] + harmonic * self.term[2])
        return csc_array((data, self.indices, self.indptr), shape=(n_dof, n_dof))

    def places_of(self, elements: IntArray) -> NDArray[np.intp]:
        """Return the places (n 27 27,) of the entries of some ``elements`` (n,)."""
        assert self.place is not None  # assembled of elements
        return self.place.reshape(-1, 27 * 27)[elements].ravel()


def assemble_stiffness(mesh: MeridianMesh, material: Material) -> FourierStiffness:
    """Assemble the stiffness of all harmonics at once.

    Raises
    ------
    InputError
        An element is turned inside out, which a wall too thick for the meridian's curvature does.
    """
    indices, indptr, place = _pattern(mesh)
    term = assembled(_element_stiffness(mesh, material), place, len(indices))
    stiffness = FourierStiffness(indices, indptr, term, place)
    return stiffness if mesh.foundation is None else _on_foundation(mesh, stiffness)


def stiffness_of_elements(
    mesh: MeridianMesh,
    material: Material,
    like: FourierStiffness,
    elements: IntArray,
    factor: FloatArray | None = None,
) -> FloatArray:
    """Return the terms (3, n_nonzero) [N/m per radian] of some ``elements`` (n,) alone.

    They are in the pattern of ``like``, the stiffness of a mesh of the same elements. ``factor`` (n,) is on the
    modulus of each; 1 where none is given.

    Raises
    ------
    InputError
        As :func:`assemble_stiffness`.
    """
    term = _element_stiffness(some_elements(mesh, elements), material, factor)
    return assembled(term, like.places_of(elements), len(like.indices))


def _element_stiffness(
    mesh: MeridianMesh, material: Material, factor: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return K_0, K_1 and K_2 of each element, (n_e, 27, 27) [N/m per radian]; ``factor`` (n_e,) is on its
    modulus."""
    constant, linear, weight = strain_displacement(mesh)
    weight = weight if factor is None else factor[:, None] * weight
    stress_constant = stress_times_weight(mesh, material, constant, weight)
    stress_linear = stress_times_weight(mesh, material, linear, weight)
    mixed = _virtual_work(constant, stress_linear)
    return (
        _virtual_work(constant, stress_constant),
        mixed + mixed.transpose(0, 2, 1),
        _virtual_work(linear, stress_linear),
    )


def some_elements(mesh: MeridianMesh, elements: IntArray) -> MeridianMesh:
    """Return the mesh of some ``elements`` alone, for their integrals; all nodes stay."""
    material_of = None if mesh.material_of is None else mesh.material_of[elements]
    return replace(mesh, element=mesh.element[elements], material_of=material_of)


def assembled(terms: Sequence[FloatArray], place: NDArray[np.intp], n_nonzero: int) -> FloatArray:
    """Assemble ``terms``, (n_e, 27, 27) each: sum entries that have the same ``place`` (n_e 27 27,).

    Returns
    -------
    (n_terms, n_nonzero) in the unit of the terms.
    """
    return np.array([np.bincount(place, term.ravel(), n_nonzero) for term in terms], dtype=np.float64)


def _pattern(mesh: MeridianMesh) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return pattern and places of the elements' entries, as in :class:`FourierStiffness`."""
    n_e = len(mesh.element)
    dof = (3 * mesh.element[:, :, None] + np.arange(3)).reshape(n_e, 27)
    row = np.broadcast_to(dof[:, :, None], (n_e, 27, 27)).ravel()
    column = np.broadcast_to(dof[:, None, :], (n_e, 27, 27)).ravel()
    key, place = np.unique(column * mesh.n_dof + row, return_inverse=True)
    indptr = np.searchsorted(key, np.arange(mesh.n_dof + 1) * mesh.n_dof)
    return key % mesh.n_dof, indptr, place


def stress_times_weight(
    mesh: MeridianMesh, material: Material, strain: FloatArray, weight: FloatArray
) -> FloatArray:
    """Return stress times weight of strains (n_e, n_q, 6, 27)."""
    if mesh.material_of is None:
        return np.asarray(np.einsum("ij,eqjb,eq->eqib", material.stiffness, strain, weight))
    stiffness = np.stack([material_of_mesh.stiffness for material_of_mesh in (material, *mesh.materials)])[
        mesh.material_of
    ]
    return np.asarray(np.einsum("eij,eqjb,eq->eqib", stiffness, strain, weight))


def _on_foundation(mesh: MeridianMesh, stiffness: FourierStiffness) -> FourierStiffness:
    """Return ``stiffness`` with springs on the aft ring, per area along x and across it, equal in all harmonics.

    The ring's nodes are joined by the elements behind it, so that the pattern stays.
    """
    assert mesh.foundation is not None
    normal, tangential, edge = mesh.foundation
    block = ring_products(mesh, edge)
    term = stiffness.term.copy()
    for component, spring in enumerate((normal, tangential, tangential)):
        row = np.broadcast_to(3 * edge[:, :, None] + component, block.shape).ravel()
        column = np.broadcast_to(3 * edge[:, None, :] + component, block.shape).ravel()
        for i, j, value in zip(row, column, spring * block.ravel(), strict=True):
            first, last = stiffness.indptr[j : j + 2]
            term[0, first + np.searchsorted(stiffness.indices[first:last], i)] += value
    return replace(stiffness, term=term)


def ring_products(mesh: MeridianMesh, edge: IntArray) -> FloatArray:
    """Return the integrals of two shape functions over the area of edges (n, 3), (n, 3, 3) [m2] per radian."""
    xi, weight = np.polynomial.legendre.leggauss(4)
    shape, slope = quadratic_shape(xi)
    r = mesh.node[edge, 1] @ shape.T
    length = np.linalg.norm(np.einsum("qa,eac->eqc", slope, mesh.node[edge]), axis=2)
    return np.asarray(np.einsum("eq,qa,qb->eab", r * length * weight, shape, shape, optimize=True))


def _virtual_work(strain: FloatArray, stress: FloatArray) -> FloatArray:
    """Sum strain^T stress, (n_e, n_q, 6, 27) each, over points and components: (n_e, 27, 27)."""
    n_e = len(strain)
    return strain.reshape(n_e, -1, 27).transpose(0, 2, 1) @ stress.reshape(n_e, -1, 27)


def strain_displacement(mesh: MeridianMesh) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return strain per displacement amplitude, B_m = constant + m linear, and quadrature weights.

    Returns
    -------
    constant, linear : (n_e, n_q, 6, 27) [1/m]; strains [x, r, phi, x-r, x-phi, r-phi], the first four
        ~ cos(m phi), the last two ~ sin(m phi).
    weight : (n_e, n_q) r dA [m^3] per radian.
    """
    shape, by_xi, by_eta, reference_weight = reference_points()
    position = mesh.node[mesh.element]
    tangent_xi = np.einsum("qa,eac->eqc", by_xi, position)
    tangent_eta = np.einsum("qa,eac->eqc", by_eta, position)
    area = tangent_xi[..., 0] * tangent_eta[..., 1] - tangent_xi[..., 1] * tangent_eta[..., 0]
    _refuse_folded(area, position)
    r = np.einsum("qa,ea->eq", shape, position[..., 1])
    d_x = (by_xi * tangent_eta[..., 1:] - by_eta * tangent_xi[..., 1:]) / area[..., None]
    d_r = (by_eta * tangent_xi[..., :1] - by_xi * tangent_eta[..., :1]) / area[..., None]
    over_r = shape / r[..., None]
    constant = np.zeros((*area.shape, 6, 9, 3))
    constant[..., 0, :, 0] = d_x
    constant[..., 1, :, 1] = d_r
    constant[..., 2, :, 1] = over_r
    constant[..., 3, :, 0], constant[..., 3, :, 1] = d_r, d_x
    constant[..., 4, :, 2] = d_x
    constant[..., 5, :, 2] = d_r - over_r
    linear = np.zeros_like(constant)
    linear[..., 2, :, 2] = over_r
    linear[..., 4, :, 0] = -over_r
    linear[..., 5, :, 1] = -over_r
    flat = (*area.shape, 6, 27)
    return constant.reshape(flat), linear.reshape(flat), reference_weight * area * r


def reference_points() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return shape functions and their derivatives by xi and eta, (n_q, 9) each, and weights (n_q,)."""
    xi, along_weight = np.polynomial.legendre.leggauss(POINTS_ALONG)
    eta, through_weight = np.polynomial.legendre.leggauss(POINTS_THROUGH)
    along, d_along = quadratic_shape(xi)
    through, d_through = quadratic_shape(eta)

    def product(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.einsum("pi,qj->pqij", a, b).reshape(len(xi) * len(eta), 9)

    weight = np.outer(along_weight, through_weight).ravel()
    return product(along, through), product(d_along, through), product(along, d_through), weight


def reference_points_of_mass(mesh: MeridianMesh) -> tuple[FloatArray, FloatArray]:
    """Return shape functions (n_q, 9) and r dA [m3] per radian (n_e, n_q) at points for two shape functions."""
    point, point_weight = np.polynomial.legendre.leggauss(3)
    value, slope = quadratic_shape(point)
    shape, by_xi, by_eta = (
        np.einsum("pi,qj->pqij", a, b).reshape(9, 9) for a, b in ((value, value), (slope, value), (value, slope))
    )
    position = mesh.node[mesh.element]
    along = np.einsum("qa,eac->eqc", by_xi, position)
    across = np.einsum("qa,eac->eqc", by_eta, position)
    area = along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0]
    volume = area * np.einsum("qa,ea->eq", shape, position[..., 1]) * np.outer(point_weight, point_weight).ravel()
    return shape, volume


def _refuse_folded(area: FloatArray, position: FloatArray) -> None:
    folded = np.flatnonzero((area <= 0.0).any(axis=1))
    if len(folded):
        raise InputError(
            f"the wall folds over itself at x = {position[folded[0], 4, 0]:.4g} m: "
            "it is too thick for the meridian's curvature or slope break there"
        )


def free_motions(mesh: MeridianMesh, harmonic: int, twist: bool = False) -> csc_array:
    """Return the motions that supports and the axis leave free, (n_dof, n_free), unit entries.

    On the axis displacement and strain are bounded: u_r = u_phi = 0 for m = 0; u_x = 0 and
    u_r + u_phi = 0 (a lateral translation) for m = 1; no displacement for m >= 2. Pressure does not twist,
    so for m = 0 u_phi = 0 everywhere, which also removes the free rotation in roll; unless ``twist``, for loads
    that do.
    """
    free = np.ones((len(mesh.node), 3), dtype=bool)
    axis = mesh.axis_node
    free[axis] = {0: [True, False, False], 1: [False, True, False]}.get(harmonic, [False, False, False])
    if harmonic == 0 and not twist:
        free[:, 2] = False
    free[mesh.guided_node, 0] = False
    free[mesh.clamped_node] = False
    dof = np.flatnonzero(free)
    number = np.full(mesh.n_dof, -1)
    number[dof] = np.arange(len(dof))
    entry = np.ones(len(dof))
    row, column = dof, number[dof]
    if harmonic == 1:
        moving = axis[free[axis, 1]]
        row = np.concatenate([row, 3 * moving + 2])
        column = np.concatenate([column, number[3 * moving + 1]])
        entry = np.concatenate([entry, np.full(len(moving), -1.0)])
    return csc_array((entry, (row, column)), shape=(mesh.n_dof, len(dof)))


@dataclass(frozen=True, eq=False)
class HarmonicSolver:
    """Factored stiffness of one harmonic with its supports.

    Attributes
    ----------
    free : (n_dof, n_free) free motions.
    factor : factors of the stiffness of the free motions.
    """

    free: csc_array
    factor: Factors

    def solve(self, load: FloatArray) -> FloatArray:
        """Return displacement amplitudes [m], (n_dof, k), under nodal forces ``load`` (n_dof, k).

        Forces are in newton per :func:`roll_integral`.
        """
        if self._dof is None:
            return np.asarray(self.free @ self.factor.solve(np.asarray(self.free.T @ load).T).T)
        return self.factor.solve(load.T, self._dof).T

    @cached_property
    def _dof(self) -> IntArray | None:
        return _selected(self.free)


def factor_harmonic(
    mesh: MeridianMesh, stiffness: FourierStiffness, harmonic: int, twist: bool = False
) -> HarmonicSolver:
    """Hold the supports and factor the stiffness of one harmonic; ``twist`` as in :func:`free_motions`.

    Raises
    ------
    InputError
        The supports leave a rigid motion free.
    """
    free = free_motions(mesh, harmonic, twist)
    if mesh.foundation is None:
        _refuse_rigid_motion(mesh, free, harmonic)
    return HarmonicSolver(free, factored(_of_free(stiffness.matrix(harmonic), free)))


def _selected(free: csc_array) -> IntArray | None:
    """Return the dof of each free motion (n_free,) where every one moves one dof by 1; None elsewhere."""
    is_one = free.nnz == free.shape[1] and bool((free.data == 1.0).all())
    return free.indices.astype(np.int64) if is_one else None


def _of_free(matrix: csc_array, free: csc_array) -> csc_array:
    """Return the matrix of the free motions, F^T K F; without products where these are dofs."""
    dof = _selected(free)
    if dof is None:
        return csc_array(free.T @ matrix @ free)
    number = np.full(matrix.shape[0], -1)
    number[dof] = np.arange(len(dof))
    column = np.repeat(number, np.diff(matrix.indptr))
    row = number[matrix.indices]
    is_free = (row >= 0) & (column >= 0)
    count = np.bincount(column[is_free], minlength=len(dof))
    pointer = np.concatenate([[0], np.cumsum(count)])
    reduced = csc_array((matrix.data[is_free], row[is_free], pointer), shape=(len(dof), len(dof)))
    reduced.eliminate_zeros()
    return reduced


def rigid_motions(mesh: MeridianMesh, harmonic: int) -> FloatArray:
    """Return the rigid motions of a harmonic as columns, (n_dof, k), without roll (pressure cannot cause it).

    Axial translation for m = 0; translation along z and rotation about y for m = 1; none above.
    """
    x, r = mesh.node.T
    zero, unit = np.zeros_like(x), np.ones_like(x)
    motion = {0: [[unit, zero, zero]], 1: [[zero, unit, -unit], [-r, x, -x]]}.get(harmonic, [])
    return np.array(motion).reshape(len(motion), 3, len(x)).transpose(2, 1, 0).reshape(mesh.n_dof, -1)


def _refuse_rigid_motion(mesh: MeridianMesh, free: csc_array, harmonic: int) -> None:
    # The factorisation would not notice: rounding makes the vanishing pivot a small number.
    rigid = rigid_motions(mesh, harmonic)
    if harmonic == 0:
        roll = np.zeros((len(mesh.node), 3))
        roll[:, 2] = mesh.node[:, 1]
        rigid = np.column_stack([rigid, roll.ravel()])
    is_held = np.bincount(free.indices, minlength=mesh.n_dof) == 0
    if np.linalg.matrix_rank(rigid[is_held]) < rigid.shape[1]:
        raise InputError(f"the supports leave a rigid motion of harmonic {harmonic} free")
