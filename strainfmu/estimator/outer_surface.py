"""Places on a surface of triangles that are seen from outside, along rays from the axis of the body."""

from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray, IntArray

_EDGES = ((0, 1), (1, 2), (2, 0))


class SurfacePlaces(NamedTuple):
    """Places on a surface: three nodes (.., 3) and their weights (.., 3) [1] each."""

    node: IntArray
    weight: FloatArray

    def of(self, values: FloatArray) -> FloatArray:
        """Return ``values`` (n_p,) of the nodes at the places (..)."""
        return np.asarray(np.sum(values[self.node] * self.weight, axis=-1))


def outermost_places(
    point: FloatArray, triangle: IntArray, station: FloatArray, roll_angle: FloatArray
) -> SurfacePlaces:
    """Return the outermost places (n_x, n_roll) of a surface along rays from the axis.

    Where a ray meets no triangle, the place next to it in the same plane counts.

    Parameters
    ----------
    point, triangle : (n_p, 3) [m], (n_t, 3).
    station : (n_x,) between the stations of the nodes [m].
    roll_angle : (n_roll,) from +z towards +y [rad].
    """
    places = [_at_station(point, triangle, x, roll_angle) for x in station.tolist()]
    return SurfacePlaces(np.stack([row.node for row in places]), np.stack([row.weight for row in places]))


def _at_station(point: FloatArray, triangle: IntArray, station: float, roll_angle: FloatArray) -> SurfacePlaces:
    """Return the places (n_roll,) of one station: its plane cuts triangles in segments, and rays these."""
    ahead = (point[:, 0] <= station)[triangle]
    cut = triangle[ahead.any(axis=1) & ~ahead.all(axis=1)]
    first, second = _ends(point[:, 0] - station, cut)
    corners = point[cut][:, :, 1:]
    start, end = (np.einsum("sc,scy->sy", weight, corners) for weight in (first, second))
    along = np.stack([np.sin(roll_angle), np.cos(roll_angle)])
    across = np.stack([along[1], -along[0]])
    off_start, off_end = start @ across, end @ across
    apart = off_start - off_end
    part = np.clip(off_start / np.where(apart == 0.0, 1.0, apart), 0.0, 1.0)
    radius = (1.0 - part) * (start @ along) + part * (end @ along)
    meets = (off_start * off_end <= 0.0) & (radius > 0.0)
    # Where no segment meets the ray, the one that deviates least from it.
    deviation = np.minimum(np.arctan2(np.abs(off_start), start @ along), np.arctan2(np.abs(off_end), end @ along))
    segment = np.argmax(np.where(meets, radius, -deviation), axis=0)
    chosen = part[segment, np.arange(len(roll_angle))][:, None]
    return SurfacePlaces(cut[segment], (1.0 - chosen) * first[segment] + chosen * second[segment])


def _ends(distance: FloatArray, cut: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return weights (n_s, 3) of the corners of both ends of the segment in each triangle ``cut`` (n_s, 3).

    ``distance`` (n_p,) is the distance of the nodes from the plane, which parts one corner of each from the
    others.
    """
    off = distance[cut]
    ends = np.zeros((2, len(cut), 3))
    count = np.zeros(len(cut), dtype=np.int64)
    for a, b in _EDGES:
        rows = np.flatnonzero((off[:, a] <= 0.0) != (off[:, b] <= 0.0))
        part = off[rows, a] / (off[rows, a] - off[rows, b])
        ends[count[rows], rows, a], ends[count[rows], rows, b] = 1.0 - part, part
        count[rows] += 1
    return ends[0], ends[1]
