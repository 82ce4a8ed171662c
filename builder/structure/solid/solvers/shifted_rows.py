"""Gauge rows of a structure of equal sectors, taken apart into patterns and shifts by sectors.

Gauges at the same position in different sectors have the same response but for the shift, so that a row of gauges
at four roll angles costs one solution instead of four.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array

from builder.structure.solid.mesh.swept_mesh import SweptSector
from strainfmu.arrays import FloatArray, IntArray

SAME_ENTRY = 1e-10
"""Difference of two rows, over their largest entry, below which they count as one pattern."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ShiftedRows:
    """Distinct rows in sector frames, and where each given row is one of them.

    Attributes
    ----------
    n_sectors, n_dof : of the structure, and of one sector.
    pattern, sector, dof : (e,) entries: which pattern, sector and dof of the sector.
    entry : (e,) values [1/m].
    pattern_of_row, shift_of_row : (n_rows,) row g is pattern ``pattern_of_row[g]`` moved on by that many sectors.
    """

    n_sectors: int
    n_dof: int
    pattern: IntArray
    sector: IntArray
    dof: IntArray
    entry: FloatArray
    pattern_of_row: IntArray
    shift_of_row: IntArray

    @property
    def n_patterns(self) -> int:
        return int(self.pattern_of_row.max()) + 1

    def harmonic(self, m: int) -> csc_array:
        """Return (n_dof, n_patterns): the transposed patterns on harmonic ``m``, a Fourier sum over sectors."""
        # Whole turns are taken off before the sine is, so that the phase is exact to round-off.
        phase = np.exp(-2j * np.pi * (m * self.sector % self.n_sectors) / self.n_sectors)
        return csc_array((self.entry * phase, (self.dof, self.pattern)), shape=(self.n_dof, self.n_patterns))


def shifted_rows(sector: SweptSector, rows: csr_array) -> ShiftedRows:
    """Turn rows (n_rows, n_dof of the structure) along body axes into sector frames, and find equal ones."""
    parts = [_row_in_sector_frames(sector, csr_array(rows[[i]])) for i in range(rows.shape[0])]
    kept: list[int] = []
    pattern_of_row = np.empty(len(parts), dtype=np.int64)
    for i, (_, index, entry) in enumerate(parts):
        equal = (n for n, k in enumerate(kept) if _same(parts[k][1], parts[k][2], index, entry))
        pattern_of_row[i] = next(equal, len(kept))
        if pattern_of_row[i] == len(kept):
            kept.append(i)
    index = np.concatenate([parts[k][1] for k in kept])
    return ShiftedRows(
        n_sectors=sector.n_sectors,
        n_dof=sector.n_dof,
        pattern=np.repeat(np.arange(len(kept)), [len(parts[k][1]) for k in kept]),
        sector=index // sector.n_dof,
        dof=index % sector.n_dof,
        entry=np.concatenate([parts[k][2] for k in kept]),
        pattern_of_row=pattern_of_row,
        shift_of_row=np.array([first for first, _, _ in parts], dtype=np.int64),
    )


def _row_in_sector_frames(sector: SweptSector, row: csr_array) -> tuple[int, IntArray, FloatArray]:
    """Return a row's first sector, its indices (sector after the first) * n_dof + dof, sorted, and its entries."""
    node, slot = np.unique(row.indices // 3, return_inverse=True)
    vector = np.zeros((len(node), 3))
    np.add.at(vector, (slot, row.indices % 3), row.data)
    of_node = node // sector.n_nodes
    first = _first_sector(of_node, sector.n_sectors)
    turns = {int(s): sector.rotation(int(s)) for s in np.unique(of_node)}
    turned = np.array([turns[int(s)].T @ v for s, v in zip(of_node, vector, strict=True)]).reshape(-1, 3)
    after_first = (of_node - first) % sector.n_sectors
    start = after_first * sector.n_dof + 3 * (node % sector.n_nodes)
    order = np.argsort(start)
    return first, (start[order][:, None] + np.arange(3)).ravel(), turned[order].ravel()


def _first_sector(sector: IntArray, n_sectors: int) -> int:
    """Return the sector behind the widest gap round the axis."""
    used = np.unique(sector)
    if not len(used):
        return 0
    gap = np.diff(used, prepend=used[-1] - n_sectors)
    return int(used[gap.argmax()])


def _same(index: IntArray, entry: FloatArray, other_index: IntArray, other: FloatArray) -> bool:
    if not np.array_equal(index, other_index):
        return False
    return bool(np.abs(entry - other).max(initial=0.0) <= SAME_ENTRY * np.abs(entry).max(initial=0.0))
