"""Strain under loads of walls that differ from the expected one: thicker, tapered, uneven round the body.

The factors of the wall as expected serve all of them. With strain rows b, stiffness K and a thickness or taper s,
the adjoint a(s) = b K^-1 follows to second order from

    a_0 = b_0 K_0^-1,  a_1 = (b_1 - a_0 K_1) K_0^-1,  a_2 = (b_2 - a_1 K_1 - a_0 K_2) K_0^-1.

What stands in brackets is zero but at the nodes of the elements that change. So a load f, which moves the expected
wall by u = K_0^-1 f, is solved for once, and each change costs the product of these few columns with u.

In free flight rigid motions are taken out of every adjoint, with the inertia of the wall as expected: walls that
differ strain a rigid motion no more than that one.

A wall whose thickness goes as cos(w phi) couples, to first order, each harmonic n with n - w and n + w. With the
stiffness K of the even wall and D its derivative by the amplitude of the harmonic, the strain
b K^-1 f of a load f changes by -b K^-1 D K^-1 f. At every roll angle D is taken as the derivative of the even
wall's stiffness there, times cos(w phi); the slope of the inner surface round the body is left out, thickness over
radius of what is kept. The strain b on the inner surface moves with it, and so does the mass.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array

from builder.structure.fourier.fourier_elasticity import (
    FourierStiffness,
    HarmonicSolver,
    assemble_stiffness,
    assembled,
    factor_harmonic,
    ring_products,
    some_elements,
    stiffness_of_elements,
    strain_displacement,
    stress_times_weight,
)
from builder.structure.fourier.free_flight import FlyingSolver
from builder.structure.fourier.inner_surface import SurfacePoints, inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh, line_edges, line_nodes
from builder.structure.fourier.strain_operator import strain_of_nodes, strain_rows
from builder.structure.wall import Material
from strainfmu.arrays import BoolArray, FloatArray, IntArray

WAVES = (1, 2)
"""Harmonics w of the wall that are known."""

SIDES = (-1, 1, 0)
"""Difference of the harmonics of strain and load, over the wall's harmonic; 0 where the surface itself moves."""


class ChangedNodes:
    """The nodes that a change of the wall reaches: of elements that move, and next to them those that give strain.

    Attributes
    ----------
    node : (n,) their numbers.
    dof : (3 n,) numbers of their components.
    """

    def __init__(self, n_nodes: int, moved: IntArray, points: Sequence[SurfacePoints] = ()) -> None:
        """``moved`` are nodes of elements that change, ``points`` the gauges' stations on each of the walls."""
        reached = np.zeros(n_nodes, dtype=bool)
        reached[moved] = True
        near: list[BoolArray] = [np.asarray(reached[point.node].any(axis=1)) for point in points]
        for point, of_point in zip(points, near, strict=True):
            reached[point.node[of_point]] = True
        self.node = np.flatnonzero(reached)
        self.dof = (3 * self.node[:, None] + np.arange(3)).ravel()
        self._number = np.full(n_nodes, len(self.node))
        self._number[self.node] = np.arange(len(self.node))
        self._near = near

    def strain_rows(self, points: Sequence[SurfacePoints], harmonic: int) -> list[FloatArray]:
        """Return the strain rows (n_s, 3, 3 n) of each of the ``points`` that this was made with; zero where the
        change does not reach them."""
        rows = []
        for point, near in zip(points, self._near, strict=True):
            of_point = np.zeros((len(near), len(self.node) + 1, 3, 3))
            place = self._number[point.node[near]]
            of_point[np.flatnonzero(near)[:, None], place] = strain_of_nodes(point, harmonic)[near]
            rows.append(of_point[:, :-1].transpose(0, 2, 1, 3).reshape(len(near), 3, -1))
        return rows

    def among(self, pattern: FourierStiffness, term: FloatArray) -> FourierStiffness:
        """Return the stiffness of ``term`` (n_terms, n_nonzero) in ``pattern`` between these nodes alone."""
        nonzero, n_dof = term.any(axis=0), len(pattern.indptr) - 1
        number = np.zeros(n_dof, dtype=np.int64)
        number[self.dof] = np.arange(len(self.dof))
        column = number[np.repeat(np.arange(n_dof), np.diff(pattern.indptr))[nonzero]]
        indptr = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=len(self.dof)))])
        return FourierStiffness(number[pattern.indices[nonzero]], indptr, term[:, nonzero])


def harmonic_product(
    mesh: MeridianMesh, material: Material, like: FourierStiffness, elements: IntArray
) -> FloatArray:
    """Return the stiffness (4, n_nonzero) of some ``elements`` (n,) between displacements of any two harmonics.

    They are the entries of cc, cl, cl' and ll, sums of B' C B over the constant part of B and the one that goes
    with the harmonic [N/m per radian]: between harmonics n (rows) and m, cc + m cl + n cl' + n m ll.
    ``like`` is the stiffness of a mesh of the same elements.
    """
    some = some_elements(mesh, elements)
    constant, linear, weight = strain_displacement(some)
    n_e = len(elements)
    of_constant, of_linear = (
        stress_times_weight(some, material, part, weight).reshape(n_e, -1, 27) for part in (constant, linear)
    )
    constant, linear = (part.reshape(n_e, -1, 27).transpose(0, 2, 1) for part in (constant, linear))
    mixed = constant @ of_linear
    blocks = constant @ of_constant, mixed, mixed.transpose(0, 2, 1), linear @ of_linear
    # The pattern is symmetric; its places are by columns.
    by_column = [block.transpose(0, 2, 1) for block in blocks]
    return assembled(by_column, like.places_of(elements), len(like.indices))


def neighbour_weight(n: int) -> float:
    """Return the part of cos(m phi), m = n +- w not both there if n = 0, in cos(w phi) cos(n phi)."""
    return 1.0 if n == 0 else 0.5


def reflected(adjoint: FloatArray) -> FloatArray:
    """Return strains (n_s, 3, n_dof) per force of harmonic -m from strains of m: what goes round changes sign."""
    mirrored = adjoint.copy()
    mirrored[:, 2] *= -1.0
    mirrored[..., 2::3] *= -1.0
    return mirrored


def times_cosine(force: FloatArray) -> FloatArray:
    """Return the amplitudes (2, n_m, .., 3) of cos(phi) times a field of nodal forces in the same form.

    Families and components are as in :mod:`builder.structure.loads.fourier`. What would go beyond the last
    harmonic is left out.
    """
    out = np.zeros_like(force)
    out[:, 1] = force[:, 0]
    out[:, 2:] = 0.5 * force[:, 1:-1]
    out[:, :-1] += 0.5 * force[:, 1:]
    # At m = 0 sines vanish: no motion round the body in the first family, none else in the second.
    out[0, 0, ..., 2] = 0.0
    out[1, 0, ..., :2] = 0.0
    return out


def times_sine(force: FloatArray) -> FloatArray:
    """Return the amplitudes of sin(phi) times a field: as cos(phi) in a frame rolled by a quarter turn."""
    turned = times_cosine(rolled_quarter(force))
    return rolled_quarter(rolled_quarter(rolled_quarter(turned)))


def times_waves(force: FloatArray) -> list[list[FloatArray]]:
    """Return, for each of :data:`WAVES`, the amplitudes of cos(w phi) and of sin(w phi) times a field."""
    cosine = times_cosine(force)
    return [
        [cosine, times_sine(force)],
        [2.0 * times_cosine(cosine) - force, 2.0 * times_sine(cosine)],
    ]


def rolled_quarter(force: FloatArray, wave: int = 1) -> FloatArray:
    """Return amplitudes (2, n_m, ..) referred to a quarter of the wall's period: phi' = phi - pi / (2 wave)."""
    m = np.arange(force.shape[1]).reshape(-1, *[1] * (force.ndim - 2))
    cosine, sine = quarter_turns(m, wave)
    return np.stack([cosine * force[0] + sine * force[1], cosine * force[1] - sine * force[0]])


def quarter_turns(m: IntArray, wave: int) -> tuple[FloatArray, FloatArray]:
    """Return cosine and sine of harmonics ``m`` over a quarter of the wall's period, 0 and +-1 exactly so."""
    angle: FloatArray = 0.5 * np.pi * np.asarray(m, dtype=np.float64) / wave
    return np.cos(angle).round(15), np.sin(angle).round(15)


CLAMP_LENGTH = 2e-3
"""Length of wall that yields as the clamp does, at which its effect is solved for [m]."""


Solver = HarmonicSolver | FlyingSolver


class ExpectedWall:
    """The wall as expected: adjoints and factors of the few harmonics that are at work.

    Attributes
    ----------
    x : (n_s,) stations [m].
    n_m : number of harmonics.
    """

    def __init__(self, mesh: MeridianMesh, material: Material, x: FloatArray, n_m: int) -> None:
        self.mesh, self.material, self.x, self.n_m = mesh, material, x, n_m
        self._solvers: dict[int, Solver] = {}
        self._adjoints: dict[int, FloatArray] = {}

    @cached_property
    def stiffness(self) -> FourierStiffness:
        return assemble_stiffness(self.mesh, self.material)

    def at_harmonic(self, n: int) -> Solver:
        """Return the factors of harmonic ``n``. Harmonics follow one another: what is so far behind that an uneven
        wall does not couple it with ``n`` is forgotten."""
        self.forget(n - max(WAVES))
        return self._solver(n)

    def forget(self, n: int) -> None:
        """Forget the harmonics below ``n``."""
        self._solvers = {m: solver for m, solver in self._solvers.items() if m >= n}
        self._adjoints = {m: adjoint for m, adjoint in self._adjoints.items() if m >= n}

    def _solver(self, m: int) -> Solver:
        if m not in self._solvers:
            self._solvers[m] = (
                FlyingSolver(self.mesh, self.stiffness, m)
                if self.mesh.masses is not None and m < 2
                else factor_harmonic(self.mesh, self.stiffness, m, twist=True)
            )
        return self._solvers[m]

    def adjoint(self, m: int) -> FloatArray:
        """Return the adjoint (n_s, 3, n_dof) of harmonic ``m``, strain per nodal force at the stations [1/N]; -m
        is m reflected."""
        if abs(m) not in self._adjoints:
            self._adjoints[abs(m)] = solved(self._solver(abs(m)), strain_rows(self.mesh, self.x, abs(m)))
        adjoint = self._adjoints[abs(m)]
        return adjoint if m >= 0 else reflected(adjoint)


def solved(solver: Solver, rows: FloatArray) -> FloatArray:
    """Return ``rows`` (.., n_dof) times the inverse stiffness."""
    return solver.solve(rows.reshape(-1, rows.shape[-1]).T).T.reshape(rows.shape)


def moved_by(solver: Solver, force: FloatArray) -> FloatArray:
    """Return what nodal forces (n_dof, k) move the wall, (n_dof, k): balanced by inertia in free flight."""
    return solver.moved_by(force) if isinstance(solver, FlyingSolver) else solver.solve(force)


class ThickerWall:
    """A wall whose thickness changes in one way, by its first two derivatives.

    ``minus`` and ``plus`` are meshes of the wall ``expected`` changed by a small ``step`` to both sides.

    Attributes
    ----------
    dof : (n,) components of nodes that the change reaches.
    """

    def __init__(self, minus: MeridianMesh, plus: MeridianMesh, step: float, expected: ExpectedWall) -> None:
        self._expected, self._step = expected, step
        self._rows = dict[int, tuple[FloatArray, FloatArray]]()
        walls, even, moved = (minus, plus, expected.mesh), expected.stiffness, moved_elements(minus, plus)
        self._points = [inner_surface_points(wall, expected.x) for wall in walls]
        self._nodes = ChangedNodes(len(plus.node), plus.element[moved], self._points)
        self.dof = self._nodes.dof
        terms = self._by_order(*(stiffness_of_elements(wall, expected.material, even, moved) for wall in walls))
        self._stiffness = [self._nodes.among(even, term) for term in terms]

    def rows(self, n: int) -> tuple[FloatArray, FloatArray]:
        """Return the rows (n_s, 3, n) of :attr:`dof` whose product with a load's motion in harmonic ``n`` is
        strain per change, and per its square; kept for the next time."""
        if n not in self._rows:
            self._rows[n] = self._rows_of(n)
        return self._rows[n]

    def _rows_of(self, n: int) -> tuple[FloatArray, FloatArray]:
        solver, zeroth = self._expected.at_harmonic(n), self._expected.adjoint(n)
        b_1, b_2 = self._by_order(*self._nodes.strain_rows(self._points, n))
        k_1, k_2 = (term.matrix(n) for term in self._stiffness)
        first, whole = b_1 - _times(zeroth[..., self.dof], k_1), np.zeros(zeroth.shape)
        whole[..., self.dof] = first
        first_adjoint = solved(solver, whole)[..., self.dof]
        return first, b_2 - _times(first_adjoint, k_1) - _times(zeroth[..., self.dof], k_2)

    def _by_order(self, minus: FloatArray, plus: FloatArray, even: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the first two coefficients of Taylor's series by central differences."""
        return (plus - minus) / (2.0 * self._step), (plus - 2.0 * even + minus) / (2.0 * self._step**2)


def moved_elements(first: MeridianMesh, second: MeridianMesh) -> IntArray:
    """Return the elements (n,) of which two meshes have a node at different places."""
    moved = (first.node != second.node).any(axis=1)
    return np.flatnonzero(moved[first.element].any(axis=1))


def _times(rows: FloatArray, matrix: csc_array) -> FloatArray:
    """Return rows (.., n_dof) times a symmetric matrix."""
    return np.asarray((matrix @ rows.reshape(-1, rows.shape[-1]).T).T.reshape(rows.shape))


class ElasticClamp:
    """The clamp that holds the aft ring, as a layer of the wall's material that yields along or across the body.

    With traction t on the ring a layer of length l and modulus E moves by t l / E. With M the integral of two
    shape functions over the ring, P what the wall does as its nodes move, K the stiffness, the nodes move by
    (E M / l + P' K P)^-1 P' f under forces f, and the adjoint a = b K^-1 of strain rows b changes by

        da = (b P) (E M / l + P' K P)^-1 P'.

    The change is taken as linear between a rigid clamp and a length of :data:`CLAMP_LENGTH`. A motion of the
    whole ring, as the clamp's rotation, strains nothing: P is a rigid motion then.

    An elastic foundation of stiffness k per area that has such a layer in series is softer by k^2 l / E, to first
    order, and the adjoint changes by a (k^2 / E) M K^-1.
    """

    def __init__(self, mesh: MeridianMesh, material: Material) -> None:
        self._foundation = None if mesh.foundation is None else mesh.foundation[:2]
        edge = line_edges(mesh.clamped_node) if mesh.foundation is None else mesh.foundation[2]
        self._node = mesh.clamped_node if mesh.foundation is None else line_nodes(edge)
        product = np.zeros((len(self._node), len(self._node)))
        for number, block in enumerate(ring_products(mesh, edge)):
            block_dofs = slice(2 * number, 2 * number + 3)
            product[block_dofs, block_dofs] += block
        self._springs = product * material.youngs_modulus / CLAMP_LENGTH
        self._compliance = product / material.youngs_modulus

    def adjoints(self, stiffness: FourierStiffness, solver: Solver, rows: FloatArray, n: int) -> FloatArray:
        """Return (2, n_s, 3, n_dof) change of the adjoint of harmonic ``n`` per length along and across the body;
        ``rows`` (n_s, 3, n_dof) are the strain rows."""
        matrix, change = stiffness.matrix(n), np.zeros((2, *rows.shape))
        for which, components in enumerate(((0,), (1, 2))):
            ring = np.concatenate([3 * self._node + component for component in components])
            if self._foundation is not None:
                softer = self._foundation[which] ** 2 * np.kron(np.eye(len(components)), self._compliance)
                change[which][..., ring] = solved(solver, rows)[..., ring] @ softer
                change[which] = solved(solver, change[which])
                continue
            motion = -solver.solve(matrix[:, ring].toarray())
            motion[ring] += np.eye(len(ring))
            springs = np.kron(np.eye(len(components)), self._springs)
            yields = np.linalg.solve(springs + (matrix @ motion)[ring], motion.T)
            change[which] = (rows @ motion) @ yields / CLAMP_LENGTH
        return change


class StifferRegion:
    """A wall whose modulus is larger by ``size`` where ``weight`` (n_e,) of its elements is 1: to first order.

    ``dof`` (n,) are the components of nodes that the change reaches.
    """

    def __init__(self, expected: ExpectedWall, weight: FloatArray, size: float = 1.0) -> None:
        mesh, even, changed = expected.mesh, expected.stiffness, np.flatnonzero(weight)
        term = stiffness_of_elements(mesh, expected.material, even, changed, size * weight[changed])
        nodes = ChangedNodes(len(mesh.node), mesh.element[changed])
        self._expected, self.dof, self._stiffness = expected, nodes.dof, nodes.among(even, term)

    def rows(self, n: int) -> FloatArray:
        """Return the rows (n_s, 3, n) of :attr:`dof` whose product with a load's motion is strain per change."""
        return -_times(self._expected.adjoint(n)[..., self.dof], self._stiffness.matrix(n))


class UnevenChange:
    """Walls of a region whose thickness goes as cos(w phi), by their derivative.

    ``plus`` and ``minus`` are meshes of an even wall thicker and thinner by ``step`` in that region.

    Attributes
    ----------
    dof : (n,) components of nodes that the change reaches.
    """

    def __init__(self, plus: MeridianMesh, minus: MeridianMesh, step: float, expected: ExpectedWall) -> None:
        walls, even, moved = (plus, minus), expected.stiffness, moved_elements(plus, minus)
        self._expected, self._step = expected, step
        self._points = [inner_surface_points(mesh, expected.x) for mesh in walls]
        self._nodes = ChangedNodes(len(plus.node), plus.element[moved], self._points)
        self.dof = self._nodes.dof
        of_plus, of_minus = (harmonic_product(wall, expected.material, even, moved) for wall in walls)
        self._product = self._nodes.among(even, (of_plus - of_minus) / (2.0 * step))

    def rows(self, n: int) -> Iterator[tuple[int, int, FloatArray]]:
        """Yield rows (n_s, 3, n) of :attr:`dof` whose product with the motion of a load of harmonic ``n`` is
        strain per amplitude of cos(w phi), each with the numbers of w and of its side; those that are not zero."""
        plus, minus = self._nodes.strain_rows(self._points, n)
        moves = (plus - minus) / (2.0 * self._step)  # the surface itself
        for place, wave in enumerate(WAVES):
            yield place, SIDES.index(0), moves
            for side in (-1, 1):
                m = n + wave * side
                if (m >= 0 or n > 0) and abs(m) < self._expected.n_m:
                    adjoint = self._expected.adjoint(m)[..., self.dof].reshape(-1, len(self.dof))
                    force = (self._between(n, m) @ adjoint.T).T.reshape(*moves.shape)
                    yield place, SIDES.index(side), -neighbour_weight(n) * force

    def _between(self, n: int, m: int) -> csr_array:
        """Return the forces in harmonic ``n`` per motion in harmonic ``m``; the product's places are by rows."""
        product, size = self._product, len(self.dof)
        data = np.array([1.0, m, n, n * m]) @ product.term
        return csr_array((data, product.indices, product.indptr), shape=(size, size))
