"""Solvers of sparse problems: agreement, residuals, refusals, choice."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import block_diag, csr_array, eye_array
from scipy.sparse.linalg import eigsh
from solid_bodies import METAL, cube, swept_tube

from builder.structure.solid.linear_solvers import (
    BACK_ENDS,
    PETSC,
    PYTHON_VARIABLE,
    RANKS_VARIABLE,
    SparseSolver,
    choose_solver,
    named_back_end,
)
from builder.structure.solid.solid_mesh import SUPPORT
from builder.structure.solid.sparse_problem import (
    RESIDUAL_BOUND,
    SUPERLU,
    BackEnd,
    SolverError,
    SparseProblem,
    checked_residual,
    importable,
    relative_residual,
)
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.strain_solution import held_problem
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import REGION
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

MATERIALS = {REGION: METAL}
SERIAL = [back_end for back_end in BACK_ENDS if back_end.name != "petsc"]


def unheld_problem(matrix: csr_array) -> SparseProblem:
    return SparseProblem(matrix, csr_array(eye_array(matrix.shape[0])))


def held_cube(n: int = 3) -> SparseProblem:
    return held_problem(cube("tetrahedron10", n), MATERIALS, [Clamped("x0")])


def prepared(problem: SparseProblem, back_end: BackEnd) -> SparseSolver:
    if not back_end.installed():
        pytest.skip(f"{back_end.name} is not installed: {back_end.install}")
    return SparseSolver(problem, back_end)


def use_petsc(monkeypatch: pytest.MonkeyPatch) -> None:
    """Open MPI starts as root, and more processes than cores, by these variables alone."""
    python = os.environ.get(PYTHON_VARIABLE, sys.executable)
    found = subprocess.run([python, "-c", "import petsc4py, mpi4py"], capture_output=True, check=False)
    if found.returncode or shutil.which("mpiexec") is None:
        pytest.skip(f"no mpiexec, or no petsc4py and mpi4py in {python}; {PYTHON_VARIABLE} may name another one")
    monkeypatch.setenv(PYTHON_VARIABLE, python)
    for name in ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"):
        monkeypatch.setenv(name, "1")


@pytest.mark.parametrize("back_end", SERIAL, ids=lambda back_end: back_end.name)
def test_agrees_with_the_dense_inverse(back_end: BackEnd) -> None:
    """Dense LAPACK solution: they differ by round-off times a condition number of 1e5."""
    problem = held_cube(4)
    solver = prepared(problem, back_end)
    load = np.random.default_rng(0).normal(size=(problem.n_dof, 3))
    exact = problem.free @ np.linalg.solve(problem.matrix.toarray(), problem.free.T @ load)
    np.testing.assert_allclose(solver.solve(load), exact, rtol=0.0, atol=1e-10 * np.abs(exact).max())
    assert solver.relative_residual < 1e-8


@pytest.mark.parametrize("ranks", [1, 2])
def test_petsc_agrees_with_superlu_on_any_number_of_processes(ranks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same solution from a matrix spread over processes, to round-off; loads in two blocks."""
    problem = held_cube()
    use_petsc(monkeypatch)
    monkeypatch.setenv(RANKS_VARIABLE, str(ranks))
    load = np.random.default_rng(0).normal(size=(problem.n_dof, 66))
    exact = SparseSolver(problem, SUPERLU).solve(load)
    found = SparseSolver(problem, PETSC).solve(load)
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-10 * np.abs(exact).max())


def test_petsc_says_why_its_processes_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    if shutil.which("mpiexec") is None:
        pytest.skip("no mpiexec")
    monkeypatch.setenv(PYTHON_VARIABLE, shutil.which("false") or "false")
    with pytest.raises(SolverError, match="solver petsc: the processes ended"):
        SparseSolver(held_cube(1), PETSC)


@pytest.mark.parametrize("ranks", ["0", "two"])
def test_petsc_refuses_a_wrong_number_of_processes(ranks: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(RANKS_VARIABLE, ranks)
    monkeypatch.setenv(PYTHON_VARIABLE, sys.executable)
    with pytest.raises(InputError, match=f"STRAINFMU_PETSC_RANKS: '{ranks}' found"):
        choose_solver(held_cube(1), "petsc")


@pytest.mark.parametrize("back_end", SERIAL, ids=lambda back_end: back_end.name)
def test_swept_mesh_with_sparse_loads(back_end: BackEnd) -> None:
    """Forces as a sparse matrix give what the same forces give as an array; a solution keeps the support still."""
    mesh = swept_tube()
    problem = held_problem(mesh, MATERIALS, [Clamped(SUPPORT)])
    solver = prepared(problem, back_end)
    load = csr_array((np.array([1.0, -2.0]), ([4, 100], [0, 1])), shape=(mesh.n_dof, 2))
    found = solver.solve(load)
    reference = SparseSolver(problem, SUPERLU).solve(load.toarray())
    np.testing.assert_allclose(found, reference, rtol=0.0, atol=1e-9 * np.abs(reference).max())
    held = np.unique(mesh.surface[SUPPORT])
    assert not found.reshape(-1, 3, 2)[held].any()


@pytest.mark.parametrize("back_end", SERIAL, ids=lambda back_end: back_end.name)
def test_free_body_is_refused(back_end: BackEnd) -> None:
    """Nothing holds the body: six rigid motions cost nothing."""
    stiffness = assemble_stiffness(cube("tetrahedron10", 2), MATERIALS)
    with pytest.raises(SolverError, match=r"singular|positive definite"):
        prepared(unheld_problem(stiffness), back_end)


@pytest.mark.parametrize("back_end", SERIAL, ids=lambda back_end: back_end.name)
def test_indefinite_matrix_is_refused(back_end: BackEnd) -> None:
    """A shift to between the two lowest eigenvalues makes one of them negative; the matrix stays regular."""
    problem = held_cube(2)
    lowest = np.sort(eigsh(problem.matrix, k=3, sigma=0.0, which="LM", return_eigenvectors=False))
    shift = 0.5 * (lowest[0] + lowest[2])
    shifted = csr_array(problem.matrix - shift * eye_array(problem.matrix.shape[0]))
    with pytest.raises(SolverError, match="not positive definite"):
        prepared(SparseProblem(shifted, problem.free, problem.node), back_end)


def test_part_that_is_not_joined_is_refused() -> None:
    """Two cubes, one held: gauge rows on the held one alone would not notice."""
    stiffness = assemble_stiffness(cube("hexahedron20", 1), MATERIALS)
    problem = held_problem(cube("hexahedron20", 1), MATERIALS, [Clamped("x0")])
    both = block_diag([problem.matrix, stiffness])
    with pytest.raises(SolverError, match=r"singular or nearly so|positive definite"):
        SparseSolver(unheld_problem(csr_array(both)), SUPERLU)


def test_residual_sample_leaves_no_column_out() -> None:
    """One wrong column among twenty, of small loads: the sum of all columns shows it."""
    matrix = csr_array(np.diag(np.arange(1.0, 31.0)))
    load = np.random.default_rng(0).normal(size=(30, 20)) * np.geomspace(1.0, 1e-6, 20)
    solution = load / np.arange(1.0, 31.0)[:, None]
    assert relative_residual(matrix, solution, load) < 1e-14
    solution[3, 13] *= 1.01
    assert relative_residual(matrix, solution, load) > 1e-4
    with pytest.raises(SolverError, match=r"solver any: relative residual .*, at most 1e-06 is allowed"):
        checked_residual("any", matrix, solution, load)
    assert RESIDUAL_BOUND == 1e-6
    assert relative_residual(matrix, solution[:, :0], load[:, :0]) == 0.0


def test_not_a_number_is_no_solution() -> None:
    matrix = csr_array(np.eye(3))
    with pytest.raises(SolverError, match="relative residual nan"):
        checked_residual("any", matrix, np.full((3, 1), np.nan), np.ones((3, 1)))


def test_missing_solver_names_what_to_install_and_its_licence() -> None:
    absent = replace(SUPERLU, name="absent", install="pip install absent", installed=lambda: importable("no.such"))
    message = r"^solver 'absent' is not installed: pip install absent \(licence: BSD-3-Clause\)$"
    with pytest.raises(InputError, match=message):
        SparseSolver(held_cube(1), absent)
    for back_end in BACK_ENDS:
        if not back_end.installed():
            with pytest.raises(InputError, match=rf"solver '{back_end.name}' is not installed: .*licence: "):
                choose_solver(held_cube(1), back_end.name)


def test_choice() -> None:
    problem = held_cube(1)
    assert choose_solver(problem).name == "superlu"
    chosen = choose_solver(problem, "superlu")
    assert (chosen.name, chosen.licence) == ("superlu", "BSD-3-Clause")
    with pytest.raises(InputError, match="needs a mesh of equal sectors"):
        choose_solver(problem, "cyclic")
    with pytest.raises(InputError, match="solver 'lu' found, must be one of cyclic, superlu, pardiso"):
        named_back_end("lu")


def test_nothing_permissive_needs_to_be_installed() -> None:
    """The licence of a back end chosen by default binds no program that calls it."""
    assert SUPERLU.installed()
    assert not any(word in SUPERLU.licence for word in ("GPL", "Intel"))


def test_residuals_are_of_the_solutions_so_far() -> None:
    solver = SparseSolver(held_cube(2), SUPERLU)
    assert solver.relative_residual == 0.0
    assert 0.0 < solver.probe_residual < 1e-10
    solver.solve(np.ones((375, 2)))
    assert 0.0 < solver.relative_residual < 1e-10


@pytest.mark.parametrize(
    ("loads", "message"),
    [
        (np.ones((5, 1)), r"loads \(5, 1\) found, must be \(81, any number\)"),
        (np.ones(81), r"loads \(81,\) found"),
        (np.full((81, 1), np.nan), "loads: a value is not finite"),
    ],
)
def test_wrong_loads_are_refused(loads: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SparseSolver(held_cube(1), SUPERLU).solve(loads)


def test_wrong_problems_are_refused() -> None:
    good = csr_array(np.diag([1.0, 2.0]))
    with pytest.raises(InputError, match="not symmetric"):
        unheld_problem(csr_array(np.array([[2.0, 1.0], [0.0, 2.0]])))
    with pytest.raises(InputError, match="not finite"):
        unheld_problem(csr_array(np.diag([1.0, np.inf])))
    with pytest.raises(InputError, match=r"matrix \(2, 2\), free motions \(3, 3\) differ"):
        SparseProblem(good, csr_array(np.eye(3)))
    with pytest.raises(InputError, match="2 nodes found for 2 dofs"):
        SparseProblem(good, csr_array(np.eye(2)), np.zeros((2, 3)))
    with pytest.raises(SolverError, match="diagonal is not positive"):
        SparseSolver(unheld_problem(csr_array(np.diag([1.0, -1.0]))), SUPERLU)
