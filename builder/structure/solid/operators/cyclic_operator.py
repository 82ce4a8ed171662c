"""A structure made of equal sectors round the axis: block-circulant operators, harmonic by harmonic.

With displacements, forces and pressures of sector s in its own frame, every operator of such a structure is block
circulant: f_s = A_0 u_s + A_1 u_(s+1) + A_2 u_(s-1). The discrete Fourier transform over sectors,
u_s = 1/n sum over m of w^(m s) U(m) with w = exp(2 pi i / n), leaves one small operator per harmonic,
A(m) = A_0 + A_1 w^m + A_2 w^-m, and harmonics n - m are the conjugates of m (Davis, Circulant Matrices, section
5.6; Thomas, Int. J. Numer. Meth. Eng. 14, 1979, for vibration of rotors). Sectors need no symmetry of their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from builder.structure.solid.mesh.solid_mesh import SolidMesh
from builder.structure.solid.mesh.swept_mesh import SweptSector, two_sector_mesh
from builder.structure.solid.operators.stiffness import sector_blocks, sector_stiffness
from builder.structure.solid.operators.supports import Support, restrain
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class CircularOperator:
    """A block-circulant operator.

    Attributes
    ----------
    n_sectors : number of sectors.
    here, after, before : (n_rows, n_columns) blocks from a sector itself, the next and the one before.
    """

    n_sectors: int
    here: csr_array
    after: csr_array
    before: csr_array

    def harmonic(self, m: int) -> csr_array:
        """Return the operator (n_rows, n_columns) on harmonic ``m``; real where ``m`` is its own conjugate."""
        pointer, index, (here, after, before) = self._aligned
        turn = np.exp(2j * np.pi * m / self.n_sectors)
        if 2 * m % self.n_sectors == 0:
            data = here + round(turn.real) * (after + before)
        else:
            data = here + turn * after + turn.conjugate() * before
        return csr_array((data, index, pointer), shape=self.here.shape)

    @cached_property
    def _aligned(self) -> tuple[NDArray[np.int32], NDArray[np.int32], FloatArray]:
        """Pointer and index of the pattern common to the blocks, and their entries on it (3, n_entries)."""
        n_columns = self.here.shape[1]
        parts = [block.tocoo() for block in (self.here, self.after, self.before)]
        keys = [part.row.astype(np.int64) * n_columns + part.col for part in parts]
        common = np.unique(np.concatenate(keys))
        entry = np.zeros((3, len(common)))
        for values, key, part in zip(entry, keys, parts, strict=True):
            np.add.at(values, np.searchsorted(common, key), part.data)
        pointer = np.searchsorted(common, np.arange(self.here.shape[0] + 1) * n_columns)
        return pointer.astype(np.int32), (common % n_columns).astype(np.int32), entry


@dataclass(frozen=True, eq=False)
class CyclicProblem:
    """A u = f for a held structure of equal sectors.

    Attributes
    ----------
    sector : the mesh of one sector.
    stiffness : free^T A free [N/m] in sector frames, of the free motions of each sector.
    free : (3 n_s, n_free) free motions of one sector in its frame, orthonormal columns [-].
    """

    sector: SweptSector
    stiffness: CircularOperator
    free: csr_array

    @property
    def n_sectors(self) -> int:
        return self.sector.n_sectors

    @property
    def n_dof(self) -> int:
        """Displacement components of the whole structure, held ones included."""
        return self.n_sectors * self.sector.n_dof


def n_harmonics(n_sectors: int) -> int:
    """Return the number of harmonics from 0 that real fields over sectors need."""
    return n_sectors // 2 + 1


def cyclic_problem(
    sector: SweptSector, materials: Mapping[str, Material], supports: Sequence[Support]
) -> CyclicProblem:
    """Assemble the held stiffness of a structure of equal sectors from one of them.

    A support is given by the name of a surface, and every sector has its part of that surface, so supports are
    cyclic as the mesh is. Three held points, or free flight, are not: those need the full mesh.

    Raises
    ------
    InputError
        A support's surface does not exist, supports leave a rigid motion free, or the stiffness has no material.
    """
    own, after = sector_stiffness(sector, materials)
    added_own, added_after = sector_blocks(sector, restrain(two_sector_mesh(sector), supports).added)
    free = _free_motions_of_sector(sector, supports)
    own, after = free.T @ (own + added_own) @ free, free.T @ (after + added_after) @ free
    stiffness = CircularOperator(
        n_sectors=sector.n_sectors, here=csr_array(own), after=csr_array(after), before=csr_array(after.T)
    )
    return CyclicProblem(sector, stiffness, free)


def _free_motions_of_sector(sector: SweptSector, supports: Sequence[Support]) -> csr_array:
    """Return (3 n_s, n_free): what supports leave free at the nodes of a sector, in its frame.

    Nodes between two sectors take the normals of both, so the sector before is there too.
    """
    n = sector.n_nodes
    turns = [sector.rotation(s) for s in (-1, 0, 1)]
    neighbours = SolidMesh(
        element_type=two_sector_mesh(sector).element_type,
        node=np.concatenate([sector.node @ turn.T for turn in turns]),
        element=np.concatenate([sector.element, sector.element + n]),
        region=np.zeros(2 * len(sector.element), dtype=np.int64),
        region_names=("both",),
        surface={name: np.concatenate([facet, facet + n]) for name, facet in sector.surface.items()},
    )
    middle = csc_array(restrain(neighbours, supports).free[sector.n_dof : 2 * sector.n_dof])
    return csr_array(middle[:, np.diff(middle.indptr) > 0])


def to_sector_frames(sector: SweptSector, vector: FloatArray) -> FloatArray:
    """Turn vectors (n_dof, k) of the whole structure from body axes into sector frames, (n_sectors, 3 n_s, k)."""
    turns = np.stack([sector.rotation(s) for s in range(sector.n_sectors)])
    parts = vector.reshape(sector.n_sectors, sector.n_nodes, 3, -1)
    turned = np.einsum("sij,snik->snjk", turns, parts, optimize=True)
    return turned.reshape(sector.n_sectors, sector.n_dof, -1)


def to_body_axes(sector: SweptSector, vector: FloatArray) -> FloatArray:
    """Turn vectors (n_sectors, 3 n_s, k) from sector frames into body axes, (n_dof, k)."""
    turns = np.stack([sector.rotation(s) for s in range(sector.n_sectors)])
    parts = vector.reshape(sector.n_sectors, sector.n_nodes, 3, -1)
    turned = np.einsum("sij,snjk->snik", turns, parts, optimize=True)
    return turned.reshape(sector.n_sectors * sector.n_dof, -1)
