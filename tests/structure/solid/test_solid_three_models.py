"""Gauge strains of the shipped vehicle by three models that share no mesh: hexahedra, tetrahedra, Fourier."""

from typing import NamedTuple

import numpy as np
import pytest
from installed_gmsh import gmsh_or_skip

from builder.reports.mesh_study import linear_tetrahedra
from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import harmonic_response
from builder.structure.solid.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.gmsh_mesh import graded_wall_mesh
from builder.structure.solid.linear_solvers import choose_solver, named_back_end
from builder.structure.solid.mesh_choice import TETRAHEDRON_LENGTH
from builder.structure.solid.nodal_loads import pressure_load, surface_points
from builder.structure.solid.solid_mesh import EXTERNAL, SUPPORT, SolidMesh
from builder.structure.solid.strain_solution import held_problem
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import full_mesh, swept_wall
from builder.structure.wall import wall_of
from builder.vehicle.file import IC3X, load_vehicle
from strainfmu.arrays import FloatArray

pytestmark = pytest.mark.slow

VEHICLE = load_vehicle(IC3X)
BODY, WALL = VEHICLE.body(), wall_of(VEHICLE)
STATIONS, ROLLS = np.linspace(0.35, 3.30, 9), 0.1 + 0.25 * np.pi * np.arange(8)
HARMONICS = np.arange(5)
FASTEST = ("pardiso", "superlu")
"""Direct solvers by their time on tetrahedra; the last is always there, and slow on 650,000 components."""


class Reference(NamedTuple):
    """Gauges (144, 3) [m], directions, and their strain (144, 5) per pressure cos(m phi) by the Fourier model."""

    position: FloatArray
    direction: FloatArray
    strain: FloatArray


@pytest.fixture(scope="module")
def fourier() -> Reference:
    """Nine stations at eight roll angles, axial and hoop."""
    mesh = shell_mesh(BODY, WALL, 0.0075, 2)
    response = harmonic_response(mesh, WALL.material, STATIONS, np.array([0.0, BODY.length]), int(HARMONICS[-1]))
    point = inner_surface_points(mesh, STATIONS)
    x, roll = np.repeat(STATIONS, len(ROLLS)), np.tile(ROLLS, len(STATIONS))
    radius, along_x, along_r = (np.repeat(a, len(ROLLS)) for a in (point.radius, *point.tangent.T))
    sine, cosine = np.sin(roll), np.cos(roll)
    position = np.column_stack([x, radius * sine, radius * cosine])
    axial, hoop = (
        np.column_stack([along_x, along_r * sine, along_r * cosine]),
        np.column_stack([0 * x, cosine, -sine]),
    )
    wave = np.cos(np.outer(ROLLS, HARMONICS))
    strain = [
        (part.sum(axis=2)[:, None] * wave).reshape(-1, len(HARMONICS))
        for part in (response.meridional, response.hoop)
    ]
    return Reference(np.tile(position, (2, 1)), np.concatenate([axial, hoop]), np.concatenate(strain))


def rms_differences(mesh: SolidMesh, fourier: Reference) -> FloatArray:
    """Return (5,) rms difference of the gauge strains from the Fourier model's over their rms, per harmonic.

    Gauges are laid onto the mesh's inner face, which is faceted where elements are linear.
    """
    rows = gauge_rows(mesh, gauges_at(fourier.position, fourier.direction), near_surface=True)
    fastest = next(name for name in FASTEST if named_back_end(name).installed())
    solver = choose_solver(held_problem(mesh, {"wall": WALL.material}, [Clamped(SUPPORT)]), fastest)
    point = surface_points(mesh, EXTERNAL)
    pressure = np.cos(np.outer(np.arctan2(point[:, 1], point[:, 2]), HARMONICS))
    strain = rows @ solver.solve(pressure_load(mesh, EXTERNAL) @ pressure)
    rms = np.sqrt(np.mean((strain - fourier.strain) ** 2, axis=0) / np.mean(fourier.strain**2, axis=0))
    print(mesh.element_type, mesh.n_dof, "rms difference, %:", np.round(100.0 * rms, 2))
    return np.asarray(rms)


def test_swept_hexahedra(fourier: Reference) -> None:
    """The coarse mesh of 90,816 displacement components: 0.5 % in every harmonic."""
    assert rms_differences(full_mesh(swept_wall(BODY, WALL, "coarse")), fourier).max() < 0.005


@pytest.fixture(scope="module")
def tetrahedra() -> SolidMesh:
    """The resolution ``paper``: 0.45 sqrt(r t) round the axis."""
    gmsh_or_skip()
    return graded_wall_mesh(BODY, WALL, TETRAHEDRON_LENGTH["paper"])


def test_quadratic_tetrahedra(fourier: Reference, tetrahedra: SolidMesh) -> None:
    """650,000 displacement components: 1 % in every harmonic."""
    assert rms_differences(tetrahedra, fourier).max() < 0.01


def test_linear_tetrahedra_fail(fourier: Reference, tetrahedra: SolidMesh) -> None:
    """The same mesh without its middle nodes keeps mean pressure and beam bending, and loses the ovalisation."""
    rms = rms_differences(linear_tetrahedra(tetrahedra), fourier)
    assert rms[:2].max() < 0.05
    assert rms[2:].min() > 0.7
