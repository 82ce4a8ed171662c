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
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builder.structure.solid.sparse_problem import BackEnd, Factor, SolverError, SparseProblem, importable
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

WORKER = Path(__file__).with_name("petsc_worker.py")
PYTHON_VARIABLE, RANKS_VARIABLE = "STRAINFMU_PETSC_PYTHON", "STRAINFMU_PETSC_RANKS"
LAST_WORDS = 200  # characters of a failed worker's complaint that are passed on


@dataclass(frozen=True)
class MpiLaunch:
    """How the processes are started.

    Attributes
    ----------
    ranks : number of processes, at least 1.
    python : interpreter with numpy, mpi4py and petsc4py.
    mpiexec : the MPI launcher and its options.

    Raises
    ------
    InputError
        The number is not positive.
    """

    ranks: int = 1
    python: str = sys.executable
    mpiexec: tuple[str, ...] = ("mpiexec",)

    def __post_init__(self) -> None:
        if self.ranks < 1:
            raise InputError(f"petsc: {self.ranks} processes found, at least 1 is needed")


def launch_of_environment() -> MpiLaunch:
    """Return the launch that STRAINFMU_PETSC_PYTHON and STRAINFMU_PETSC_RANKS request.

    Raises
    ------
    InputError
        The number of ranks is not a whole positive number.
    """
    ranks = os.environ.get(RANKS_VARIABLE, "1")
    if not ranks.isdecimal():
        raise InputError(f"{RANKS_VARIABLE}: '{ranks}' found, must be a number of processes")
    return MpiLaunch(int(ranks), os.environ.get(PYTHON_VARIABLE, sys.executable))


def distributed_factor(problem: SparseProblem, launch: MpiLaunch) -> Factor:
    """Factorise over the processes of a launch.

    Raises
    ------
    InputError
        The launcher is not there, or the interpreter lacks petsc4py.
    SolverError
        The processes fail; the message ends with what they reported.
    """
    if shutil.which(launch.mpiexec[0]) is None:
        raise InputError(f"solver petsc: '{launch.mpiexec[0]}' not found, install an MPI such as openmpi-bin")
    folder = Path(tempfile.mkdtemp(prefix="strainfmu_petsc_"))
    matrix = problem.matrix
    matrix.sort_indices()
    for name, array in (("pointer", matrix.indptr), ("index", matrix.indices), ("entry", matrix.data)):
        np.save(folder / f"{name}.npy", array)
    command = [*launch.mpiexec, "-n", str(launch.ranks), launch.python, str(WORKER), str(folder)]
    complaint = (folder / "complaint.txt").open("w")
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaint, text=True)
    complaint.close()
    _answer(process, folder)

    def solve(load: FloatArray) -> FloatArray:
        np.save(folder / "load.npy", load)
        _say(process, "solve")
        _answer(process, folder)
        return np.concatenate([np.load(folder / f"answer_{rank}.npy") for rank in range(launch.ranks)])

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


def petsc_back_end(launch: MpiLaunch | None = None) -> BackEnd:
    """Return the back end that runs on the processes of a launch, by default the launch of the environment."""
    return BackEnd(
        name="petsc",
        licence="BSD-2-Clause (PETSc, petsc4py) over MUMPS, CeCILL-C",
        install="apt-get install python3-petsc4py python3-mpi4py openmpi-bin, then "
        f"{PYTHON_VARIABLE}=/usr/bin/python3",
        installed=lambda: launch is not None or PYTHON_VARIABLE in os.environ or importable("petsc4py"),
        factor=lambda problem: distributed_factor(problem, launch or launch_of_environment()),
    )
