"""Gauge rows of a structure of equal sectors, found on a few of them.

The strain of a gauge depends on the facets around it alone. It is rolled, by whole sectors, into a window of a few
sectors; the search costs the same however many sectors there are, and gauges at the same position in different
sectors get the same row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array, csr_array, vstack

from builder.structure.solid.gauge_rows import Gauges, gauge_rows
from builder.structure.solid.swept_mesh import AnyMesh, SweptSector, sector_window
from strainfmu.arrays import FloatArray, IntArray

NEIGHBOURS = 2
"""Sectors on either side of a gauge's own that strain recovery takes into account."""

BOUNDARY = 1e-9  # of a sector: a gauge this close before a sector counts to it
DECIMALS = 12  # m: positions are rounded there, so that rolled gauges agree to the last bit


def layout_rows(mesh: AnyMesh, layouts: Mapping[str, Gauges], near_surface: bool = False) -> csr_array:
    """Return B of all layouts on a mesh, one after another; within a layout no gauge may occur twice.

    ``near_surface``, of meshes that are not swept, is as in
    :func:`~builder.structure.solid.gauge_rows.gauge_rows`.
    """
    if isinstance(mesh, SweptSector):
        rows = [cyclic_gauge_rows(mesh, gauges) for gauges in layouts.values()]
    else:
        rows = [gauge_rows(mesh, gauges, near_surface) for gauges in layouts.values()]
    return csr_array(vstack(rows))


def cyclic_gauge_rows(sector: SweptSector, gauges: Gauges) -> csr_array:
    """Return B, the strain of each gauge per displacement of the whole structure, body axes.

    Parameters
    ----------
    sector : the mesh of one sector.
    gauges : the gauges, in body axes.

    Returns
    -------
    (n_gauges, n_dof) [1/m], as :func:`~builder.structure.solid.gauge_rows.gauge_rows` gives on the full
    mesh; a gauge on the line between two sectors is searched for in the latter and takes the mean of both.
    """
    reach = min(NEIGHBOURS + _sectors_along(sector, gauges), (sector.n_sectors - 1) // 2)
    window = sector_window(sector, reach, reach)
    of_gauge = _sector_of(sector, gauges.position)
    row, column, entry = [], [], []
    for s in np.unique(of_gauge).tolist():
        chosen = np.flatnonzero(of_gauge == s)
        rolled = _rolled(gauges, chosen, sector.rotation(s))
        part = gauge_rows(window, rolled).tocoo()
        vector = _turned(part, sector.rotation(s))
        row.append(chosen[vector.row])
        column.append((vector.col + (s - reach) * sector.n_dof) % (sector.n_sectors * sector.n_dof))
        entry.append(vector.data)
    index = (np.concatenate(row), np.concatenate(column))
    shape = (len(gauges.name), sector.n_sectors * sector.n_dof)
    return csr_array(coo_array((np.concatenate(entry), index), shape=shape))


def _sectors_along(sector: SweptSector, gauges: Gauges) -> int:
    """Return over how many sectors the longest gauge can reach to one side."""
    radius = np.hypot(gauges.position[:, 1], gauges.position[:, 2])
    arc = 2.0 * np.pi / sector.n_sectors * np.maximum(radius, 1e-300)
    return int(np.ceil(min(float((0.5 * gauges.length / arc).max(initial=0.0)), float(sector.n_sectors))))


def _sector_of(sector: SweptSector, position: FloatArray) -> IntArray:
    """Return (n,) the sector whose roll angles hold each position."""
    turns = np.arctan2(position[:, 1], position[:, 2]) / (2.0 * np.pi) % 1.0
    number: IntArray = np.floor(turns * sector.n_sectors + BOUNDARY).astype(np.int64) % sector.n_sectors
    return number


def _rolled(gauges: Gauges, chosen: IntArray, turn: FloatArray) -> Gauges:
    """Return the chosen gauges in the axes of the sector whose frame ``turn`` (3, 3) turns into body axes."""
    return replace(
        gauges,
        name=tuple(gauges.name[i] for i in chosen),
        position=np.round(gauges.position[chosen] @ turn, DECIMALS),
        direction=np.round(gauges.direction[chosen] @ turn, DECIMALS),
        length=gauges.length[chosen],
        surface=tuple(gauges.surface[i] for i in chosen),
    )


def _turned(rows: coo_array, turn: FloatArray) -> coo_array:
    """Turn rows (n, 3 n_nodes) from a sector's frame into body axes."""
    row, component = rows.row, rows.col % 3
    entry = rows.data[:, None] * turn[:, component].T
    column = (rows.col - component)[:, None] + np.arange(3)
    flat = coo_array((entry.ravel(), (np.repeat(row, 3), column.ravel())), shape=rows.shape)
    flat.sum_duplicates()
    return flat
