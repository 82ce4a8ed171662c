"""Values of a file brought to the vehicle's surface, with the geometry kept: solvers write many cases on one mesh.

What depends on the two surfaces alone (sense of the normals, closest points, weights, largest gap) is found for
the first of the files that share a mesh.
"""

from __future__ import annotations

from functools import lru_cache
from hashlib import sha256
from typing import Generic, TypeVar

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

T = TypeVar("T", SurfaceMesh, SurfaceField)

KEPT = 2
"""Meshes whose geometry is kept: a case on a mesh of its own among others does not drive theirs out."""


class _Known(Generic[T]):
    """A mesh or a field that equals another one of the same digest, for what is kept."""

    def __init__(self, digest: str, held: T) -> None:
        self.digest = digest
        self.held: T = held

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


def on_surface(field: SurfaceField, ratio: FloatArray, surface: SurfaceMesh) -> FloatArray:
    """Return p/p_inf (n_nodes,) at the nodes of ``surface`` of the field's values ``ratio`` (n,).

    Raises
    ------
    InputError
        The field does not lie on the surface, or does not cover it.
    """
    target = _known(surface)
    if field.triangle is None:
        # Where one-sided points are carried on, the line may leave what the file holds.
        return np.clip(_cloud(_points(field), target) @ ratio, ratio.min(), ratio.max())
    found = SurfaceMesh(field.point, field.triangle)
    source = _oriented(_known(found), target)
    if field.face is not None:
        source, ratio = reconstruct(source, field.face, ratio)
    transfer, gap = _transfer(_known(source), target)
    check_mapping(mapping_report(transfer, source, surface, ratio - 1.0, gap), MappingTolerances())
    return transfer.consistent(ratio)


def _known(mesh: SurfaceMesh) -> _Known[SurfaceMesh]:
    return _Known(mesh.digest(), mesh)


def _points(field: SurfaceField) -> _Known[SurfaceField]:
    digest = sha256(np.ascontiguousarray(field.point, dtype="<f8").tobytes())
    if field.normal is not None:
        digest.update(np.ascontiguousarray(field.normal, dtype="<f8").tobytes())
    return _Known(digest.hexdigest(), field)


@lru_cache(maxsize=KEPT)
def _cloud(source: _Known[SurfaceField], target: _Known[SurfaceMesh]) -> sparse.csr_array:
    return cloud_map(source.held.point, source.held.normal, target.held)


@lru_cache(maxsize=KEPT)
def _oriented(source: _Known[SurfaceMesh], target: _Known[SurfaceMesh]) -> SurfaceMesh:
    return orient(source.held, target.held)


@lru_cache(maxsize=KEPT)
def _transfer(source: _Known[SurfaceMesh], target: _Known[SurfaceMesh]) -> tuple[PressureMap, SurfaceGap]:
    transfer = pressure_map(source.held, target.held)
    return transfer, surface_gap(transfer, source.held, target.held)
