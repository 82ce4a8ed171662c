"""One process of the distributed solver; run under MPI with the folder of a problem.

It imports only numpy, mpi4py and petsc4py, because its interpreter may lack this project. Each process reads
its own rows. Rank 0 takes one word at a time from standard input, ``solve`` or ``end``, and prints ``done``.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np


def factorise(folder: Path, petsc: Any, communicator: Any) -> Any:
    """Return the factorised matrix and the rows (first, last) of this process."""
    pointer = np.load(folder / "pointer.npy", mmap_mode="r")
    n = len(pointer) - 1
    n_rows, rest = divmod(n, communicator.size)
    first = communicator.rank * n_rows + min(communicator.rank, rest)
    last = first + n_rows + (communicator.rank < rest)
    stored = slice(int(pointer[first]), int(pointer[last]))
    own_pointer = np.asarray(pointer[first : last + 1] - pointer[first], dtype=petsc.IntType)
    index = np.asarray(np.load(folder / "index.npy", mmap_mode="r")[stored], dtype=petsc.IntType)
    entry = np.array(np.load(folder / "entry.npy", mmap_mode="r")[stored])
    size = (last - first, n)
    matrix = petsc.Mat().createAIJ(size=(size, size), csr=(own_pointer, index, entry), comm=communicator)
    matrix.setOption(petsc.Mat.Option.SPD, True)
    solver = petsc.KSP().create(communicator)
    solver.setOperators(matrix)
    solver.setType("preonly")
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("mumps")
    solver.setErrorIfNotConverged(True)
    solver.setUp()
    return solver, first, last


def solve(folder: Path, petsc: Any, solver: Any, first: int, last: int) -> None:
    """Solve for the loads in the folder and leave the rows of this process there."""
    load = np.load(folder / "load.npy", mmap_mode="r")
    n, k = load.shape
    communicator = solver.getComm()
    part = np.asfortranarray(load[first:last])
    right = petsc.Mat().createDense(((last - first, n), (petsc.DECIDE, k)), array=part, comm=communicator)
    answer = petsc.Mat().createDense(((last - first, n), (petsc.DECIDE, k)), comm=communicator)
    answer.setUp()
    right.assemble()
    answer.assemble()
    solver.getPC().getFactorMatrix().matSolve(right, answer)
    np.save(folder / f"answer_{communicator.rank}.npy", np.ascontiguousarray(answer.getDenseArray()))
    right.destroy()
    answer.destroy()


def main(folder: Path) -> None:
    """Serve one problem until the word ``end`` comes."""
    import petsc4py

    petsc4py.init([])
    from mpi4py import MPI
    from petsc4py import PETSc

    world = MPI.COMM_WORLD
    solver, first, last = factorise(folder, PETSc, PETSc.COMM_WORLD)
    while True:
        world.barrier()
        if world.rank == 0:
            print("done", flush=True)
        word = world.bcast(sys.stdin.readline().strip() if world.rank == 0 else None)
        if word != "solve":
            return
        solve(folder, PETSc, solver, first, last)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
