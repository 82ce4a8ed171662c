"""Strain per nodal force of walls that differ from the expected one: thicker, tapered, uneven round the body.

The factors of the wall as expected serve all of them. With strain rows b, stiffness K and a thickness or taper s,
the adjoint a(s) = b K^-1 follows to second order from

    a_0 = b_0 K_0^-1,  a_1 = (b_1 - a_0 K_1) K_0^-1,  a_2 = (b_2 - a_1 K_1 - a_0 K_2) K_0^-1.

In free flight rigid motions are taken out of every adjoint, with the inertia of the wall as expected: walls that
differ strain a rigid motion no more than that one.

A wall whose thickness goes as cos(w phi) couples, to first order, each harmonic n with n - w and n + w. With the
stiffness K of the even wall and D its derivative by the amplitude of the harmonic, the strain
b K^-1 f of a load f changes by -b K^-1 D K^-1 f. At every roll angle D is taken as the derivative of the even
wall's stiffness there, times cos(w phi); the slope of the inner surface round the body is left out, thickness over
radius of what is kept. The strain b on the inner surface moves with it, and so does the mass.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
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
from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh, line_edges, line_nodes
from builder.structure.fourier.strain_operator import strain_rows, strain_rows_at
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray, IntArray

WAVES = (1, 2)
"""Harmonics w of the wall that are known."""

SIDES = (-1, 1, 0)
"""Difference of the harmonics of strain and load, over the wall's harmonic; 0 where the surface itself moves."""


@dataclass(frozen=True, eq=False)
class HarmonicProduct:
    """Stiffness between displacements of harmonic n (rows) and m: cc + m cl + n cl' + n m ll.

    Attributes
    ----------
    indices, indptr : pattern of the compressed rows.
    term : (4, n_nonzero) entries of cc, cl, cl' and ll, sums of B' C B over the constant part of B and the one
        that goes with the harmonic [N/m per radian].
    """

    indices: NDArray[np.intp]
    indptr: NDArray[np.intp]
    term: FloatArray

    def times(self, n: int, m: int, motion: FloatArray) -> FloatArray:
        """Return (n_dof, k) forces in harmonic ``n`` of motions (n_dof, k) in harmonic ``m``."""
        n_dof = len(self.indptr) - 1
        data = np.array([1.0, m, n, n * m]) @ self.term
        return np.asarray(csr_array((data, self.indices, self.indptr), shape=(n_dof, n_dof)) @ motion)

    def less(self, subtracted: HarmonicProduct, step: float) -> HarmonicProduct:
        """Return the difference to ``subtracted``, of the same pattern, over ``step``; without entries of zero."""
        term = (self.term - subtracted.term) / step
        nonzero = term.any(axis=0)
        return HarmonicProduct(
            self.indices[nonzero], np.concatenate([[0], np.cumsum(nonzero)])[self.indptr], term[:, nonzero]
        )


def harmonic_product(
    mesh: MeridianMesh, material: Material, like: FourierStiffness, elements: IntArray
) -> HarmonicProduct:
    """Return the stiffness of some ``elements`` (n,) of a wall between displacements of any two harmonics.

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
    term = assembled(by_column, like.places_of(elements), len(like.indices))
    return HarmonicProduct(like.indices, like.indptr, term)


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
    x : (n_s,) stations of the gauges [m].
    n_m : number of harmonics.
    """

    def __init__(
        self, mesh: MeridianMesh, material: Material, stations: FloatArray, gauges: IntArray, n_m: int
    ) -> None:
        """``gauges`` (n_s,) are the gauges' among all ``stations`` (n_all,) [m]."""
        self.mesh, self.x, self.n_m = mesh, stations[gauges], n_m
        self.stiffness = assemble_stiffness(mesh, material)
        self._stations, self._gauges = stations, gauges
        self._solvers: dict[int, Solver] = {}
        self._adjoints: dict[int, FloatArray] = {}
        self._of_gauges: dict[int, FloatArray] = {}

    def at_harmonic(self, n: int) -> tuple[Solver, FloatArray]:
        """Return the factors of harmonic ``n`` and its adjoint (n_all, 3, n_dof), strain per nodal force at all
        stations [1/N].

        Harmonics follow one another. Adjoints of those that an uneven wall couples with ``n`` are solved then, and
        what is behind them is forgotten.
        """
        for m in range(n, min(n + max(WAVES) + 1, self.n_m)):
            if m not in self._solvers:
                self._solvers[m] = (
                    FlyingSolver(self.mesh, self.stiffness, m)
                    if self.mesh.masses is not None and m < 2
                    else factor_harmonic(self.mesh, self.stiffness, m, twist=True)
                )
                self._adjoints[m] = solved(self._solvers[m], strain_rows(self.mesh, self._stations, m))
                self._of_gauges[m] = self._adjoints[m][self._gauges]
        self._solvers.pop(n - 1, None)
        for store in (self._adjoints, self._of_gauges):
            store.pop(n - max(WAVES) - 1, None)
        return self._solvers[n], self._adjoints[n]

    def at_gauges(self, m: int) -> FloatArray:
        """Return the adjoint (n_s, 3, n_dof) of harmonic ``m`` at the gauges; -m is m reflected."""
        adjoint = self._of_gauges[abs(m)]
        return adjoint if m >= 0 else reflected(adjoint)


def solved(solver: Solver, rows: FloatArray) -> FloatArray:
    """Return ``rows`` (.., n_dof) times the inverse stiffness."""
    return solver.solve(rows.reshape(-1, rows.shape[-1]).T).T.reshape(rows.shape)


class ThickerWall:
    """A wall whose thickness changes in one way, by its first two derivatives.

    ``minus`` and ``plus`` are meshes of the wall ``expected`` changed by a small ``step`` to both sides.
    """

    def __init__(
        self, minus: MeridianMesh, plus: MeridianMesh, step: float, expected: ExpectedWall, material: Material
    ) -> None:
        self._expected, self._step, self._n_nodes = expected, step, len(plus.node)
        walls, even, moved = (minus, plus, expected.mesh), expected.stiffness, moved_elements(minus, plus)
        self._points = [inner_surface_points(wall, expected.x) for wall in walls]
        terms = self._by_order(*(stiffness_of_elements(wall, material, even, moved) for wall in walls))
        self._stiffness = [_without_zeros(even, term) for term in terms]

    def adjoints(self, solver: Solver, n: int) -> tuple[FloatArray, FloatArray]:
        """Return the adjoint of harmonic ``n`` per change and per its square, (n_s, 3, n_dof) each."""
        zeroth = self._expected.at_gauges(n)
        minus, plus, even = (strain_rows_at(points, self._n_nodes, n) for points in self._points)
        b_1, b_2 = self._by_order(minus, plus, even)
        k_1, k_2 = (term.matrix(n) for term in self._stiffness)
        first = solved(solver, b_1 - _times(zeroth, k_1))
        second = solved(solver, b_2 - _times(first, k_1) - _times(zeroth, k_2))
        return first, second

    def _by_order(self, minus: FloatArray, plus: FloatArray, even: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the first two coefficients of Taylor's series by central differences."""
        return (plus - minus) / (2.0 * self._step), (plus - 2.0 * even + minus) / (2.0 * self._step**2)


def moved_elements(first: MeridianMesh, second: MeridianMesh) -> IntArray:
    """Return the elements (n,) of which two meshes have a node at different places."""
    moved = (first.node != second.node).any(axis=1)
    return np.flatnonzero(moved[first.element].any(axis=1))


def _without_zeros(pattern: FourierStiffness, term: FloatArray) -> FourierStiffness:
    """Return the stiffness of ``term`` in ``pattern``; most of it is zero, where the wall stays as it is."""
    nonzero = term.any(axis=0)
    indptr = np.concatenate([[0], np.cumsum(nonzero)])[pattern.indptr]
    return FourierStiffness(pattern.indices[nonzero], indptr, term[:, nonzero])


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
    """A wall whose modulus is larger by ``size`` where ``weight`` (n_e,) of its elements is 1: to first order."""

    def __init__(
        self,
        mesh: MeridianMesh,
        material: Material,
        weight: FloatArray,
        even: FourierStiffness,
        size: float = 1.0,
    ) -> None:
        changed = np.flatnonzero(weight)
        term = stiffness_of_elements(mesh, material, even, changed, size * weight[changed])
        self._stiffness = _without_zeros(even, term)

    def adjoint(self, zeroth: FloatArray, solver: Solver, n: int) -> FloatArray:
        """Return the derivative (n_s, 3, n_dof) of the adjoint ``zeroth`` by the change."""
        return solved(solver, -_times(zeroth, self._stiffness.matrix(n)))


class UnevenChange:
    """Walls of a region whose thickness goes as cos(w phi), by their derivative.

    ``plus`` and ``minus`` are meshes of an even wall thicker and thinner by ``step`` in that region, ``x`` (n_s,)
    the stations of the gauges [m].
    """

    def __init__(
        self, plus: MeridianMesh, minus: MeridianMesh, step: float, x: FloatArray, product: HarmonicProduct
    ) -> None:
        self._points, self._n_nodes = [inner_surface_points(mesh, x) for mesh in (plus, minus)], len(plus.node)
        self._step, self._product = step, product

    def rows(self, n: int) -> FloatArray:
        """Return the derivative (n_s, 3, n_dof) of the strain rows: the surface itself moves."""
        plus, minus = (strain_rows_at(points, self._n_nodes, n) for points in self._points)
        return (plus - minus) / (2.0 * self._step)

    def forces(self, adjoint: FloatArray, n: int, m: int) -> FloatArray:
        """Return (n_s, 3, n_dof): what of the ``adjoint`` of harmonic ``m`` the uneven wall turns into ``n``."""
        force = self._product.times(n, m, adjoint.reshape(-1, adjoint.shape[-1]).T).T
        return np.asarray(-neighbour_weight(n) * force.reshape(adjoint.shape))


def uneven_adjoints(
    changes: Sequence[UnevenChange], expected: ExpectedWall, solver: Solver, n: int
) -> Iterator[tuple[tuple[int, int, int], FloatArray]]:
    """Yield changes of the adjoint (n_s, 3, n_dof) by the amplitude of cos(w phi), those that are not zero.

    Each is with the numbers of its harmonic w, its region and its side. The load's harmonic is ``n``.
    """
    n_m, of_surface = expected.n_m, SIDES.index(0)
    sides = [(wave, side) for wave in WAVES for side in (-1, 1)]
    reached = [(w, side) for w, side in sides if (n + w * side >= 0 or n > 0) and abs(n + w * side) < n_m]
    for region, change in enumerate(changes):
        rows = change.rows(n)
        moved = rows.any(axis=-1)  # the surface moves at the stations of a region alone
        rows[moved] = solved(solver, rows[moved])
        for wave in range(len(WAVES)):
            yield (wave, region, of_surface), rows
        harmonics = [n + wave * side for wave, side in reached]
        forces = np.array([change.forces(expected.at_gauges(m), n, m) for m in harmonics])
        for (wave, side), adjoint in zip(reached, solved(solver, forces), strict=True):
            yield (WAVES.index(wave), region, SIDES.index(side)), adjoint
