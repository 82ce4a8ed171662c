"""Symmetry classes of pressure: its parts that are even or odd under y -> -y and under z -> -z, as projections."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from builder.aero.mapping.pressure_map import mirror_operator
from builder.aero.surface.mesh import Surface, grid_of, mesh_of
from builder.structure.observability import SYMMETRIES
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray

Mirrors = tuple[sparse.csr_array, sparse.csr_array]


def mirror_operators(surface: Surface) -> Mirrors | None:
    """Return sparse (n_p, n_p) M_y, M_z: (M_y p)(x, y, z) = p(x, -y, z). None where the surface is not symmetric.

    A grid always is symmetric. On other surfaces the value is the closest point's.
    """
    grid = grid_of(surface)
    if grid is not None:
        return grid_mirrors(grid)
    of_y, of_z = (mirror_operator(mesh_of(surface), axis) for axis in (1, 2))
    return None if of_y is None or of_z is None else (of_y, of_z)


def grid_mirrors(grid: SurfaceGrid) -> Mirrors:
    """Return the same for a grid, without interpolation error.

    Pressure is trigonometric in roll angle. Where no node lies opposite another, it is mirrored wave by wave.
    """
    rings = sparse.identity(len(grid.x))
    of_y, of_z = (sparse.csr_array(sparse.kron(rings, of_ring)) for of_ring in _ring_mirrors(grid.n_roll))
    return of_y, of_z


def _ring_mirrors(n_roll: int) -> Mirrors:
    """Return the mirrors (n_roll, n_roll) of one ring of nodes at even steps of roll angle from 0."""
    node, every = np.arange(n_roll), np.ones(n_roll)
    of_y = sparse.csr_array((every, (node, -node % n_roll)))
    if n_roll % 2 == 0:
        return of_y, sparse.csr_array((every, (node, (n_roll // 2 - node) % n_roll)))
    # phi -> pi - phi keeps cos(m phi) of even m and sin(m phi) of odd m. An odd number of nodes carries both of
    # every m up to (n_roll - 1) / 2 and nothing else: these waves are an orthogonal basis.
    harmonic = np.arange(1, n_roll // 2 + 1)
    phase = np.outer(2.0 * np.pi * node / n_roll, harmonic)
    scale, sign = np.sqrt(2.0 / n_roll), np.where(harmonic % 2 == 0, 1.0, -1.0)
    cosines, sines = scale * np.cos(phase), scale * np.sin(phase)
    return of_y, sparse.csr_array(1.0 / n_roll + (cosines * sign) @ cosines.T - (sines * sign) @ sines.T)


def class_fractions(fields: FloatArray, area: FloatArray, mirrors: Mirrors | None) -> FloatArray:
    """Return (n, 4) fraction [1] of each class of symmetry in the mean square of each field.

    Parameters
    ----------
    fields : (n_p, n) pressures, none of them 0 throughout.
    area : (n_p,) of the nodes, in any unit.
    mirrors : of the surface; None gives NaN.
    """
    if mirrors is None:
        return np.full((fields.shape[1], len(SYMMETRIES)), np.nan)
    parts = (symmetric_part(fields, mirrors, symmetry.even_in_y, symmetry.even_in_z) for symmetry in SYMMETRIES)
    variance = np.stack([area @ part**2 for part in parts], axis=1)
    return variance / variance.sum(axis=1, keepdims=True)


def symmetric_part(field: FloatArray, mirrors: Mirrors, even_in_y: bool, even_in_z: bool) -> FloatArray:
    """Return the part of ``field`` (n_p, n) that is even, or odd, under y -> -y and z -> -z."""
    part = field
    for mirror, even in zip(mirrors, (even_in_y, even_in_z), strict=True):
        image = mirror @ part
        part = 0.5 * (part + image if even else part - image)
    return part
