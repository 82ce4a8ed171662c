"""Linear tetrahedra cut from swept hexahedra: the mesh, its strain, and the cyclic solver on it."""

import numpy as np
import pytest

from builder.reproduce.strain_models import element_strain_rows, tetrahedral_sector
from builder.structure.solid.cyclic import rows_in_sectors
from builder.structure.solid.elements import boundary_facets
from builder.structure.solid.gauge_rows import gauges_at
from builder.structure.solid.matter import Matter
from builder.structure.solid.nodal_loads import triangulated_surface
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SUPPORT
from builder.structure.solid.strain_solution import solve_strain
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import SweptResolution, SweptSector, full_mesh, swept_wall
from builder.structure.wall import wall_of
from builder.vehicle.file import IC3X, load_vehicle
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def sector() -> SweptSector:
    vehicle = load_vehicle(IC3X)
    return tetrahedral_sector(swept_wall(vehicle.body(), wall_of(vehicle), SweptResolution(0.2, 1, 16)))


def test_tetrahedra_fill_the_hexahedra_without_gaps(sector: SweptSector) -> None:
    mesh = full_mesh(sector)
    a, b, c, d = (mesh.node[mesh.element[:, k]] for k in range(4))
    volume = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0
    assert volume.min() > 0.0
    # Cuts that do not meet would leave facets inside the wall that belong to one tetrahedron alone.
    outside, _ = boundary_facets(mesh.element_type, mesh.element)
    named = np.concatenate([facet for facet in mesh.surface.values() if len(facet)])
    assert {frozenset(f) for f in outside.tolist()} == {frozenset(f) for f in named.tolist()}
    # Gauss: the volume is that of the closed surface, normals outward.
    corner = mesh.node[named]
    flux = np.einsum(
        "ij,ij->", corner.mean(axis=1), np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    )
    assert flux / 6.0 == pytest.approx(volume.sum(), rel=1e-12)


def test_hexahedra_are_asked_for(sector: SweptSector) -> None:
    with pytest.raises(InputError, match="tetrahedron4"):
        tetrahedral_sector(sector)


def test_strain_of_a_linear_displacement_is_exact(sector: SweptSector) -> None:
    # Patch test: u = G x has the strain e . G e along e everywhere; e lies in a facet's plane here.
    mesh = full_mesh(sector)
    facet = mesh.named_surface(INTERNAL)[::37]
    corner = mesh.node[facet]
    direction = corner[:, 1] - corner[:, 0]
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    rows = element_strain_rows(mesh, gauges_at(corner.mean(axis=1), direction))
    gradient = np.random.default_rng(1).normal(size=(3, 3))
    strain = rows @ (mesh.node @ gradient.T).ravel()
    np.testing.assert_allclose(strain, np.einsum("ni,ij,nj->n", direction, gradient, direction), rtol=1e-9)


def test_cyclic_solution_is_that_of_the_full_mesh(sector: SweptSector) -> None:
    vehicle = load_vehicle(IC3X)
    mesh = full_mesh(sector)
    inner = triangulated_surface(mesh, INTERNAL)
    chosen = np.linspace(0, len(inner.triangle) - 1, 5).astype(int)
    point = inner.point[inner.triangle[chosen]].mean(axis=1)
    on_mesh = element_strain_rows(mesh, gauges_at(point, np.tile([1.0, 0.0, 0.0], (5, 1))))
    rows = rows_in_sectors(sector, on_mesh)
    matter, support = Matter(material=wall_of(vehicle).material), Clamped(SUPPORT)
    by_sectors = solve_strain(sector, matter, support, rows, None).strain_operator
    whole = solve_strain(sector, matter, support, rows, "superlu").strain_operator
    assert by_sectors.shape[1] == triangulated_surface(mesh, EXTERNAL).n_nodes
    # Both are direct solutions of one system; its condition number of 1e8 leaves 1e-8.
    assert np.abs(by_sectors - whole).max() < 1e-7 * np.abs(whole).max()
