"""Surfaces that change with a parameter of the flow: how far their nodes move, from one file per value.

The files hold the same triangles in the same order, such as one mesh whose nodes were moved: a fin turned about
its hinge. Pressure is computed on the moved surface and given at the nodes of the surface as it is, on which it
acts.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from builder.aero.cfd.formats.surface_files import read_surface
from builder.aero.shapes import file_scale
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError, InputError

if TYPE_CHECKING:
    from builder.vehicle.file import FlowEntries

SAME_PLACE = 1e-5
"""Of the length: how far copies of one node may lie apart."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Deflection:
    """One parameter.

    Attributes
    ----------
    name : of the parameter.
    value : (k,) rising values at which the surface is known.
    shift : (k, n, 3) by which each node moves there [m].
    """

    name: str
    value: FloatArray
    shift: FloatArray

    def shift_at(self, value: float) -> FloatArray:
        """Return by how much the nodes (n, 3) move at ``value`` [m], linear between the known ones.

        Raises
        ------
        FlowReachError
            The value lies beyond the known ones.
        """
        if not self.value[0] <= value <= self.value[-1]:
            raise FlowReachError(
                f"{self.name}: expected {self.value[0]:g} .. {self.value[-1]:g}, the values of its surfaces, "
                f"got {value:g}"
            )
        i = int(np.clip(np.searchsorted(self.value, value) - 1, 0, len(self.value) - 2))
        share = (value - self.value[i]) / (self.value[i + 1] - self.value[i])
        return np.asarray((1.0 - share) * self.shift[i] + share * self.shift[i + 1])

    def digest(self) -> str:
        """Return a hash of values and shifts."""
        return sha256(self.value.tobytes() + self.shift.tobytes()).hexdigest()


def deflections_of(outside: FlowEntries, surface: SurfaceMesh) -> tuple[Deflection, ...]:
    """Return how ``surface``, from ``shape.surface``, moves with the parameters of the vehicle file.

    Raises
    ------
    InputError
        A file is missing, or does not hold the triangles of ``shape.surface`` in their order.
    """
    if not outside.parameters:
        return ()
    shape = outside.shape
    assert shape is not None
    assert shape.surface is not None
    path = outside.folder / shape.surface
    scale = file_scale(path, float(np.ptp(read_surface(path).point[:, 0])), shape.unit, shape.length_m)
    known = read_surface(path, scale)
    node = _nodes_of(known, surface)
    deflections = []
    for name, entry in outside.parameters.items():
        shifts = {entry.undeflected: np.zeros((surface.n_nodes, 3))}
        for position in entry.surfaces:
            shifts[position.value] = _shift(outside.folder / position.file, scale, known)[node]
        values = sorted(shifts)
        deflections.append(
            Deflection(name=name, value=np.array(values), shift=np.array([shifts[value] for value in values]))
        )
    return tuple(deflections)


def _nodes_of(known: SurfaceMesh, surface: SurfaceMesh) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return for each node of ``surface`` one of ``known`` at the same place."""
    distance, node = cKDTree(known.point).query(surface.point)
    assert distance.max() <= SAME_PLACE * float(np.ptp(known.point[:, 0]))
    return np.asarray(node, dtype=np.intp)


def _shift(path: Path, scale: float, known: SurfaceMesh) -> FloatArray:
    """Return by how much the nodes of ``known`` (n, 3) [m] move to where the file has them."""
    moved = read_surface(path, scale)
    if len(moved.triangle) != len(known.triangle):
        raise InputError(
            f"{path}: expected the {len(known.triangle)} triangles of shape.surface in their order, got "
            f"{len(moved.triangle)}"
        )
    of_corner = moved.point[moved.triangle] - known.point[known.triangle]
    shift = np.zeros_like(known.point)
    shift[known.triangle] = of_corner
    apart = np.linalg.norm(shift[known.triangle] - of_corner, axis=2).max(axis=1)
    worst = int(apart.argmax())
    if apart[worst] > SAME_PLACE * float(np.ptp(known.point[:, 0])):
        place = ", ".join(f"{value:.4g}" for value in known.point[known.triangle[worst, 0]])
        raise InputError(
            f"{path}: expected the triangles of shape.surface in their order, got others from ({place}) m on"
        )
    return shift
