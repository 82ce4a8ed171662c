"""Solver of structures of equal sectors: one small complex system per harmonic, SuperLU each, in threads.

No factor and no field over the whole structure is kept, so memory grows with one sector and with the result.
SuperLU releases Python's lock, so threads suffice.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from scipy.sparse import csc_array, csr_array

from builder.processors import processors
from builder.reporting import Progress
from builder.structure.solid.operators.cyclic_operator import (
    CircularOperator,
    CyclicProblem,
    n_harmonics,
    to_body_axes,
    to_sector_frames,
)
from builder.structure.solid.operators.surface_load import sector_pressure_load, surface_nodes
from builder.structure.solid.solvers.problem import (
    SolveStatistics,
    checked_loads,
    checked_residual,
    peak_memory,
    probe_loads,
    refuse_indefinite,
)
from builder.structure.solid.solvers.shifted_rows import ShiftedRows, shifted_rows
from builder.structure.solid.solvers.superlu import factor_symmetric
from strainfmu.arrays import ComplexArray, FloatArray
from strainfmu.errors import InputError

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
