"""The cyclic solver against the full mesh: Z_p, displacements, supports, shapes of sectors, refusals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array
from solid_bodies import GUIDED, METAL, sector_stiffness, tube

from builder.reports.growth import growth_rows, growth_table, sector_of_size
from builder.structure.gauge_placement import gauge_mesh
from builder.structure.solid.cyclic import (
    CyclicProblem,
    CyclicSolver,
    cyclic_problem,
    pressure_operator,
    rows_in_sectors,
    sector_rows,
)
from builder.structure.solid.elements import element_faces
from builder.structure.solid.gauge_layouts import solid_gauges
from builder.structure.solid.gauge_rows import Gauges, gauge_rows, gauges_at
from builder.structure.solid.linear_solvers import choose_solver
from builder.structure.solid.nodal_loads import pressure_load
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT
from builder.structure.solid.sparse_problem import SolverError
from builder.structure.solid.strain_solution import held_problem, strain_operator
from builder.structure.solid.supports import Clamped, Foundation, Support
from builder.structure.solid.swept_mesh import REGION, SweptSector, full_mesh
from builder.structure.wall import wall_of
from builder.vehicle.file import IC3X, load_vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError

MATERIALS = {REGION: METAL}
CLAMPED = [Clamped(SUPPORT)]
RADIUS = 0.12
FACES = element_faces("hexahedron20")


def gauges_round(angles: Sequence[float], x: float = 0.06, length: float = 0.0) -> Gauges:
    """An axial and a hoop gauge at each roll angle [deg] on the inner surface of a tube."""
    phi = np.deg2rad(angles)
    position = np.column_stack([np.full(len(phi), x), RADIUS * np.sin(phi), RADIUS * np.cos(phi)])
    hoop = np.column_stack([np.zeros(len(phi)), np.cos(phi), -np.sin(phi)])
    direction = np.concatenate([np.tile([1.0, 0.0, 0.0], (len(phi), 1)), hoop])
    return gauges_at(np.tile(position, (2, 1)), direction, length=length)


def full_strain_operator(
    sector: SweptSector, rows: csr_array, supports: Sequence[Support], dense: bool = False
) -> FloatArray:
    mesh = full_mesh(sector)
    problem = held_problem(mesh, MATERIALS, supports)
    load = pressure_load(mesh, EXTERNAL)
    if dense:
        answer = problem.free @ np.linalg.solve(problem.matrix.toarray(), problem.free.T @ rows.T.toarray())
        return np.asarray((load.T @ answer).T)
    return strain_operator(rows, choose_solver(problem, "superlu"), load)


def cyclic_strain_operator(sector: SweptSector, rows: csr_array, supports: Sequence[Support]) -> FloatArray:
    problem = cyclic_problem(sector, MATERIALS, supports)
    load = pressure_operator(sector, EXTERNAL)
    return CyclicSolver(problem).strain_operator(rows_in_sectors(sector, rows), load)


def largest_difference(found: FloatArray, reference: FloatArray) -> float:
    return float(np.abs(found - reference).max() / np.abs(reference).max())


@pytest.mark.parametrize("n_sectors", [6, 7])
def test_tiny_mesh_agrees_with_the_dense_inverse(n_sectors: int) -> None:
    """LAPACK on all sectors at once, an even and an odd number; round-off times a condition number of 1e5."""
    sector = tube(0.1, RADIUS, 0.13, 0.05, n_sectors)
    rows = gauge_rows(full_mesh(sector), gauges_round([10.0, 100.0]))
    exact = full_strain_operator(sector, rows, CLAMPED, dense=True)
    assert largest_difference(cyclic_strain_operator(sector, rows, CLAMPED), exact) < 1e-10


@pytest.mark.parametrize(
    "supports",
    [
        CLAMPED,
        [Clamped(SUPPORT), Foundation(GUIDED, 1e9)],
        [Foundation(INTERNAL, 1e9, 2e8)],
        [Foundation(INTERNAL, 1e9), Foundation(GUIDED, 1e9), Foundation(SUPPORT, 0.0, 1e8)],
    ],
    ids=["clamped", "clamped and guided", "foundation", "three surfaces"],
)
def test_agrees_with_superlu_on_the_full_mesh(supports: Sequence[Support]) -> None:
    """Two independent solutions of one discrete problem."""
    sector = tube(0.3, RADIUS, 0.13, 0.05, 16, front="guided", aft="clamped")
    rows = gauge_rows(full_mesh(sector), gauges_round([5.0, 95.0, 140.0]))
    reference = full_strain_operator(sector, rows, supports)
    assert largest_difference(cyclic_strain_operator(sector, rows, supports), reference) < 1e-8


@pytest.mark.slow
def test_vehicle_agrees_with_superlu_on_the_full_mesh() -> None:
    """The shipped vehicle, all gauges of its layout, about 20,000 dofs."""
    vehicle = load_vehicle(IC3X)
    sector = sector_of_size(vehicle, 20_000)
    materials = {REGION: wall_of(vehicle).material}
    rows = sector_rows(sector, solid_gauges(vehicle, vehicle.gauges.layout, gauge_mesh(vehicle)))
    problem = cyclic_problem(sector, materials, CLAMPED)
    solver = CyclicSolver(problem)
    found = solver.strain_operator(rows, pressure_operator(sector, EXTERNAL))
    mesh = full_mesh(sector)
    direct = choose_solver(held_problem(mesh, materials, CLAMPED), "superlu")
    on_mesh = strain_operator(rows.along_body_axes(), direct, pressure_load(mesh, EXTERNAL))
    assert largest_difference(found, on_mesh) < 1e-8
    assert solver.relative_residual < 1e-8


def joined(sector: SweptSector, k: int) -> SweptSector:
    """Return ``k`` neighbouring sectors as one sector."""
    turns = [sector.rotation(s) for s in range(k)]
    first = sector.n_nodes * np.arange(k)[:, None, None]

    def repeated(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.asarray((numbers + first).reshape(-1, numbers.shape[1]))

    node = np.concatenate([sector.node @ turn.T for turn in turns])
    surface = {name: repeated(facet) for name, facet in sector.surface.items()}
    return SweptSector(
        n_sectors=sector.n_sectors // k, node=node, element=repeated(sector.element), surface=surface
    )


def with_windows(sector: SweptSector, cut: Sequence[int]) -> SweptSector:
    """Return a sector without some elements, its unused nodes and the facets on them taken away."""
    element = np.delete(sector.element, cut, axis=0)
    n = sector.n_nodes
    kept = np.unique(element % n)
    number = np.full(2 * n, -1)
    number[kept], number[n + kept] = np.arange(len(kept)), len(kept) + np.arange(len(kept))
    corners = {tuple(sorted(face)) for one in element for face in (one[i].tolist() for i in FACES)}
    surface = {
        name: number[[facet for facet in facets.tolist() if tuple(sorted(facet)) in corners]]
        for name, facets in sector.surface.items()
    }
    return SweptSector(
        n_sectors=sector.n_sectors, node=sector.node[kept], element=number[element], surface=surface
    )


def test_four_equal_windows_in_a_tube() -> None:
    """A body that is not of revolution: in sectors of five elements round the axis two are cut out."""
    sector = joined(tube(0.3, RADIUS, 0.13, 0.05, 20), 5)
    per_sector = len(sector.element) // 5
    windowed = with_windows(sector, [2 * per_sector + 2, 2 * per_sector + 3])
    assert len(full_mesh(windowed).element) == 4 * (5 * per_sector - 2)
    rows = gauge_rows(full_mesh(windowed), gauges_round([20.0, 110.0, 200.0], x=0.07))
    reference = full_strain_operator(windowed, rows, CLAMPED)
    assert largest_difference(cyclic_strain_operator(windowed, rows, CLAMPED), reference) < 1e-8


def test_threads_do_not_change_the_result() -> None:
    sector = tube(0.2, RADIUS, 0.13, 0.05, 12)
    problem = cyclic_problem(sector, MATERIALS, CLAMPED)
    rows = sector_rows(sector, gauges_round([5.0]))
    load = pressure_operator(sector, EXTERNAL)
    one, two = (CyclicSolver(problem, threads).strain_operator(rows, load) for threads in (1, 2))
    np.testing.assert_array_equal(one, two)


def test_progress_counts_harmonics() -> None:
    sector = tube(0.1, RADIUS, 0.13, 0.05, 7)
    problem = cyclic_problem(sector, MATERIALS, CLAMPED)
    rows = sector_rows(sector, gauges_round([5.0]))
    seen: list[tuple[int, int]] = []
    CyclicSolver(problem).strain_operator(
        rows, pressure_operator(sector, EXTERNAL), lambda done, n: seen.append((done, n))
    )
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_gauges_a_quarter_turn_apart_are_one_pattern() -> None:
    """Four roll angles, two directions: two distinct rows."""
    rows = sector_rows(tube(0.2, RADIUS, 0.13, 0.05, 16), gauges_round([0.0, 90.0, 180.0, 270.0]))
    assert rows.n_patterns == 2
    assert rows.shift_of_row.tolist() == [0, 4, 8, 12] * 2


@pytest.mark.parametrize("length", [0.0, 0.03])
def test_gauge_rows_of_a_window_are_those_of_the_full_mesh(length: float) -> None:
    """Inside sectors, hoop gauges as long as one too; places are rounded to 1e-12 m over elements of 1e-2 m."""
    sector = tube(0.2, RADIUS, 0.13, 0.05, 24)
    gauges = gauges_round([0.0, 6.0, 97.0, 105.0, 261.5, 355.0], length=length)
    whole, window = gauge_rows(full_mesh(sector), gauges), sector_rows(sector, gauges).along_body_axes()
    assert np.abs((whole - window).data).max() < 1e-9 * np.abs(whole.data).max()


def test_gauge_off_the_surface_is_refused() -> None:
    gauges = gauges_round([6.0])
    with pytest.raises(InputError, match="off surface 'internal'"):
        sector_rows(tube(0.2, RADIUS, 0.13, 0.05, 24), replace(gauges, position=0.99 * gauges.position))


def test_unsupported_structure_is_refused() -> None:
    sector = tube(0.2, RADIUS, 0.13, 0.05, 12)
    with pytest.raises(InputError, match="a rigid motion is left free"):
        cyclic_problem(sector, MATERIALS, [])
    with pytest.raises(InputError, match="no surface 'base'"):
        cyclic_problem(sector, MATERIALS, [Clamped("base")])


def free_problem(shift: float = 0.0) -> CyclicProblem:
    """A tube whose clamp is taken away after the fact, its stiffness shifted by ``shift`` times the diagonal."""
    sector = tube(0.2, RADIUS, 0.13, 0.05, 12)
    stiffness = sector_stiffness(sector, MATERIALS)
    unit = eye_array(sector.n_dof, format="csr")
    here = csr_array(stiffness.within + shift * stiffness.within.diagonal().max() * unit)
    return CyclicProblem(sector, replace(stiffness, within=here), unit)


@pytest.mark.parametrize("shift", [0.0, -1e-6, -1e-2])
def test_free_and_indefinite_structures_are_refused(shift: float) -> None:
    problem = free_problem(shift)
    rows = sector_rows(problem.sector, gauges_round([5.0]))
    with pytest.raises(SolverError, match=r"cyclic, harmonic \d+"):
        CyclicSolver(problem).strain_operator(rows, pressure_operator(problem.sector, EXTERNAL))


def test_wrong_rows_are_refused() -> None:
    sector = tube(0.1, RADIUS, 0.13, 0.05, 6)
    rows = gauge_rows(full_mesh(sector), gauges_round([5.0]))
    for wrong in (rows[:, :-3], rows * np.nan, rows[:0]):
        with pytest.raises(InputError, match="finite columns"):
            rows_in_sectors(sector, wrong)


@pytest.mark.slow
def test_growth_is_measured_case_by_case() -> None:
    """Two solvers of one small size, each in a process of its own; a process' failure is passed on."""
    rows = list(growth_rows(IC3X, ["cyclic", "superlu"], [8_000]))
    assert [row.solver for row in rows] == ["cyclic", "superlu"]
    assert rows[0].n_dof == rows[1].n_dof >= 8_000
    assert rows[0].n_gauges == 54
    assert max(row.relative_residual for row in rows) < 1e-8
    assert len(growth_table(rows).splitlines()) == 3
    assert not list(growth_rows(IC3X, ["superlu"], [600_000]))
    with pytest.raises(StrainfmuError, match="growth, cyclic at 0 dofs: size 0 must be at least 1"):
        list(growth_rows(IC3X, ["cyclic"], [0]))
