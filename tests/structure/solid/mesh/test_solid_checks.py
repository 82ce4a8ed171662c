"""Every fault of a mesh is found and reported in one line; sound meshes pass."""

from dataclasses import replace

import numpy as np
import pytest

from builder.structure.solid.checks import FRONT, ring_mesh
from builder.structure.solid.elements import (
    determinant_ratio,
    element_faces,
    reference_nodes,
    scaled_jacobian,
    straighten_folded,
)
from builder.structure.solid.mesh_checks import check_mesh, refuse_doubled_nodes
from builder.structure.solid.solid_mesh import (
    EXTERNAL,
    INTERNAL,
    NODES_PER_ELEMENT,
    SolidMesh,
)
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

TYPES = sorted(NODES_PER_ELEMENT)


def ring(element_type: str = "tetrahedron10") -> SolidMesh:
    return ring_mesh(element_type, 0.10, 0.12, 0.3, (3, 12, 1))


@pytest.mark.parametrize("element_type", TYPES)
def test_sound_mesh_passes(element_type: str) -> None:
    mesh = ring(element_type)
    check_mesh(mesh, length=0.3)
    assert {facet.shape[1] for facet in mesh.surface.values()} == {element_faces(element_type).shape[1]}


@pytest.mark.parametrize("element_type", TYPES)
def test_reference_elements_have_known_quality(element_type: str) -> None:
    """A cube has 1; a corner of a cube has 1/sqrt(2) at the worst of its corners, times sqrt(2) by convention."""
    node = reference_nodes(element_type)
    element = np.arange(len(node))[None]
    one = scaled_jacobian(element_type, node, element)[0]
    assert one == pytest.approx(1.0 if element_type.startswith("hexa") else np.sqrt(0.5), rel=1e-12)
    assert determinant_ratio(element_type, node, element)[0] == pytest.approx(1.0, rel=1e-12)


def test_regular_tetrahedron_has_quality_one() -> None:
    node = np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]])
    assert scaled_jacobian("tetrahedron4", node, np.arange(4)[None])[0] == pytest.approx(1.0, rel=1e-12)


def test_inverted_element_is_named_with_its_place() -> None:
    mesh = ring()
    element = mesh.element.copy()
    element[17, [1, 2]] = element[17, [2, 1]]
    element[17, [4, 6]] = element[17, [6, 4]]
    element[17, [8, 9]] = element[17, [9, 8]]
    x, y, z = mesh.node[element[17]].mean(axis=0)
    with pytest.raises(
        InputError, match=r"1 of 216 elements are inverted or folded, the first is element 17"
    ) as found:
        check_mesh(replace(mesh, element=element))
    assert f"at ({x:.4g}, {y:.4g}, {z:.4g}) m" in str(found.value)


def test_folded_by_a_middle_node_is_found() -> None:
    mesh = ring()
    node = mesh.node.copy()
    middle = mesh.element[5, 4]
    node[middle] = node[mesh.element[5, 0]] + 0.95 * (node[mesh.element[5, 1]] - node[mesh.element[5, 0]])
    with pytest.raises(InputError, match="inverted or folded"):
        check_mesh(replace(mesh, node=node))


def test_folded_elements_are_straightened_and_no_others() -> None:
    mesh = ring()
    node = mesh.node.copy()
    middle = mesh.element[5, 4]
    ends = node[mesh.element[5, :2]]
    node[middle] = ends[0] + 0.95 * (ends[1] - ends[0])
    mended = straighten_folded("tetrahedron10", node, mesh.element)
    assert determinant_ratio("tetrahedron10", mended, mesh.element).min() > 0.05
    np.testing.assert_allclose(mended[middle], ends.mean(axis=0), rtol=0, atol=1e-15)
    near = np.isin(mesh.element, middle).any(axis=1)
    far = np.setdiff1d(np.arange(len(node)), mesh.element[near])
    np.testing.assert_array_equal(mended[far], node[far])


def test_separate_part_is_counted_and_boxed() -> None:
    """The six tetrahedra of one cell, 3 x 3 x 3 nodes, one metre further aft."""
    mesh = ring()
    cell = mesh.element[:: len(mesh.element) // 6]
    used, element = np.unique(cell, return_inverse=True)
    both = replace(
        mesh,
        node=np.concatenate([mesh.node, mesh.node[used] + np.array([1.0, 0.0, 0.0])]),
        element=np.concatenate([mesh.element, element.reshape(cell.shape) + mesh.n_nodes]),
        region=np.zeros(len(mesh.element) + 6, dtype=np.int64),
    )
    with pytest.raises(
        InputError, match=r"2 parts that share no node; the smallest has 27 of .* box x 1 to 1.1, y"
    ):
        check_mesh(both)


def test_missing_surface_is_named() -> None:
    mesh = ring()
    surface = {name: facet for name, facet in mesh.surface.items() if name != INTERNAL}
    with pytest.raises(InputError, match="no surface 'internal', found"):
        check_mesh(replace(mesh, surface=surface))


def test_facet_inside_the_body_is_refused() -> None:
    """The cut between two rows of elements has facets, but no outer face."""
    mesh = ring("hexahedron20")
    inner_cut = mesh.node[mesh.element][..., 0].max(axis=1) < 0.11
    cut = mesh.element[inner_cut][:, [1, 2, 6, 5, 9, 18, 13, 17]]
    with pytest.raises(InputError, match="surface 'cut': 12 of 12 facets are not outer faces"):
        check_mesh(replace(mesh, surface={**mesh.surface, "cut": cut}))


def test_inward_facet_is_refused() -> None:
    mesh = ring()
    facet = mesh.surface[EXTERNAL].copy()
    facet[3] = facet[3][[0, 2, 1, 5, 4, 3]]
    with pytest.raises(InputError, match=r"surface 'external': 1 of 72 facets point inward.*facet 3"):
        check_mesh(replace(mesh, surface={**mesh.surface, EXTERNAL: facet}))


def test_facet_begun_at_another_corner_is_sound() -> None:
    mesh = ring()
    facet = mesh.surface[EXTERNAL][:, [1, 2, 0, 4, 5, 3]]
    check_mesh(replace(mesh, surface={**mesh.surface, EXTERNAL: facet}))


def test_facet_that_is_there_twice_is_refused() -> None:
    mesh = ring()
    facet = np.concatenate([mesh.surface[EXTERNAL], mesh.surface[EXTERNAL][:1]])
    with pytest.raises(InputError, match="surface 'external': 1 of 73 facets are listed twice"):
        check_mesh(replace(mesh, surface={**mesh.surface, EXTERNAL: facet}))


def test_node_in_no_element_is_named() -> None:
    mesh = ring()
    node = np.concatenate([mesh.node, [[0.0, 0.0, 5.0]]])
    with pytest.raises(
        InputError, match=rf"1 nodes are in no element, the first is node {mesh.n_nodes} at \(0, 0, 5\)"
    ):
        check_mesh(replace(mesh, node=node))


def test_doubled_nodes_are_named() -> None:
    """A slit: the last row of elements has nodes of its own."""
    mesh = ring()
    last = mesh.node[mesh.element][..., 0].min(axis=1) > 0.19
    element = mesh.element.copy()
    element[last] += mesh.n_nodes
    node = np.concatenate([mesh.node, mesh.node])
    used, element = np.unique(element, return_inverse=True)
    slit = replace(
        mesh, node=node[used], element=element.reshape(mesh.element.shape), surface={FRONT: mesh.surface[FRONT]}
    )
    with pytest.raises(InputError, match=r"pairs of nodes at one point.*merge coincident nodes"):
        refuse_doubled_nodes(slit)


@pytest.mark.parametrize(
    ("factor", "hint"),
    [(1000.0, "with the unit mm"), (100.0, "with the unit cm"), (1.0 / 0.0254, "unit inch"), (1.5, "")],
)
def test_wrong_unit_is_found_by_the_length(factor: float, hint: str) -> None:
    mesh = ring()
    with pytest.raises(InputError, match=r"long in x, the vehicle 0.3 m") as found:
        check_mesh(replace(mesh, node=factor * mesh.node), length=0.3)
    assert hint in str(found.value)
    assert ("unit" in str(found.value)) == bool(hint)


def test_impossible_ring_is_refused() -> None:
    with pytest.raises(InputError, match="element type 'wedge15' found"):
        ring_mesh("wedge15", 0.1, 0.12, 0.3, (1, 12, 1))
    with pytest.raises(InputError, match="must be positive and increase"):
        ring_mesh("tetrahedron10", 0.12, 0.1, 0.3, (1, 12, 1))
    with pytest.raises(InputError, match=r"at least \(1, 6, 1\)"):
        ring_mesh("tetrahedron10", 0.1, 0.12, 0.3, (1, 4, 1))
