"""Problems split by planes of symmetry: the parts are independent, complete, and give the same displacement."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array, hstack
from scipy.sparse.linalg import norm
from solid_bodies import METAL, swept_tube

from builder.structure.solid.solid_mesh import SUPPORT, SolidMesh
from builder.structure.solid.sparse_problem import SUPERLU, SparseProblem, factor_symmetric, symmetric_parts
from builder.structure.solid.strain_solution import held_problem
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import REGION

pytestmark = pytest.mark.fast

MATERIALS = {REGION: METAL}


@pytest.fixture(scope="module")
def mesh() -> SolidMesh:
    return swept_tube()


def held(mesh: SolidMesh) -> SparseProblem:
    return held_problem(mesh, MATERIALS, [Clamped(SUPPORT)])


def test_parts_are_independent_and_complete(mesh: SolidMesh) -> None:
    """Four parts of about a quarter each: an orthonormal basis of all, and no stiffness between them, to 1e-10."""
    problem = held(mesh)
    parts = symmetric_parts(problem)
    n = problem.matrix.shape[0]
    assert len(parts) == 4
    assert sum(part.shape[1] for part in parts) == n
    assert max(part.shape[1] for part in parts) < 0.3 * n
    basis = csr_array(hstack(parts))
    assert norm(basis.T @ basis - eye_array(n)) < 1e-10
    size = norm(problem.matrix)
    for i, one in enumerate(parts):
        for other in parts[:i]:
            assert norm(csr_array(one.T @ problem.matrix @ other)) < 1e-10 * size


def test_solution_is_that_of_the_whole_matrix(mesh: SolidMesh) -> None:
    """Random loads, 1e-9; the whole matrix is factorised at once beside it."""
    problem = held(mesh)
    loads = np.random.default_rng(3).normal(size=(problem.matrix.shape[0], 5))
    whole = factor_symmetric(problem.matrix).solve(loads)
    found = SUPERLU.factor(problem)(loads)
    np.testing.assert_allclose(found, whole, rtol=0.0, atol=1e-9 * np.abs(whole).max())


def test_a_moved_node_leaves_the_plane_it_was_moved_along(mesh: SolidMesh) -> None:
    """A node moved along y, off both planes, breaks the two; the problem is solved as a whole then."""
    node = mesh.node.copy()
    moved = int(np.argmax(np.abs(node[:, 1]) * np.abs(node[:, 2])))
    node[moved, 1] *= 1.0 + 1e-4
    (only,) = symmetric_parts(held(replace(mesh, node=node)))
    assert norm(only - eye_array(only.shape[0])) == 0.0


def test_one_plane_is_used_where_there_is_but_one(mesh: SolidMesh) -> None:
    """Everything above the plane z = 0 stretched by 1 %: symmetric about y = 0 alone, so two parts."""
    node = mesh.node.copy()
    node[:, 2] = np.where(node[:, 2] > 0.0, 1.01 * node[:, 2], node[:, 2])
    assert len(symmetric_parts(held(replace(mesh, node=node)))) == 2


def test_stiffness_counts_and_not_shape_alone(mesh: SolidMesh) -> None:
    """A spring at one node of a symmetric mesh breaks the symmetry."""
    problem = held(mesh)
    spring = np.zeros(problem.matrix.shape[0])
    spring[len(spring) // 3] = 0.01 * problem.matrix.diagonal().max()
    matrix = csr_array(problem.matrix + csr_array((spring, (range(len(spring)),) * 2), shape=problem.matrix.shape))
    assert len(symmetric_parts(replace(problem, matrix=matrix))) == 1
