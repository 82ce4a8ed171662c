"""A structure made of equal sectors round the axis: block-circulant operators, harmonic by harmonic.

With displacements, forces and pressures of sector s in its own frame, every operator of such a structure is block
circulant: f_s = A_0 u_s + A_1 u_(s+1) + A_2 u_(s-1). The discrete Fourier transform over sectors,
u_s = 1/n sum over m of w^(m s) U(m) with w = exp(2 pi i / n), leaves one small operator per harmonic,
A(m) = A_0 + A_1 w^m + A_2 w^-m, and harmonics n - m are the conjugates of m (Davis, Circulant Matrices, section
5.6; Thomas, Int. J. Numer. Meth. Eng. 14, 1979, for vibration of rotors). Sectors need no symmetry of their own.

Gauges at the same position in different sectors have the same row and the same response but for the shift, so
that a row of gauges at four roll angles costs one solution instead of four. The strain of a gauge depends on the
facets around it alone: rolled by whole sectors it is searched for on a window of a few of them.

Solver of structures of equal sectors: one small complex system per harmonic, SuperLU each, in threads.

No factor and no field over the whole structure is kept, so memory grows with one sector and with the result.
SuperLU releases Python's lock, so threads suffice.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, coo_array, csc_array, csr_array, eye_array, kron

from builder.processors import processors
from builder.reporting import Progress
from builder.structure.solid.gauge_rows import Gauges, gauge_rows
from builder.structure.solid.nodal_loads import facet_pressure_load, nodal_force_load, surface_nodes
from builder.structure.solid.sparse_problem import (
    checked_residual,
    factor_symmetric,
    probe_loads,
    refuse_indefinite,
)
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.supports import Support, restrain
from builder.structure.solid.swept_mesh import SweptSector, sector_window
from builder.structure.wall import Material
from strainfmu.arrays import ComplexArray, FloatArray, IntArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class CircularOperator:
    """A block-circulant operator.

    Attributes
    ----------
    n_sectors : number of sectors.
    within, after, before : (n_rows, n_columns) blocks from a sector itself, the next and the one before.
    """

    n_sectors: int
    within: csr_array
    after: csr_array
    before: csr_array

    def harmonic(self, m: int) -> csr_array:
        """Return the operator (n_rows, n_columns) on harmonic ``m``; real where ``m`` is its own conjugate."""
        pointer, index, (within, after, before) = self._aligned
        turn = np.exp(2j * np.pi * m / self.n_sectors)
        if 2 * m % self.n_sectors == 0:
            data = within + round(turn.real) * (after + before)
        else:
            data = within + turn * after + turn.conjugate() * before
        return csr_array((data, index, pointer), shape=self.within.shape)

    def between(self, onto: csr_array, right: csr_array) -> CircularOperator:
        """Return onto @ block @ right of every block."""
        within, after, before = (
            csr_array(onto @ block @ right) for block in (self.within, self.after, self.before)
        )
        return CircularOperator(n_sectors=self.n_sectors, within=within, after=after, before=before)

    @cached_property
    def _aligned(self) -> tuple[NDArray[np.int32], NDArray[np.int32], FloatArray]:
        """Pointer and index of the pattern common to the blocks, and their entries on it (3, n_entries)."""
        n_columns = self.within.shape[1]
        parts = [block.tocoo() for block in (self.within, self.after, self.before)]
        keys = [part.row.astype(np.int64) * n_columns + part.col for part in parts]
        common = np.unique(np.concatenate(keys))
        entry = np.zeros((3, len(common)))
        for values, key, part in zip(entry, keys, parts, strict=True):
            np.add.at(values, np.searchsorted(common, key), part.data)
        pointer = np.searchsorted(common, np.arange(self.within.shape[0] + 1) * n_columns)
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


def pressure_operator(sector: SweptSector, surface_name: str) -> CircularOperator:
    """Return C_map in sector frames [m2]: nodal forces per pressure at a surface's nodes.

    Columns are in the order of :func:`~builder.structure.solid.nodal_loads.surface_nodes`.
    """
    both, node = sector_window(sector), surface_nodes(sector, surface_name)
    load = facet_pressure_load(both.node, both.named_surface(surface_name))
    within, after, before = _blocks(csr_array(_frames(sector, range(2)).T @ load))
    return CircularOperator(
        n_sectors=sector.n_sectors, within=within[:, node], after=after[:, node], before=before[:, node]
    )


def force_operator(sector: SweptSector, surface_name: str) -> CircularOperator:
    """Return nodal forces in sector frames per force at a surface's nodes, column = 3 * node + component [-]."""
    within = nodal_force_load(sector, surface_name)
    none = csr_array(within.shape)
    return CircularOperator(n_sectors=sector.n_sectors, within=within, after=none, before=none)


def _symmetric(sector: SweptSector, both: csr_array) -> CircularOperator:
    """Return the operator of a symmetric matrix over the dofs of two sectors, summed over the first's elements."""
    frame = _frames(sector, range(2))
    within, after, _ = _blocks(csr_array(frame.T @ both @ frame))
    return CircularOperator(n_sectors=sector.n_sectors, within=within, after=after, before=csr_array(after.T))


def _frames(sector: SweptSector, sectors: range) -> csr_array:
    """Return vectors of ``sectors`` along body axes per the same in their frames."""
    turns = [kron(eye_array(sector.n_nodes), sector.rotation(s)) for s in sectors]
    return csr_array(block_diag(turns, format="csr"))


def _blocks(both: csr_array) -> tuple[csr_array, csr_array, csr_array]:
    """Return what a sector gets from itself, the next and the one before, of a matrix over two sectors."""
    n_rows, n_columns = both.shape[0] // 2, both.shape[1] // 2
    of_first, after = both[:n_rows], both[n_rows:]
    within = csr_array(of_first[:, :n_columns] + after[:, n_columns:])
    return within, csr_array(of_first[:, n_columns:]), csr_array(after[:, :n_columns])


def cyclic_problem(
    sector: SweptSector, materials: Mapping[str, Material], supports: Sequence[Support]
) -> CyclicProblem:
    """Assemble the held stiffness of a structure of equal sectors from one of them.

    A support is given by the name of a surface, and every sector has its part of that surface, so supports are
    cyclic as the mesh is. Three held points, or free flight, are not: those need the full mesh.
    """
    both = sector_window(sector)
    restraint = restrain(both, supports)
    stiffness = csr_array(assemble_stiffness(both, materials) + restraint.added)
    of_sector = csc_array(restraint.free[: sector.n_dof])
    free = csr_array(of_sector[:, np.diff(of_sector.indptr) > 0])
    return CyclicProblem(sector, _symmetric(sector, stiffness).between(csr_array(free.T), free), free)


NEIGHBOURS = 2
"""Sectors on either side of a gauge's own that strain recovery takes into account."""

BOUNDARY = 1e-9  # of a sector: a gauge this close before a sector counts to it
DECIMALS = 12  # m: positions are rounded there, so that rolled gauges agree to the last bit


@dataclass(frozen=True, eq=False, kw_only=True)
class SectorRows:
    """Gauge rows B of a structure of equal sectors: distinct ones in sector frames, and where each gauge has one.

    Attributes
    ----------
    sector : the mesh of one sector.
    first : number of the first sector that a pattern reaches, from the gauge's own.
    pattern : (n_patterns, n_w * n_dof) strain per displacement of n_w sectors from the first [1/m].
    pattern_of_row, shift_of_row : (n_d,) row g is pattern ``pattern_of_row[g]`` moved on by that many sectors.
    """

    sector: SweptSector
    first: int
    pattern: csr_array
    pattern_of_row: IntArray
    shift_of_row: IntArray

    @property
    def n_patterns(self) -> int:
        return int(self.pattern.shape[0])

    def harmonic(self, m: int) -> csc_array:
        """Return (n_dof, n_patterns): the transposed patterns on harmonic ``m``, a Fourier sum over sectors."""
        entries, n_dof, n_sectors = self.pattern.tocoo(), self.sector.n_dof, self.sector.n_sectors
        # Whole turns are taken off before the sine is, so that the phase is exact to round-off.
        turns = m * (entries.col // n_dof + self.first) % n_sectors
        data = entries.data * np.exp(-2j * np.pi * turns / n_sectors)
        return csc_array((data, (entries.col % n_dof, entries.row)), shape=(n_dof, self.n_patterns))

    def along_body_axes(self) -> csr_array:
        """Return B (n_d, n_dof of the structure) [1/m] per displacement along body axes."""
        sector, n_dof = self.sector, self.sector.n_dof
        rows = coo_array(self.pattern[self.pattern_of_row])
        moved = (rows.col // n_dof + self.first + self.shift_of_row[rows.row]) % sector.n_sectors
        shape = (len(self.pattern_of_row), sector.n_sectors * n_dof)
        in_frames = coo_array((rows.data, (rows.row, moved * n_dof + rows.col % n_dof)), shape=shape)
        return csr_array(csr_array(in_frames) @ _frames(sector, range(sector.n_sectors)).T)


def rows_in_sectors(sector: SweptSector, rows: csr_array) -> SectorRows:
    """Return gauge rows (n_d, n_dof of the structure) [1/m] along body axes, each as a pattern of its own."""
    n_dof = sector.n_sectors * sector.n_dof
    if not rows.shape[0] or rows.shape[1] != n_dof or not np.isfinite(rows.data).all():
        raise InputError(f"gauge rows {rows.shape}: must be at least one row of {n_dof} finite columns")
    every = np.arange(rows.shape[0])
    in_frames = csr_array(rows @ _frames(sector, range(sector.n_sectors)))
    return SectorRows(
        sector=sector, first=0, pattern=in_frames, pattern_of_row=every, shift_of_row=np.zeros_like(every)
    )


def sector_rows(sector: SweptSector, gauges: Gauges) -> SectorRows:
    """Return the rows of gauges in body axes, as :func:`~builder.structure.solid.gauge_rows.gauge_rows` does.

    A gauge on the line between two sectors is searched for in the latter and takes the mean of both.
    """
    turns = np.arctan2(gauges.position[:, 1], gauges.position[:, 2]) / (2.0 * np.pi) % 1.0
    shift: IntArray = np.floor(turns * sector.n_sectors + BOUNDARY).astype(np.int64) % sector.n_sectors
    frames = np.stack([sector.rotation(s) for s in range(sector.n_sectors)])[shift]
    position, direction = (
        np.round(np.einsum("gi,gij->gj", vectors, frames), DECIMALS) + 0.0  # which makes 0 of -0
        for vectors in (gauges.position, gauges.direction)
    )
    rolled = replace(gauges, position=position, direction=direction)
    numbers: dict[tuple[bytes, str], int] = {}
    places = np.column_stack([position, direction, gauges.length])
    pattern_of_row = np.array(
        [
            numbers.setdefault((place.tobytes(), name), len(numbers))
            for place, name in zip(places, gauges.surface, strict=True)
        ]
    )
    distinct = rolled.some(np.unique(pattern_of_row, return_index=True)[1])
    reach = min(NEIGHBOURS + _sectors_along(sector, gauges), (sector.n_sectors - 1) // 2)
    of_window = gauge_rows(sector_window(sector, reach, reach), distinct)
    return SectorRows(
        sector=sector,
        first=-reach,
        pattern=csr_array(of_window @ _frames(sector, range(-reach, reach + 2))),
        pattern_of_row=pattern_of_row,
        shift_of_row=shift,
    )


def _sectors_along(sector: SweptSector, gauges: Gauges) -> int:
    """Return over how many sectors the longest gauge can reach to one side."""
    radius = np.hypot(gauges.position[:, 1], gauges.position[:, 2])
    arc = 2.0 * np.pi / sector.n_sectors * np.maximum(radius, 1e-300)
    return int(np.ceil(min(float((0.5 * gauges.length / arc).max(initial=0.0)), float(sector.n_sectors))))


BLOCK = 64
"""Right-hand sides of one harmonic solved at once."""


class CyclicSolver:
    """Solver of a structure of equal sectors.

    Parameters
    ----------
    problem : the structure.
    threads : harmonics solved at the same time; by default as many as this process may use processors.

    Attributes
    ----------
    relative_residual, probe_residual : largest ||A x - b|| / ||b|| so far, of solutions and of probes.
    """

    name = "cyclic"
    licence = "BSD-3-Clause (scipy, SuperLU)"

    def __init__(self, problem: CyclicProblem, threads: int | None = None) -> None:
        self.problem = problem
        self.relative_residual = self.probe_residual = 0.0
        self._threads = threads or processors()
        self._lock = threading.Lock()
        self._probe = probe_loads(problem.free)

    def strain_operator(
        self, rows: SectorRows, load: CircularOperator, progress: Progress | None = None
    ) -> FloatArray:
        """Return Z = B A^-1 C by adjoint solves, without a field over the whole structure.

        Rows that are the same but for a shift by sectors are solved for once.

        Parameters
        ----------
        rows : n_d gauge rows B.
        load : C in sector frames, such as :func:`pressure_operator` gives.
        progress : called with (harmonics done, harmonics in all).

        Returns
        -------
        (n_d, n_sectors * n_columns), sector by sector: strain per unit of the load's columns.
        """
        problem = self.problem
        reduced = load.between(csr_array(problem.free.T), csr_array(eye_array(load.within.shape[1])))
        shape = (n_harmonics(problem.n_sectors), load.within.shape[1], rows.n_patterns)
        spectrum = np.empty(shape, dtype=np.complex128)

        def solve_harmonic(m: int) -> None:
            self._adjoint_harmonic(m, rows, reduced, spectrum[m])

        self._over_harmonics(solve_harmonic, progress)
        pattern = np.fft.irfft(spectrum, n=problem.n_sectors, axis=0)
        operator = np.empty((len(rows.pattern_of_row), pattern.shape[0] * pattern.shape[1]))
        for row, (which, shift) in enumerate(zip(rows.pattern_of_row, rows.shift_of_row, strict=True)):
            operator[row] = np.roll(pattern[:, :, which], shift, axis=0).ravel()
        return operator

    def _adjoint_harmonic(self, m: int, rows: SectorRows, load: CircularOperator, out: ComplexArray) -> None:
        onto_columns = csr_array(load.harmonic(m).conj().T)
        right = csc_array(self.problem.free.T @ rows.harmonic(m))
        solve = self._factored(m)
        for first in range(0, rows.n_patterns, BLOCK):
            block = slice(first, first + BLOCK)
            out[:, block] = onto_columns @ solve(right[:, block].toarray())

    def _factored(self, m: int) -> Callable[[ComplexArray], ComplexArray]:
        """Factorise harmonic ``m`` and return its checked solution, (n_free, k) to (n_free, k)."""
        name = f"cyclic, harmonic {m}"
        matrix = self.problem.stiffness.harmonic(m)
        factor = factor_symmetric(matrix)

        def raw(right: ComplexArray) -> ComplexArray:
            if matrix.dtype == np.complex128:
                answer: ComplexArray = factor.solve(np.asarray(right, dtype=np.complex128))
                return answer
            if not np.iscomplexobj(right):
                return np.asarray(factor.solve(right))
            return np.asarray(factor.solve(right.real.copy()) + 1j * factor.solve(right.imag.copy()))

        def checked(right: ComplexArray) -> ComplexArray:
            answer = raw(right)
            residual = checked_residual(name, matrix, answer, right)
            with self._lock:
                self.relative_residual = max(self.relative_residual, residual)
            return answer

        probed = refuse_indefinite(name, matrix, raw, self._probe)
        with self._lock:
            self.probe_residual = max(self.probe_residual, probed)
        return checked

    def _over_harmonics(self, solve: Callable[[int], None], progress: Progress | None = None) -> None:
        n = n_harmonics(self.problem.n_sectors)
        with ThreadPoolExecutor(min(self._threads, n)) as pool:
            for done, _ in enumerate(pool.map(solve, range(n)), start=1):
                if progress is not None:
                    progress(done, n)
