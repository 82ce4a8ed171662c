"""Displacement of points on the inner surface per surface pressure, by the adjoint solves that give strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.strain_operator import operator_in_roll, response_of_rows
from builder.structure.wall import Material
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceTargets:
    """Points of the inner surface whose displacement along a direction is read.

    Attributes
    ----------
    x, roll_angle : (n,) stations [m] and roll angles [rad].
    direction : (n, 3) unit vectors, body axes.
    """

    x: FloatArray
    roll_angle: FloatArray
    direction: FloatArray


def displacement_rows(mesh: MeridianMesh, x: FloatArray) -> FloatArray:
    """Return (n, 3, n_dof) [1]: axial, radial, circumferential displacement at stations ``x`` (n,) [m].

    The same for every harmonic: the first two go as cos(m phi), the last, towards growing roll angle, as sin.
    """
    point = inner_surface_points(mesh, x)
    rows = np.zeros((len(x), 3, len(mesh.node), 3))
    for component in range(3):
        rows[np.arange(len(x))[:, None], component, point.node, component] = point.value
    return rows.reshape(len(x), 3, mesh.n_dof)


def displacement_operator(
    mesh: MeridianMesh, material: Material, targets: SurfaceTargets, grid: SurfaceGrid, max_harmonic: int
) -> FloatArray:
    """Return (n, n_p) [m/Pa], displacement of ``targets`` per pressure at the nodes of ``grid``.

    Errors are as in :func:`builder.structure.fourier.strain_operator.harmonic_response`.
    """
    rows = displacement_rows(mesh, targets.x)
    response = response_of_rows(mesh, material, lambda _: rows, grid.x, max_harmonic)
    axial, radial, around = response.reshape(len(targets.x), 3, *response.shape[1:]).transpose(1, 0, 2, 3)
    sin, cos = np.sin(targets.roll_angle), np.cos(targets.roll_angle)
    along_x, along_y, along_z = targets.direction.T
    outward, tangential = along_y * sin + along_z * cos, along_y * cos - along_z * sin
    even = along_x[:, None, None] * axial + outward[:, None, None] * radial
    return operator_in_roll(even, tangential[:, None, None] * around, targets.roll_angle, grid)
