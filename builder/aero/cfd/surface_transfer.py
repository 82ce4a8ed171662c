"""Values of a file brought to the vehicle's surface, with the geometry kept: solvers write many cases on one mesh.

What depends on the two surfaces alone (sense of the normals, closest points, weights, largest gap) is found for
the first of the files that share a mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256

import numpy as np
from scipy import sparse

from builder.aero.cfd.cell_reconstruction import reconstruct
from builder.aero.cfd.placement import orient
from builder.aero.cfd.point_cloud import cloud_map
from builder.aero.cfd.surface_field import SurfaceField
from builder.aero.mapping.pressure_map import PressureMap, pressure_map
from builder.aero.mapping.report import (
    MappingTolerances,
    SurfaceGap,
    check_mapping,
    mapping_report,
    surface_gap,
)
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray

KEPT = 2
"""Meshes whose geometry is kept: a case on a mesh of its own among others does not drive theirs out."""


@dataclass(frozen=True)
class _Mesh:
    """A surface that equals another one of the same nodes and triangles."""

    digest: str
    mesh: SurfaceMesh = field(compare=False)


@dataclass(frozen=True)
class _Points:
    """Points, with normals or without, that equal others of the same coordinates."""

    digest: str
    point: FloatArray = field(compare=False)
    normal: FloatArray | None = field(compare=False)


def on_surface(field: SurfaceField, ratio: FloatArray, surface: SurfaceMesh) -> FloatArray:
    """Return p/p_inf (n_nodes,) at the nodes of ``surface`` of the field's values ``ratio`` (n,).

    Raises
    ------
    InputError
        The field does not lie on the surface, or does not cover it.
    """
    target = _Mesh(surface.digest(), surface)
    if field.triangle is None:
        # Where one-sided points are carried on, the line may leave what the file holds.
        return np.clip(_cloud(_points(field), target) @ ratio, ratio.min(), ratio.max())
    found = SurfaceMesh(field.point, field.triangle)
    source = _oriented(_Mesh(found.digest(), found), target)
    if field.face is not None:
        source, ratio = reconstruct(source, field.face, ratio)
    transfer, gap = _transfer(_Mesh(source.digest(), source), target)
    check_mapping(mapping_report(transfer, source, surface, ratio - 1.0, gap), MappingTolerances())
    return transfer.consistent(ratio)


def _points(field: SurfaceField) -> _Points:
    digest = sha256(np.ascontiguousarray(field.point, dtype="<f8").tobytes())
    if field.normal is not None:
        digest.update(np.ascontiguousarray(field.normal, dtype="<f8").tobytes())
    return _Points(digest.hexdigest(), field.point, field.normal)


@lru_cache(maxsize=KEPT)
def _cloud(source: _Points, target: _Mesh) -> sparse.csr_array:
    return cloud_map(source.point, source.normal, target.mesh)


@lru_cache(maxsize=KEPT)
def _oriented(source: _Mesh, target: _Mesh) -> SurfaceMesh:
    return orient(source.mesh, target.mesh)


@lru_cache(maxsize=KEPT)
def _transfer(source: _Mesh, target: _Mesh) -> tuple[PressureMap, SurfaceGap]:
    transfer = pressure_map(source.mesh, target.mesh)
    return transfer, surface_gap(transfer, source.mesh, target.mesh)
