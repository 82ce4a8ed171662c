"""One interface to all solvers, and the choice among them; PARDISO of Intel oneMKL through pypardiso.

SuperLU solves half a million components of a free shape in 7 GiB.

PETSc under MPI: the matrix and its factor spread over processes (MUMPS, Cholesky).

The processes run :mod:`~builder.structure.solid.petsc_worker` and live as long as the factor. Matrix and
loads reach them through files in a folder of their own, so their Python may be another one than ours: Debian's
petsc4py, for one, is built for Debian's numpy.

The peak of memory in the statistics is this process' own; each of the others holds its part of the factor.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import weakref
from pathlib import Path

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix, issparse, triu

from builder.structure.solid.sparse_problem import (
    RESIDUAL_BOUND,
    SUPERLU,
    BackEnd,
    Factor,
    SolverError,
    SparseProblem,
    checked_loads,
    checked_residual,
    importable,
    probe_loads,
    refuse_indefinite,
    relative_residual,
)
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

POSITIVE_DEFINITE = 2  # matrix type of PARDISO: real, symmetric, positive definite
NOT_POSITIVE = -4  # its error: zero or negative pivot


def _pardiso_factor(problem: SparseProblem) -> Factor:
    """Factorise the upper triangle by Cholesky's method."""
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    upper = csr_matrix(triu(problem.matrix, format="csr"))
    solver = PyPardisoSolver(mtype=POSITIVE_DEFINITE)
    try:
        solver.factorize(upper)
    except PyPardisoError as error:
        cause = "the stiffness is not positive definite" if error.value == NOT_POSITIVE else str(error)
        raise SolverError(f"solver pardiso: {cause}") from None

    def solve(load: FloatArray) -> FloatArray:
        answer: FloatArray = solver.solve(upper, np.asfortranarray(load))
        return answer

    # The library keeps its factor outside Python's memory.
    weakref.finalize(solve, solver.free_memory, everything=True)
    return solve


PARDISO = BackEnd(
    name="pardiso",
    licence="BSD-3-Clause over Intel oneMKL, Intel Simplified Software License",
    install="pip install 'strainfmu[pardiso]'",
    installed=lambda: importable("pypardiso"),
    factor=_pardiso_factor,
)


WORKER = Path(__file__).with_name("petsc_worker.py")
MPIEXEC = "mpiexec"
PYTHON_VARIABLE, RANKS_VARIABLE = "STRAINFMU_PETSC_PYTHON", "STRAINFMU_PETSC_RANKS"
LAST_WORDS = 200  # characters of a failed worker's complaint that are passed on


def _ranks() -> int:
    """Return the number of processes that STRAINFMU_PETSC_RANKS requests."""
    ranks = os.environ.get(RANKS_VARIABLE, "1")
    if not ranks.isdecimal() or int(ranks) < 1:
        raise InputError(f"{RANKS_VARIABLE}: '{ranks}' found, must be a number of processes, at least 1")
    return int(ranks)


def _distributed_factor(problem: SparseProblem) -> Factor:
    """Factorise over the processes that STRAINFMU_PETSC_PYTHON and STRAINFMU_PETSC_RANKS request."""
    ranks, python = _ranks(), os.environ.get(PYTHON_VARIABLE, sys.executable)
    if shutil.which(MPIEXEC) is None:
        raise InputError(f"solver petsc: '{MPIEXEC}' not found, install an MPI such as openmpi-bin")
    folder = Path(tempfile.mkdtemp(prefix="strainfmu_petsc_"))
    matrix = problem.matrix
    matrix.sort_indices()
    for name, array in (("pointer", matrix.indptr), ("index", matrix.indices), ("entry", matrix.data)):
        np.save(folder / f"{name}.npy", array)
    command = [MPIEXEC, "-n", str(ranks), python, str(WORKER), str(folder)]
    complaint = (folder / "complaint.txt").open("w")
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaint, text=True)
    complaint.close()
    _answer(process, folder)

    def solve(load: FloatArray) -> FloatArray:
        np.save(folder / "load.npy", load)
        _say(process, "solve")
        _answer(process, folder)
        return np.concatenate([np.load(folder / f"answer_{rank}.npy") for rank in range(ranks)])

    weakref.finalize(solve, _end, process, folder)
    return solve


def _say(process: subprocess.Popen[str], word: str) -> None:
    assert process.stdin is not None
    process.stdin.write(word + "\n")
    process.stdin.flush()


def _answer(process: subprocess.Popen[str], folder: Path) -> None:
    """Wait until the processes are done; if they have ended instead, raise their error."""
    assert process.stdout is not None
    for line in process.stdout:
        if line.strip() == "done":
            return
    process.wait()
    printed = (folder / "complaint.txt").read_text().strip().splitlines()
    errors = [line for line in printed if "error" in line.lower()]
    reason = (errors or printed or ["no message"])[0]
    shutil.rmtree(folder, ignore_errors=True)
    raise SolverError(f"solver petsc: the processes ended: {reason[:LAST_WORDS]}")


def _end(process: subprocess.Popen[str], folder: Path) -> None:
    if process.poll() is None:
        _say(process, "end")
        process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            stream.close()
    shutil.rmtree(folder, ignore_errors=True)


PETSC = BackEnd(
    name="petsc",
    licence="BSD-2-Clause (PETSc, petsc4py) over MUMPS, CeCILL-C",
    install="apt-get install python3-petsc4py python3-mpi4py openmpi-bin, then "
    f"{PYTHON_VARIABLE}=/usr/bin/python3",
    installed=lambda: PYTHON_VARIABLE in os.environ or importable("petsc4py"),
    factor=_distributed_factor,
)


BLOCK = 64
"""Right-hand sides solved at once."""

BACK_ENDS = (SUPERLU, PARDISO, PETSC)
"""The first is chosen where none is named: its licence binds no program that calls it.

Intel's licence is a user's decision; petsc starts other processes.
"""
CYCLIC = "cyclic"


class SparseSolver:
    """A problem prepared by a back end.

    Parameters
    ----------
    problem : the problem.
    back_end : what solves it.

    Attributes
    ----------
    name, licence : what solves, and on what terms.
    relative_residual : largest ||A x - b|| / ||b|| of requested solutions so far.
    probe_residual : the same of probes that move the whole body
        (:func:`~builder.structure.solid.sparse_problem.probe_loads`): rounding error times the condition of the
        matrix, a pessimistic guide to the relative error of Z_p where the body bends as a beam.
    """

    def __init__(self, problem: SparseProblem, back_end: BackEnd) -> None:
        if not back_end.installed():
            raise back_end.missing()
        self.name, self.licence = back_end.name, back_end.licence
        self._problem = problem
        self._factor = back_end.factor(problem)
        self.relative_residual = 0.0
        self.probe_residual = refuse_indefinite(self.name, problem.matrix, self._factor, probe_loads(problem.free))

    def solve(self, right_hand_sides: FloatArray | csr_array) -> FloatArray:
        """Return displacements (n_dof, k) [m] under loads (n_dof, k) [N], both along body axes."""
        loads = checked_loads(right_hand_sides, self._problem.n_dof)
        displacement = np.empty(loads.shape)
        for first in range(0, loads.shape[1], BLOCK):
            block = loads[:, first : first + BLOCK]
            displacement[:, first : first + BLOCK] = self._solve_block(block)
        return displacement

    def _solve_block(self, loads: FloatArray | csc_array) -> FloatArray:
        reduced = self._problem.free.T @ loads
        dense = reduced.toarray() if issparse(reduced) else reduced
        answer = self._factor(dense)
        if relative_residual(self._problem.matrix, answer, dense) > RESIDUAL_BOUND:
            # A step of refinement: smooth pressures move a slender body far, and round-off goes with the motion.
            answer = answer + self._factor(dense - self._problem.matrix @ answer)
        residual = checked_residual(self.name, self._problem.matrix, answer, dense)
        self.relative_residual = max(self.relative_residual, residual)
        displacement: FloatArray = self._problem.free @ answer
        return displacement


def choose_solver(problem: SparseProblem, name: str | None = None) -> SparseSolver:
    """Prepare a problem with the named solver, ``superlu`` by default.

    Raises
    ------
    InputError
        The named one does not exist, is not installed (the message gives what to install and its licence), or
        does not fit the problem.
    SolverError
        The matrix is singular, not positive definite or too large.
    """
    if name == CYCLIC:
        raise InputError(f"solver '{CYCLIC}' needs a mesh of equal sectors, such as one swept round the axis")
    return SparseSolver(problem, SUPERLU if name is None else named_back_end(name))


def named_back_end(name: str) -> BackEnd:
    """Return the back end of that name."""
    for back_end in BACK_ENDS:
        if back_end.name == name:
            return back_end
    known = ", ".join((CYCLIC, *(back_end.name for back_end in BACK_ENDS)))
    raise InputError(f"solver '{name}' found, must be one of {known}")
