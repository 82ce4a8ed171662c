"""Consistent nodal forces of a pressure on the outer surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from builder.structure.fourier.meridian_mesh import MeridianMesh, locate_on_edge, quadratic_shape
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

# Shape function (2) x radius (2) x slope (1) x pressure (1): degree 6 in xi.
LOAD_POINTS = 4
REACH_TOLERANCE = 1e-9


def pressure_load(mesh: MeridianMesh, station_x: FloatArray) -> csc_array:
    """Return nodal forces per unit pressure at each station, for pressure ~ cos(m phi).

    Pressure is linear in x between stations and may jump at a pair of equal ones. Edges are split at the
    stations and every part is integrated exactly, f = -integral of p n N r ds, so the forces sum to the
    exact resultant on the meshed surface. The integral over roll is left out, as in
    :mod:`builder.structure.fourier.fourier_elasticity`; the matrix is the same for all harmonics.

    Parameters
    ----------
    mesh : the mesh.
    station_x : (n_x,) stations [m], non-decreasing, from one end of the outer surface to the other.

    Returns
    -------
    (n_dof, n_x) force [N] per pressure [Pa] and per roll integral.

    Raises
    ------
    InputError
        Stations decrease or do not reach over the outer surface.
    """
    edge = mesh.outer_edge
    ends = mesh.node[edge[[0, -1], [0, 2]], 0]
    slack = REACH_TOLERANCE * (ends[1] - ends[0])
    if np.any(np.diff(station_x) < 0.0):
        raise InputError("pressure stations must not decrease")
    if station_x[0] > ends[0] + slack or station_x[-1] < ends[1] - slack:
        raise InputError(
            f"pressure stations reach from {station_x[0]:g} m to {station_x[-1]:g} m, "
            f"the surface from {ends[0]:g} m to {ends[1]:g} m"
        )
    cut = np.unique(np.concatenate([mesh.node[edge[:, ::2], 0].ravel(), np.clip(station_x, *ends)]))
    part, xi, weight = _points_of_parts(mesh, cut)
    shape, d_shape = quadratic_shape(xi)
    position = mesh.node[edge[part]]
    x, r = np.einsum("cqa,cad->dcq", shape, position)
    d_x, d_r = np.einsum("cqa,cad->dcq", d_shape, position)
    before, hat = _hat_functions(station_x, 0.5 * (cut[:-1] + cut[1:]), x)
    normal_force = np.stack([d_r, -d_x])  # -n ds/dxi for the outward normal n
    value = np.einsum("dcq,cqa,cqk->cadk", normal_force * (weight * r), shape, hat)
    row = np.broadcast_to((3 * edge[part][:, :, None] + np.arange(2))[..., None], value.shape)
    column = np.broadcast_to((before[:, None] + np.arange(2))[:, None, None, :], value.shape)
    return csc_array((value.ravel(), (row.ravel(), column.ravel())), shape=(mesh.n_dof, len(station_x)))


def _points_of_parts(mesh: MeridianMesh, cut: FloatArray) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
    """Return edge (n_part,), quadrature points xi and weights (n_part, n_q) between consecutive cuts."""
    part, middle = locate_on_edge(mesh, mesh.outer_edge, 0.5 * (cut[:-1] + cut[1:]))
    end_x = mesh.node[mesh.outer_edge[part][:, ::2], 0]
    half = np.diff(cut) / (end_x[:, 1] - end_x[:, 0])
    point, weight = np.polynomial.legendre.leggauss(LOAD_POINTS)
    return part, middle[:, None] + half[:, None] * point, half[:, None] * weight


def _hat_functions(
    station_x: FloatArray, part_x: FloatArray, x: FloatArray
) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the station before each part (n_part,) and the two hat functions there (n_part, n_q, 2)."""
    before = np.clip(np.searchsorted(station_x, part_x, side="right") - 1, 0, len(station_x) - 2)
    start, end = station_x[before][:, None], station_x[before + 1][:, None]
    fraction = (x - start) / (end - start)
    return before, np.stack([1.0 - fraction, fraction], axis=-1)
