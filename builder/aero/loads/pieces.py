"""Parts of a triangulated surface, cut exactly: pressure stays linear over the pieces of a triangle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of triangles of a surface.

    Attributes
    ----------
    triangle : (k, 3) nodes of the triangle that each piece lies in.
    share : (k, 3, 3) shares of these nodes in each corner of the piece.
    """

    triangle: IntArray
    share: FloatArray


def whole_surface(mesh: SurfaceMesh) -> Pieces:
    """Return every triangle of ``mesh`` as a piece."""
    return Pieces(mesh.triangle, np.broadcast_to(np.eye(3), (len(mesh.triangle), 3, 3)))


def part_below(pieces: Pieces, value: FloatArray, level: float) -> Pieces:
    """Return the part of ``pieces`` on which ``value`` (n,), linear between the nodes, is below ``level``."""
    at_corner = np.squeeze(pieces.share @ value[pieces.triangle][:, :, None], axis=2)
    below = at_corner < level
    count = below.sum(axis=1)
    nodes, shares = [pieces.triangle[count == 3]], [pieces.share[count == 3]]
    for alone in (1, 2):
        # Corner 0 is the one on its own side of the level; the order of the others is kept.
        rows = np.flatnonzero(count == alone)
        odd = np.argmax(below[rows] == (alone == 1), axis=1)
        order = (odd[:, None] + np.arange(3)) % 3
        at = np.take_along_axis(at_corner[rows], order, axis=1)
        turned = np.take_along_axis(pieces.share[rows], order[:, :, None], axis=1)
        turned = np.take_along_axis(turned, order[:, None, :], axis=2)
        first, second = (np.zeros((len(rows), 3)) for _ in range(2))
        for cut, end in ((first, 1), (second, 2)):
            part = (level - at[:, 0]) / (at[:, end] - at[:, 0])
            cut[:, 0], cut[:, end] = 1.0 - part, part
        unit = [np.broadcast_to(np.eye(3)[k], (len(rows), 3)) for k in range(3)]
        parts = [[unit[0], first, second]] if alone == 1 else [[first, unit[1], unit[2]], [first, unit[2], second]]
        for corners in parts:
            nodes.append(np.take_along_axis(pieces.triangle[rows], order, axis=1))
            shares.append(np.stack(corners, axis=1) @ turned)
    return Pieces(np.concatenate(nodes), np.concatenate(shares))


def forces_and_moments(mesh: SurfaceMesh, pieces: Pieces, about: FloatArray) -> FloatArray:
    """Return (n, 6) force and moment about ``about`` (3,) [m], in body axes, per nodal pressure [m2, m3].

    They are of F = integral of -p n dS over ``pieces`` with n outward. Exact for pressure linear over triangles.
    """
    corner = pieces.share @ mesh.point[pieces.triangle]
    area = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    arm = corner - about
    # Integral of N_i N_j over a triangle is A (1 + delta_ij) / 12.
    arm = (arm.sum(axis=1, keepdims=True) + arm) / 12.0
    of_corner = np.concatenate(
        [np.broadcast_to(area[:, None] / 3.0, arm.shape), np.cross(arm, area[:, None])], axis=2
    )
    of_node = -pieces.share.transpose(0, 2, 1) @ of_corner
    total = np.zeros((mesh.n_nodes, 6))
    np.add.at(total, pieces.triangle, of_node)
    return total
