"""A structure made of equal sectors round the axis: block-circulant operators, harmonic by harmonic.

With displacements, forces and pressures of sector s in its own frame, every operator of such a structure is block
circulant: f_s = A_0 u_s + A_1 u_(s+1) + A_2 u_(s-1). The discrete Fourier transform over sectors,
u_s = 1/n sum over m of w^(m s) U(m) with w = exp(2 pi i / n), leaves one small operator per harmonic,
A(m) = A_0 + A_1 w^m + A_2 w^-m, and harmonics n - m are the conjugates of m (Davis, Circulant Matrices, section
5.6; Thomas, Int. J. Numer. Meth. Eng. 14, 1979, for vibration of rotors). Sectors need no symmetry of their own.

Gauge rows of a structure of equal sectors, taken apart into patterns and shifts by sectors.

Gauges at the same position in different sectors have the same response but for the shift, so that a row of gauges
at four roll angles costs one solution instead of four.

Solver of structures of equal sectors: one small complex system per harmonic, SuperLU each, in threads.

No factor and no field over the whole structure is kept, so memory grows with one sector and with the result.
SuperLU releases Python's lock, so threads suffice.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from builder.processors import processors
from builder.reporting import Progress
from builder.structure.solid.nodal_loads import sector_pressure_load, surface_nodes
from builder.structure.solid.solid_mesh import SolidMesh
from builder.structure.solid.sparse_problem import (
    SolveStatistics,
    checked_loads,
    checked_residual,
    factor_symmetric,
    peak_memory,
    probe_loads,
    refuse_indefinite,
)
from builder.structure.solid.stiffness import sector_blocks, sector_stiffness
from builder.structure.solid.supports import Support, restrain
from builder.structure.solid.swept_mesh import SweptSector, two_sector_mesh
from builder.structure.wall import Material
from strainfmu.arrays import ComplexArray, FloatArray, IntArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class CircularOperator:
    """A block-circulant operator.

    Attributes
    ----------
    n_sectors : number of sectors.
    here, after, before : (n_rows, n_columns) blocks from a sector itself, the next and the one before.
    """

    n_sectors: int
    here: csr_array
    after: csr_array
    before: csr_array

    def harmonic(self, m: int) -> csr_array:
        """Return the operator (n_rows, n_columns) on harmonic ``m``; real where ``m`` is its own conjugate."""
        pointer, index, (here, after, before) = self._aligned
        turn = np.exp(2j * np.pi * m / self.n_sectors)
        if 2 * m % self.n_sectors == 0:
            data = here + round(turn.real) * (after + before)
        else:
            data = here + turn * after + turn.conjugate() * before
        return csr_array((data, index, pointer), shape=self.here.shape)

    @cached_property
    def _aligned(self) -> tuple[NDArray[np.int32], NDArray[np.int32], FloatArray]:
        """Pointer and index of the pattern common to the blocks, and their entries on it (3, n_entries)."""
        n_columns = self.here.shape[1]
        parts = [block.tocoo() for block in (self.here, self.after, self.before)]
        keys = [part.row.astype(np.int64) * n_columns + part.col for part in parts]
        common = np.unique(np.concatenate(keys))
        entry = np.zeros((3, len(common)))
        for values, key, part in zip(entry, keys, parts, strict=True):
            np.add.at(values, np.searchsorted(common, key), part.data)
        pointer = np.searchsorted(common, np.arange(self.here.shape[0] + 1) * n_columns)
        return pointer.astype(np.int32), (common % n_columns).astype(np.int32), entry


@dataclass(frozen=True, eq=False)
class CyclicProblem:
    """A u = f for a held structure of equal sectors.

    Attributes
    ----------
    sector : the mesh of one sector.
    stiffness : free^T A free [N/m] in sector frames, of the free motions of each sector.
    free : (3 n_s, n_free) free motions of one sector in its frame, orthonormal columns [-].
    """

    sector: SweptSector
    stiffness: CircularOperator
    free: csr_array

    @property
    def n_sectors(self) -> int:
        return self.sector.n_sectors

    @property
    def n_dof(self) -> int:
        """Displacement components of the whole structure, held ones included."""
        return self.n_sectors * self.sector.n_dof


def n_harmonics(n_sectors: int) -> int:
    """Return the number of harmonics from 0 that real fields over sectors need."""
    return n_sectors // 2 + 1


def cyclic_problem(
    sector: SweptSector, materials: Mapping[str, Material], supports: Sequence[Support]
) -> CyclicProblem:
    """Assemble the held stiffness of a structure of equal sectors from one of them.

    A support is given by the name of a surface, and every sector has its part of that surface, so supports are
    cyclic as the mesh is. Three held points, or free flight, are not: those need the full mesh.

    Raises
    ------
    InputError
        A support's surface does not exist, supports leave a rigid motion free, or the stiffness has no material.
    """
    own, after = sector_stiffness(sector, materials)
    added_own, added_after = sector_blocks(sector, restrain(two_sector_mesh(sector), supports).added)
    free = _free_motions_of_sector(sector, supports)
    own, after = free.T @ (own + added_own) @ free, free.T @ (after + added_after) @ free
    stiffness = CircularOperator(
        n_sectors=sector.n_sectors, here=csr_array(own), after=csr_array(after), before=csr_array(after.T)
    )
    return CyclicProblem(sector, stiffness, free)


def _free_motions_of_sector(sector: SweptSector, supports: Sequence[Support]) -> csr_array:
    """Return (3 n_s, n_free): what supports leave free at the nodes of a sector, in its frame.

    Nodes between two sectors take the normals of both, so the sector before is there too.
    """
    n = sector.n_nodes
    turns = [sector.rotation(s) for s in (-1, 0, 1)]
    neighbours = SolidMesh(
        element_type=two_sector_mesh(sector).element_type,
        node=np.concatenate([sector.node @ turn.T for turn in turns]),
        element=np.concatenate([sector.element, sector.element + n]),
        region=np.zeros(2 * len(sector.element), dtype=np.int64),
        region_names=("both",),
        surface={name: np.concatenate([facet, facet + n]) for name, facet in sector.surface.items()},
    )
    middle = csc_array(restrain(neighbours, supports).free[sector.n_dof : 2 * sector.n_dof])
    return csr_array(middle[:, np.diff(middle.indptr) > 0])


def to_sector_frames(sector: SweptSector, vector: FloatArray) -> FloatArray:
    """Turn vectors (n_dof, k) of the whole structure from body axes into sector frames, (n_sectors, 3 n_s, k)."""
    turns = np.stack([sector.rotation(s) for s in range(sector.n_sectors)])
    parts = vector.reshape(sector.n_sectors, sector.n_nodes, 3, -1)
    turned = np.einsum("sij,snik->snjk", turns, parts, optimize=True)
    return turned.reshape(sector.n_sectors, sector.n_dof, -1)


def to_body_axes(sector: SweptSector, vector: FloatArray) -> FloatArray:
    """Turn vectors (n_sectors, 3 n_s, k) from sector frames into body axes, (n_dof, k)."""
    turns = np.stack([sector.rotation(s) for s in range(sector.n_sectors)])
    parts = vector.reshape(sector.n_sectors, sector.n_nodes, 3, -1)
    turned = np.einsum("sij,snjk->snik", turns, parts, optimize=True)
    return turned.reshape(sector.n_sectors * sector.n_dof, -1)


SAME_ENTRY = 1e-10
"""Difference of two rows, over their largest entry, below which they count as one pattern."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ShiftedRows:
    """Distinct rows in sector frames, and where each given row is one of them.

    Attributes
    ----------
    n_sectors, n_dof : of the structure, and of one sector.
    pattern, sector, dof : (e,) entries: which pattern, sector and dof of the sector.
    entry : (e,) values [1/m].
    pattern_of_row, shift_of_row : (n_rows,) row g is pattern ``pattern_of_row[g]`` moved on by that many sectors.
    """

    n_sectors: int
    n_dof: int
    pattern: IntArray
    sector: IntArray
    dof: IntArray
    entry: FloatArray
    pattern_of_row: IntArray
    shift_of_row: IntArray

    @property
    def n_patterns(self) -> int:
        return int(self.pattern_of_row.max()) + 1

    def harmonic(self, m: int) -> csc_array:
        """Return (n_dof, n_patterns): the transposed patterns on harmonic ``m``, a Fourier sum over sectors."""
        # Whole turns are taken off before the sine is, so that the phase is exact to round-off.
        phase = np.exp(-2j * np.pi * (m * self.sector % self.n_sectors) / self.n_sectors)
        return csc_array((self.entry * phase, (self.dof, self.pattern)), shape=(self.n_dof, self.n_patterns))


def shifted_rows(sector: SweptSector, rows: csr_array) -> ShiftedRows:
    """Turn rows (n_rows, n_dof of the structure) along body axes into sector frames, and find equal ones."""
    parts = [_row_in_sector_frames(sector, csr_array(rows[[i]])) for i in range(rows.shape[0])]
    kept: list[int] = []
    pattern_of_row = np.empty(len(parts), dtype=np.int64)
    for i, (_, index, entry) in enumerate(parts):
        equal = (n for n, k in enumerate(kept) if _same(parts[k][1], parts[k][2], index, entry))
        pattern_of_row[i] = next(equal, len(kept))
        if pattern_of_row[i] == len(kept):
            kept.append(i)
    index = np.concatenate([parts[k][1] for k in kept])
    return ShiftedRows(
        n_sectors=sector.n_sectors,
        n_dof=sector.n_dof,
        pattern=np.repeat(np.arange(len(kept)), [len(parts[k][1]) for k in kept]),
        sector=index // sector.n_dof,
        dof=index % sector.n_dof,
        entry=np.concatenate([parts[k][2] for k in kept]),
        pattern_of_row=pattern_of_row,
        shift_of_row=np.array([first for first, _, _ in parts], dtype=np.int64),
    )


def _row_in_sector_frames(sector: SweptSector, row: csr_array) -> tuple[int, IntArray, FloatArray]:
    """Return a row's first sector, its indices (sector after the first) * n_dof + dof, sorted, and its entries."""
    node, slot = np.unique(row.indices // 3, return_inverse=True)
    vector = np.zeros((len(node), 3))
    np.add.at(vector, (slot, row.indices % 3), row.data)
    of_node = node // sector.n_nodes
    first = _first_sector(of_node, sector.n_sectors)
    turns = {int(s): sector.rotation(int(s)) for s in np.unique(of_node)}
    turned = np.array([turns[int(s)].T @ v for s, v in zip(of_node, vector, strict=True)]).reshape(-1, 3)
    after_first = (of_node - first) % sector.n_sectors
    start = after_first * sector.n_dof + 3 * (node % sector.n_nodes)
    order = np.argsort(start)
    return first, (start[order][:, None] + np.arange(3)).ravel(), turned[order].ravel()


def _first_sector(sector: IntArray, n_sectors: int) -> int:
    """Return the sector behind the widest gap round the axis."""
    used = np.unique(sector)
    if not len(used):
        return 0
    gap = np.diff(used, prepend=used[-1] - n_sectors)
    return int(used[gap.argmax()])


def _same(index: IntArray, entry: FloatArray, other_index: IntArray, other: FloatArray) -> bool:
    if not np.array_equal(index, other_index):
        return False
    return bool(np.abs(entry - other).max(initial=0.0) <= SAME_ENTRY * np.abs(entry).max(initial=0.0))


BLOCK = 64
"""Right-hand sides of one harmonic solved at once."""

BLOCK_NUMBERS = 2**25
"""Numbers in the block of loads on the whole structure that is transformed at once: 256 MB."""


class CyclicSolver:
    """Solver of a structure of equal sectors.

    Parameters
    ----------
    problem : the structure.
    threads : harmonics solved at the same time; by default as many as this process may use processors.
    """

    name = "cyclic"
    licence = "BSD-3-Clause (scipy, SuperLU)"

    def __init__(self, problem: CyclicProblem, threads: int | None = None) -> None:
        self.problem = problem
        self._threads = threads or processors()
        self._lock = threading.Lock()
        self._probe = probe_loads(problem.free)
        blocks = (problem.stiffness.here, problem.stiffness.after, problem.stiffness.before)
        entries = problem.n_sectors * sum(block.nnz for block in blocks)
        self._statistics = SolveStatistics(
            n_dof=problem.n_dof,
            n_entries=entries,
            factor_seconds=0.0,
            solve_seconds=0.0,
            peak_memory=peak_memory(),
            relative_residual=0.0,
            probe_residual=0.0,
        )

    @property
    def statistics(self) -> SolveStatistics:
        """What has been used so far; seconds are summed over threads."""
        return replace(self._statistics, peak_memory=peak_memory())

    def solve(self, right_hand_sides: FloatArray | csr_array) -> FloatArray:
        """Return displacements (n_dof, k) [m] under loads (n_dof, k) [N], both along body axes.

        Every call factorises again, so give all loads at once.

        Raises
        ------
        SolverError
            The stiffness is singular or not positive definite, or a residual is above the bound.
        InputError
            Loads have a wrong shape or are not finite.
        """
        loads = checked_loads(right_hand_sides, self.problem.n_dof)
        displacement = np.empty(loads.shape)
        width = max(1, BLOCK_NUMBERS // self.problem.n_dof)
        for first in range(0, loads.shape[1], width):
            block = loads[:, first : first + width]
            dense = block if isinstance(block, np.ndarray) else block.toarray()
            displacement[:, first : first + width] = self._solve_block(dense)
        return displacement

    def _solve_block(self, loads: FloatArray) -> FloatArray:
        problem = self.problem
        parts = to_sector_frames(problem.sector, loads)
        spectrum = np.fft.rfft(_on_each_sector(csr_array(problem.free.T), parts), axis=0)

        def one(m: int) -> None:
            spectrum[m] = self._solve_harmonic(m, spectrum[m])

        self._over_harmonics(one)
        parts = np.fft.irfft(spectrum, n=problem.n_sectors, axis=0)
        return to_body_axes(problem.sector, _on_each_sector(problem.free, parts))

    def strain_operator(
        self, rows: csr_array, load: CircularOperator, progress: Progress | None = None
    ) -> FloatArray:
        """Return Z = B A^-1 C by adjoint solves, without a field over the whole structure.

        Rows that are the same but for a shift by sectors are solved for once.

        Parameters
        ----------
        rows : (n_d, n_dof) gauge rows B along body axes [1/m].
        load : C in sector frames, such as :func:`pressure_operator` gives.
        progress : called with (harmonics done, harmonics in all).

        Returns
        -------
        (n_d, n_sectors * n_columns), sector by sector: strain per unit of the load's columns.

        Raises
        ------
        SolverError
            The stiffness is singular or not positive definite, or a residual is above the bound.
        InputError
            There are no rows, or they do not fit the structure or are not finite.
        """
        problem = self.problem
        if not rows.shape[0] or rows.shape[1] != problem.n_dof or not np.isfinite(rows.data).all():
            raise InputError(
                f"gauge rows {rows.shape}: must be at least one row of {problem.n_dof} finite columns"
            )
        shifted = shifted_rows(problem.sector, rows)
        reduced = CircularOperator(
            n_sectors=problem.n_sectors,
            here=csr_array(problem.free.T @ load.here),
            after=csr_array(problem.free.T @ load.after),
            before=csr_array(problem.free.T @ load.before),
        )
        shape = (n_harmonics(problem.n_sectors), load.here.shape[1], shifted.n_patterns)
        spectrum = np.empty(shape, dtype=np.complex128)

        def one(m: int) -> None:
            self._adjoint_harmonic(m, shifted, reduced, spectrum[m])

        self._over_harmonics(one, progress)
        pattern = np.fft.irfft(spectrum, n=problem.n_sectors, axis=0)
        operator = np.empty((len(shifted.pattern_of_row), pattern.shape[0] * pattern.shape[1]))
        for row, (which, shift) in enumerate(zip(shifted.pattern_of_row, shifted.shift_of_row, strict=True)):
            operator[row] = np.roll(pattern[:, :, which], shift, axis=0).ravel()
        return operator

    def _adjoint_harmonic(self, m: int, rows: ShiftedRows, load: CircularOperator, out: ComplexArray) -> None:
        onto_columns = csr_array(load.harmonic(m).conj().T)
        right = csc_array(self.problem.free.T @ rows.harmonic(m))
        solve = self._factored(m)
        for first in range(0, rows.n_patterns, BLOCK):
            block = slice(first, first + BLOCK)
            out[:, block] = onto_columns @ solve(right[:, block].toarray())

    def _solve_harmonic(self, m: int, right: ComplexArray) -> ComplexArray:
        return self._factored(m)(right)

    def _factored(self, m: int) -> Callable[[ComplexArray], ComplexArray]:
        """Factorise harmonic ``m`` and return its checked solution, (n_free, k) to (n_free, k)."""
        name = f"cyclic, harmonic {m}"
        start = time.perf_counter()
        matrix = self.problem.stiffness.harmonic(m)
        factor = factor_symmetric(matrix)

        def raw(right: ComplexArray) -> ComplexArray:
            if matrix.dtype == np.complex128:
                answer: ComplexArray = factor.solve(np.asarray(right, dtype=np.complex128))
                return answer
            if not np.iscomplexobj(right):
                return np.asarray(factor.solve(right))
            return np.asarray(factor.solve(right.real.copy()) + 1j * factor.solve(right.imag.copy()))

        seconds = time.perf_counter() - start
        self._note(factor_seconds=seconds, probe=refuse_indefinite(name, matrix, raw, self._probe))

        def checked(right: ComplexArray) -> ComplexArray:
            begin = time.perf_counter()
            answer = raw(right)
            taken = time.perf_counter() - begin
            self._note(solve_seconds=taken, residual=checked_residual(name, matrix, answer, right))
            return answer

        return checked

    def _note(
        self, factor_seconds: float = 0.0, solve_seconds: float = 0.0, residual: float = 0.0, probe: float = 0.0
    ) -> None:
        with self._lock:
            so_far = self._statistics
            self._statistics = replace(
                so_far,
                factor_seconds=so_far.factor_seconds + factor_seconds,
                solve_seconds=so_far.solve_seconds + solve_seconds,
                relative_residual=max(so_far.relative_residual, residual),
                probe_residual=max(so_far.probe_residual, probe),
            )

    def _over_harmonics(self, one: Callable[[int], None], progress: Progress | None = None) -> None:
        n = n_harmonics(self.problem.n_sectors)
        with ThreadPoolExecutor(min(self._threads, n)) as pool:
            for done, _ in enumerate(pool.map(one, range(n)), start=1):
                if progress is not None:
                    progress(done, n)


def pressure_operator(problem: CyclicProblem, surface_name: str) -> CircularOperator:
    """Return C_map in sector frames [m2]: nodal forces per pressure at a surface's nodes.

    Raises
    ------
    InputError
        The sector has no surface of that name.
    """
    here, after, before = sector_pressure_load(problem.sector, surface_name)
    return CircularOperator(n_sectors=problem.n_sectors, here=here, after=after, before=before)


def force_operator(problem: CyclicProblem, surface_name: str) -> CircularOperator:
    """Return nodal forces in sector frames per force at a surface's nodes, column = 3 * node + component [-].

    Raises
    ------
    InputError
        The sector has no surface of that name.
    """
    node, n_dof = surface_nodes(problem.sector, surface_name), problem.sector.n_dof
    row = (3 * node[:, None] + np.arange(3)).ravel()
    here = csr_array((np.ones(len(row)), (row, np.arange(len(row)))), shape=(n_dof, len(row)))
    none = csr_array(here.shape)
    return CircularOperator(n_sectors=problem.n_sectors, here=here, after=none, before=none)


def _on_each_sector(matrix: csr_array, parts: FloatArray) -> FloatArray:
    """Return matrix @ part for parts (n_sectors, n, k)."""
    n_sectors, n, k = parts.shape
    flat = matrix @ parts.transpose(1, 0, 2).reshape(n, -1)
    return np.ascontiguousarray(flat.reshape(-1, n_sectors, k).transpose(1, 0, 2))
