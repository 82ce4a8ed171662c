"""The strain operator: adjoint against forward solutions, dot products, free flight, progress."""

from functools import cache

import numpy as np
import pytest
from scipy.sparse import csr_array
from solid_bodies import METAL, swept_tube

from builder.structure.solid.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.linear_solvers import SparseSolver, choose_solver
from builder.structure.solid.matter import FreeFlight, Matter, determinate_support, free_flight
from builder.structure.solid.nodal_loads import pressure_load
from builder.structure.solid.solid_mesh import EXTERNAL, SUPPORT, SolidMesh
from builder.structure.solid.strain_solution import displacement, held_problem, strain_operator
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import REGION
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

MATERIALS = {REGION: METAL}
N_GAUGES = 20


@cache
def case() -> tuple[SolidMesh, csr_array, csr_array, SparseSolver]:
    """A clamped tube with 20 gauges: mesh, rows, load and solver."""
    mesh = swept_tube()
    roll = np.linspace(0.0, 6.0, N_GAUGES)
    position = np.column_stack([np.linspace(0.03, 0.17, N_GAUGES), 0.12 * np.sin(roll), 0.12 * np.cos(roll)])
    direction = np.column_stack([np.cos(roll), np.sin(roll) * np.cos(roll), -(np.sin(roll) ** 2)])
    rows = gauge_rows(mesh, gauges_at(position, direction))
    problem = held_problem(mesh, MATERIALS, [Clamped(SUPPORT)])
    return mesh, rows, pressure_load(mesh, EXTERNAL), choose_solver(problem, "superlu")


def pressures(load: csr_array) -> np.ndarray:
    return np.random.default_rng(0).uniform(0.5e5, 2e5, (load.shape[1], 3))


def forward_error(
    z: np.ndarray,
    rows: csr_array,
    solver: SparseSolver,
    load: csr_array,
    pressure: np.ndarray,
    flight: FreeFlight | None = None,
) -> float:
    """Return the largest difference of Z_p p (n_p, k) from B u(p), over the largest strain."""
    field = displacement(solver, load, pressure, flight).reshape(pressure.shape[1], -1)
    strain = rows @ field.T
    return float(np.abs(z @ pressure - strain).max() / np.abs(strain).max())


def test_adjoint_rows_give_the_strain_of_forward_solutions() -> None:
    _, rows, load, solver = case()
    z = strain_operator(rows, solver, load)
    assert z.shape == (N_GAUGES, load.shape[1])
    assert forward_error(z, rows, solver, load, pressures(load)) < 1e-10


def test_forward_error_notices_a_wrong_operator() -> None:
    _, rows, load, solver = case()
    z = 1.01 * strain_operator(rows, solver, load)
    assert forward_error(z, rows, solver, load, pressures(load)) == pytest.approx(0.01, rel=1e-6)


def test_dot_product() -> None:
    """(Z p) . d = p . (Z^T d), the right side by one adjoint solution for the sum of all gauges' rows; 1e-12."""
    _, rows, load, solver = case()
    random = np.random.default_rng(1)
    pressure, data = random.normal(size=load.shape[1]), random.normal(size=N_GAUGES)
    left = (strain_operator(rows, solver, load) @ pressure) @ data
    combined = load.T @ solver.solve((rows.T @ data)[:, None])[:, 0]
    size = np.abs(combined) @ np.abs(pressure)
    assert left == pytest.approx(pressure @ combined, abs=1e-12 * size)


def test_progress_counts_gauges() -> None:
    _, rows, load, solver = case()
    seen: list[tuple[int, int]] = []
    strain_operator(rows, solver, load, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(16, N_GAUGES), (N_GAUGES, N_GAUGES)]


def test_displacement_has_one_vector_per_node() -> None:
    mesh, rows, load, solver = case()
    pressure = pressures(load)
    several = displacement(solver, load, pressure)
    assert several.shape == (3, mesh.n_nodes, 3)
    np.testing.assert_allclose(displacement(solver, load, pressure[:, 1]), several[1], rtol=1e-12, atol=1e-18)
    expected = strain_operator(rows, solver, load) @ pressure[:, 1]
    np.testing.assert_allclose(rows @ several[1].ravel(), expected, atol=1e-10 * np.abs(expected).max())


def test_free_flight_does_not_depend_on_the_nodes_that_hold_it() -> None:
    mesh, rows, load, _ = case()
    flight = free_flight(mesh, Matter(material=METAL, density=4430.0))
    operators = []
    for support in (None, determinate_support(mesh, np.array([3, 200, mesh.n_nodes - 1]))):
        solver = choose_solver(held_problem(mesh, MATERIALS, support), "superlu")
        z = strain_operator(rows, solver, load, flight)
        assert forward_error(z, rows, solver, load, pressures(load), flight) < 1e-8
        operators.append(z)
    assert np.abs(operators[1] - operators[0]).max() < 1e-8 * np.abs(operators[0]).max()


def test_deformed_shape_in_flight_has_no_rigid_motion() -> None:
    mesh, _, load, _ = case()
    flight = free_flight(mesh, Matter(material=METAL, density=4430.0))
    solver = choose_solver(held_problem(mesh, MATERIALS, None), "superlu")
    field = displacement(solver, load, pressures(load)[:, 0], flight).ravel()
    left = np.abs(flight.inertia_force.T @ field) / np.diag(flight.inertia)
    assert left.max() < 1e-10 * np.abs(field).max() / 0.1


def test_rows_of_another_mesh_are_refused() -> None:
    _, rows, load, solver = case()
    with pytest.raises(
        InputError, match=f"gauge rows are of {rows.shape[1] - 3} dofs, the load of {load.shape[0]}"
    ):
        strain_operator(rows[:, :-3], solver, load)
