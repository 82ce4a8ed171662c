"""Stiffness of a solid: linear elasticity, isotropic, one material per region.

K_ab = integral of lambda grad N_a (grad N_b)^T + mu grad N_b (grad N_a)^T + mu (grad N_a . grad N_b) I dV for the
3 x 3 block of nodes a and b (Bathe, Finite Element Procedures, section 4.2, in index notation).
"""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.sparse import bsr_array, csc_array, csr_array

from builder.structure.solid.elements import Quadrature, reference_element
from builder.structure.solid.solid_mesh import SolidMesh
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

CHUNK = 512
"""Elements worked on at once: 15 MB for 20 nodes, the fastest of 64 to 2048."""


def physical_gradients(
    element_type: str, position: FloatArray, quadrature: Quadrature = "full", first: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Return gradients of the shape functions by position, and the volume of each quadrature point.

    Parameters
    ----------
    element_type : kind of the elements.
    position : (m, n_e, 3) nodes of each element [m].
    quadrature : as in :func:`builder.structure.solid.elements.reference_element`.
    first : number of the first element, for messages.

    Returns
    -------
    gradient : (m, n_q, 3, n_e) [1/m].
    volume : (m, n_q) weight times determinant of the Jacobian [m3], positive.
    """
    reference = reference_element(element_type, quadrature)
    n_q, n_e, _ = reference.gradient.shape
    by_reference = reference.gradient.transpose(1, 0, 2).reshape(n_e, 3 * n_q)
    jacobian = position.transpose(0, 2, 1) @ by_reference
    jacobian = jacobian.reshape(-1, 3, n_q, 3).transpose(0, 2, 1, 3)  # (m, n_q, position, reference)
    cofactor = np.stack(
        [np.cross(jacobian[..., (j + 1) % 3], jacobian[..., (j + 2) % 3]) for j in range(3)], axis=-1
    )
    determinant = np.einsum("eqi,eqi->eq", jacobian[..., 0], cofactor[..., 0])
    folded = np.flatnonzero((determinant <= 0.0).any(axis=1))
    if len(folded):
        where = position[folded[0]].mean(axis=0)
        raise InputError(
            f"mesh: element {first + folded[0]} is turned inside out at x, y, z = "
            f"{where[0]:.4g}, {where[1]:.4g}, {where[2]:.4g} m"
        )
    inverse = cofactor / determinant[..., None, None]
    return inverse @ reference.gradient.transpose(0, 2, 1), reference.weight * determinant


def element_materials(mesh: SolidMesh, materials: Mapping[str, Material]) -> FloatArray:
    """Return (m, 2) Lamé's lambda and mu [Pa] of each element."""
    missing = [name for name in mesh.region_names if name not in materials]
    if missing:
        raise InputError(f"mesh: region '{missing[0]}' has no material, found {sorted(materials) or 'none'}")
    return np.array([materials[name].lame_parameters for name in mesh.region_names])[mesh.region]


def _chunks(
    mesh: SolidMesh, materials: Mapping[str, Material], quadrature: Quadrature | None
) -> Iterator[tuple[slice, FloatArray]]:
    """Yield ranges of elements and their stiffness (c, n_e, 3, n_e, 3) [N/m]."""
    lame = element_materials(mesh, materials)
    quadrature = quadrature or mesh.quadrature
    if not (reference_element(mesh.element_type, quadrature).weight > 0.0).all():
        raise InputError(f"quadrature {quadrature} of {mesh.element_type} has weights that are not positive")
    for start in range(0, len(mesh.element), CHUNK):
        chunk = slice(start, min(start + CHUNK, len(mesh.element)))
        gradient, volume = physical_gradients(mesh.element_type, mesh.node[mesh.element[chunk]], quadrature, start)
        m, n_q, _, n_e = gradient.shape
        # Both sides weighted alike, so that the product is symmetric to the last bit or nearly so.
        weighted = (gradient * np.sqrt(volume)[..., None, None]).transpose(0, 1, 3, 2).reshape(m, n_q, 3 * n_e)
        product = (weighted.transpose(0, 2, 1) @ weighted).reshape(m, n_e, 3, n_e, 3)
        dot = np.einsum("eaibi->eab", product)
        by_lambda, by_mu = lame[chunk, 0, None, None, None, None], lame[chunk, 1, None, None, None, None]
        stiffness = by_lambda * product + by_mu * product.transpose(0, 1, 4, 3, 2)
        for i in range(3):
            stiffness[:, :, i, :, i] += lame[chunk, 1, None, None] * dot
        yield chunk, stiffness


def assemble_stiffness(
    mesh: SolidMesh, materials: Mapping[str, Material], quadrature: Quadrature | None = None
) -> csr_array:
    """Return the stiffness (n_dof, n_dof) [N/m] of a mesh that nothing holds.

    Symmetric to round-off, positive semi-definite, columns sorted. Entries are summed chunk by chunk as 3 x 3
    blocks, so the peak of memory is about twice the result.

    Parameters
    ----------
    mesh : the mesh.
    materials : material by name of region.
    quadrature : by default the mesh's own (:data:`builder.structure.solid.elements.THIN_WALL_POINTS`).
    """
    n, n_e = mesh.n_nodes, mesh.element.shape[1]
    key = (mesh.element[:, :, None] * n + mesh.element[:, None, :]).reshape(len(mesh.element), n_e**2)
    pair, index = np.unique(key, return_inverse=True)
    index = index.reshape(key.shape)
    block = np.zeros((len(pair), 9))
    for chunk, part in _chunks(mesh, materials, quadrature):
        target, column = np.unique(index[chunk], return_inverse=True)
        blocks = part.transpose(0, 1, 3, 2, 4).reshape(-1, 9)
        pointer = np.arange(len(blocks) + 1)
        gather = csc_array((np.ones(len(blocks)), column.ravel(), pointer), shape=(len(target), len(blocks)))
        block[target] += gather @ blocks
    pointer = np.searchsorted(pair, np.arange(n + 1) * n)
    stiffness = bsr_array((block.reshape(-1, 3, 3), pair % n, pointer), shape=(3 * n, 3 * n))
    return csr_array(stiffness.tocsr())
