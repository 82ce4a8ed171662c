"""The same mesh and load through CalculiX: displacement, gauge strain, and what a full Z_p would cost there."""

import time
from dataclasses import dataclass
from pathlib import Path

import calculix_deck as calculix
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_array

from builder.structure.solid.checks import ring_mesh
from builder.structure.solid.elements import FACE_CORNERS, Quadrature
from builder.structure.solid.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.linear_solvers import SparseSolver, choose_solver
from builder.structure.solid.nodal_loads import pressure_load, surface_points
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT, SolidMesh
from builder.structure.solid.sparse_problem import SparseProblem
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.strain_solution import strain_operator
from builder.structure.solid.supports import Clamped, restrain
from builder.structure.solid.swept_mesh import full_mesh, swept_wall
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import chain_segments
from strainfmu.arrays import FloatArray

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not calculix.installed(), reason="needs CalculiX: apt-get install calculix-ccx"),
]

METAL = Material(110e9, 0.31)
LENGTH, INSIDE, OUTSIDE = 1.2, 0.138, 0.15
STATIONS, ROLLS = np.linspace(0.2, 1.0, 9), np.deg2rad([0.0, 90.0, 225.0])


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """A clamped mesh, prepared: its solver, its load C_map, its gauges and the nodes they sit on."""

    mesh: SolidMesh
    solver: SparseSolver
    load: csr_array
    rows: csr_array
    gauge_node: NDArray[np.int64]
    direction: FloatArray
    seconds: float


def gauges_on_nodes(mesh: SolidMesh) -> tuple[NDArray[np.int64], FloatArray]:
    """Return nodes of the inner face near stations and rolls, each twice, and axial and hoop units."""
    length = np.ptp(mesh.node[:, 0]) / LENGTH
    corner = np.unique(mesh.surface[INTERNAL][:, : FACE_CORNERS[mesh.element_type]])
    x, y, z = mesh.node[corner].T
    sine, cosine = y / np.hypot(y, z), z / np.hypot(y, z)
    nodes, directions = [], []
    for station in length * STATIONS:
        for roll in ROLLS:
            found = np.argmin(np.abs(x - station) + np.abs(sine - np.sin(roll)) + np.abs(cosine - np.cos(roll)))
            nodes += [corner[found]] * 2
            directions += [[1.0, 0.0, 0.0], [0.0, cosine[found], -sine[found]]]
    return np.array(nodes), np.array(directions)


def prepare(mesh: SolidMesh, quadrature: Quadrature = "full") -> Case:
    """Assemble, by default with CalculiX's quadrature (3 x 3 x 3 points, 4 points), and solve for all of Z_p."""
    node, direction = gauges_on_nodes(mesh)
    start = time.perf_counter()
    rows = gauge_rows(mesh, gauges_at(mesh.node[node], direction))
    restraint = restrain(mesh, [Clamped(SUPPORT)])
    stiffness = assemble_stiffness(mesh, {"wall": METAL}, quadrature)
    solver = choose_solver(SparseProblem(restraint.held_stiffness(stiffness), restraint.free, mesh.node))
    assert isinstance(solver, SparseSolver)
    load = pressure_load(mesh, EXTERNAL)
    strain_operator(rows, solver, load)
    return Case(
        mesh=mesh,
        solver=solver,
        load=load,
        rows=rows,
        gauge_node=node,
        direction=direction,
        seconds=time.perf_counter() - start,
    )


@pytest.fixture(scope="module")
def vehicle() -> Case:
    """The shipped vehicle, swept with hexahedra of 30 mm."""
    five, one = np.deg2rad([5.0, 1.0])
    body = chain_segments([(1.75, five, five), (3.6, one, one)])
    return prepare(full_mesh(swept_wall(body, Wall(0.004, 0.10, METAL), "coarse")))


@pytest.fixture(scope="module", params=["hexahedron20", "tetrahedron10"])
def tube(request: pytest.FixtureRequest) -> Case:
    """A tube clamped at one end."""
    counts = (40, 64, 1) if request.param == "hexahedron20" else (30, 48, 1)
    return prepare(ring_mesh(request.param, INSIDE, OUTSIDE, LENGTH, counts))


def wind(mesh: SolidMesh) -> FloatArray:
    """Return (n_p,) pressure [Pa] that varies along the body and as harmonics 0, 1 and 2 round it."""
    point = surface_points(mesh, EXTERNAL)
    roll = np.arctan2(point[:, 1], point[:, 2])
    return 1e5 * (1.0 + 0.3 * point[:, 0]) * (1.0 + 0.5 * np.cos(roll) + 0.4 * np.cos(2.0 * roll))


def clamped_nodes(mesh: SolidMesh) -> NDArray[np.int64]:
    return np.unique(mesh.surface[SUPPORT])


def distance(found: FloatArray, expected: FloatArray) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def test_whole_vehicle(vehicle: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Displacement to 1e-6 (CalculiX prints seven digits), and the cost of Z_p: there, one load case per gauge."""
    mesh, n_gauges = vehicle.mesh, vehicle.rows.shape[0]
    force = (vehicle.load @ wind(mesh)).reshape(-1, 3)
    seconds = calculix.run(tmp_path, calculix.deck(mesh, METAL, clamped_nodes(mesh), force, None))
    displacement = vehicle.solver.solve(force.reshape(-1, 1)).reshape(-1, 3)
    with capsys.disabled():
        print(
            f"\n{mesh.element_type}, {mesh.n_dof} dofs, {n_gauges} gauges: Z_p {vehicle.seconds:.1f} s here "
            f"({vehicle.solver.name}); {n_gauges} loads of {seconds:.1f} s in CalculiX: "
            f"{n_gauges * seconds / vehicle.seconds:.0f} times as long"
        )
    assert distance(displacement, calculix.printed_displacement(tmp_path, mesh.n_nodes)) < 1e-6


def test_displacement(tube: Case, tmp_path: Path) -> None:
    """Nodal forces of ours: 1e-6."""
    mesh = tube.mesh
    force = (tube.load @ wind(mesh)).reshape(-1, 3)
    calculix.run(tmp_path, calculix.deck(mesh, METAL, clamped_nodes(mesh), force, None))
    displacement = tube.solver.solve(force.reshape(-1, 1)).reshape(-1, 3)
    assert distance(displacement, calculix.printed_displacement(tmp_path, mesh.n_nodes)) < 1e-6


def test_gauge_strain(tmp_path: Path) -> None:
    """Strain at gauges on nodes, quadrature of swept meshes, against CalculiX's own there: 0.5 % of its rms.

    CalculiX extrapolates it linearly from integration points, of which the 2 x 2 x 2 of C3D20R are good for that.
    The hoop strain of a curved wall in bending is not linear through it, so the wall has two elements there: with
    one, CalculiX's strain at the inner face is t/(3 R) low.
    """
    case = prepare(ring_mesh("hexahedron20", 0.146, OUTSIDE, 0.5 * LENGTH, (24, 80, 2)), "thin_wall")
    mesh = case.mesh
    force = (case.load @ wind(mesh)).reshape(-1, 3)
    calculix.run(tmp_path, calculix.deck(mesh, METAL, clamped_nodes(mesh), force, None, "C3D20R"))
    tensor = calculix.nodal_strain(tmp_path, mesh.n_nodes)[case.gauge_node]
    theirs = np.einsum("gi,gij,gj->g", case.direction, tensor, case.direction)
    ours = (case.rows @ case.solver.solve(force.reshape(-1, 1)))[:, 0]
    print("strain", distance(ours, theirs))
    assert distance(ours, theirs) < 5e-3


def test_pressure_load(tube: Case, tmp_path: Path) -> None:
    """Uniform pressure by CalculiX's own *DLOAD on faces against our consistent forces: displacement to 1e-5.

    On curved triangles CalculiX integrates with three points, which is not exact; ours is.
    """
    mesh = tube.mesh
    calculix.run(tmp_path, calculix.deck(mesh, METAL, clamped_nodes(mesh), None, (EXTERNAL, 1e5)))
    force = tube.load @ np.full(tube.load.shape[1], 1e5)
    displacement = tube.solver.solve(force.reshape(-1, 1)).reshape(-1, 3)
    rtol = 1e-6 if mesh.element_type == "hexahedron20" else 1e-5
    assert distance(displacement, calculix.printed_displacement(tmp_path, mesh.n_nodes)) < rtol
