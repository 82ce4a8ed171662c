"""PETSc under MPI: the matrix and its factor spread over processes (MUMPS, Cholesky).

The processes run :mod:`~builder.structure.solid.petsc_worker` and live as long as the factor. Matrix and
loads reach them through files in a folder of their own, so their Python may be another one than ours: Debian's
petsc4py, for one, is built for Debian's numpy.

The peak of memory in the statistics is this process' own; each of the others holds its part of the factor.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import weakref
from pathlib import Path

import numpy as np

from builder.structure.solid.sparse_problem import BackEnd, Factor, SolverError, SparseProblem, importable
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

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
    """Factorise over the processes that STRAINFMU_PETSC_PYTHON and STRAINFMU_PETSC_RANKS request.

    Raises
    ------
    InputError
        The launcher is not there, or the number of processes is no positive whole number.
    SolverError
        The processes fail; the message ends with what they reported.
    """
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
