"""Strain per nodal force of walls that differ from the expected one: thicker, tapered, uneven round the body.

The factors of the wall as expected serve all of them. With strain rows b, stiffness K and a thickness or taper s,
the adjoint a(s) = b K^-1 follows to second order from

    a_0 = b_0 K_0^-1,  a_1 = (b_1 - a_0 K_1) K_0^-1,  a_2 = (b_2 - a_1 K_1 - a_0 K_2) K_0^-1.

In free flight rigid motions are taken out of every adjoint, with the inertia of the wall as expected: walls that
differ strain a rigid motion no more than that one.

An uneven wall changes it to first order, see :mod:`builder.structure.as_built.wall_harmonics`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import csc_array

from builder.structure.as_built.wall_harmonics import SIDES, WAVES, HarmonicProduct, neighbour_weight, reflected
from builder.structure.fourier.fourier_elasticity import (
    FourierStiffness,
    HarmonicSolver,
    assemble_stiffness,
    factor_harmonic,
    ring_products,
    stiffness_of_elements,
)
from builder.structure.fourier.free_flight import FlyingSolver
from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh, line_edges, line_nodes
from builder.structure.fourier.strain_operator import strain_rows, strain_rows_at
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray, IntArray

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
