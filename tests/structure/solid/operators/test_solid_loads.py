"""Nodal forces of a pressure: resultants, virtual work, sectors, and forces of another mesh."""

import numpy as np
import pytest
from solid_bodies import ELEMENT_TYPES, cube, tube

from builder.structure.solid.cyclic import pressure_operator
from builder.structure.solid.elements import reference_facet
from builder.structure.solid.nodal_loads import (
    nodal_force_load,
    pressure_load,
    surface_nodes,
    vector_area,
)
from builder.structure.solid.solid_mesh import EXTERNAL, SolidMesh
from builder.structure.solid.swept_mesh import full_mesh
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

FINE_DEGREE = 15


def curved_cube(element_type: str) -> SolidMesh:
    """A cube with a side bulged out: the bulge moves the nodes of x1 too."""
    mesh = cube(element_type, 2, shake=0.1)
    x, y, z = mesh.node.T
    bulge = 0.2 * x**2 * np.sin(np.pi * y) * np.sin(np.pi * z)
    return SolidMesh(
        element_type=element_type,
        node=np.column_stack([x + bulge, y, z]),
        element=mesh.element,
        region=mesh.region,
        region_names=mesh.region_names,
        surface=mesh.surface,
    )


def surface_integral(mesh: SolidMesh, name: str, pressure: np.ndarray, field: np.ndarray) -> float:
    """Return -integral of p n . v dS with p and v (n_nodes, 3) interpolated; finer quadrature."""
    facet = mesh.surface[name]
    shape = reference_facet(mesh.element_type, FINE_DEGREE).shape
    area = vector_area(mesh.element_type, mesh.node[facet], FINE_DEGREE)
    nodal = np.zeros(mesh.n_nodes)
    nodal[surface_nodes(mesh, name)] = pressure
    at_points = np.einsum("qa,fa->fq", shape, nodal[facet])
    velocity = np.einsum("qa,fac->fqc", shape, field[facet])
    return -float(np.einsum("fq,fqc,fqc->", at_points, area, velocity))


@pytest.mark.parametrize("element_type", ELEMENT_TYPES)
def test_forces_and_moments_sum_to_those_of_the_pressure(element_type: str) -> None:
    """Exact on the meshed, curved surface: 1e-12 of the sum of magnitudes."""
    mesh = curved_cube(element_type)
    load = pressure_load(mesh, "x1")
    pressure = np.random.default_rng(0).uniform(0.5, 2.0, load.shape[1])
    force = (load @ pressure).reshape(-1, 3)
    scale = np.abs(force).sum()
    for axis in range(3):
        translation = np.tile(np.eye(3)[axis], (mesh.n_nodes, 1))
        rotation = np.cross(np.eye(3)[axis], mesh.node)
        found = np.einsum("nc,nc->", force, translation), np.einsum("nc,nc->", force, rotation)
        expected = [surface_integral(mesh, "x1", pressure, motion) for motion in (translation, rotation)]
        np.testing.assert_allclose(found, expected, atol=1e-12 * scale)


@pytest.mark.parametrize("element_type", ELEMENT_TYPES)
def test_virtual_work_identity(element_type: str) -> None:
    """f . v = -integral of p n . v dS for any nodal v, to 1e-12."""
    mesh = curved_cube(element_type)
    load = pressure_load(mesh, "x1")
    random = np.random.default_rng(1)
    pressure, field = random.normal(size=load.shape[1]), random.normal(size=(mesh.n_nodes, 3))
    force = load @ pressure
    expected = surface_integral(mesh, "x1", pressure, field)
    assert force @ field.ravel() == pytest.approx(expected, abs=1e-12 * np.abs(force).sum())


def test_uniform_pressure_all_round_has_no_resultant() -> None:
    mesh = curved_cube("hexahedron20")
    force = sum((pressure_load(mesh, side) @ np.ones(len(surface_nodes(mesh, side)))) for side in mesh.surface)
    total = np.asarray(force).reshape(-1, 3)
    scale = np.abs(total).sum()
    assert np.abs(total.sum(axis=0)).max() < 1e-13 * scale
    assert np.abs(np.cross(mesh.node, total).sum(axis=0)).max() < 1e-13 * scale


def test_pressure_pushes_into_the_body() -> None:
    mesh = cube("hexahedron20", 2)
    force = (pressure_load(mesh, "x1") @ np.full(len(surface_nodes(mesh, "x1")), 3.0)).reshape(-1, 3)
    np.testing.assert_allclose(force.sum(axis=0), [-3.0, 0.0, 0.0], atol=1e-14)


def test_sector_blocks_are_those_of_the_whole_mesh() -> None:
    sector = tube(0.2, 0.12, 0.13, 0.05, 8)
    mesh = full_mesh(sector)
    load = pressure_operator(sector, EXTERNAL)
    pressure = np.random.default_rng(2).normal(size=(8, load.within.shape[1]))
    blocks = [pressure.T, np.roll(pressure, -1, axis=0).T, np.roll(pressure, 1, axis=0).T]
    in_frames = sum(
        matrix @ part for matrix, part in zip((load.within, load.after, load.before), blocks, strict=True)
    )
    turns = np.stack([sector.rotation(s) for s in range(8)])
    in_body = np.einsum("sij,snj->sni", turns, np.asarray(in_frames).T.reshape(8, -1, 3)).ravel()
    whole = pressure_load(mesh, EXTERNAL) @ pressure.ravel()
    np.testing.assert_allclose(in_body, whole, atol=1e-13 * np.abs(whole).max())


def test_forces_act_at_the_nodes_of_the_surface() -> None:
    mesh = cube("hexahedron20", 2)
    node = surface_nodes(mesh, "x1")
    force = np.random.default_rng(3).normal(size=(len(node), 3))
    at_nodes = (nodal_force_load(mesh, "x1") @ force.ravel()).reshape(-1, 3)
    np.testing.assert_array_equal(at_nodes[node], force)
    assert np.count_nonzero(at_nodes) == force.size


def test_wrong_names_are_refused() -> None:
    mesh = cube("hexahedron8", 2)
    with pytest.raises(InputError, match=r"no surface 'top', found \['x0', 'x1'"):
        pressure_load(mesh, "top")
