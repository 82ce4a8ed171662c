"""Orders of convergence on a manufactured solution (Oberkampf and Roy, Verification and Validation, ch. 6)."""

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu
from solid_bodies import METAL, cube

from builder.structure.solid.elements import reference_element
from builder.structure.solid.nodal_loads import surface_nodes
from builder.structure.solid.solid_mesh import SolidMesh
from builder.structure.solid.stiffness import assemble_stiffness, physical_gradients
from builder.structure.solid.supports import free_motions
from builder.structure.solid.swept_mesh import REGION

WAVE = np.array([[1.1, 0.7, -0.4], [-0.6, 1.3, 0.5], [0.3, -0.8, 1.2]])
"""u_i = sin(WAVE_i . x)."""

ERROR_DEGREE = 8


def exact(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement (..., 3) and its gradient (..., 3, 3)."""
    phase = point @ WAVE.T
    return np.sin(phase), np.cos(phase)[..., None] * WAVE


def body_force(point: np.ndarray) -> np.ndarray:
    """Return -div stress (..., 3) = -(lambda + mu) grad div u - mu laplacian u."""
    lame, shear = METAL.lame_parameters
    sine = np.sin(point @ WAVE.T)
    grad_div = -np.einsum("...i,ii,ij->...j", sine, WAVE, WAVE)
    laplacian = -sine * (WAVE**2).sum(axis=1)
    return -(lame + shear) * grad_div - shear * laplacian


def errors(mesh: SolidMesh) -> tuple[float, float]:
    """Return the L2 errors of displacement and of strain, displacement given on the boundary."""
    shape = reference_element(mesh.element_type, ERROR_DEGREE).shape
    position = mesh.node[mesh.element]
    gradient, volume = physical_gradients(mesh.element_type, position, ERROR_DEGREE)
    point = np.einsum("qa,eac->eqc", shape, position)
    force = np.zeros((mesh.n_nodes, 3))
    np.add.at(force, mesh.element, np.einsum("eq,qa,eqc->eac", volume, shape, body_force(point)))
    held = np.unique(np.concatenate([surface_nodes(mesh, side) for side in mesh.surface]))
    free = free_motions(mesh.n_nodes, np.repeat(held, 3), np.tile(np.eye(3), (len(held), 1)))
    given = np.zeros((mesh.n_nodes, 3))
    given[held] = exact(mesh.node[held])[0]
    stiffness = assemble_stiffness(mesh, {REGION: METAL})
    right = free.T @ (force.ravel() - stiffness @ given.ravel())
    factor = splu(csc_array(free.T @ stiffness @ free), permc_spec="MMD_AT_PLUS_A")
    u = (given.ravel() + free @ factor.solve(right)).reshape(-1, 3)[mesh.element]
    value, slope = exact(point)
    miss = np.einsum("qa,eac->eqc", shape, u) - value
    slope_miss = np.einsum("eqda,eac->eqcd", gradient, u) - slope
    strain_miss = 0.5 * (slope_miss + slope_miss.transpose(0, 1, 3, 2))
    by_volume = [
        np.einsum("eq,eqc->", volume, (part**2).reshape(*volume.shape, -1)) for part in (miss, strain_miss)
    ]
    return float(np.sqrt(by_volume[0])), float(np.sqrt(by_volume[1]))


CELLS = (2, 4, 6)


@pytest.mark.parametrize(
    ("element_type", "shake", "bend"),
    [
        ("hexahedron20", 0.0, 0.0),
        ("hexahedron20", 0.0, 0.06),
        ("tetrahedron10", 0.0, 0.0),
        ("tetrahedron10", 0.0, 0.06),
        ("tetrahedron10", 0.2, 0.0),
    ],
)
def test_quadratic_elements_converge_with_orders_3_and_2(element_type: str, shake: float, bend: float) -> None:
    """Regular, smoothly curved and shaken meshes.

    Shaken hexahedra are left out: serendipity elements hold all quadratics on parallelepipeds alone, to which
    elements of smooth meshes tend (Arnold, Boffi and Falk, Math. Comp. 71, 2002).
    """
    found = np.log([errors(cube(element_type, n, shake, bend)) for n in CELLS])
    slope = np.polyfit(-np.log(CELLS), found, 1)[0]
    assert slope[0] == pytest.approx(3.0, abs=0.2)
    assert slope[1] == pytest.approx(2.0, abs=0.2)
