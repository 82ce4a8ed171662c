"""Shape functions against VTK's, quadrature, and the stiffness of single elements and of small meshes."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from solid_bodies import ELEMENT_TYPES, METAL, cube

from builder.structure.solid.elements import (
    FACET_DEGREE,
    facet_reference_nodes,
    facet_shape_functions,
    reference_element,
    reference_facet,
    reference_nodes,
    shape_functions,
)
from builder.structure.solid.nodal_loads import surface_nodes
from builder.structure.solid.solid_mesh import SolidMesh
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.supports import free_motions, rigid_motions
from builder.structure.solid.swept_mesh import REGION
from builder.structure.wall import Material
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

MATERIALS = {REGION: METAL}


def vtk_cell(element_type: str, facet: bool) -> Any:
    vtk = pytest.importorskip("vtk")
    names = {
        "hexahedron20": ("vtkQuadraticHexahedron", "vtkQuadraticQuad"),
        "tetrahedron10": ("vtkQuadraticTetra", "vtkQuadraticTriangle"),
        "hexahedron8": ("vtkHexahedron", "vtkQuad"),
        "tetrahedron4": ("vtkTetra", "vtkTriangle"),
    }
    return getattr(vtk, names[element_type][facet])()


@pytest.mark.parametrize("facet", [False, True], ids=["element", "facet"])
@pytest.mark.parametrize("element_type", ELEMENT_TYPES)
def test_nodes_and_shape_functions_are_those_of_vtk(element_type: str, facet: bool) -> None:
    cell = vtk_cell(element_type, facet)
    nodes = facet_reference_nodes(element_type) if facet else reference_nodes(element_type)
    of_vtk = np.array([cell.GetParametricCoords()[i] for i in range(3 * len(nodes))]).reshape(-1, 3)
    np.testing.assert_allclose(nodes, of_vtk[:, : nodes.shape[1]], atol=1e-15)
    point = np.random.default_rng(0).dirichlet(np.ones(4), 5)[:, :3]
    value = (
        facet_shape_functions(element_type, point[:, :2])[0] if facet else shape_functions(element_type, point)[0]
    )
    expected = [0.0] * len(nodes)
    for i in range(len(point)):
        at = [*point[i, :2], 0.0] if facet else point[i].tolist()
        cell.InterpolateFunctions(at, expected)
        np.testing.assert_allclose(value[i], expected, atol=1e-14)


@pytest.mark.parametrize("element_type", ELEMENT_TYPES)
def test_gradients_are_derivatives_of_the_shape_functions(element_type: str) -> None:
    """Central differences; shape functions are of degree 2 in each coordinate, so only round-off is left."""
    point, h = np.random.default_rng(1).dirichlet(np.ones(4), 6)[:, :3], 1e-4
    _, gradient = shape_functions(element_type, point)
    for axis in range(3):
        step = h * np.eye(3)[axis]
        up, down = (shape_functions(element_type, point + sign * step)[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose(gradient[..., axis], (up - down) / (2.0 * h), atol=1e-10)


@pytest.mark.parametrize("element_type", ELEMENT_TYPES)
def test_quadrature_has_the_size_of_the_reference_element(element_type: str) -> None:
    size = 1.0 if "hexa" in element_type else 1.0 / 6.0
    assert reference_element(element_type).weight.sum() == pytest.approx(size, rel=1e-14)
    area = 1.0 if "hexa" in element_type else 0.5
    assert reference_facet(element_type).weight.sum() == pytest.approx(area, rel=1e-14)


def test_quadrature_with_negative_weights_is_refused() -> None:
    with pytest.raises(InputError, match="quadrature 3 of tetrahedron10 has weights that are not positive"):
        assemble_stiffness(cube("tetrahedron10", 1), MATERIALS, 3)


@pytest.mark.parametrize("element_type", ELEMENT_TYPES)
def test_facet_quadrature_is_exact_to_its_degree(element_type: str) -> None:
    """Integral of x^d over the unit square 1/(d+1), over the triangle 1/((d+1)(d+2))."""
    reference, d = reference_facet(element_type), FACET_DEGREE[element_type]
    exact = 1.0 / (d + 1) if "hexa" in element_type else 1.0 / ((d + 1) * (d + 2))
    assert reference.weight @ reference.point[:, 0] ** d == pytest.approx(exact, rel=1e-12)


def element_stiffness(mesh: SolidMesh, number: int, quadrature: Any = None) -> np.ndarray:
    """Return the stiffness (3 n_e, 3 n_e) of one element, assembled from a mesh of this element alone."""
    alone = replace(mesh, element=mesh.element[[number]], region=mesh.region[[number]])
    dof = (3 * mesh.element[number][:, None] + np.arange(3)).ravel()
    return np.asarray(assemble_stiffness(alone, MATERIALS, quadrature).toarray()[np.ix_(dof, dof)])


@pytest.mark.parametrize("quadrature", ["full", "thin_wall"])
@pytest.mark.parametrize("element_type", ELEMENT_TYPES)
def test_only_rigid_motions_are_without_strain(element_type: str, quadrature: Any) -> None:
    """Six eigenvalues are zero to round-off, the seventh is not: no spurious modes."""
    mesh = cube(element_type, 2, shake=0.2)
    if quadrature == "thin_wall" and element_type != "hexahedron20":
        with pytest.raises(InputError, match=f"'thin_wall' is for hexahedron20, {element_type} found"):
            assemble_stiffness(mesh, MATERIALS, quadrature)
        return
    value = np.linalg.eigvalsh(element_stiffness(mesh, 0, quadrature))
    assert np.abs(value[:6]).max() < 1e-13 * value[-1]
    assert value[6] > 1e-4 * value[-1]


@pytest.mark.parametrize("element_type", ELEMENT_TYPES)
def test_rigid_motions_need_no_force(element_type: str) -> None:
    mesh = cube(
        element_type, 2, shake=0.2, bend=0.05 if element_type in ("hexahedron20", "tetrahedron10") else 0.0
    )
    stiffness = assemble_stiffness(mesh, MATERIALS)
    assert np.abs(stiffness @ rigid_motions(mesh.node)).max() < 1e-10 * np.abs(stiffness.data).max()
    assert np.abs((stiffness - stiffness.T).data).max(initial=0.0) < 1e-14 * np.abs(stiffness.data).max()


@pytest.mark.parametrize("bend", [0.0, 0.05], ids=["straight", "curved"])
@pytest.mark.parametrize("element_type", ELEMENT_TYPES)
def test_patch_test(element_type: str, bend: float) -> None:
    """Linear displacement given on the boundary of distorted elements is the solution inside, to 1e-10.

    Four points integrate straight tetrahedra exactly; curved ones need degree 3 (gradient 1, cofactor 2), and 5 is
    the next with positive weights.
    """
    quadrature = 5 if bend and element_type == "tetrahedron10" else "full"
    mesh = cube(element_type, 3, shake=0.2, bend=bend)
    slope = np.random.default_rng(2).normal(size=(3, 3))
    exact = (mesh.node @ slope.T).ravel()
    held = np.unique(np.concatenate([surface_nodes(mesh, side) for side in mesh.surface]))
    free = free_motions(mesh.n_nodes, np.repeat(held, 3), np.tile(np.eye(3), (len(held), 1)))
    stiffness = assemble_stiffness(mesh, MATERIALS, quadrature)
    given = exact - free @ (free.T @ exact)
    inner = np.linalg.solve((free.T @ stiffness @ free).toarray(), -(free.T @ (stiffness @ given)))
    np.testing.assert_allclose(given + free @ inner, exact, atol=1e-10 * np.abs(exact).max())


def test_assembled_stiffness_is_the_sum_of_the_elements() -> None:
    mesh = cube("hexahedron20", 2, shake=0.1)
    field = np.random.default_rng(4).normal(size=(2, mesh.n_dof))
    by_element = 0.0
    for number, nodes in enumerate(mesh.element):
        dof = (3 * nodes[:, None] + np.arange(3)).ravel()
        by_element += field[0][dof] @ element_stiffness(mesh, number) @ field[1][dof]
    assert field[0] @ (assemble_stiffness(mesh, MATERIALS) @ field[1]) == pytest.approx(by_element, rel=1e-12)


def test_energy_is_that_of_scikit_fem() -> None:
    """Its own assembly of linear elasticity on straight second-order tetrahedra; smooth fields, 1e-12."""
    import skfem
    from skfem.models.elasticity import linear_elasticity

    mesh = cube("tetrahedron10", 2, shake=0.2)
    corner = np.unique(mesh.element[:, :4])
    theirs = skfem.MeshTet(mesh.node[corner].T, np.searchsorted(corner, mesh.element[:, :4]).T)
    basis = skfem.Basis(theirs, skfem.ElementVector(skfem.ElementTetP2()), intorder=2)
    shear = METAL.youngs_modulus / (2.0 * (1.0 + METAL.poisson_ratio))
    lame = 2.0 * shear * METAL.poisson_ratio / (1.0 - 2.0 * METAL.poisson_ratio)
    stiffness = skfem.asm(linear_elasticity(lame, shear), basis)

    def field(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(x + 2.0 * y), z * np.exp(x), np.cos(y - z)])

    values = field(*basis.doflocs)
    component = np.empty(basis.N, dtype=int)
    for c in range(3):
        for dofs in (basis.nodal_dofs, basis.edge_dofs):
            component[dofs[c]] = c
    at_dofs = values[component, np.arange(basis.N)]
    ours = field(*mesh.node.T).T.ravel()
    expected = at_dofs @ (stiffness @ at_dofs)
    assert ours @ (assemble_stiffness(mesh, MATERIALS) @ ours) == pytest.approx(expected, rel=1e-12)


def test_each_region_has_its_material() -> None:
    """Two cubes in series under strain along x: energy is half the sum of their moduli."""
    mesh = cube("hexahedron20", 2)
    aft = mesh.node[mesh.element].mean(axis=1)[:, 0] > 0.5
    mesh = replace(mesh, region=aft.astype(np.int64), region_names=("soft", "hard"))
    stiffness = assemble_stiffness(mesh, {"soft": Material(1e9, 0.0), "hard": Material(3e9, 0.0)})
    stretch = np.column_stack([mesh.node[:, 0], np.zeros((mesh.n_nodes, 2))]).ravel()
    assert stretch @ (stiffness @ stretch) == pytest.approx(2e9, rel=1e-12)
    with pytest.raises(InputError, match="region 'hard' has no material, found \\['soft'\\]"):
        assemble_stiffness(mesh, {"soft": METAL})


def test_element_turned_inside_out_is_refused() -> None:
    mesh = cube("tetrahedron4", 1)
    element = mesh.element.copy()
    element[4, [0, 1]] = element[4, [1, 0]]
    with pytest.raises(InputError, match="element 4 is turned inside out at x, y, z = "):
        assemble_stiffness(replace(mesh, element=element), MATERIALS)
