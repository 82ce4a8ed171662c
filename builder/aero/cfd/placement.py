"""Placement of a foreign surface on the vehicle's: axes, the other half of a half model, sense of the normals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from builder.aero.cfd.surface_field import SurfaceField
from builder.aero.surface.mesh import SurfaceMesh
from builder.aero.surface.parts import part_of_node
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

ON_PLANE = 1e-4
"""A half model may cross its symmetry plane by this fraction of its extent."""


def place(field: SurfaceField, matrix: FloatArray, translation: FloatArray) -> SurfaceField:
    """Return the field in body axes, points x at M x + t; ``matrix`` (3, 3) orthogonal, ``translation`` (3,)."""
    normal = None if field.normal is None else field.normal @ matrix.T
    return replace(field, point=field.point @ matrix.T + translation, normal=normal)


def mirror(file: Path, field: SurfaceField, ratio: FloatArray) -> tuple[SurfaceField, FloatArray]:
    """Return the whole of a half model and its values: the half itself and its image in the plane y = 0.

    Points on the plane are in both halves, so that cells on either side of it are neighbours.

    Raises
    ------
    InputError
        The model has points on both sides.
    """
    y = field.point[:, 1]
    slack = ON_PLANE * float(np.linalg.norm(np.ptp(field.point, axis=0)))
    if y.min() < -slack and y.max() > slack:
        raise InputError(
            f"{file}: mirrored, but points lie on both sides of the symmetry plane: y from {y.min():.4g} to "
            f"{y.max():.4g} m"
        )
    reflected = field.point * np.array([1.0, -1.0, 1.0])
    both = replace(field, point=np.concatenate([field.point, reflected]))
    if field.normal is not None:
        both = replace(both, normal=np.concatenate([field.normal, field.normal * np.array([1.0, -1.0, 1.0])]))
    if field.triangle is not None:
        image = np.where(np.abs(y) <= slack, 0, len(y)) + np.arange(len(y))
        both = replace(both, triangle=np.concatenate([field.triangle, image[field.triangle][:, ::-1]]))
    if field.face is not None:
        both = replace(both, face=np.concatenate([field.face, field.face + len(ratio)]))
    return both, np.concatenate([ratio, ratio])


def orient(source: SurfaceMesh, surface: SurfaceMesh) -> SurfaceMesh:
    """Return the source with its normals outward, as the normals of the vehicle's ``surface`` are.

    Solvers write patches with normals out of the flow as often as into it. Each connected part is turned as a
    whole, by the majority of its area.
    """
    part = part_of_node(source)[source.triangle[:, 0]]
    middle = source.point[source.triangle].mean(axis=1)
    nearest = cKDTree(surface.point).query(middle)[1]
    agreement = np.einsum("mi,mi->m", source.vector_area, surface.node_normal[nearest])
    turned = np.bincount(part, agreement)[part] < 0.0
    triangle = np.where(turned[:, None], source.triangle[:, ::-1], source.triangle)
    return SurfaceMesh(source.point, triangle)
